// From a camera's JPEG to the position: CPU time of the whole data path in one thread, per camera and frame, of three
// cameras that show one ball, in four image sizes. In one run and in turn:
//   whole      every picture is decoded by libjpeg-turbo into new memory, then tracked (as before version 0.3)
//   on demand  the bytes are indexed, the pixels are decoded where they are looked at, then tracked
//   OpenCV     what a user would write: imdecode, cvtColor, inRange, connectedComponents, triangulation
// Besides: libjpeg-turbo's planar decode alone, the index alone, and the share of the pictures that was decoded.
// Then a camera host with `send: matches`: from a JPEG to the message, pictures decoded whole and on demand.
//   bytes [ROUNDS, 5 [host]]      host: only the camera host
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "benchmark/blob_tracker.h"
#include "benchmark/camera_jpegs.h"
#include "benchmark/speed_run.h"
#include "calib/model/median.h"
#include "capture/frames/light_watch.h"
#include "capture/frames/repeat_watch.h"
#include "capture/jpeg/jpeg_reader.h"
#include "color/match_tiles.h"
#include "hosts/match_finder.h"

namespace {

using namespace huetrack;

constexpr int cameras = 3, sets = 10, sets_per_round = 60;

double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * double(now.tv_sec) + 1e-6 * double(now.tv_nsec);
}

class Path {
 public:
  virtual ~Path() = default;
  virtual bool take(capture::FrameSet& set) = 0;  // whether there is a position
};

class HuetrackPath : public Path {
 public:
  HuetrackPath(const calib::CameraRig& rig, capture::JpegReading reading)
      : reading_(reading),
        readers_(cameras),
        repeats_(cameras),
        light_(cameras),
        tracker_(rig, figures::lime_ball(), figures::options_for(object_tracking::Observation::huetrack, 500)) {}

  bool take(capture::FrameSet& set) override {
    for (std::size_t c = 0; c < set.frames.size(); ++c) {
      capture::Frame& frame = *set.frames[c];
      frame.pixels = *read(c, frame).image;
      repeats_[c].is_repeated(frame.pixels);
      if (light_[c].is_wanted(frame.captured_at)) light_[c].look(frame.pixels, frame.captured_at);
    }
    const bool is_tracking = tracker_.update(set).state == object_tracking::TrackState::tracking;
    tracker_.learn();
    for (const auto& frame : set.frames) {
      if (!frame->pixels.on_demand) continue;
      decoded_ += frame->pixels.on_demand->decoded_units();
      units_ += frame->pixels.on_demand->units();
    }
    return is_tracking;
  }
  double share_decoded() const { return units_ > 0 ? double(decoded_) / double(units_) : 1; }

 private:
  capture::JpegResult read(std::size_t c, const capture::Frame& frame) {
    if (reading_ == capture::JpegReading::whole) return capture::JpegDecoder().decode(*frame.encoded);
    return readers_[c].read(readers_[c].keep(*frame.encoded));
  }

  const capture::JpegReading reading_;
  std::vector<capture::JpegReader> readers_;
  std::vector<capture::RepeatWatch> repeats_;
  std::vector<capture::LightWatch> light_;
  object_trackers::ObjectTracker tracker_;
  std::size_t decoded_ = 0, units_ = 0;
};

class OpenCvPath : public Path {
 public:
  explicit OpenCvPath(const calib::CameraRig& rig) : blob_(figures::blob_tracker_for(rig, figures::lime_ball())) {}
  bool take(capture::FrameSet& set) override {
    for (std::size_t c = 0; c < set.frames.size(); ++c) {
      cv::imdecode(*set.frames[c]->encoded, cv::IMREAD_COLOR, &bgr_[c]);
      const cv::Mat& bgr = bgr_[c];
      capture::Image image{.format = capture::PixelFormat::bgr,
                           .range = capture::ColorRange::full,
                           .width = bgr.cols,
                           .height = bgr.rows,
                           .planes = {},
                           .owner = {}};
      image.planes[0] = {bgr.data, static_cast<std::ptrdiff_t>(bgr.step[0])};
      set.frames[c]->pixels = std::move(image);
    }
    return blob_.locate(set).has_value();
  }

 private:
  figures::BlobTracker blob_;
  std::array<cv::Mat, cameras> bgr_;
};

struct Size {
  int width, height;
  double aim;  // share of the time of whole decoding
};

// Median of the rounds, ms a camera and frame.
double per_frame(const std::vector<double>& rounds) {
  return calib::median(rounds) / (cameras * sets_per_round);
}

