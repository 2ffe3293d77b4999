// cyclone_page DOMAIN HOST PID: what a page needs, in a client of another DDS vendor, from the same IDL. Reads scene,
// preview and the ROS 2 topics of the view, asks for a frozen picture, and prints what came, one "path value" per line,
// until it has all of it, or for 60 s (then it fails). It judges nothing: ros_view_test.cpp does.
#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "huetrack_view.h"
#include "ros2_messages.h"

static dds_entity_t check(dds_entity_t entity, const char* what) {
  if (entity < 0) {
    fprintf(stderr, "%s: %s\n", what, dds_strretcode(-entity));
    exit(2);
  }
  return entity;
}

static dds_qos_t* qos_of(dds_reliability_kind_t reliability, dds_durability_kind_t durability) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, reliability, DDS_SECS(1));
  dds_qset_durability(qos, durability);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  return qos;
}

static dds_entity_t subscribe(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* name,
                              dds_reliability_kind_t reliability, dds_durability_kind_t durability) {
  dds_qos_t* qos = qos_of(reliability, durability);
  const dds_entity_t topic = check(dds_create_topic(participant, type, name, NULL, NULL), name);
  const dds_entity_t reader = check(dds_create_reader(participant, topic, qos, NULL), name);
  dds_delete_qos(qos);
  return reader;
}

static void scene(const void* sample) {
  const huetrack_msg_Scene* s = sample;
  printf("scene/pid %u\nscene/frame_id %s\nscene/cameras %u\nscene/targets %u\n", (unsigned)s->pid, s->frame_id,
         (unsigned)s->cameras._length, (unsigned)s->targets._length);
  printf("scene/camera %s %u %.17g %.17g %u\n", s->cameras._buffer[0].name, (unsigned)s->cameras._buffer[0].width,
         s->cameras._buffer[0].intrinsics[0], s->cameras._buffer[0].border._buffer[95],
         (unsigned)s->cameras._buffer[0].distortion._length);
  printf("scene/color %.17g\n", s->targets._buffer[0].colors._buffer[1].hue_deg[1]);
  printf("scene/why_not %s\n", s->why_not);
}

static void preview(const void* sample) {
  const huetrack_msg_Preview* s = sample;
  printf("preview/camera %s\npreview/set %llu\npreview/jpeg %u %u\n", s->camera, (unsigned long long)s->set_number,
         (unsigned)s->jpeg._length, (unsigned)s->jpeg._buffer[s->jpeg._length - 1]);
  printf("preview/target %s %u %.9g %u\n", s->targets._buffer[0].target, (unsigned)s->targets._buffer[0].state,
         (double)s->targets._buffer[0].ellipse[1], (unsigned)s->targets._buffer[0].particles._length);
}

static void map(const void* sample) {
  const huetrack_msg_CameraMap* s = sample;
  const huetrack_msg_CameraMapPoint* p = &s->points._buffer[s->points._length - 1];
  printf("map/camera %s %u %lld %u %u\n", s->camera, (unsigned)s->pid, (long long)s->captured_at,
         (unsigned)s->map_points, (unsigned)s->points._length);
  printf("map/point %u %.9g %.9g %u %d\n", (unsigned)p->id, (double)p->position[1], (double)p->covariance[5],
         (unsigned)p->state, p->given);
}

static void reply(const void* sample) {
  const huetrack_msg_TeachReply* s = sample;
  printf("reply/client %s\nreply/number %u\nreply/granted %d\nreply/reason %s\nreply/mask %u\n", s->client,
         (unsigned)s->number, s->granted, s->reason, (unsigned)s->cameras._buffer[0].mask._length);
}

static void control(const void* sample) {
  const huetrack_msg_ControlReply* s = sample;
  printf("control/number %u\ncontrol/reason %s\ncontrol/column %s\ncontrol/bytes %u %u\n", (unsigned)s->number,
         s->reason, s->rows._buffer[1].columns._buffer[0], (unsigned)s->bytes._length, (unsigned)s->bytes._buffer[2]);
}

static void markers(const void* sample) {
  const visualization_msgs_msg_dds__MarkerArray_* s = sample;
  const visualization_msgs_msg_dds__Marker_* m = &s->markers._buffer[0];
  printf("markers/count %u\nmarkers/first %s %d %d %.17g %.17g %s\n", (unsigned)s->markers._length, m->ns, (int)m->type,
         (int)m->action, m->pose.position.z, m->scale.x, m->header.frame_id);
}

static void image(const void* sample) {
  const sensor_msgs_msg_dds__CompressedImage_* s = sample;
  printf("image/format %s\nimage/frame_id %s\nimage/bytes %u\n", s->format, s->header.frame_id,
         (unsigned)s->data._length);
}

static void info(const void* sample) {
  const sensor_msgs_msg_dds__CameraInfo_* s = sample;
  printf("info/model %s %u %u\ninfo/k %.17g %.17g\n", s->distortion_model, (unsigned)s->width, (unsigned)s->d._length,
         s->k[0], s->k[2]);
}

