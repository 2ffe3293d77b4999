#include "publish/ros_view.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>

#include "calib/model/covariance_ellipse.h"
#include "idl/camera_info.h"
#include "idl/ros_fields.h"

namespace huetrack::publish {
namespace {

using Marker = visualization_msgs::msg::dds_::Marker_;

enum MarkerType : std::int32_t {
  sphere = 2,
  line_list = 5,
  text_view_facing = 9
};  // visualization_msgs/msg/Marker.msg
enum MarkerAction : std::int32_t { add = 0, remove = 2 };

constexpr float camera_grey = 0.6F;
constexpr std::int32_t target_lifetime_s = 2;

Marker marker(std::int64_t at, const std::string& frame_id, const std::string& group, std::int32_t id,
              MarkerType type) {
  Marker m;
  idl::set_header(m.header(), at, frame_id);
  m.ns(group);
  m.id(id);
  m.type(type);
  m.action(add);
  m.pose().orientation().w(1);
  return m;
}

void set_color(Marker& m, const std::array<float, 3>& rgb, float alpha) {
  m.color().r(rgb[0]);
  m.color().g(rgb[1]);
  m.color().b(rgb[2]);
  m.color().a(alpha);
}

void add_line(Marker& m, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  for (const Eigen::Vector3d& p : {from, to}) idl::set_xyz(m.points().emplace_back(), p);
}

void set_ellipsoid(Marker& m, const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance);
  Eigen::Matrix3d rotation = axes.eigenvectors();
  if (rotation.determinant() < 0) rotation.col(0) = -rotation.col(0);
  idl::set_rotation(m.pose().orientation(), Eigen::Quaterniond(rotation).coeffs());
  const Eigen::Vector3d diameter = 2 * calib::chi_95_in_3d * axes.eigenvalues().cwiseMax(1e-12).cwiseSqrt();
  idl::set_xyz(m.scale(), diameter);
}

// Markers of one time, in the world frame except for a moving camera.
class MarkersOfScene {
 public:
  MarkersOfScene(std::int64_t unix_ns, const std::string& frame_id) : at_(unix_ns), frame_id_(frame_id) {}

  void add_object(const msg::SceneTarget& target, const object_tracking::ObjectEstimate& estimate) {
    const std::string object = object_tracking::object_name(target.name(), estimate.object);
    Marker ball = marker(at_, frame_id_, object, 0, sphere);
    Marker ellipsoid = marker(at_, frame_id_, object, 1, sphere);
    Marker name = marker(at_, frame_id_, object, 2, text_view_facing);
    if (estimate.has_position()) {
      idl::set_xyz(ball.pose().position(), estimate.position);
      idl::set_xyz(ball.scale(), Eigen::Vector3d::Constant(2 * target.radius_m()));
      // Translucent, because the ellipsoid is usually inside.
      set_color(ball, target.rgb(), estimate.state == object_tracking::TrackState::tracking ? 0.45F : 0.2F);
      idl::set_xyz(ellipsoid.pose().position(), estimate.position);
      set_ellipsoid(ellipsoid, estimate.covariance);
      set_color(ellipsoid, target.rgb(), 0.8F);
      idl::set_xyz(name.pose().position(), estimate.position + Eigen::Vector3d(0, 0, 2 * target.radius_m()));
      idl::set_xyz(name.scale(), Eigen::Vector3d(0, 0, 1.5 * target.radius_m()));
      set_color(name, {1, 1, 1}, 1);
      name.text(object);
    } else {
      for (Marker* m : {&ball, &ellipsoid, &name}) m->action(remove);
    }
    // RViz deletes them after this time.
    for (Marker* m : {&ball, &ellipsoid, &name}) {
      m->lifetime().sec(target_lifetime_s);
      array_.markers().push_back(std::move(*m));
    }
  }

  // Its field of view up to that depth, and its name. number: in the scene.
  void add_camera(const msg::SceneCamera& camera, std::int32_t number, double depth, bool moves) {
    const Eigen::Vector3d eye = moves ? Eigen::Vector3d::Zero() : Eigen::Vector3d(camera.position().data());
    const Eigen::Quaterniond to_frame =  // of the border's rays, which are in the world frame of the rig file
        moves ? Eigen::Quaterniond(camera.orientation_xyzw().data()).conjugate() : Eigen::Quaterniond::Identity();
    const std::string& frame = moves ? camera.name() : frame_id_;
    Marker view = marker(at_, frame, "cameras", 2 * number, line_list);
    view.frame_locked(moves);
    idl::set_xyz(view.scale(), Eigen::Vector3d(0.005, 0, 0));
    set_color(view, {camera_grey, camera_grey, camera_grey}, 1);
    std::vector<Eigen::Vector3d> rim;
    for (std::size_t i = 0; i + 2 < camera.border().size(); i += 3) {
      const Eigen::Vector3d ray(camera.border()[i], camera.border()[i + 1], camera.border()[i + 2]);
      if (ray.allFinite()) rim.emplace_back(eye + depth * (to_frame * ray));
    }
    for (std::size_t i = 0; i < rim.size(); ++i) {
      add_line(view, rim[i], rim[(i + 1) % rim.size()]);
      if (i % std::max<std::size_t>(1, rim.size() / 4) == 0) add_line(view, eye, rim[i]);
    }
    Marker name = marker(at_, frame, "cameras", 2 * number + 1, text_view_facing);
    name.frame_locked(moves);
    idl::set_xyz(name.pose().position(),
                 eye + (moves ? Eigen::Vector3d(0, -depth / 4, 0) : Eigen::Vector3d(0, 0, depth / 4)));
    idl::set_xyz(name.scale(), Eigen::Vector3d(0, 0, depth / 5));
    set_color(name, {1, 1, 1}, 1);
    name.text(camera.name());
    array_.markers().push_back(std::move(view));
    array_.markers().push_back(std::move(name));
  }

