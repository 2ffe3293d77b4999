// Detects interlaced pictures whose file does not say so, and fields that are stated in the wrong order, by their
// pixels: where the picture moves, neighbouring rows are of different moments, so that neighbouring rows
// differ more than the next but one. (Stripes of single rows in the room would look alike.) The field that was taken
// first differs less from the other one of the picture before.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>

#include "capture/frames/frame.h"
#include "capture/frames/picture_layout.h"

namespace huetrack::capture {

struct CombEvidence {
  double row_curvature = 0;                                  // sum over moving pixels of |p[y-1] - 2 p[y] + p[y+1]|
  double field_curvature = 0;                                // the same, two rows up and down: within one field
  double column_curvature = 0, second_column_curvature = 0;  // as these, along the rows: one and two columns apart
  double top_after_bottom = 0, bottom_after_top = 0;         // difference of each field's rows from the other's before
  std::int64_t moving = 0;                                   // pixels
  // Of the colours' own rows, where a row of theirs stands for two of the picture (4:2:0) and the picture is combed.
  double color_row_curvature = 0, color_field_curvature = 0;
  std::int64_t color_combed = 0;  // samples

  // Curvature falls with the distance in films (0.34 to 0.55 in all of ours), is equal in noise (1), and rises with
  // fields (1.27 to 2.7).
  double ratio() const { return field_curvature > 0 ? row_curvature / field_curvature : 0; }
  // As ratio(), along the rows, where fields leave the curvature of a film, and a mosaic of colours that of fields.
  double column_ratio() const { return second_column_curvature > 0 ? column_curvature / second_column_curvature : 0; }
  double color_ratio() const { return color_field_curvature > 0 ? color_row_curvature / color_field_curvature : 0; }
  bool is_top_first() const { return top_after_bottom < bottom_after_top; }
  // >= 1: ratio of the two fields' differences from the picture before; 0: unknown.
  double order_ratio() const {
    const auto [less, more] = std::minmax(top_after_bottom, bottom_after_top);
    return less > 0 ? more / less : 0;
  }
};

// What a recording or a file states of fields.
struct StatedFields {
  FirstField first = FirstField::top;
  bool is_tagged = false;  // by the file; false: by `fields` of the recording
};

// thread-compatible.
class CombWatch {
 public:
  // The next picture of a camera, whole and as stored. stated: its first field is played. nullopt: the picture is.
  void see(const Image& picture, std::optional<StatedFields> stated = {});
  // Once, when the pictures contradict what is stated: what is wrong and what to do, as "is interlaced, but ...".
  std::optional<std::string> take_problem();
  const CombEvidence& evidence() const { return evidence_; }

 private:
  bool is_contradicted() const;
  bool is_mosaic() const;  // raw samples behind a colour filter (Bayer)
  // The colours were halved as those of whole pictures are, so each of their rows is the mean of both fields.
  bool has_mixed_colors() const;

  Image before_;                          // no planes: the next picture is not compared
  std::int64_t pictures_ = 0, wait_ = 0;  // since the last one that was kept, and up to the next one
  CombEvidence evidence_;
  std::optional<StatedFields> stated_;
  bool shares_colors_ = false;  // 4:2:0
  bool has_problem_ = false, is_known_ = false;
};

}  // namespace huetrack::capture
