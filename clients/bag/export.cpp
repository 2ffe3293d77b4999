#include "clients/bag/export.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "calib/model/rig_yaml.h"
#include "clients/bag/bag.h"
#include "clients/bag/picture_bag.h"
#include "clients/bag/ros_messages.h"
#include "clients/plot/track_file.h"
#include "idl/ros_fields.h"
#include "idl/topics.h"

namespace huetrack::bag {
namespace {

namespace geometry = geometry_msgs::msg::dds_;
constexpr double unknown_orientation_variance = 1e6;  // rad^2; as service/publish has it

const std::string pose_definition =
    "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n" + separator() +
    "MSG: geometry_msgs/PoseWithCovariance\ngeometry_msgs/Pose pose\nfloat64[36] covariance\n" + separator() +
    "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n" + separator() +
    "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n" + quaternion_definition() + header_definition();

using Tracks = std::map<std::string, std::vector<plot::TrackRow>>;  // by target, or by camera

// What a row says, in the messages' own terms.
struct Pose {
  std_msgs::msg::dds_::Header_ header;
  Eigen::Vector4d orientation;  // x, y, z, w
  Eigen::Vector3d position;
  std::array<double, 36> covariance{};
};

Pose pose_of(const plot::TrackRow& row, std::int64_t at_ns, const std::string& frame_id) {
  Pose pose;
  idl::set_header(pose.header, at_ns, frame_id);
  pose.position = row.position;
  const bool has_orientation = !row.orientation.hasNaN();
  pose.orientation = has_orientation ? row.orientation : Eigen::Vector4d(idl::no_rotation.data());
  const auto at = [&](int i, int j) -> double& { return pose.covariance[std::size_t(6 * i + j)]; };
  if (has_orientation) {
    std::size_t k = 0;
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) at(i, j) = at(j, i) = row.pose_covariance[k++];
    return pose;
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) at(i, j) = row.covariance(i, j);
    at(i + 3, i + 3) = unknown_orientation_variance;
  }
  return pose;
}

std::string pose_message(const Pose& pose) {
  geometry::PoseWithCovarianceStamped_ message;
  message.header(pose.header);
  idl::set_xyz(message.pose().pose().position(), pose.position);
  idl::set_rotation(message.pose().pose().orientation(), pose.orientation);
  message.pose().covariance(pose.covariance);
  return cdr_of(message);
}

std::string tf_message(const Pose& pose, const std::string& child) {
  tf2_msgs::msg::dds_::TFMessage_ message;
  auto& transform = message.transforms().emplace_back();
  transform.header(pose.header);
  idl::set_transform(transform, child, pose.position, pose.orientation);
  return cdr_of(message);
}

// The ROS 2 messages of huetrackd (service/publish): a pose with covariance and a transform in /tf for each position.
// frame_id: the world's name; offset: added to all times.
Bag bag_of(const Tracks& tracks, const std::string& frame_id, std::chrono::nanoseconds offset) {
  Bag bag;
  bag.topics.push_back(
      {std::string(idl::ros2_tf_topic).substr(rtps_prefix), "tf2_msgs/msg/TFMessage", tf_definition()});
  for (const auto& [name, rows] : tracks) {
    const std::size_t topic = bag.topics.size();
    const std::string word = word_of(name);
    const bool is_camera = !rows.empty() && rows.front().is_camera;
    bag.topics.push_back(
        {(is_camera ? idl::ros2_camera_pose_topic(word) : idl::ros2_pose_topic(word)).substr(rtps_prefix),
         "geometry_msgs/msg/PoseWithCovarianceStamped", pose_definition});
    for (const plot::TrackRow& row : rows) {
      if (!row.has_position()) continue;
      const std::int64_t at_ns = ros_time(row.at.time_since_epoch(), offset);
      const Pose pose = pose_of(row, at_ns, frame_id);
      bag.messages.push_back({topic, at_ns, pose_message(pose)});
      bag.messages.push_back({0, at_ns, tf_message(pose, word)});
    }
  }
  if (bag.messages.empty()) throw std::runtime_error("no row has a position: there is nothing to export");
  std::ranges::stable_sort(bag.messages, {}, &Message::at_ns);
  return bag;
}

// The poses of a rig's cameras for /tf_static: world from each camera's optical frame, whose name is the frame_id of
// its pictures.
Topic static_tf_topic() {
  return {.name = std::string(idl::ros2_tf_static_topic).substr(rtps_prefix),
          .type = "tf2_msgs/msg/TFMessage",
          .definition = tf_definition(),
          .is_kept_for_latecomers = true};
}

