#include "calib/gather/live_boards.h"

#include <algorithm>
#include <condition_variable>
#include <cstdio>
#include <future>
#include <mutex>
#include <set>
#include <thread>

#include "calib/gather/progress_line.h"
#include "capture/frame_synchronizer.h"

namespace huetrack::gather {
namespace {

using Clock = std::chrono::steady_clock;

// The newest frame set of live cameras; older ones that nobody took are dropped. thread-safe.
class NewestSet {
 public:
  NewestSet(std::vector<LiveCameraSource>& cameras, capture::Duration tolerance)
      : synchronizer_({.camera_count = static_cast<int>(cameras.size()), .tolerance = tolerance}),
        open_(cameras.size()) {
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      threads_.emplace_back([this, c, source = cameras[c].source.get()](const std::stop_token& stop) {
        while (auto frame = source->next(stop)) {
          frame->camera = static_cast<int>(c);
          push(std::move(*frame));
        }
        const std::scoped_lock lock(mutex_);
        if (--open_ == 0) {
          while (auto set = synchronizer_.flush()) newest_ = std::move(*set);
        }
        arrived_.notify_all();
      });
    }
  }

  // nullopt: nothing new within `patience`, or ended.
  std::optional<capture::FrameSet> take(std::chrono::milliseconds patience) {
    std::unique_lock lock(mutex_);
    arrived_.wait_for(lock, patience, [&] { return newest_.has_value() || open_ == 0; });
    return std::exchange(newest_, std::nullopt);
  }
  bool ended() {
    const std::scoped_lock lock(mutex_);
    return open_ == 0 && !newest_;
  }

