// Interlaced live cameras: frame grabbers, old webcams, streams without a tag. Detects combs, and plays a field.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "capture/frames/comb_watch.h"
#include "capture/frames/frame_source.h"
#include "capture/frames/picture_layout.h"
#include "capture/live_camera.h"

namespace huetrack::capture {

// Frames of a source; of cameras with a stated first field that field's picture, in full size (their JPEG bytes, which
// hold both fields, are left out: Frame::encoded). thread-compatible; warning() and take_events() are thread-safe.
class FieldSource final : public FrameSource {
 public:
  // fields: by Frame::camera; a camera without one is progressive.
  FieldSource(std::unique_ptr<FrameSource> source, std::map<int, FirstField> fields);

  std::optional<Frame> next(std::stop_token stop) override;
  bool ended(int camera) const override { return source_->ended(camera); }
  Duration waited() const override { return source_->waited(); }
  std::uint64_t jumps() const override { return source_->jumps(); }

  // What this camera's pictures contradict, and what to do, as "is interlaced, but ..."; empty: nothing so far.
  std::string warning(int camera) const;
  std::vector<CameraEvent> take_events(int camera);  // since the last call: the warning, once

 private:
  std::unique_ptr<FrameSource> source_;
  const std::map<int, FirstField> fields_;
  std::map<int, CombWatch> watches_;  // the thread's that calls next()
  mutable std::mutex mutex_;
  std::map<int, std::string> warnings_;                 // guarded by mutex_
  std::map<int, std::vector<CameraEvent>> new_events_;  // guarded by mutex_
};

// Puts a FieldSource around the source of a camera. Its warnings and events are then among the camera's.
// others: the cameras whose frames that source delivers, too. fields: as FieldSource's
void watch_fields(LiveCamera& camera, std::vector<LiveCamera*> others, std::map<int, FirstField> fields);

}  // namespace huetrack::capture