void measure(const Size& size, int rounds) {
  figures::Sequence sequence = figures::scene_at(cameras, size.width, size.height, sets);
  figures::compress(sequence);
  double bytes = 0;
  for (const auto& set : sequence.sets)
    for (const auto& frame : set.frames) bytes += double(frame->encoded->size()) / (cameras * sets);

  HuetrackPath whole(sequence.rig, capture::JpegReading::whole),
      on_demand(sequence.rig, capture::JpegReading::on_demand);
  OpenCvPath opencv(sequence.rig);
  capture::JpegDecoder decoder;
  capture::JpegReader reader;
  const auto each_frame = [&](auto&& decode) {
    for (int i = 0; i < sets_per_round; ++i)
      for (const auto& frame : sequence.sets[std::size_t(i % sets)].frames) decode(*frame);
  };
  std::array<std::vector<double>, 5> ms;
  std::array<int, 3> positions{};
  const std::array<Path*, 3> paths{&whole, &on_demand, &opencv};
  std::array<figures::Player, 3> players{figures::Player(sequence.sets), figures::Player(sequence.sets),
                                         figures::Player(sequence.sets)};
  for (int round = -1; round < rounds; ++round) {  // the first one warms up
    for (std::size_t p = 0; p < paths.size(); ++p) {
      double begin = cpu_ms(), copying = 0;
      for (int i = 0; i < sets_per_round; ++i) {
        const double before = cpu_ms();
        capture::FrameSet set = players[p].next();
        copying += cpu_ms() - before;
        positions[p] += paths[p]->take(set) && round >= 0 ? 1 : 0;
      }
      if (round >= 0) ms[p].push_back(cpu_ms() - begin - copying);
    }
    const double begin = cpu_ms();
    each_frame([&](const capture::Frame& frame) { decoder.decode(*frame.encoded); });
    const double middle = cpu_ms();
    each_frame([&](const capture::Frame& frame) { reader.read(frame.encoded); });
    if (round < 0) continue;
    ms[3].push_back(middle - begin);
    ms[4].push_back(cpu_ms() - middle);
  }
  const double before = per_frame(ms[0]), now = per_frame(ms[1]), by_opencv = per_frame(ms[2]);
  std::printf(
      "%4dx%-4d %4.0f kB | %6.2f %9.2f %7.2f | %8.2f %6.2f | %6.2f (aim %.2f) %7.1f | %5.0f %% | %3.0f %% %3.0f %% "
      "%3.0f %%\n",
      size.width, size.height, bytes / 1000, before, now, by_opencv, per_frame(ms[3]), per_frame(ms[4]), now / before,
      size.aim, by_opencv / now, 100 * on_demand.share_decoded(), 100.0 * positions[0] / (rounds * sets_per_round),
      100.0 * positions[1] / (rounds * sets_per_round), 100.0 * positions[2] / (rounds * sets_per_round));
  std::fflush(stdout);
}

// A host's CPU time of a frame: JPEG to matches of one colour, with the pixels around one outline.
void measure_host(const Size& size, int rounds) {
  figures::Sequence sequence = figures::scene_at(cameras, size.width, size.height, sets);
  figures::compress(sequence);
  const hosts::MatchFinderOptions asked{
      .colors = {color::matched_color(figures::lime_ball().color)},
      .picture_every = std::chrono::seconds(1),
      .patches = {{.u = size.width / 2, .v = size.height / 2, .width = 64, .height = 64}}};
  std::array<std::vector<double>, 2> ms;
  std::array<std::size_t, 2> sent{};
  std::array<std::vector<hosts::MatchFinder>, 2> finders;
  for (auto& of : finders) of = std::vector<hosts::MatchFinder>(cameras);
  std::array<std::int64_t, 2> count{};
  for (int round = -1; round < rounds; ++round) {
    for (const std::size_t way : {0U, 1U}) {
      capture::JpegReader::set_reading(way == 0 ? capture::JpegReading::whole : capture::JpegReading::on_demand);
      const double begin = cpu_ms();
      for (int i = 0; i < sets_per_round; ++i) {
        ++count[way];
        for (std::size_t c = 0; c < cameras; ++c) {
          capture::Frame frame = *sequence.sets[std::size_t(i % sets)].frames[c];
          frame.stamped_at = capture::Timestamp(capture::duration_of(double(count[way]) / 30));
          const auto bytes = finders[way][c].find(frame, asked);
          if (round >= 0 && bytes) sent[way] += bytes->size();
        }
      }
      if (round >= 0) ms[way].push_back(cpu_ms() - begin);
    }
  }
  capture::JpegReader::set_reading(capture::JpegReading::on_demand);
  const double before = per_frame(ms[0]), now = per_frame(ms[1]);
  std::printf("host, %dx%d: %.2f ms a frame whole, %.2f on demand: %.2f (aim 0.50); %s bytes\n", size.width,
              size.height, before, now, now / before, sent[0] == sent[1] ? "the same" : "OTHER");
}

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::max(1, std::atoi(argv[1])) : 5;
  cv::setNumThreads(1);
  std::puts(
      "CPU ms per camera and frame: bytes to position of\n"
      "size           JPEG |  whole on demand  OpenCV | planar   index | demand/whole   OpenCV/d. | decoded | tracked");
  for (const Size& size : {Size{640, 480, 0.4}, {1280, 720, 0.3}, {1920, 1080, 0.25}, {1920, 1440, 0.25}})
    if (argc < 3) measure(size, rounds);
  measure_host({1280, 720, 0.5}, rounds);
  return 0;
}
