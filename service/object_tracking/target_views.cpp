#include "object_tracking/target_views.h"

#include <algorithm>
#include <cmath>

#include "color/match_tiles.h"
#include "object_tracking/motion_state.h"

namespace huetrack::object_tracking {

TargetViews::TargetViews(const calib::CameraRig& rig, const TargetOptions& target) {
  for (const calib::Camera& camera : rig.cameras) {
    cameras_.push_back(std::make_unique<PerCamera>(camera, target.color_in(camera.name)));
    const auto ignored = std::ranges::find(target.ignored, camera.name, &IgnoredRegions::value_type::first);
    if (ignored != target.ignored.end()) cameras_.back()->matches.ignore(ignored->second);
  }
}

std::vector<std::size_t> TargetViews::trust(std::span<const CameraTrust> cameras) {
  std::vector<std::size_t> changed;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    PerCamera& c = *cameras_[i];
    const CameraTrust trust = i < cameras.size() ? cameras[i] : CameraTrust{};
    const bool is_left_out = c.is_used && !trust.is_used;
    const bool is_explained = trust.has_moved && !c.has_moved;
    c.is_used = trust.is_used;
    c.has_moved = trust.has_moved;
    const calib::Rigid3d pose = trust.cam_from_world.value_or(c.in_rig);
    const calib::Rigid3d& before = c.camera.cam_from_world;
    const bool is_moved = pose.rotation.coeffs() != before.rotation.coeffs() || pose.translation != before.translation;
    if (is_moved) {
      c.camera.cam_from_world = pose;
      c.projector = calib::BatchProjector(c.camera);
    }
    if (!is_moved && !is_left_out && !is_explained) continue;
    c.matches.leave_out_nothing();  // refers to what StaticClutterMask forgets with the camera
    changed.push_back(i);
  }
  return changed;
}

const color::ColorTable& TargetViews::table_for(PerCamera& camera, capture::PixelFormat format,
                                                capture::ColorRange range) {
  if (camera.table && camera.table->is_for(format, range)) return *camera.table;
  for (const auto& other : cameras_) {  // cameras of one kind share a table
    if (other->table && other->table->is_for(format, range) && other->color == camera.color) {
      camera.table = other->table;
      return *camera.table;
    }
  }
  camera.table = std::make_shared<const color::ColorTable>(camera.color, format, range);
  return *camera.table;
}

bool is_apart(const std::vector<TargetView>& views) {
  return std::ranges::any_of(views, [&](const TargetView& view) {
    return std::abs(capture::seconds(view.frame->captured_at - views.front().frame->captured_at)) >
           time_prior.same_sigma_s;
  });
}

bool TargetViews::look_at(PerCamera& camera, const capture::Frame& frame, const color::ColorTable*& table) {
  if (!frame.matches) {
    table = &table_for(camera, frame.pixels.format, frame.pixels.range);
    camera.matches.look_at(frame.pixels, *table);
    return true;
  }
  const auto* found = frame.matches->of(color::matched_color(camera.color));
  if (found == nullptr && camera.color_before) found = frame.matches->of(color::matched_color(*camera.color_before));
  if (found == nullptr) {
    ++camera.frames_of_other_colors;
    return false;
  }
  camera.matches.look_at(*found);
  return true;
}

const std::vector<TargetView>& TargetViews::look_at(const capture::FrameSet& set) {
  views_.clear();
  unused_.clear();
  for (std::size_t i = 0; i < cameras_.size() && i < set.frames.size(); ++i) {
    if (!set.frames[i] || set.frames[i]->status != capture::FrameStatus::ok) continue;
    const capture::Frame& frame = *set.frames[i];
    PerCamera& c = *cameras_[i];
    if (frame.pixels.width != c.camera.image_size.width || frame.pixels.height != c.camera.image_size.height) continue;
    const color::ColorTable* table = nullptr;
    if (!look_at(c, frame, table)) continue;
    (c.is_used ? views_ : unused_)
        .push_back({int(i), &c.camera, &c.projector, &c.matches, &frame.pixels, table, &frame,
                    capture::seconds(set.at - frame.captured_at)});
  }
  return views_;
}

}  // namespace huetrack::object_tracking