// One message with all of them but the moving cameras, which are in /tf. Message::topic is 0.
Message static_tf_of(const calib::CameraRig& rig, const std::set<std::string>& moving, const std::string& frame_id,
                     std::int64_t at_ns) {
  tf2_msgs::msg::dds_::TFMessage_ message;
  for (const calib::Camera& camera : rig.cameras) {
    if (moving.contains(camera.name)) continue;
    const calib::Rigid3d world_from_cam = calib::inverse(camera.cam_from_world);
    auto& transform = message.transforms().emplace_back();
    idl::set_header(transform.header(), at_ns, frame_id);
    idl::set_transform(transform, camera.name, world_from_cam.translation, world_from_cam.rotation.coeffs());
  }
  return {.topic = 0, .at_ns = at_ns, .data = cdr_of(message)};
}

void refuse_other_forms(const std::filesystem::path& out) {
  const std::string extension = out.extension();
  if (extension == ".db3" || extension == ".bag" || extension == ".csv")
    throw std::runtime_error(out.string() +
                             ": a rosbag2 is a folder, which gets its .db3 by itself (--out my_bag); "
                             "the other form is one file, --out FILE.mcap");
  if (extension == ".tum")
    throw std::runtime_error(out.string() +
                             ": `huetrack watch --format tum` writes TUM, of a replay or live; this "
                             "writes a rosbag2 (--out FOLDER) or MCAP (--out FILE.mcap)");
}

// A recording in place of the tracks: a common mistake.
void refuse_recording(const std::filesystem::path& tracks) {
  std::error_code none;
  if (std::filesystem::is_directory(tracks, none) || tracks.extension() == ".yaml")
    throw std::runtime_error(tracks.string() + ": is no track CSV; a recording's pictures are exported by --pictures " +
                             tracks.string());
}

// The tracked cameras.
std::set<std::string> moving_of(const Tracks& tracks) {
  std::set<std::string> moving;
  for (const auto& [name, rows] : tracks)
    if (!rows.empty() && rows.front().is_camera) moving.insert(name);
  return moving;
}

}  // namespace

void export_track(const BagOptions& options) {
  refuse_other_forms(options.out);
  refuse_recording(options.tracks);
  if (options.tracks.empty() && options.pictures.empty())
    throw std::runtime_error("give a track CSV, or --pictures RECORDING, or both");
  const std::chrono::nanoseconds offset(std::llround(options.clock_offset_s * 1e9));
  Tracks tracks;
  if (!options.tracks.empty()) tracks = plot::read_tracks(options.tracks);
  const Bag bag = options.tracks.empty() ? Bag() : bag_of(tracks, options.frame_id, offset);
  std::vector<Topic> topics = bag.topics;
  std::optional<RecordedPictures> pictures;
  std::optional<Message> picture;
  if (!options.pictures.empty()) {
    pictures.emplace(options.pictures, options.rig, topics.size(), offset);
    topics.insert(topics.end(), pictures->topics().begin(), pictures->topics().end());
    picture = pictures->next();
    if (!picture && bag.messages.empty())
      throw std::runtime_error(options.pictures.front() + " has no picture: there is nothing to export");
  }
  const calib::CameraRig rig = pictures              ? pictures->rig()
                               : options.rig.empty() ? calib::CameraRig()
                                                     : calib::read_rig(options.rig);
  const bool has_places = !rig.cameras.empty();
  if (has_places) topics.push_back(static_tf_topic());

  std::error_code none;
  const bool was_there = std::filesystem::is_regular_file(options.out, none);  // a rosbag2 is always a new folder
  const auto writer =
      options.out.extension() == ".mcap" ? mcap_writer(topics, options.out) : rosbag2_writer(topics, options.out);
  std::size_t messages = 0;
  if (has_places) {  // first: valid for all that follow
    const std::int64_t from_ns = bag.messages.empty() ? picture->at_ns
                                 : picture            ? std::min(bag.messages.front().at_ns, picture->at_ns)
                                                      : bag.messages.front().at_ns;
    Message places = static_tf_of(rig, moving_of(tracks), options.frame_id, from_ns);
    places.topic = topics.size() - 1;
    writer->add(places);
    ++messages;
  }
  for (auto track = bag.messages.begin(); track != bag.messages.end() || picture; ++messages) {
    const bool is_tracks_turn = !picture || (track != bag.messages.end() && track->at_ns <= picture->at_ns);
    writer->add(is_tracks_turn ? *track : *picture);
    if (is_tracks_turn)
      ++track;
    else
      picture = pictures->next();
  }
  writer->finish();
  if (was_there) std::fprintf(stderr, "note: %s: the previous file is replaced\n", options.out.c_str());
  if (pictures)
    for (const std::string& warning : pictures->take_warnings()) std::fprintf(stderr, "note: %s\n", warning.c_str());
  if (pictures && options.clock_offset_s == 0 && pictures->started_at_s())
    std::fprintf(stderr, "note: times are of the recording's clock; --clock-offset %.9f makes them UNIX time\n",
                 *pictures->started_at_s());
  std::printf("%s: %zu messages on %zu topics:", options.out.c_str(), messages, topics.size());
  for (const Topic& topic : topics) std::printf(" %s", topic.name.c_str());
  std::printf("\n");
}

}  // namespace huetrack::bag
