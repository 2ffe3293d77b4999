// Detects time stamps that the target's path in one camera contradicts: films whose frame rate was converted, fields
// that are shown in the wrong order, tables of the times at which frames arrived.
//
// A picture whose stamp is wrong by tau shows the target v tau away from its path, along the path only. Over seven
// pictures a path is a quintic up to noise, so the divided difference that no quintic has is noise across the path, and
// along it noise and the difference of v tau. A fault hypothesis gives tau for every picture, and is named if it
// explains the path so much better that chance does not. See design.md.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "view_watch/view_watch.h"

namespace huetrack::view_watch {

// thread-compatible; one per camera and target of one object.
class PathTimes {
 public:
  struct Sample {
    std::int64_t number = 0;  // of the camera's frame; dropped frames count
    double stamp_s = 0;       // of the frame
    double t_s = 0;           // of the target's row
    Eigen::Vector2d px = Eigen::Vector2d::Zero();
    double sigma_px = 0;
    bool is_target = false;  // associated with it
  };

  void see(const Sample& sample);
  void begin_anew() { samples_.clear(); }

  // By the samples so far; none but in one of 40 calls. camera: for the mistake. Some
  // microseconds; where the path contradicts the stamps, some 10 ms.
  std::optional<Mistake> judge(int camera);

 private:
  std::deque<Sample> samples_;
  std::size_t new_ = 0;  // calls since the samples were judged
};

}  // namespace huetrack::view_watch
