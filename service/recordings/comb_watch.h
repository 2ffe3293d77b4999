// Detects interlaced pictures whose file does not say so, by their pixels: where the picture moves, rows of one field
// lie beside rows of another moment, so that neighbouring rows differ more than the next but one. (Stripes of single
// rows in the room would look alike.) Private to this
// module.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "capture/frames/frame.h"

namespace huetrack::recordings {

struct CombEvidence {
  double row_curvature = 0;                           // sum over moving pixels of |p[y-1] - 2 p[y] + p[y+1]|
  double field_curvature = 0;                         // the same, two rows up and down: within one field
  double top_after_bottom = 0, bottom_after_top = 0;  // difference of each field's rows from the other's before
  std::int64_t moving = 0;                            // pixels

  // Curvature falls with the distance in films (0.34 to 0.55 in all of ours), is equal in noise (1), and rises with
  // fields (1.27 to 2.7).
  double ratio() const { return field_curvature > 0 ? row_curvature / field_curvature : 0; }
};

// thread-compatible.
class CombWatch {
 public:
  // The next picture of a camera, upright.
  void see(const capture::Image& picture);
  // Once, when the pictures are combs: what is wrong and what to do, as "is interlaced, but ...".
  std::optional<std::string> take_problem();
  const CombEvidence& evidence() const { return evidence_; }

 private:
  capture::Image before_;  // no planes: the next picture is not compared
  std::int64_t pictures_ = 0;
  CombEvidence evidence_;
  bool has_problem_ = false, is_known_ = false;
};

}  // namespace huetrack::recordings