static void tf(const void* sample) {
  const tf2_msgs_msg_dds__TFMessage_* s = sample;
  printf("tf/child %s %u\n", s->transforms._buffer[0].child_frame_id, (unsigned)s->transforms._length);
}

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const dds_entity_t participant = check(dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL), "domain");
  struct {
    dds_entity_t reader;
    void (*print)(const void*);
    int got;
  } topics[] = {
      {subscribe(participant, &huetrack_msg_Scene_desc, "huetrack/scene", DDS_RELIABILITY_RELIABLE,
                 DDS_DURABILITY_TRANSIENT_LOCAL),
       scene, 0},
      {subscribe(participant, &huetrack_msg_CameraMap_desc, "huetrack/camera_map", DDS_RELIABILITY_RELIABLE,
                 DDS_DURABILITY_TRANSIENT_LOCAL),
       map, 0},
      {subscribe(participant, &huetrack_msg_Preview_desc, "huetrack/preview", DDS_RELIABILITY_BEST_EFFORT,
                 DDS_DURABILITY_VOLATILE),
       preview, 0},
      {subscribe(participant, &huetrack_msg_TeachReply_desc, "huetrack/teach_reply", DDS_RELIABILITY_RELIABLE,
                 DDS_DURABILITY_VOLATILE),
       reply, 0},
      {subscribe(participant, &huetrack_msg_ControlReply_desc, "huetrack/control_reply", DDS_RELIABILITY_RELIABLE,
                 DDS_DURABILITY_VOLATILE),
       control, 0},
      {subscribe(participant, &visualization_msgs_msg_dds__MarkerArray__desc, "rt/huetrack/markers",
                 DDS_RELIABILITY_RELIABLE, DDS_DURABILITY_VOLATILE),
       markers, 0},
      {subscribe(participant, &sensor_msgs_msg_dds__CompressedImage__desc, "rt/huetrack/cam_0/image/compressed",
                 DDS_RELIABILITY_RELIABLE, DDS_DURABILITY_VOLATILE),
       image, 0},
      {subscribe(participant, &sensor_msgs_msg_dds__CameraInfo__desc, "rt/huetrack/cam_0/camera_info",
                 DDS_RELIABILITY_RELIABLE, DDS_DURABILITY_VOLATILE),
       info, 0},
      {subscribe(participant, &tf2_msgs_msg_dds__TFMessage__desc, "rt/tf_static", DDS_RELIABILITY_RELIABLE,
                 DDS_DURABILITY_TRANSIENT_LOCAL),
       tf, 0},
  };
  dds_qos_t* qos = qos_of(DDS_RELIABILITY_RELIABLE, DDS_DURABILITY_VOLATILE);
  const dds_entity_t topic =
      check(dds_create_topic(participant, &huetrack_msg_TeachRequest_desc, "huetrack/teach_request", NULL, NULL),
            "teach_request");
  const dds_entity_t writer = check(dds_create_writer(participant, topic, qos, NULL), "teach_request");
  const dds_entity_t control_topic =
      check(dds_create_topic(participant, &huetrack_msg_ControlRequest_desc, "huetrack/control_request", NULL, NULL),
            "control_request");
  const dds_entity_t control_writer =
      check(dds_create_writer(participant, control_topic, qos, NULL), "control_request");
  dds_delete_qos(qos);
  const size_t count = sizeof topics / sizeof *topics;
  size_t complete = 0;
  for (int round = 0; round < 6000 && complete < count; ++round) {
    if (round % 20 == 0) {
      huetrack_msg_TeachPoint at = {"cam.0", {10, 20.5}};
      huetrack_msg_TeachRequest request = {.client = "cyclone",
                                           .number = 7,
                                           .host = argv[2],
                                           .pid = (uint32_t)atoi(argv[3]),
                                           .action = huetrack_msg_TEACH_ACTION_LOOK,
                                           .target = "ball",
                                           .wider = -3};
      request.points._buffer = &at;
      request.points._length = request.points._maximum = 1;
      dds_write(writer, &request);
      char* words[] = {"record", "list"};
      huetrack_msg_ControlRequest asked = {
          .client = "cyclone", .number = 8, .host = argv[2], .pid = (uint32_t)atoi(argv[3])};
      asked.words._buffer = words;
      asked.words._length = asked.words._maximum = 2;
      dds_write(control_writer, &asked);
    }
    complete = 0;
    for (size_t i = 0; i < count; ++i) {
      void* sample[1] = {NULL};
      dds_sample_info_t about;
      while (dds_take(topics[i].reader, sample, &about, 1, 1) == 1) {
        if (about.valid_data && !topics[i].got) {
          topics[i].print(sample[0]);
          topics[i].got = 1;
        }
        dds_return_loan(topics[i].reader, sample, 1);
      }
      complete += (size_t)topics[i].got;
    }
    dds_sleepfor(DDS_MSECS(10));
  }
  dds_delete(participant);
  if (complete == count) return 0;
  for (size_t i = 0; i < count; ++i)
    fprintf(stderr, "topic %u: %s\n", (unsigned)i, topics[i].got ? "came" : "nothing came");
  return 1;
}
