// cyclone_subscriber DOMAIN TARGET: a client of another DDS vendor, from the same IDL. Prints every field of every
// sample of the native and the ROS 2 topics, one "path value" per line, until it has seen enough of each, or for 60 s
// (then it fails). It judges nothing: second_vendor_test.cpp does.
#include <dds/dds.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "camera_times.h"
#include "huetrack.h"
#include "object_set.h"
#include "ros2_messages.h"

static void number(const char* prefix, const char* field, double value) {
  if (isnan(value))
    printf("%s%s nan\n", prefix, field);
  else
    printf("%s%s %.17g\n", prefix, field, value);
}

static void numbers(const char* prefix, const char* field, const double* values, int count) {
  for (int i = 0; i < count; ++i) {
    char name[64];
    snprintf(name, sizeof name, "%s[%d]", field, i);
    number(prefix, name, values[i]);
  }
}

static void integer(const char* prefix, const char* field, int64_t value) {
  printf("%s%s %" PRId64 "\n", prefix, field, value);
}

static void text(const char* prefix, const char* field, const char* value) {
  printf("%s%s %s\n", prefix, field, value);
}

static void print_position(const huetrack_msg_ObjectPosition* s) {
  char p[64];
  snprintf(p, sizeof p, "position/%d/", (int)s->state);
  text(p, "target", s->target);
  integer(p, "captured_at", s->captured_at);
  integer(p, "received_at", s->received_at);
  integer(p, "published_at", s->published_at);
  integer(p, "set_number", (int64_t)s->set_number);
  integer(p, "state", (int64_t)s->state);
  numbers(p, "position", s->position, 3);
  numbers(p, "velocity", s->velocity, 3);
  numbers(p, "covariance", s->covariance, 9);
  numbers(p, "map_position", s->map_position, 3);
  integer(p, "views", s->views);
  number(p, "confidence", s->confidence);
  integer(p, "particle_count", s->particle_count);
  number(p, "effective_sample_size", s->effective_sample_size);
  integer(p, "per_view", s->per_view._length);
  for (uint32_t i = 0; i < s->per_view._length; ++i) {
    const huetrack_msg_ViewSupport* v = &s->per_view._buffer[i];
    char q[96];
    snprintf(q, sizeof q, "%sper_view[%u].", p, (unsigned)i);
    text(q, "camera", v->camera);
    integer(q, "delivered", v->delivered);
    integer(q, "in_view", v->in_view);
    integer(q, "seen", v->seen);
    number(q, "pixel[0]", (double)v->pixel[0]);
    number(q, "pixel[1]", (double)v->pixel[1]);
    number(q, "radius_px", (double)v->radius_px);
    number(q, "support", (double)v->support);
    number(q, "residual_px", (double)v->residual_px);
  }
}

static void print_camera(const huetrack_msg_CameraPose* s) {
  char p[64];
  snprintf(p, sizeof p, "camera/%d/", (int)s->state);
  text(p, "camera", s->camera);
  integer(p, "captured_at", s->captured_at);
  integer(p, "received_at", s->received_at);
  integer(p, "published_at", s->published_at);
  integer(p, "frame_number", (int64_t)s->frame_number);
  integer(p, "state", (int64_t)s->state);
  numbers(p, "position", s->position, 3);
  numbers(p, "orientation", s->orientation, 4);
  numbers(p, "covariance", s->covariance, 36);
  integer(p, "features_in_view", s->features_in_view);
  integer(p, "features_matched", s->features_matched);
  integer(p, "map_points", s->map_points);
  number(p, "confidence", s->confidence);
  integer(p, "particle_count", s->particle_count);
  number(p, "effective_sample_size", s->effective_sample_size);
}

static void print_strings(const char* prefix, const char* field, const dds_sequence_string* list) {
  integer(prefix, field, list->_length);
  for (uint32_t i = 0; i < list->_length; ++i) {
    char name[64];
    snprintf(name, sizeof name, "%s[%u]", field, (unsigned)i);
    text(prefix, name, list->_buffer[i]);
  }
}