 private:
  void push(capture::Frame frame) {
    const std::scoped_lock lock(mutex_);
    for (capture::FrameSet& set : synchronizer_.push(std::move(frame))) newest_ = std::move(set);
    if (newest_) arrived_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable arrived_;
  capture::FrameSynchronizer synchronizer_;  // these three guarded by mutex_
  std::optional<capture::FrameSet> newest_;
  std::size_t open_;
  std::vector<std::jthread> threads_;  // last: they end first
};

// The board has hardly moved since the last look, in all cameras that saw it then and now; and some did.
bool is_at_rest(const std::vector<solver::BoardView>& now, const std::vector<solver::BoardView>& before, double dt_s,
                const std::vector<calib::ImageSize>& sizes) {
  bool any = false;
  for (const solver::BoardView& view : now) {
    const auto same = std::ranges::find(before, view.camera, &solver::BoardView::camera);
    if (same == before.end()) continue;
    const auto moved = moved_px(view, *same);
    if (!moved) continue;
    any = true;
    constexpr double widths_per_second = 0.04;
    if (*moved > widths_per_second * sizes[static_cast<std::size_t>(view.camera)].width * std::max(dt_s, 0.05))
      return false;
  }
  return any;
}

std::string awaited(const std::vector<CameraSighting>& cameras) {
  std::string names;
  for (const CameraSighting& camera : cameras) {
    if (camera.pictures == 0) names += (names.empty() ? "" : ", ") + camera.name;
  }
  return "waiting for the first picture of " + names;
}

}  // namespace

FoundBoards gather_live(std::vector<LiveCameraSource> cameras, const board::BoardDetector& detector,
                        const LiveBoardsOptions& options, std::stop_token stop) {
  FoundBoards found;
  std::vector<std::string> names;
  std::vector<calib::ImageSize> sizes(cameras.size());
  std::vector<ShownPicture> shown(cameras.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    names.push_back(cameras[c].name);
    found.cameras.emplace_back();
    found.cameras.back().name = shown[c].camera = cameras[c].name;
  }
  std::optional<ViewCoverage> coverage;
  ProgressLine line(options.progress);
  DetectionPage page(options.view);
  NewestSet newest(cameras, options.tolerance);
  const auto start = Clock::now();
  std::vector<solver::BoardView> before;
  double before_s = 0;
  std::optional<double> first_s;
  std::string status = "waiting for the cameras";
  while (!stop.stop_requested() && !newest.ended()) {
    if (options.seconds && Clock::now() - start > std::chrono::duration<double>(*options.seconds)) break;
    for (LiveCameraSource& camera : cameras) {
      if (!camera.take_trouble) continue;
      for (const std::string& trouble : camera.take_trouble()) {
        line.clear();
        std::fprintf(stderr, "huetrack-calibrate: %s: %s\n", camera.name.c_str(), trouble.c_str());
      }
    }
    const auto set = newest.take(std::chrono::milliseconds(200));
    if (!set) {
      if (line.due() && !coverage) line.draw(awaited(found.cameras));
      continue;
    }
    ++found.sets_seen;
    if (!first_s) first_s = capture::seconds(set->at);
    const double at_s = capture::seconds(set->at) - *first_s;
    std::vector<std::future<board::BoardDetection>> detections(cameras.size());
    std::vector<cv::Mat> greys(cameras.size());
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      if (!set->frames[c]) continue;
      greys[c] = board_grey_of(set->frames[c]->pixels);
      sizes[c] = found.cameras[c].image_size = {greys[c].cols, greys[c].rows};
      detections[c] = std::async(std::launch::async, [&, c] {
        const cv::Mat& grey = greys[c];
        return detector.detect({grey.data, grey.cols, grey.rows, static_cast<std::ptrdiff_t>(grey.step)});
      });
    }
    std::vector<solver::BoardView> views;
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      if (!detections[c].valid()) continue;
      board::BoardDetection detection = detections[c].get();
      CameraSighting& camera = found.cameras[c];
      ++camera.pictures;
      shown[c].grey = greys[c];
      shown[c].corners = detection.px;
      shown[c].caption = detection.found() ? std::to_string(detection.ids.size()) + " corners" : detection.why_not;
      if (!detection.found()) {
        ++camera.why_not[detection.why_not];
        continue;
      }
      ++camera.boards;
      std::array<char, 32> at{};
      std::snprintf(at.data(), at.size(), " at %.2f s", at_s);
      views.push_back(
          {static_cast<int>(c), 0, camera.name + at.data(), std::move(detection.ids), std::move(detection.px)});
    }
    ++found.sets_looked_at;
    if (!coverage && std::ranges::none_of(sizes, [](calib::ImageSize s) { return s.width == 0; }))
      coverage.emplace(detector.board(), names, sizes);
    const bool rests = is_at_rest(views, before, at_s - before_s, sizes);
    // A set that lacks a frame, as when a camera lags, says nothing about what its cameras share.
    const bool complete = std::ranges::all_of(set->frames, [](const auto& frame) { return frame.has_value(); });
    if (coverage && complete && rests && coverage->is_new(views)) {
      coverage->add(views);
      for (solver::BoardView& view : views) {
        solver::BoardView kept = view;
        kept.set = static_cast<int>(found.set_at_s.size());
        found.thumbnails.push_back(thumbnail_of(greys[static_cast<std::size_t>(view.camera)]));
        found.views.push_back(std::move(kept));
      }
      found.set_at_s.push_back(at_s);
      status = "kept view " + std::to_string(found.set_at_s.size());
    } else if (!views.empty()) {
      status = !rests ? "hold it still" : "seen before: move it elsewhere";
      if (rests) ++found.duplicates;
    } else {
      status = "no camera sees the board";
    }
    before = std::move(views);
    before_s = at_s;
    if (options.looked) options.looked(status);
    if (!coverage) {
      if (line.due()) line.draw(awaited(found.cameras));
      continue;
    }
    const auto needs = coverage->needs();
    if (line.due()) line.draw(status + (needs.empty() ? "" : "; then: " + needs.front()) + "\n" + coverage->lines());
    if (page.due()) page.show(shown, *coverage, status);
    if (options.until_enough && needs.empty()) break;
  }
  line.clear();
  page.close("finished with " + std::to_string(found.set_at_s.size()) + " moments");
  for (const CameraSighting& camera : found.cameras) {
    if (camera.pictures == 0) throw InputError("camera " + camera.name + " gave no picture");
  }
  for (const CameraSighting& camera : found.cameras) {
    const bool kept = std::ranges::any_of(found.views, [&](const solver::BoardView& view) {
      return names[static_cast<std::size_t>(view.camera)] == camera.name;
    });
    if (kept) continue;
    const auto why = std::ranges::max_element(camera.why_not, {}, [](const auto& entry) { return entry.second; });
    throw InputError(
        "camera " + camera.name + ": the board (" + detector.board().description() + ") was " +
        (camera.boards > 0 ? "never at rest" : "in none of its " + std::to_string(camera.pictures) + " pictures") +
        (camera.boards > 0 || why == camera.why_not.end() ? std::string() : ": " + why->first));
  }
  return found;
}

}  // namespace huetrack::gather
