// What a recording.yaml states of a camera's times, compared with what the camera's file says itself. Pure but for
// TimesBesideFilm. Private to this module.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "capture/frames/frame.h"
#include "recordings/image_series.h"
#include "recordings/recording.h"

namespace huetrack::recordings {

struct TimesProblem {
  std::string text;         // "its times are 0.0005556 s a frame, but ...: they look like minutes: ..."
  bool is_of_unit = false;  // another unit explains it: the times are wrong
};

// Listed times (camera.timestamps) that are too far apart, or too close, for the file. file_period: by its header; 0:
// it has none, as images. nullopt: they may be right.
std::optional<TimesProblem> problem_of_listed_times(const RecordedCamera& camera, capture::Duration file_period);

// A table with a row for every frame but those that it leaves out in its times, of a film that has these frames, too:
// its rows are numbered without them.
std::optional<std::string> problem_of_rows(const RecordedCamera& camera, std::int64_t film_frames);

// Times as seconds.frames: 0.28, 0.29, 1.00, 1.01.
std::optional<std::string> problem_of_timecode(const RecordedCamera& camera);

struct RateRemark {
  std::string text;
  bool is_mistake = false;  // false: the table is right, and the film's header is not
};

// Listed times that were measured, at another rate than the film's header says, of a film without measured times. Such
// headers are often wrong (webcams slow down in the dark); but the program that measured the times listed every
// picture of the film. If the table ends earlier or later by as much as the rates differ, it numbers other pictures.
// film_frames: nullopt: unknown
std::optional<RateRemark> remark_on_measured_rate(const RecordedCamera& camera, capture::Duration film_period,
                                                  std::optional<std::int64_t> film_frames);

// Listed times that are rounded to 10 ms or more, and are uneven by that: what that costs, and what to do.
std::optional<std::string> remark_on_rounding(const RecordedCamera& camera);

// Whether a stream's times are even. thread-compatible.
class EvenTimes {
 public:
  void see(std::int64_t index, capture::Timestamp at);
  double hz() const;  // 0: they are not, or too few are known

 private:
  std::int64_t first_ = 0, last_ = 0, pictures_ = 0;  // index
  capture::Timestamp first_at_{}, last_at_{};
  double shortest_s_ = 0, longest_s_ = 0;  // of the steps
};

struct NumbersProblem {
  std::string text;
  bool counts_files = false;  // the table numbers the files, not the pictures: read so, it has the gaps of the names
};

// Numbers that are missing in the names of a series, as pictures that the camera dropped, and stated times that do not
// know it. nullopt: there are none, or the times have the same gaps.
std::optional<NumbersProblem> problem_of_numbers(const RecordedCamera& camera, std::span<const ImageFile> files);

// The times that a recording states (fps, timestamps) beside the film's own time stamps, as they are played. Times that
// do not vary were not measured: they follow from a rate that somebody typed, as those of most headers do. Measured
// times are right where the others are not; two of one kind must agree. thread-compatible.
class TimesBesideFilm {
 public:
  TimesBesideFilm(const RecordedCamera& camera, capture::Duration film_period);

  void see_header(capture::Duration period);  // of a film without time stamps of its own; 0: it says none
  // The next picture's place in the stream, its stated time without the offset, and its time by the container.
  void see(std::int64_t index, capture::Timestamp stated, capture::Timestamp stamp);
  void end();  // after the last picture
  // Contradictions since the last call, as "fps says 25, but ...".
  std::vector<std::string> take_problems() { return std::exchange(problems_, {}); }

 private:
  struct Seen {
    std::int64_t index;
    double stated_s, film_s;
  };
  void compare_rates(const Seen& picture);
  void compare_lengths(const Seen& picture);
  void report_rate(double stated_period_s, double film_period_s, std::string_view remedy);
  void look_for_gap();
  void look_for_gap_beside_measured();
  void report_gap(long missing, std::int64_t before);
  void compare_rows();

  std::string name_;  // of the times: "fps", or the table
  std::string key_;
  bool is_measured_ = false;    // stated times vary
  bool is_counted_ = false;     // they follow from a rate
  double stated_period_s_ = 0;  // 0: unknown
  double film_period_s_;
  std::optional<Seen> first_;
  std::deque<Seen> recent_;
  std::vector<double> film_steps_s_, stated_steps_s_;  // from one frame to the next
  bool has_compared_ = false, has_problem_ = false;
  std::vector<std::string> problems_;
};

}  // namespace huetrack::recordings