static void print_status(const huetrack_msg_ServiceStatus* s) {
  const char* p = "status/";
  text(p, "host", s->host);
  integer(p, "pid", s->pid);
  integer(p, "at", s->at);
  text(p, "program_version", s->program_version);
  text(p, "mode", s->mode);
  text(p, "frame_id", s->frame_id);
  text(p, "config_file", s->config_file);
  text(p, "config_identity", s->config_identity);
  text(p, "rig_identity", s->rig_identity);
  text(p, "rig_history", s->rig_history);
  number(p, "clock_offset_s", s->clock_offset_s);
  number(p, "set_rate_hz", s->set_rate_hz);
  integer(p, "sets", (int64_t)s->sets);
  integer(p, "incomplete_sets", (int64_t)s->incomplete_sets);
  integer(p, "late_frames", (int64_t)s->late_frames);
  integer(p, "dropped_sets", (int64_t)s->dropped_sets);
  integer(p, "published", (int64_t)s->published);
  integer(p, "publish_failures", (int64_t)s->publish_failures);
  integer(p, "cameras", s->cameras._length);
  for (uint32_t i = 0; i < s->cameras._length; ++i) {
    const huetrack_msg_CameraStatus* c = &s->cameras._buffer[i];
    char q[64];
    snprintf(q, sizeof q, "status/cameras[%u].", (unsigned)i);
    text(q, "name", c->name);
    integer(q, "health", (int64_t)c->health);
    text(q, "message", c->message);
    integer(q, "frames", (int64_t)c->frames);
    integer(q, "dropped", (int64_t)c->dropped);
    integer(q, "corrupted", (int64_t)c->corrupted);
    number(q, "rate_hz", c->rate_hz);
    number(q, "age_s", c->age_s);
  }
  print_strings(p, "targets", &s->targets);
  print_strings(p, "warnings", &s->warnings);
}

static void print_times(const huetrack_msg_CameraTimes* s) {
  const char* p = "times/";
  text(p, "host", s->host);
  integer(p, "pid", s->pid);
  integer(p, "at", s->at);
  integer(p, "cameras", s->cameras._length);
  for (uint32_t i = 0; i < s->cameras._length; ++i) {
    const huetrack_msg_CameraTime* c = &s->cameras._buffer[i];
    char q[64];
    snprintf(q, sizeof q, "times/cameras[%u].", (unsigned)i);
    text(q, "camera", c->camera);
    number(q, "latency_s", c->latency_s);
    number(q, "latency_sigma_s", c->latency_sigma_s);
    number(q, "readout_s", c->readout_s);
    number(q, "readout_sigma_s", c->readout_sigma_s);
  }
}

static void print_set(const huetrack_msg_ObjectSet* s) {
  const char* p = "set/";
  text(p, "target", s->target);
  integer(p, "captured_at", s->captured_at);
  integer(p, "received_at", s->received_at);
  integer(p, "published_at", s->published_at);
  integer(p, "set_number", (int64_t)s->set_number);
  integer(p, "most", s->most);
  integer(p, "objects", s->objects._length);
  for (uint32_t i = 0; i < s->objects._length; ++i) {
    const huetrack_msg_ObjectInSet* o = &s->objects._buffer[i];
    char q[64];
    snprintf(q, sizeof q, "set/objects[%u].", (unsigned)i);
    text(q, "name", o->name);
    integer(q, "number", o->number);
    integer(q, "state", o->state);
    integer(q, "is_birth", o->is_birth);
    integer(q, "is_end", o->is_end);
    numbers(q, "position", o->position, 3);
    numbers(q, "velocity", o->velocity, 3);
    numbers(q, "covariance", o->covariance, 9);
    integer(q, "views", o->views);
    number(q, "confidence", o->confidence);
  }
}

static void print_header(const char* p, const std_msgs_msg_dds__Header_* header) {
  text(p, "frame_id", header->frame_id);
}

