#include "clients/bag/track_bag.h"

#include <algorithm>
#include <stdexcept>

#include "clients/bag/ros_messages.h"
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

}  // namespace

Bag bag_of(const std::map<std::string, std::vector<plot::TrackRow>>& tracks, const std::string& frame_id,
           std::chrono::nanoseconds offset) {
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

}  // namespace huetrack::bag
