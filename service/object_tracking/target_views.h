// One target in every camera of a frame set: colour tables, matching pixels, projections.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "calib/model/batch_projector.h"
#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "color/color_model.h"
#include "color/color_window.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::object_tracking {

// A camera that gave a usable frame in the current set.
struct TargetView {
  int index;  // into CameraRig::cameras
  const calib::Camera* camera;
  const calib::BatchProjector* projector;
  color::MatchBits* matches;       // the pixels of the target's colour in this frame
  const capture::Image* image;     // of a frame of matches without planes
  const color::ColorTable* table;  // nullptr: a frame of matches
  const capture::Frame* frame;
  double age_s;  // the set's time minus this frame's own capture time (its middle row's), >= 0

  double below_middle(double row) const { return image->height > 1 ? row / (image->height - 1) - 0.5 : 0.0; }
};

// thread-compatible. Views point into this object: it does not move.
class TargetViews {
 public:
  TargetViews(const calib::CameraRig& rig, const TargetOptions& target);
  TargetViews(const TargetViews&) = delete;
  TargetViews& operator=(const TargetViews&) = delete;

  // The views of this set, in camera order; valid until the next call. Without frames of another size than the rig's,
  // cameras that are not used, and frames of matches of other colours only.
  const std::vector<TargetView>& look_at(const capture::FrameSet& set);
  const std::vector<TargetView>& unused() const { return unused_; }
  const std::vector<TargetView>& used() const { return views_; }

  // Builds the camera's colour table for this format in advance.
  void expect(std::size_t camera, capture::PixelFormat format, capture::ColorRange range) {
    table_for(*cameras_.at(camera), format, range);
  }

  // From the next set on. Returns the table in use until now.
  std::shared_ptr<const color::ColorTable> recolor(std::size_t camera, const color::HsiRange& color,
                                                   std::shared_ptr<const color::ColorTable> table) {
    PerCamera& c = *cameras_.at(camera);
    c.color_before = std::exchange(c.color, color);
    c.table_before = c.table;  // the views of this set point to it
    return std::exchange(c.table, std::move(table));
  }

  // From the next set on; ObjectTracker::trust(). Returns the cameras whose history is void: their pose changed, they
  // are not used any more, or their inconsistency is explained.
  std::vector<std::size_t> trust(std::span<const CameraTrust> cameras);

  const color::HsiRange& color_in(std::size_t camera) const { return cameras_[camera]->color; }
  // Frames of matches of other colours than the target's.
  std::uint64_t frames_of_other_colors(std::size_t camera) const { return cameras_[camera]->frames_of_other_colors; }

  std::size_t camera_count() const { return cameras_.size(); }
  const calib::Camera& camera(std::size_t i) const { return cameras_[i]->camera; }
  const calib::BatchProjector& projector(std::size_t i) const { return cameras_[i]->projector; }

 private:
  struct PerCamera {
    PerCamera(const calib::Camera& c, const color::HsiRange& color_of_target)
        : in_rig(c.cam_from_world),
          camera(c),
          projector(c),
          matches(c.image_size.width, c.image_size.height),
          color(color_of_target) {}
    calib::Rigid3d in_rig;
    calib::Camera camera;
    calib::BatchProjector projector;
    color::MatchBits matches;
    bool is_used = true, has_moved = false;
    color::HsiRange color;
    std::optional<color::HsiRange> color_before = {};  // a remote camera matches it until it has the new one
    std::uint64_t frames_of_other_colors = 0;
    std::shared_ptr<const color::ColorTable> table;  // of the last format; built when it is first seen
    std::shared_ptr<const color::ColorTable> table_before = {};
  };
  // false: matches of other colours only. table: the one in use, or nullptr.
  bool look_at(PerCamera& camera, const capture::Frame& frame, const color::ColorTable*& table);
  const color::ColorTable& table_for(PerCamera& camera, capture::PixelFormat format, capture::ColorRange range);

  std::vector<std::unique_ptr<PerCamera>> cameras_;
  std::vector<TargetView> views_, unused_;
};

// The frames were not started by one trigger.
bool is_apart(const std::vector<TargetView>& views);

}  // namespace huetrack::object_tracking