static void print_pose(const geometry_msgs_msg_dds__PoseWithCovarianceStamped_* s) {
  char p[64];
  snprintf(p, sizeof p, "pose/%d.%09u/", (int)s->header.stamp.sec, (unsigned)s->header.stamp.nanosec);
  print_header(p, &s->header);
  const geometry_msgs_msg_dds__Pose_* pose = &s->pose.pose;
  const double at[] = {pose->position.x, pose->position.y, pose->position.z};
  const double turned[] = {pose->orientation.x, pose->orientation.y, pose->orientation.z, pose->orientation.w};
  numbers(p, "position", at, 3);
  numbers(p, "orientation", turned, 4);
  numbers(p, "covariance", s->pose.covariance, 36);
}

static void print_poses(const geometry_msgs_msg_dds__PoseArray_* s) {
  char p[64];
  snprintf(p, sizeof p, "poses/%d.%09u/", (int)s->header.stamp.sec, (unsigned)s->header.stamp.nanosec);
  print_header(p, &s->header);
  integer(p, "poses", s->poses._length);
  for (uint32_t i = 0; i < s->poses._length; ++i) {
    const geometry_msgs_msg_dds__Pose_* pose = &s->poses._buffer[i];
    const double at[] = {pose->position.x, pose->position.y, pose->position.z};
    const double turned[] = {pose->orientation.x, pose->orientation.y, pose->orientation.z, pose->orientation.w};
    char q[96];
    snprintf(q, sizeof q, "%sposes[%u].", p, (unsigned)i);
    numbers(q, "position", at, 3);
    numbers(q, "orientation", turned, 4);
  }
}

static void print_tf(const tf2_msgs_msg_dds__TFMessage_* s) {
  for (uint32_t i = 0; i < s->transforms._length; ++i) {
    const geometry_msgs_msg_dds__TransformStamped_* t = &s->transforms._buffer[i];
    char p[64];
    snprintf(p, sizeof p, "tf/%d.%09u/", (int)t->header.stamp.sec, (unsigned)t->header.stamp.nanosec);
    print_header(p, &t->header);
    integer(p, "transforms", s->transforms._length);
    text(p, "child_frame_id", t->child_frame_id);
    const geometry_msgs_msg_dds__Transform_* x = &t->transform;
    const double at[] = {x->translation.x, x->translation.y, x->translation.z};
    const double turned[] = {x->rotation.x, x->rotation.y, x->rotation.z, x->rotation.w};
    numbers(p, "translation", at, 3);
    numbers(p, "rotation", turned, 4);
  }
}

static dds_entity_t check(dds_entity_t entity, const char* what) {
  if (entity < 0) {
    fprintf(stderr, "%s: %s\n", what, dds_strretcode(-entity));
    exit(2);
  }
  return entity;
}

static dds_entity_t subscribe(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* topic,
                              dds_durability_kind_t durability) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, durability);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  const dds_entity_t t = check(dds_create_topic(participant, type, topic, NULL, NULL), topic);
  const dds_entity_t reader = check(dds_create_reader(participant, t, qos, NULL), topic);
  dds_delete_qos(qos);
  return reader;
}

// What the writer announces of itself.
static int print_writer(dds_entity_t reader, const char* name) {
  dds_instance_handle_t writer;
  if (dds_get_matched_publications(reader, &writer, 1) < 1) return 0;
  dds_builtintopic_endpoint_t* endpoint = dds_get_matched_publication_data(reader, writer);
  if (endpoint == NULL) return 0;
  void* data = NULL;
  size_t size = 0;
  printf("%s/type %s\n", name, endpoint->type_name);
  if (dds_qget_userdata(endpoint->qos, &data, &size)) printf("%s/user_data %.*s\n", name, (int)size, (const char*)data);
  dds_free(data);
  dds_builtintopic_free_endpoint(endpoint);
  return 1;
}

typedef void (*print_fn)(const void*);