  void add_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
    Marker box = marker(at_, frame_id_, "volume", 0, line_list);
    idl::set_xyz(box.scale(), Eigen::Vector3d(0.004, 0, 0));
    set_color(box, {camera_grey, camera_grey, camera_grey}, 0.6F);
    for (int corner = 0; corner < 8; ++corner) {
      for (int axis = 0; axis < 3; ++axis) {
        if ((corner >> axis & 1) != 0) continue;
        const auto at_corner = [&](int k) {
          return Eigen::Vector3d((k & 1) != 0 ? high.x() : low.x(), (k & 2) != 0 ? high.y() : low.y(),
                                 (k & 4) != 0 ? high.z() : low.z());
        };
        add_line(box, at_corner(corner), at_corner(corner | 1 << axis));
      }
    }
    array_.markers().push_back(std::move(box));
  }

  visualization_msgs::msg::dds_::MarkerArray_ take() { return std::move(array_); }

 private:
  const std::int64_t at_;
  const std::string& frame_id_;
  visualization_msgs::msg::dds_::MarkerArray_ array_;
};

}  // namespace

std::string ros_name(const std::string& camera) {
  std::string name;
  for (const char c : camera) {
    const bool is_kept = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    if (is_kept) {
      name += c;
    } else if (name.empty() || name.back() != '_') {
      name += '_';
    }
  }
  if (name.empty() || (name.front() >= '0' && name.front() <= '9')) name.insert(0, "camera_");
  return name;
}

visualization_msgs::msg::dds_::MarkerArray_ to_markers(const msg::Scene& scene,
                                                       std::span<const object_tracking::ObjectEstimate> estimates,
                                                       capture::Timestamp captured, const std::string& frame_id,
                                                       const std::string& tracked_camera) {
  MarkersOfScene markers(captured.time_since_epoch().count(), frame_id);
  for (const object_tracking::ObjectEstimate& estimate : estimates) {
    assert(estimate.target < scene.targets().size());
    markers.add_object(scene.targets()[estimate.target], estimate);
  }
  const Eigen::Vector3d low(scene.volume_min().data()), high(scene.volume_max().data());
  const double depth = 0.12 * (high - low).norm();
  for (std::size_t c = 0; c < scene.cameras().size(); ++c)
    if (const msg::SceneCamera& camera = scene.cameras()[c]; !camera.model().empty())  // calibrated
      markers.add_camera(camera, static_cast<std::int32_t>(c), depth, camera.name() == tracked_camera);
  markers.add_box(low, high);
  return markers.take();
}

sensor_msgs::msg::dds_::CompressedImage_ to_ros_image(const msg::Preview& preview) {
  sensor_msgs::msg::dds_::CompressedImage_ image;
  idl::set_header(image.header(), preview.captured_at(), preview.camera());
  image.format("jpeg");
  image.data(preview.jpeg());
  return image;
}

sensor_msgs::msg::dds_::CameraInfo_ to_camera_info(const msg::Preview& preview, const msg::SceneCamera& camera) {
  sensor_msgs::msg::dds_::CameraInfo_ info;
  if (camera.model().empty()) {  // zeros: ROS' convention for an uncalibrated camera
    info.width(preview.width());
    info.height(preview.height());
  } else {
    const double sx = static_cast<double>(preview.width()) / preview.image_width();
    const double sy = static_cast<double>(preview.height()) / preview.image_height();
    const auto& [fx, fy, cx, cy] = camera.intrinsics();
    // Pixel centres are integers at both sizes; distances scale from the image's edge at -0.5.
    info = idl::camera_info(preview.width(), preview.height(), camera.model(),
                            {fx * sx, fy * sy, (cx + 0.5) * sx - 0.5, (cy + 0.5) * sy - 0.5}, camera.distortion());
  }
  idl::set_header(info.header(), preview.captured_at(), preview.camera());
  return info;
}

tf2_msgs::msg::dds_::TFMessage_ to_static_tf(const msg::Scene& scene, const std::string& frame_id,
                                             const std::string& tracked_camera) {
  tf2_msgs::msg::dds_::TFMessage_ message;
  for (const msg::SceneCamera& camera : scene.cameras()) {
    if (camera.name() == tracked_camera || camera.model().empty()) continue;
    auto& transform = message.transforms().emplace_back();
    idl::set_header(transform.header(), scene.at(), frame_id);
    idl::set_transform(transform, camera.name(), camera.position(), camera.orientation_xyzw());
  }
  return message;
}

}  // namespace huetrack::publish
