#include "clients/bag/ros_messages.h"

#include <algorithm>
#include <cctype>
#include <limits>
#include <stdexcept>

#include "clients/bag/bag.h"

namespace huetrack::bag {
namespace {

constexpr std::int64_t ns_per_s = 1'000'000'000;

}  // namespace

std::string separator() {
  return std::string(80, '=') + "\n";
}

std::string header_definition() {
  return separator() + "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + separator() +
         "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
}

std::string quaternion_definition() {
  return separator() + "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n";
}

std::string tf_definition() {
  return "geometry_msgs/TransformStamped[] transforms\n" + separator() +
         "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\n"
         "geometry_msgs/Transform transform\n" +
         separator() +
         "MSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n" +
         separator() + "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n" + quaternion_definition() +
         header_definition();
}

std::string offered_qos_profiles(const Topic& topic) {
  if (!topic.is_kept_for_latecomers) return "";
  const std::string endless = "    sec: 9223372036\n    nsec: 854775807\n";
  return "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:\n" + endless + "  lifespan:\n" +
         endless + "  liveliness: 1\n  liveliness_lease_duration:\n" + endless +
         "  avoid_ros_namespace_conventions: false\n";
}

std::string word_of(std::string name) {
  std::ranges::replace_if(
      name, [](unsigned char c) { return std::isalnum(c) == 0 && c != '_'; }, '_');
  return name;
}

std::int64_t ros_time(std::chrono::nanoseconds since_epoch, std::chrono::nanoseconds offset) {
  const std::int64_t ns = (since_epoch + offset).count();
  if (ns < 0 || ns / ns_per_s > std::numeric_limits<std::int32_t>::max())
    throw std::runtime_error("the time " + std::to_string(ns / ns_per_s) +
                             " s is none that ROS 2 can say (1970 to 2038); --clock-offset is added to all");
  return ns;
}

}  // namespace huetrack::bag