static int take(dds_entity_t reader, print_fn print) {
  void* sample[1] = {NULL};
  dds_sample_info_t info;
  int count = 0;
  while (dds_take(reader, sample, &info, 1, 1) == 1) {
    if (info.valid_data) {
      print(sample[0]);
      ++count;
    }
    dds_return_loan(reader, sample, 1);
  }
  return count;
}

static void any_position(const void* s) {
  print_position(s);
}
static void any_status(const void* s) {
  print_status(s);
}
static void any_times(const void* s) {
  print_times(s);
}
static void any_set(const void* s) {
  print_set(s);
}
static void any_poses(const void* s) {
  print_poses(s);
}
static void any_camera(const void* s) {
  print_camera(s);
}
static void any_pose(const void* s) {
  print_pose(s);
}
static void any_tf(const void* s) {
  print_tf(s);
}

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const dds_entity_t participant = check(dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL), "domain");
  char pose_topic[128];
  snprintf(pose_topic, sizeof pose_topic, "rt/huetrack/%s/pose", argv[2]);
  struct {
    const char* name;
    dds_entity_t reader;
    print_fn print;
    int enough, got, writer_known;
  } topics[] = {
      {"position",
       subscribe(participant, &huetrack_msg_ObjectPosition_desc, "huetrack/object_position", DDS_DURABILITY_VOLATILE),
       any_position, 12, 0, 0},
      {"status",
       subscribe(participant, &huetrack_msg_ServiceStatus_desc, "huetrack/status", DDS_DURABILITY_TRANSIENT_LOCAL),
       any_status, 1, 0, 0},
      {"times",
       subscribe(participant, &huetrack_msg_CameraTimes_desc, "huetrack/camera_times", DDS_DURABILITY_TRANSIENT_LOCAL),
       any_times, 1, 0, 0},
      {"set", subscribe(participant, &huetrack_msg_ObjectSet_desc, "huetrack/object_set", DDS_DURABILITY_VOLATILE),
       any_set, 6, 0, 0},
      {"poses",
       subscribe(participant, &geometry_msgs_msg_dds__PoseArray__desc, "rt/huetrack/wand/poses",
                 DDS_DURABILITY_VOLATILE),
       any_poses, 6, 0, 0},
      {"pose",
       subscribe(participant, &geometry_msgs_msg_dds__PoseWithCovarianceStamped__desc, pose_topic,
                 DDS_DURABILITY_VOLATILE),
       any_pose, 6, 0, 0},
      {"camera", subscribe(participant, &huetrack_msg_CameraPose_desc, "huetrack/camera_pose", DDS_DURABILITY_VOLATILE),
       any_camera, 12, 0, 0},
      {"camera_ros",
       subscribe(participant, &geometry_msgs_msg_dds__PoseWithCovarianceStamped__desc, "rt/huetrack/camera/hand/pose",
                 DDS_DURABILITY_VOLATILE),
       any_pose, 6, 0, 0},
      {"tf", subscribe(participant, &tf2_msgs_msg_dds__TFMessage__desc, "rt/tf", DDS_DURABILITY_VOLATILE), any_tf, 12,
       0, 0},
  };
  const int topic_count = (int)(sizeof topics / sizeof topics[0]);
  int done = 0;
  for (int round = 0; round < 6000 && done < topic_count; ++round) {
    done = 0;
    for (int i = 0; i < topic_count; ++i) {
      topics[i].got += take(topics[i].reader, topics[i].print);
      if (!topics[i].writer_known) topics[i].writer_known = print_writer(topics[i].reader, topics[i].name);
      done += topics[i].got >= topics[i].enough && topics[i].writer_known;
    }
    dds_sleepfor(DDS_MSECS(10));
  }
  for (int i = 0; i < topic_count; ++i)
    if (topics[i].got < topics[i].enough)
      fprintf(stderr, "%s: %d samples of %d\n", topics[i].name, topics[i].got, topics[i].enough);
  dds_delete(participant);
  return done == topic_count ? 0 : 1;
}
