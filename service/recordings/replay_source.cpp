#include "recordings/replay_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <deque>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <utility>

#include "calib/files/config_error.h"
#include "calib/files/file_order.h"
#include "calib/files/median.h"
#include "calib/files/nearest_word.h"
#include "capture/frames/comb_watch.h"
#include "capture/frames/crop.h"
#include "capture/timing/camera_clock.h"
#include "recordings/bag_pictures.h"
#include "recordings/blend_watch.h"
#include "recordings/jpeg_stream.h"
#include "recordings/matches_reader.h"
#include "recordings/order_watch.h"
#include "recordings/picture_stream.h"
#include "recordings/stated_times.h"
#include "recordings/video_reader.h"

namespace huetrack::recordings {
namespace {

std::string list_of(std::span<const std::string> names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

// The usual time between two frames of a CSV: the median, which is robust to gaps.
capture::Duration usual_period(const RecordedCamera& camera, const FrameSelection& selection) {
  std::vector<capture::Duration> steps;
  std::optional<capture::Timestamp> before;
  for (const auto& [frame, at] : camera.timestamps) {
    if (!selection.contains(frame)) continue;
    if (before) steps.push_back(at - *before);
    before = at;
  }
  return files::median(std::move(steps), capture::Duration::zero());
}

// camera and warnings must outlive it. throws ConfigError
std::unique_ptr<PictureStream> reader_of(const RecordedCamera& camera, const ReplayOptions& options,
                                         std::vector<std::string>& warnings) {
  if (is_matches_file(camera.frames)) return std::make_unique<MatchesReader>(camera, warnings, options.keeps_encoded);
  if (!camera.topic.empty()) return std::make_unique<BagPictures>(camera, warnings, options.keeps_encoded);
  if (is_jpeg_stream(camera.frames)) return std::make_unique<JpegStream>(camera, warnings, options.keeps_encoded);
  return std::make_unique<VideoReader>(camera, options.decoder_threads, warnings, std::nullopt, options.keeps_encoded);
}

// Coded grey is grey up to rounding; sampled, as a region of a target is larger.
bool is_grey(const capture::Image& image) {
  constexpr int step_px = 3, rounding = 6;  // levels of 255: a target's colour differs by some 20
  if (image.format == capture::PixelFormat::grey) return true;
  for (int v = 0; v < image.height; v += step_px) {
    capture::require(image, 0, v, image.width, v + 1);  // a picture in colour mostly shows it in its first rows
    for (int u = 0; u < image.width; u += step_px) {
      if (image.format == capture::PixelFormat::bgr) {
        const auto [b, g, r] = capture::bgr_at(image, u, v);
        if (std::max({b, g, r}) - std::min({b, g, r}) > rounding) return false;
      } else {
        const auto yuv = capture::yuv_at(image, u, v);
        if (std::max(std::abs(yuv.u - 128), std::abs(yuv.v - 128)) > rounding) return false;
      }
    }
  }
  return true;
}

// One camera's file as frames with times and numbers.
class Stream {
 public:
  Stream(int camera_index, const RecordedCamera& camera, const std::filesystem::path& recording_file,
         const capture::FrameTiming& timing, const ReplayOptions& options, std::vector<std::string>& warnings)
      : camera_index_(camera_index),
        camera_(camera),
        timing_(timing),
        selection_(camera_),
        warnings_(warnings),
        on_contradicted_times_(options.on_contradicted_times) {
    info_.name = camera_.name;
    info_.file = camera_.frames;
    if (delivered_nothing()) {  // the file need not exist
      info_.expected_frames = 0;
      return;
    }
    // Our recording, killed when its first frames were listed but not yet in the file: it delivered nothing.
    const bool is_cut_off = !camera_.received.empty() && std::filesystem::exists(camera_.frames);
    const bool has_matches = is_matches_file(camera_.frames);
    try {
      reader_ = reader_of(camera_, options, warnings);
    } catch (const files::ConfigError&) {
      if (!is_cut_off) throw;
      forget();
      return;
    }
    if (has_matches) refuse_matches(options);
    info_.frame_period = !camera_.timestamps.empty() ? usual_period(camera_, selection_)
                         : camera_.fps > 0 ? capture::duration_of(static_cast<double>(camera_.every) / camera_.fps)
                                           : camera_.every * reader_->frame_period();
    if (is_listed_by_others()) count_frames_from_0(options);
    judge_numbers();
    if (is_listed_by_others()) judge_listed_times(options);
    if ((camera_.fps > 0 || is_listed_by_others()) && !camera_.trusts_times && mistakes_.empty())
      stated_times_.emplace(camera_, reader_->frame_period());
    begin_to_watch_order();
    if (!camera_.timestamps.empty())
      info_.expected_frames = selection_.count_below(camera_.timestamps.back().first + 1);
    else if (const auto count = reader_->frame_count())
      info_.expected_frames = selection_.count_below(*count);

    const std::size_t warned = warnings_.size();
    // The first frame with an image determines the size; corrupted ones before it are queued.
    while (auto frame = read()) {
      const bool has_image = frame->status == capture::FrameStatus::ok;
      waiting_.push_back(std::move(*frame));
      if (has_image) break;
    }
    if (info_.width == 0) {
      if (unstamped_ > 0)
        throw files::ConfigError(recording_file, 0,
                                 "cameras." + camera_.name + ": " + camera_.frames.string() +
                                     " has no time stamps: give fps or timestamps in a recording.yaml" + header_rate());
      if (is_cut_off) {
        forget();
        return;
      }
      throw files::ConfigError(camera_.frames, 0,
                               "no frame of it can be played (frames of camera " + camera_.name + ")" +
                                   (warnings_.size() > warned ? ": " + warnings_[warned] : ""));
    }
    info_.first_at = waiting_.front().captured_at;
    judge_depth();
    if (stated_times_ && !is_stamped_) stated_times_->see_header(reader_->frame_period());
    report_contradictions();
  }

  // throws ConfigError: this camera's matches cannot be played so
  void refuse_matches(const ReplayOptions& options) const {
    if (!options.takes_matches)
      throw files::ConfigError(camera_.frames, 0,
                               "has only which pixels match some colours, but this needs pictures: record with send: "
                               "frames (frames of camera " +
                                   camera_.name + ")");
    if (camera_.crop)
      throw files::ConfigError(camera_.frames, 0,
                               "has matches, of which no part can be cropped (camera " + camera_.name + ")");
  }

  // Of the first picture, whose samples have 16 bits.
  void judge_depth() {
    const auto largest = reader_->unexplained_largest();
    if (!largest) return;
    const int used = std::bit_width(static_cast<unsigned>(*largest));
    const int usual = std::max(10, used + used % 2);  // of cameras: 10, 12, 14
    contradict(
        fmt::format("the largest value of its first picture is {} of 65535, so it is played {}: if the camera has {} "
                    "bits, add bits: {} to scale the pictures; if it is really so dark, add bits: 16",
                    *largest, used <= 12 ? "nearly black" : "dark", usual, usual));
  }

  std::string header_rate() const {
    const double period_s = capture::seconds(reader_->frame_period());
    return period_s > 0 ? fmt::format(" (its header says {:.4g} frames a second)", 1 / period_s) : std::string();
  }

  // Its file has no frame to play.
  void forget() {
    warnings_.push_back(camera_.frames.string() +
                        ": nothing of it can be played: the recording was cut off at its start");
    reader_.reset();
    picture_.reset();
    waiting_.clear();
    camera_.timestamps.clear();
    camera_.received.clear();
    camera_.corrupted.clear();
    info_.expected_frames = 0;
  }

  // The next frame, nullptr at the end.
  const capture::Frame* front() {
    if (waiting_.empty())
      if (auto frame = read()) waiting_.push_back(std::move(*frame));
    return waiting_.empty() ? nullptr : &waiting_.front();
  }

  capture::Frame take() {
    capture::Frame frame = std::move(waiting_.front());
    waiting_.pop_front();
    ++(frame.status == capture::FrameStatus::ok ? info_.frames : info_.corrupted);
    return frame;
  }

  const ReplayCamera& info() const { return info_; }
  const std::vector<std::string>& mistakes() const { return mistakes_; }

  bool ended() const {
    return waiting_.empty() && !picture_ && (!reader_ || ended_) && next_corrupted_ == camera_.corrupted.size();
  }

  // No picture, that is.
  bool delivered_nothing() const { return camera_.is_listed && camera_.timestamps.empty(); }

  // Its rows have the order of arrival.
  bool has_arrivals() const {
    const auto is_numbered = [](const RecordedCamera::Received& received) { return received.arrival > 0; };
    return camera_.is_listed && camera_.received.size() == camera_.timestamps.size() &&
           std::ranges::all_of(camera_.received, is_numbered) &&
           std::ranges::all_of(camera_.corrupted, is_numbered,
                               &std::pair<capture::Timestamp, RecordedCamera::Received>::second);
  }

  // Capture time of the last frame, as far as known beforehand.
  std::optional<capture::Timestamp> expected_end() const {
    if (!camera_.timestamps.empty()) return camera_.timestamps.back().second + camera_.offset;
    if (!info_.expected_frames) return std::nullopt;
    return info_.first_at.value_or(capture::Timestamp{}) + (*info_.expected_frames - 1) * info_.frame_period;
  }

  // PictureStream::clock_start(), unless the recording gives the times.
  std::optional<capture::Duration> clock_start() const {
    const bool is_given = camera_.fps > 0 || !camera_.timestamps.empty() || camera_.offset != capture::Duration::zero();
    return reader_ && !is_given ? reader_->clock_start() : std::nullopt;
  }

 private:
  // The next picture, or an earlier frame that was recorded as corrupted.
  std::optional<capture::Frame> read() {
    if (!picture_ && reader_) picture_ = read_picture();
    const auto& corrupted = camera_.corrupted;
    if (next_corrupted_ < corrupted.size() &&
        (!picture_ || corrupted[next_corrupted_].first + camera_.offset - timing_.latency < picture_->captured_at)) {
      const auto& [at, received] = corrupted[next_corrupted_++];
      count_number(received.sequence);
      return capture::Frame{.camera = camera_index_,
                            .sequence = received.sequence,
                            .captured_at = at + camera_.offset - timing_.latency,
                            .stamped_at = received.stamped_at.value_or(at) + camera_.offset,
                            .latency = timing_.latency,
                            .readout = timing_.readout,
                            .clock = received.clock,
                            .status = capture::FrameStatus::corrupted,
                            .pixels = {},
                            .arrival = received.arrival};
    }
    auto frame = std::exchange(picture_, std::nullopt);
    if (frame) count_number(frame->sequence);
    return frame;
  }

  void count_number(std::uint32_t number) {
    if (last_number_ && number > *last_number_) info_.missing += number - *last_number_ - 1;
    last_number_ = number;
  }

  std::optional<capture::Frame> read_picture() {
    while (auto picture = reader_->next()) {
      const auto stamp = capture_time(*picture);
      if (!stamp) continue;
      if (last_stamp_ && *stamp <= *last_stamp_) {
        if (back_count_++ == 0) first_back_ = {picture->index, *last_stamp_};
        furthest_back_ = std::max(furthest_back_, *last_stamp_ - *stamp);
        longest_back_ = std::max(longest_back_, ++back_run_);
        continue;  // its number counts as missing
      }
      last_stamp_ = stamp;
      back_run_ = 0;
      const capture::Timestamp at = has_exact_times() ? *stamp : clock_.smoothed(*stamp);
      last_index_ = picture->index;
      if (camera_.received.empty()) {
        even_times_.see(picture->index, *stamp);
        info_.even_hz = even_times_.hz();
      }
      if (!first_index_) first_index_ = picture->index;

      capture::Frame frame{.camera = camera_index_,
                           .sequence = static_cast<std::uint32_t>((picture->index - *first_index_) / camera_.every),
                           .captured_at = at - timing_.latency,
                           .stamped_at = *stamp,
                           .latency = timing_.latency,
                           .readout = timing_.readout,
                           .status = capture::FrameStatus::corrupted,
                           .pixels = {}};
      if (!camera_.received.empty()) {
        const auto& received = camera_.received[row_of(picture->index)];
        frame.sequence = received.sequence;
        frame.arrival = received.arrival;
        frame.clock = received.clock;
        if (received.stamped_at) frame.stamped_at = *received.stamped_at + camera_.offset;
      } else {
        frame.stream_index = picture->index;
      }
      if (picture->image.width > 0 && has_the_size(*picture) && crop(*picture)) {
        watch_order(*picture);
        if (camera_.received.empty() && !camera_.trusts_times) blends_.see(picture->index, picture->image);
        frame.status = capture::FrameStatus::ok;
        has_color_ = has_color_ || picture->matches || !is_grey(picture->image);
        info_.is_grey = !has_color_;
        frame.pixels = std::move(picture->image);
        frame.encoded = std::move(picture->jpeg);
        frame.matches = std::move(picture->matches);
      }
      return frame;
    }
    if (!std::exchange(ended_, true)) {
      if (stated_times_) stated_times_->end();
      if (auto problem = order_ ? order_->problem() : std::nullopt) contradict(std::move(*problem));
      if (auto problem = blends_.problem()) contradict(std::move(*problem));
      if (auto problem = reader_->wrong_times(); problem && !camera_.trusts_times) contradict(std::move(*problem));
      report_contradictions();
      note_listed_frames_that_never_came();
      note_left_out();
    }
    return std::nullopt;
  }

  static std::string about_strays(const std::vector<std::filesystem::path>& strays) {
    constexpr std::size_t most_named = 3;
    std::string names;
    for (std::size_t k = 0; k < std::min(strays.size(), most_named); ++k)
      names += (k > 0 ? ", " : "") + strays[k].filename().string();
    if (strays.size() > most_named) names += fmt::format(" and {} more", strays.size() - most_named);
    const bool is_one = strays.size() == 1;
    return fmt::format(
        "{} {} not named like the other files, and {}: if {} of the series, move {} to another folder, since every "
        "picture after {} is late by as many frames; if {}, add trust_times: true",
        names, is_one ? "is" : "are", is_one ? "counts as a picture" : "count as pictures",
        is_one ? "it is none" : "they are none", is_one ? "it" : "them", is_one ? "it" : "them",
        is_one ? "it is one" : "they are some");
  }

  void begin_to_watch_order() {
    if (reader_->series().empty() || camera_.trusts_times) return;
    std::vector<std::filesystem::path> files;
    for (const ImageFile& file : reader_->series()) files.push_back(file.path);
    // Whoever lists a time for each of them knows them.
    if (camera_.timestamps.size() != files.size())
      if (const auto strays = files::stray_files(files); !strays.empty()) contradict(about_strays(strays));
    order_.emplace(std::move(files));
  }

  void watch_order(const Shown& picture) {
    if (!order_) return;
    const auto file = std::ranges::lower_bound(reader_->series(), picture.index, {}, &ImageFile::number);
    order_->see(static_cast<std::size_t>(file - reader_->series().begin()), picture.image);
  }

  // Its times have no jitter: they follow from the rate, or were smoothed when recorded.
  bool has_exact_times() const {
    return camera_.timestamps.empty() ? camera_.fps > 0
                                      : !camera_.received.empty() && camera_.received.front().stamped_at.has_value();
  }

  std::size_t row_of(std::int64_t index) const {
    const auto row =
        std::ranges::lower_bound(camera_.timestamps, index, {}, &std::pair<std::int64_t, capture::Timestamp>::first);
    assert(row != camera_.timestamps.end() && row->first == index);
    return static_cast<std::size_t>(row - camera_.timestamps.begin());
  }

  std::optional<capture::Timestamp> capture_time(const Shown& picture) {
    is_stamped_ = is_stamped_ || picture.stamp.has_value();
    if (const auto stated = stated_time(picture.index)) {
      if (picture.stamp && stated_times_) stated_times_->see(picture.index, *stated, *picture.stamp);
      report_contradictions();
      return *stated + camera_.offset;
    }
    if (picture.stamp) return *picture.stamp + camera_.offset;
    ++unstamped_;
    return std::nullopt;
  }

  // By the recording, before the offset; nullopt: it states none.
  std::optional<capture::Timestamp> stated_time(std::int64_t index) const {
    if (!camera_.timestamps.empty()) return camera_.timestamps[row_of(index)].second;
    if (camera_.fps == 0) return std::nullopt;
    // rounded once, from the exact time
    return capture::Timestamp{capture::Duration(
        std::llround(static_cast<long double>(index) * 1e9L / static_cast<long double>(camera_.fps)))};
  }

  void report_contradictions() {
    if (!stated_times_) return;
    for (std::string& problem : stated_times_->take_problems()) {
      if (on_contradicted_times_)
        on_contradicted_times_(mistake(std::move(problem)));
      else
        contradict(std::move(problem));
    }
  }

  // A table of another program or a person, for a film or pictures: our own cannot contradict its file.
  bool is_listed_by_others() const {
    return reader_ && !camera_.timestamps.empty() && camera_.received.empty() && !is_matches_file(camera_.frames);
  }

  // Spreadsheets and other tools count from 1: then the last row is one beyond the last frame, and none is 0.
  void count_frames_from_0(const ReplayOptions& options) {
    auto& rows = camera_.timestamps;
    if (rows.front().first < 1 || camera_.first_frame > 0) return;
    if (frame_count(options) == rows.back().first) {
      for (auto& [frame, at] : rows) --frame;
      warn(camera_.times_file.filename().string() + " counts its frames from 1, since frame " +
           std::to_string(rows.back().first + 1) + " is the last one: they are played so");
    } else if (rows.front().first == 1 && !camera_.trusts_times) {
      contradict(camera_.times_file.filename().string() +
                 " has no row for frame 0, the first one: if it counts frames from 1, subtract 1; if frame 0 is left "
                 "out, add trust_times: true");
    }
  }

  // In the names of a series of files.
  void judge_numbers() {
    const auto problem = camera_.trusts_times ? std::nullopt : problem_of_numbers(camera_, reader_->series());
    if (!problem) return;
    if (!problem->counts_files) {
      contradict(problem->text);
      return;
    }
    for (std::size_t k = 0; k < camera_.timestamps.size(); ++k)
      camera_.timestamps[k].first = reader_->series()[k].number;
    warn(problem->text);
  }

  // Of the whole stream. The header of some containers has only a length: the pictures are counted where that is close
  // to the rows.
  std::optional<std::int64_t> frame_count(const ReplayOptions& options) const {
    constexpr std::int64_t error_of_a_length = 2;  // frames
    const auto stated = reader_->frame_count();
    if (stated && std::abs(*stated - camera_.timestamps.back().first) > error_of_a_length) return stated;
    return counted_frames(options);
  }

  std::int64_t counted_frames(const ReplayOptions& options) const {
    RecordedCamera all = camera_;
    all.timestamps.clear();
    all.every = std::numeric_limits<std::int64_t>::max();  // of what is not predicted only the first is decoded
    std::vector<std::string> remarks;                      // the reader repeats them
    const auto counting = reader_of(all, options, remarks);
    while (counting->next()) {
    }
    return counting->position();
  }

  bool is_played_whole() const { return camera_.first_frame == 0 && camera_.every == 1; }

  // Rows from 0 on, without a gap: their number, or 0.
  std::int64_t counted_rows() const {
    const auto& rows = camera_.timestamps;
    const auto count = static_cast<std::int64_t>(rows.size());
    return is_played_whole() && rows.front().first == 0 && rows.back().first == count - 1 ? count : 0;
  }

  void judge_number_of_rows(const ReplayOptions& options) {
    const auto stated = reader_->frame_count();
    const std::int64_t listed = counted_rows();
    const auto is_one_less = [&](std::int64_t frames) { return listed > 0 && frames == listed + 1; };
    if (!stated || (!is_one_less(*stated) && !problem_of_rows(camera_, *stated))) return;
    const std::int64_t frames = counted_frames(options);  // some containers state a length only
    if (const auto rows = problem_of_rows(camera_, frames)) return contradict(*rows);
    if (is_one_less(frames))
      warn(
          fmt::format("{} lists all of its {} frames but the last: if it is the first row that is missing, every "
                      "frame has the time of the one after it",
                      camera_.times_file.filename().string(), frames));
  }

  void judge_listed_times(const ReplayOptions& options) {
    if (camera_.trusts_times) return;
    if (const auto rounding = remark_on_rounding(camera_))
      warn(camera_.times_file.filename().string() + ": " + *rounding);
    if (const auto timecode = problem_of_timecode(camera_)) throw files::ConfigError(camera_.times_file, 0, *timecode);
    judge_number_of_rows(options);
    const auto problem = problem_of_listed_times(camera_, reader_->frame_period());
    if (problem && problem->is_of_unit) throw files::ConfigError(camera_.times_file, 0, problem->text);
    if (problem) {
      contradict(camera_.times_file.filename().string() + ": " + problem->text);
      return;
    }
    const auto remark = remark_on_measured_rate(camera_, reader_->frame_period(), reader_->frame_count());
    if (!remark) return;
    if (remark->is_mistake)
      contradict(remark->text);
    else
      warn(remark->text);
  }

  bool has_the_size(const Shown& picture) {
    const capture::Image& image = picture.image;
    if (width_ == 0) {
      width_ = image.width;
      height_ = image.height;
    }
    if (image.width == width_ && image.height == height_) return true;
    if (!std::exchange(warned_of_size_, true))
      warn("frame " + std::to_string(picture.index) + " is " + std::to_string(image.width) + "x" +
           std::to_string(image.height) + ", not " + std::to_string(width_) + "x" + std::to_string(height_) +
           " as the first: frames of another size are not used");
    return false;
  }

  // Of pictures that hold two moments, as the recording or a tag says; what the pixels say is compared. throws
  // ConfigError: the first picture is turned
  void take_first_field(Shown& picture) {
    if (!has_pixels(picture.image)) return;  // matches
    if (camera_.first_field && reader_->is_turned() && info_.width == 0)
      throw files::ConfigError(
          camera_.frames, 0,
          "is turned by a tag, so fields: cannot be applied to its rows (frames of camera " + camera_.name + ")");
    std::optional<capture::StatedFields> stated;
    if (camera_.first_field)
      stated = {.first = *camera_.first_field};
    else if (picture.tagged_field)
      stated = {.first = *picture.tagged_field, .is_tagged = true};
    if (!reader_->is_turned()) {
      combs_.see(picture.image, stated);
      if (auto problem = combs_.take_problem()) contradict(std::move(*problem));
    }
    if (!stated) return;
    picture.image = capture::first_field(picture.image, stated->first);
    picture.jpeg = nullptr;  // of both fields
  }

  // The camera's own part of the picture. False: a later picture's format has no such part. throws ConfigError: the
  // first
  bool crop(Shown& picture) {
    take_first_field(picture);
    if (camera_.crop) {
      const auto problem = capture::problem_of(*camera_.crop, picture.image.format, width_, height_);
      if (!problem.empty() && info_.width == 0)
        throw files::ConfigError(camera_.frames, 0, problem + " (frames of camera " + camera_.name + ")");
      if (!problem.empty()) return false;
      picture.image = capture::cropped(picture.image, *camera_.crop);
      picture.jpeg = nullptr;  // of the whole picture
    }
    if (info_.width > 0) return true;
    info_.width = picture.image.width;
    info_.height = picture.image.height;
    info_.format = picture.image.format;
    info_.range = picture.image.range;
    info_.is_turned = reader_->is_turned();
    return true;
  }

  void note_listed_frames_that_never_came() {
    const auto last = selection_.last();
    if (!last) return;
    const std::int64_t end = last_index_ ? *last_index_ + 1 : 0;
    const std::int64_t absent = selection_.count_below(*last + 1) - selection_.count_below(end);
    if (absent <= 0) return;
    info_.missing += absent;
    const std::int64_t first = camera_.timestamps.front().first;
    std::string text = absent == 1 ? "has no frame for the last row of its time stamps"
                                   : fmt::format("has no frame for the last {} rows of its time stamps", absent);
    if (first > 0 && absent == first && is_played_whole())
      text += fmt::format(", whose first row is frame {}: frames count from 0", first);
    if (absent == 1 && counted_rows() > 1)
      text += ": if a row too many is at their start, every frame has the time of the one before it";
    warn(text);
  }

  // At the end, when it is known how many there were.
  void note_left_out() {
    constexpr std::int64_t shortest_part = 3;  // pictures in a row: fewer are damaged stamps
    const bool is_of_bag = !camera_.topic.empty();
    if (back_count_ > 0 && furthest_back_ == capture::Duration::zero() && !reader_->wrong_times())
      warn(fmt::format(
          "{} frames have the time stamp of the one before, first frame {} (at {:.3f} s), and are left out: {}",
          back_count_, first_back_.first, capture::seconds(first_back_.second),
          is_of_bag
              ? "the driver does not stamp every picture (header.stamp): correct it, or write images, and give fps"
              : "give fps or timestamps"));
    else if (longest_back_ >= shortest_part && !reader_->wrong_times() && !camera_.trusts_times)
      contradict(
          fmt::format("its time stamps begin again at frame {} (at {:.3f} s), {:.3f} s earlier, {}: {} frames are left "
                      "out, and those that follow have wrong times: {}",
                      first_back_.first, capture::seconds(first_back_.second), capture::seconds(furthest_back_),
                      is_of_bag ? "as where a clock was set" : "as where files were put together (cat)", back_count_,
                      is_of_bag ? "correct its stamps, or give the two parts as recordings of their own"
                                : "join the parts with ffmpeg -f concat, or give fps or timestamps"));
    else if (back_count_ > 0)
      warn(fmt::format(
          "its time stamps go back, first at frame {} (at {:.3f} s), by up to {:.3f} s: {} frames are left out{}",
          first_back_.first, capture::seconds(first_back_.second), capture::seconds(furthest_back_), back_count_,
          reader_->wrong_times()  ? ""  // says what to do
          : camera_.topic.empty() ? ". If the pictures are in order, give fps or timestamps"
                                  : ". Sort the bag's messages by time (`mcap sort`)"));
    if (unstamped_ > 0 && last_stamp_)
      warn(fmt::format("{} frames have no time stamp and are left out: give fps or timestamps", unstamped_));
  }

  // What the recording says, and the file contradicts.
  const std::string& mistake(std::string text) {
    return mistakes_.emplace_back(camera_.frames.string() + ": " + std::move(text) + " (camera " + camera_.name + ")");
  }

  void contradict(std::string text) { warnings_.push_back(mistake(std::move(text))); }

  void warn(const std::string& text) { warnings_.push_back(camera_.frames.string() + ": " + text); }

  int camera_index_;
  RecordedCamera camera_;
  capture::FrameTiming timing_;
  capture::CameraClock clock_;
  FrameSelection selection_;  // of camera_
  std::vector<std::string>& warnings_;
  std::function<void(const std::string&)> on_contradicted_times_;
  std::unique_ptr<PictureStream> reader_;  // of camera_; none when it delivered nothing
  std::optional<capture::Frame> picture_;  // read ahead
  std::size_t next_corrupted_ = 0;         // row of camera_.corrupted
  ReplayCamera info_;
  int width_ = 0, height_ = 0;  // of every picture, of which the camera's image may be a part
  std::deque<capture::Frame> waiting_;
  std::optional<capture::Timestamp> last_stamp_;
  std::optional<std::int64_t> first_index_, last_index_;  // in the stream, of the played pictures
  std::optional<std::uint32_t> last_number_;              // Frame::sequence
  std::optional<TimesBesideFilm> stated_times_;
  EvenTimes even_times_;
  std::optional<OrderWatch> order_;  // of a series of files
  BlendWatch blends_;
  capture::CombWatch combs_;
  std::vector<std::string> mistakes_;
  std::int64_t unstamped_ = 0, back_count_ = 0;             // left out
  std::int64_t back_run_ = 0, longest_back_ = 0;            // of these, in a row
  std::pair<std::int64_t, capture::Timestamp> first_back_;  // index, and the time before
  capture::Duration furthest_back_{0};
  bool is_stamped_ = false;  // by its file
  bool has_color_ = false;   // a picture so far
  bool warned_of_size_ = false;
  bool ended_ = false;
};

// Warns of mistakes in a time stamp's unit or in offset_s, which leave few or no sets with two views.
void warn_of_times_apart(const Recording& recording, const std::vector<std::unique_ptr<Stream>>& streams,
                         std::vector<std::string>& warnings) {
  constexpr double least_in_common = 0.5;  // of a camera's own length: cameras are started and stopped together
  struct Span {
    std::string name;
    capture::Timestamp from, to;
  };
  std::vector<Span> spans;
  for (const auto& stream : streams)
    if (const auto from = stream->info().first_at, to = stream->expected_end(); from && to)
      spans.push_back({stream->info().name, *from, *to});
  if (spans.size() < 2) return;
  for (const Span& a : spans) {
    capture::Duration most = capture::Duration::min();  // largest overlap with another camera
    for (const Span& b : spans)
      if (&a != &b) most = std::max(most, std::min(a.to, b.to) - std::max(a.from, b.from));
    const capture::Duration length = a.to - a.from;
    if (most >= capture::Duration::zero() && most >= capture::duration_of(least_in_common * capture::seconds(length)))
      continue;
    warnings.push_back(fmt::format(
        "{}: camera {} has frames from {:.3f} to {:.3f} s, and {}: are its times right (fps, offset_s, timestamps)?",
        recording.file.string(), a.name, capture::seconds(a.from.time_since_epoch()),
        capture::seconds(a.to.time_since_epoch()),
        most < capture::Duration::zero() ? "no other camera has any then"
                                         : fmt::format("no other camera has any in more than {:.0f} % of that time",
                                                       100 * capture::seconds(most) / capture::seconds(length))));
  }
}

// One file for two cameras, as a copied line has it; parts of one picture differ.
std::vector<std::string> files_given_twice(const Recording& recording, std::span<const std::string> names) {
  std::vector<std::string> mistakes;
  std::vector<const RecordedCamera*> played;
  for (const auto& camera : recording.cameras)
    if (std::ranges::find(names, camera.name) != names.end()) played.push_back(&camera);
  for (std::size_t b = 1; b < played.size(); ++b)
    for (std::size_t a = 0; a < b; ++a)
      if (played[a]->frames == played[b]->frames && played[a]->topic == played[b]->topic &&
          played[a]->crop == played[b]->crop)
        mistakes.push_back(fmt::format("{}: is given for both {} and {}: give each camera its own file",
                                       played[a]->frames.string(), played[a]->name, played[b]->name));
  return mistakes;
}

// Films whose clocks do not start at 0: no file says whether they started together, or share one clock.
void warn_of_clocks_apart(const std::vector<std::unique_ptr<Stream>>& streams, std::vector<std::string>& warnings) {
  const Stream* first = nullptr;
  for (const auto& stream : streams) {
    const auto start = stream->clock_start();
    if (!start) continue;
    if (first == nullptr) first = stream.get();
    const capture::Duration later = *start - *first->clock_start();
    if (2 * std::chrono::abs(later) <= stream->info().frame_period) continue;
    warnings.push_back(
        fmt::format("{}: its clock begins {:.3f} s {} than that of {}; both are played from their own beginning, as in "
                    "players: if they have one clock, give camera {} offset_s: {:.3f}",
                    stream->info().file.string(), std::abs(capture::seconds(later)),
                    later > capture::Duration::zero() ? "later" : "earlier", first->info().file.string(),
                    stream->info().name, capture::seconds(later)));
  }
}

}  // namespace

std::vector<std::string> ReplayOptions::problems() const {
  if (decoder_threads >= 1) return {};
  return {"decoder_threads is " + std::to_string(decoder_threads) + ", but must be >= 1"};
}

struct ReplaySource::Impl {
  std::vector<std::string> warnings;
  std::vector<std::string> mistakes;  // of no camera alone
  std::vector<std::unique_ptr<Stream>> streams;
  mutable std::vector<ReplayCamera> cameras;
  bool repeats_arrivals = false;  // in order of arrival: all cameras' rows have it
};

ReplaySource::ReplaySource(const Recording& recording, std::span<const std::string> camera_names,
                           const ReplayOptions& options)
    : impl_(std::make_unique<Impl>()) {
  for (const auto& problem : options.problems()) throw std::invalid_argument("ReplaySource: " + problem);
  if (!options.timing.empty() && options.timing.size() != camera_names.size())
    throw std::invalid_argument("ReplaySource: timing has not one entry per camera");

  impl_->warnings = recording.warnings;
  std::vector<std::string> recorded;
  for (const auto& camera : recording.cameras) recorded.push_back(camera.name);
  for (const auto& name : camera_names) {
    if (std::ranges::find(recorded, name) != recorded.end()) continue;
    std::vector<std::string> others;  // candidates for a mistyped name: not in the rig
    std::ranges::copy_if(recorded, std::back_inserter(others), [&](const std::string& other) {
      return std::ranges::find(camera_names, other) == camera_names.end();
    });
    const auto nearest = files::nearest_word(name, others);
    throw files::ConfigError(recording.file, 0,
                             "has no camera " + name + (nearest ? " (did you mean " + *nearest + "?)" : std::string()) +
                                 ": it has " + list_of(recorded) + ", and the rig has " + list_of(camera_names));
  }
  for (const auto& name : recorded)
    if (std::ranges::find(camera_names, name) == camera_names.end())
      impl_->warnings.push_back(recording.file.string() + ": camera " + name + " is not in the rig: it is not played");

  for (std::size_t c = 0; c < camera_names.size(); ++c) {
    const auto& camera = *std::ranges::find(recording.cameras, camera_names[c], &RecordedCamera::name);
    const capture::FrameTiming timing = options.timing.empty() ? capture::FrameTiming{} : options.timing[c];
    impl_->streams.push_back(
        std::make_unique<Stream>(static_cast<int>(c), camera, recording.file, timing, options, impl_->warnings));
    impl_->cameras.push_back(impl_->streams.back()->info());
  }
  impl_->mistakes = files_given_twice(recording, camera_names);
  std::ranges::copy(impl_->mistakes, std::back_inserter(impl_->warnings));
  warn_of_times_apart(recording, impl_->streams, impl_->warnings);
  warn_of_clocks_apart(impl_->streams, impl_->warnings);
  impl_->repeats_arrivals =
      std::ranges::all_of(impl_->streams, [](const auto& stream) { return stream->has_arrivals(); });
}

ReplaySource::~ReplaySource() = default;

std::optional<capture::Frame> ReplaySource::next(std::stop_token stop) {
  const auto comes_before = [&](const capture::Frame& a, const capture::Frame& b) {
    return impl_->repeats_arrivals ? a.arrival < b.arrival : a.captured_at < b.captured_at;
  };
  Stream* earliest = nullptr;
  for (const auto& stream : impl_->streams) {
    if (stop.stop_requested()) return std::nullopt;
    const capture::Frame* frame = stream->front();
    if (frame && (!earliest || comes_before(*frame, *earliest->front()))) earliest = stream.get();
  }
  return earliest ? std::optional(earliest->take()) : std::nullopt;
}

bool ReplaySource::ended(int camera) const {
  return impl_->streams.at(static_cast<std::size_t>(camera))->ended();
}

const std::vector<ReplayCamera>& ReplaySource::cameras() const {
  for (std::size_t i = 0; i < impl_->streams.size(); ++i) impl_->cameras[i] = impl_->streams[i]->info();
  return impl_->cameras;
}

std::optional<std::int64_t> ReplaySource::expected_frames() const {
  std::int64_t sum = 0;
  for (const auto& stream : impl_->streams) {
    if (!stream->info().expected_frames) return std::nullopt;
    sum += *stream->info().expected_frames;
  }
  return sum;
}

std::optional<capture::Timestamp> ReplaySource::first_at() const {
  std::optional<capture::Timestamp> first;
  for (const auto& stream : impl_->streams)
    if (const auto at = stream->info().first_at) first = std::min(first.value_or(*at), *at);
  return first;
}

std::vector<std::string> ReplaySource::mistakes() const {
  std::vector<std::string> all = impl_->mistakes;
  for (const auto& stream : impl_->streams) std::ranges::copy(stream->mistakes(), std::back_inserter(all));
  return all;
}

std::vector<std::string> ReplaySource::take_warnings() {
  return std::exchange(impl_->warnings, {});
}

}  // namespace huetrack::recordings
