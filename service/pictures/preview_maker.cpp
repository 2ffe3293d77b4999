#include "pictures/preview_maker.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/model/covariance_ellipse.h"
#include "calib/model/rig_yaml.h"
#include "capture/frames/jpeg_encoder.h"

namespace huetrack::pictures {
namespace {

constexpr std::uint32_t clutter_state = 100;  // PreviewTarget::state
constexpr float none = std::numeric_limits<float>::quiet_NaN();

// A drawing colour for a target: the middle of its hues, bright and saturated.
std::array<float, 3> drawing_rgb(const color::HsiRange& range) {
  const double to = range.hue_max_deg < range.hue_min_deg ? range.hue_max_deg + 360 : range.hue_max_deg;
  const double hue = std::fmod((range.hue_min_deg + to) / 2, 360) / 60;
  constexpr double value = 0.95, saturation = 0.8;
  std::array<float, 3> rgb{};
  for (int i = 0; i < 3; ++i) {
    const double k = std::fmod((i == 0 ? 5 : i == 1 ? 3 : 1) + hue, 6);
    rgb[std::size_t(i)] = static_cast<float>(value * (1 - saturation * std::clamp(std::min(k, 4 - k), 0.0, 1.0)));
  }
  return rgb;
}

msg::PreviewTarget drawn(const calib::Camera& camera, const std::string& name, double radius_m,
                         const object_tracking::ObjectEstimate& estimate, std::span<const Eigen::Vector3f> particles,
                         int most_particles) {
  msg::PreviewTarget out;
  out.target(name);
  out.state(static_cast<std::uint32_t>(estimate.state));
  out.pixel({none, none});
  out.ellipse({none, none, none});
  out.radius_px(0);
  if (estimate.has_position()) {
    if (const auto pixel = camera.project_world(estimate.position)) {
      out.pixel({static_cast<float>(pixel->px.x()), static_cast<float>(pixel->px.y())});
      out.radius_px(static_cast<float>(radius_m * camera.model.fx() / (estimate.position - camera.centre()).norm()));
      out.ellipse(projected_ellipse(camera, estimate.position, estimate.covariance));
    }
  }
  const std::size_t step = std::max<std::size_t>(1, particles.size() / std::size_t(std::max(1, most_particles)));
  for (std::size_t i = 0; most_particles > 0 && i < particles.size(); i += step) {
    const auto pixel = camera.project_world(particles[i].cast<double>());
    if (!pixel || !camera.contains(*pixel)) continue;
    out.particles().push_back(static_cast<float>(pixel->px.x()));
    out.particles().push_back(static_cast<float>(pixel->px.y()));
  }
  return out;
}

}  // namespace

std::array<float, 3> projected_ellipse(const calib::Camera& camera, const Eigen::Vector3d& position,
                                       const Eigen::Matrix3d& covariance) {
  const auto projected = calib::projected_covariance(camera, position, covariance);
  if (!projected) return {none, none, none};
  const calib::CovarianceEllipse ellipse = calib::ellipse_95(*projected);
  const Eigen::Vector2d major = ellipse.directions.col(1);
  return {static_cast<float>(ellipse.half_axes[1]), static_cast<float>(ellipse.half_axes[0]),
          static_cast<float>(std::atan2(major.y(), major.x()))};
}

std::vector<msg::Preview> make_previews(const config::ServiceConfig& config, const PictureJob& job,
                                        capture::Duration clock_offset) {
  std::vector<msg::Preview> previews;
  for (std::size_t c = 0; c < job.set.frames.size(); ++c) {
    const auto& frame = job.set.frames[c];
    const calib::Camera& camera = config.rig.cameras[c];
    if (!frame || frame->status != capture::FrameStatus::ok || frame->pixels.width != camera.image_size.width) continue;
    const capture::Image* const picture = picture_of(*frame);
    if (picture == nullptr) continue;
    msg::Preview& preview = previews.emplace_back();
    preview.camera(camera.name);
    preview.captured_at((frame->captured_at + clock_offset).time_since_epoch().count());
    preview.set_number(job.set.number);
    preview.image_width(std::uint32_t(frame->pixels.width));
    preview.image_height(std::uint32_t(frame->pixels.height));
    const capture::PictureSize size = capture::picture_size(*picture, config.preview.width);
    preview.width(std::uint32_t(size.width));
    preview.height(std::uint32_t(size.height));
    preview.jpeg(capture::encode_picture(*picture, size, config.preview.quality));
    for (const StillPatch& patch : job.still) {
      if (patch.camera != static_cast<int>(c)) continue;
      msg::PreviewTarget& out = preview.targets().emplace_back();
      out.target(config.targets[patch.target].name);
      out.state(clutter_state);
      out.pixel({none, none});
      out.ellipse({none, none, none});
      out.radius_px(0);
      for (const int corner : patch.box) out.particles().push_back(static_cast<float>(corner));
    }
    for (std::size_t e = 0; e < job.estimates.size(); ++e) {
      const auto& estimate = job.estimates[e];
      const auto& target = config.targets[estimate.target];
      // Particles of all objects of a target are in the entry of its first object.
      const bool is_first = e == 0 || job.estimates[e - 1].target != estimate.target;
      preview.targets().push_back(drawn(
          camera, object_tracking::object_name(target.name, estimate.object), target.radius_m, estimate,
          is_first ? job.particles[estimate.target] : decltype(job.particles)::value_type{}, config.preview.particles));
    }
  }
  return previews;
}

msg::Scene make_scene(const config::ServiceConfig& config, bool may_teach, const std::string& why_not) {
  msg::Scene scene;
  scene.at(std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
               .count());
  scene.rig_identity(calib::rig_identity(config.rig));
  const object_tracking::Volume& volume = config.object_tracking.volume;
  for (std::size_t i = 0; i < 3; ++i) {
    scene.volume_min()[i] = volume.min[Eigen::Index(i)];
    scene.volume_max()[i] = volume.max[Eigen::Index(i)];
  }
  for (const calib::Camera& camera : config.rig.cameras) {
    msg::SceneCamera& out = scene.cameras().emplace_back();
    out.name(camera.name);
    out.width(std::uint32_t(camera.image_size.width));
    out.height(std::uint32_t(camera.image_size.height));
    if (!config.is_calibrated()) continue;  // nothing else is known
    out.model(std::string(camera.model.name()));
    out.intrinsics({camera.model.fx(), camera.model.fy(), camera.model.cx(), camera.model.cy()});
    std::visit([&](const auto& lens) { out.distortion().assign(lens.distortion.begin(), lens.distortion.end()); },
               camera.model.lens());
    const calib::Rigid3d world_from_cam = calib::inverse(camera.cam_from_world);
    const auto& q = world_from_cam.rotation;
    out.position({world_from_cam.translation.x(), world_from_cam.translation.y(), world_from_cam.translation.z()});
    out.orientation_xyzw({q.x(), q.y(), q.z(), q.w()});
    constexpr int per_side = 8;
    const double right = camera.image_size.width - 0.5, bottom = camera.image_size.height - 0.5;
    const Eigen::Vector2d corners[] = {{-0.5, -0.5}, {right, -0.5}, {right, bottom}, {-0.5, bottom}, {-0.5, -0.5}};
    for (int i = 0; i < 4 * per_side; ++i) {
      const Eigen::Vector2d from = corners[i / per_side], to = corners[i / per_side + 1];
      const auto ray = camera.model.ray({from + (to - from) * (double(i % per_side) / per_side)});
      const Eigen::Vector3d in_world =
          ray ? Eigen::Vector3d(q * *ray) : Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
      for (const double value : in_world) out.border().push_back(value);
    }
  }
  for (const object_tracking::TargetOptions& target : config.targets) {
    msg::SceneTarget& out = scene.targets().emplace_back();
    out.name(target.name);
    out.radius_m(target.radius_m);
    constexpr std::array<float, 3> grey{0.6F, 0.6F, 0.6F};
    out.rgb(config::is_taught(target) ? drawing_rgb(target.color) : grey);
    if (!config::is_taught(target)) continue;
    for (const calib::Camera& camera : config.rig.cameras) {
      const color::HsiRange& range = target.color_in(camera.name);
      msg::SceneColor& color = out.colors().emplace_back();
      color.camera(camera.name);
      color.hue_deg({range.hue_min_deg, range.hue_max_deg});
      color.saturation({range.saturation_min, range.saturation_max});
      color.intensity({range.intensity_min, range.intensity_max});
    }
  }
  for (const auto& [camera, boxes] : config.ignored) {
    for (const color::PixelBox& box : boxes) {
      msg::SceneIgnore& out = scene.ignored().emplace_back();
      out.camera(camera);
      out.box({double(box.u_min), double(box.v_min), double(box.u_max), double(box.v_max)});
    }
  }
  scene.may_teach(may_teach);
  scene.why_not(why_not);
  return scene;
}

}  // namespace huetrack::pictures
