#include "calib/gather/find_boards.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "calib/board/grey_view.h"
#include "calib/gather/board_evidence.h"
#include "calib/gather/detection_page.h"
#include "calib/gather/motion_blur.h"
#include "calib/gather/progress_line.h"
#include "calib/model/median.h"
#include "calib/solver/intrinsics.h"

namespace huetrack::gather {
namespace {

// Calls task(0) .. task(count - 1) on all cores.
void on_all_cores(std::size_t count, const std::function<void(std::size_t)>& task) {
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) task(i);
  };
  std::vector<std::jthread> threads;
  const std::size_t cores = std::max(1U, std::thread::hardware_concurrency());
  for (std::size_t t = 1; t < std::min(cores, count); ++t) threads.emplace_back(work);
  work();
}

// Speed of the board in a set, pixels per second: the smaller of before and after, in the camera where it is fastest.
std::vector<double> speeds(const std::vector<BoardSet>& sets) {
  std::vector<double> result;
  for (std::size_t s = 0; s < sets.size(); ++s) {
    double fastest = 0;
    for (const solver::BoardView& view : sets[s].views) {
      double slower = std::numeric_limits<double>::infinity();
      for (const std::size_t other : {s - 1, s + 1}) {  // s - 1 may wrap: then it is out of range
        if (other >= sets.size()) continue;
        for (const solver::BoardView& neighbour : sets[other].views) {
          if (neighbour.camera != view.camera) continue;
          const double dt = std::max(1e-3, std::abs(sets[other].at_s - sets[s].at_s));
          if (const auto moved = moved_px(view, neighbour)) slower = std::min(slower, *moved / dt);
        }
      }
      if (std::isfinite(slower)) fastest = std::max(fastest, slower);
    }
    result.push_back(fastest);
  }
  return result;
}

// Whether the board has not moved in any camera.
bool is_same(const BoardSet& a, const BoardSet& b) {
  constexpr double still_px = 1.5;
  if (a.views.size() != b.views.size()) return false;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    if (a.views[v].camera != b.views[v].camera) return false;
    const auto moved = moved_px(a.views[v], b.views[v]);
    if (!moved || *moved > still_px) return false;
  }
  return true;
}

// At most `most` sets: one per equal part of the time, seen by most cameras, with the board stillest. with_next: also
// the following set, if close in time, which gives the board's motion.
std::vector<BoardSet> thinned(std::vector<BoardSet> sets, std::size_t most, bool with_next) {
  if (sets.size() <= most) return sets;
  constexpr double closely_s = 0.15;
  const std::vector<double> speed = speeds(sets);
  std::vector<std::size_t> chosen;
  for (std::size_t part = 0; part < most; ++part) {
    std::size_t best = part * sets.size() / most;
    for (std::size_t s = best; s < (part + 1) * sets.size() / most; ++s) {
      const auto seen = sets[s].views.size(), best_seen = sets[best].views.size();
      if (seen > best_seen || (seen == best_seen && speed[s] < speed[best])) best = s;
    }
    if (chosen.empty() || chosen.back() != best) chosen.push_back(best);
    if (with_next && best + 1 < sets.size() && sets[best + 1].at_s - sets[best].at_s < closely_s)
      chosen.push_back(best + 1);
  }
  std::vector<BoardSet> kept;
  for (const std::size_t s : chosen) kept.push_back(std::move(sets[s]));
  return kept;
}

std::string reasons(const PictureTally& camera) {
  const auto most = std::ranges::max_element(camera.why_not, {}, [](const auto& entry) { return entry.second; });
  if (most == camera.why_not.end()) return {};
  std::string text = most->first;
  if (camera.why_not.size() > 1)
    text += most->second == 1 ? std::string(" (once)") : " (" + std::to_string(most->second) + " times)";
  if (most->first != motion_blur_reason && camera.motion_blurred() > 0)
    text += fmt::format("; {} in {}", motion_blur_reason, camera.motion_blurred());
  return text;
}

// Some images without a board, for explain_missing_board().
class Misses {
 public:
  void add(std::size_t camera, const cv::Mat& grey) {
    auto& own = by_camera_[camera];
    if (own.size() < 4) own.push_back(grey.clone());
  }
  std::vector<board::GreyPixels> of(std::size_t camera) const {
    std::vector<board::GreyPixels> views;
    if (const auto own = by_camera_.find(camera); own != by_camera_.end()) {
      for (const cv::Mat& image : own->second) views.push_back(board::view_of(image));
    }
    return views;
  }

 private:
  std::map<std::size_t, std::vector<cv::Mat>> by_camera_;
};

// One line per camera without a detection.
std::vector<std::pair<std::string, std::string>> without_boards(const FoundBoards& found, const board::Board& board,
                                                                const Misses& misses) {
  std::vector<std::pair<std::string, std::string>> without;
  for (std::size_t c = 0; c < found.cameras.size(); ++c) {
    const PictureTally& camera = found.cameras[c];
    if (camera.pictures == 0) {
      without.emplace_back(camera.name, "camera " + camera.name + " has no usable image" +
                                            (found.warnings.empty() ? "" : ": " + found.warnings.front()));
      continue;
    }
    if (camera.boards > 0) continue;
    std::string text = "camera " + camera.name + ": the board (" + board.description() + ") is in none of its " +
                       std::to_string(camera.pictures) + " images";
    if (const std::string why = reasons(camera); !why.empty()) text += ": " + why;
    if (const std::string guess = board::explain_missing_board(board, misses.of(c)); !guess.empty())
      text += "; " + guess;
    without.emplace_back(camera.name, text);
  }
  return without;
}

// A board file that fits a part of the board, or something else, in a few images: what the others show. Empty: nothing.
std::string doubt_of_misses(const FoundBoards& found, const board::Board& board, const Misses& misses) {
  static const int few = solver::IntrinsicsOptions{}.min_views;
  for (std::size_t c = 0; c < found.cameras.size(); ++c) {
    const PictureTally& camera = found.cameras[c];
    if (camera.boards == 0 || camera.boards >= few) continue;
    if (const std::string guess = board::explain_missing_board(board, misses.of(c)); !guess.empty())
      return fmt::format("camera {}: the board ({}) is in only {} of its {} images; of the others: {}", camera.name,
                         board.description(), camera.boards, camera.pictures, guess);
  }
  return {};
}

// Appends warnings, which may be the reason: damaged files.
std::string with_first(const std::vector<std::string>& warnings, std::string text) {
  constexpr std::size_t most = 3;
  for (std::size_t i = 0; i < std::min(most, warnings.size()); ++i)
    if (text.find(warnings[i]) == std::string::npos) text += "; " + warnings[i];
  if (warnings.size() > most) text += "; and " + std::to_string(warnings.size() - most) + " more";
  return text;
}

// One image to process.
struct Task {
  std::size_t set, camera;  // set: index in the batch
  board::BoardDetection detection;
  report::EmbeddedPicture thumbnail;  // if the board was found
};

// Detects the board in all images of a batch, on all cores.
std::vector<Task> detected(const std::vector<PictureSet>& batch, const board::BoardDetector& detector) {
  std::vector<Task> tasks;
  for (std::size_t s = 0; s < batch.size(); ++s) {
    for (std::size_t c = 0; c < batch[s].pictures.size(); ++c) {
      if (batch[s].pictures[c]) tasks.push_back({s, c, {}, {}});
    }
  }
  on_all_cores(tasks.size(), [&](std::size_t t) {
    const cv::Mat& grey = batch[tasks[t].set].pictures[tasks[t].camera]->grey;
    tasks[t].detection = detector.detect(board::view_of(grey));
    if (tasks[t].detection.found()) tasks[t].thumbnail = thumbnail_of(grey);
  });
  return tasks;
}

// throws InputError: the size differs from earlier images.
void count_picture(PictureTally& camera, const LabelledPicture& picture) {
  const calib::ImageSize size{picture.grey.cols, picture.grey.rows};
  if (camera.pictures++ == 0) camera.image_size = size;
  if (size == camera.image_size) return;
  throw InputError(fmt::format(
      "{} of camera {} is {}x{}, earlier images are {}x{}: a calibration is for one size; remove the others",
      picture.label, camera.name, size.width, size.height, camera.image_size.width, camera.image_size.height));
}

// Moves one camera's failures that were due to motion blur to motion_blur_reason.
class Smears {
 public:
  void missed(const cv::Mat& grey, const std::string& why_not) {
    if (board_.may_be_in(grey)) why_not_.push_back(why_not);
  }
  void found(const cv::Mat& grey, const std::vector<Eigen::Vector2d>& corners, PictureTally& camera) {
    const int certain = board_.found(grey, corners);
    for (int k = 0; k < certain; ++k) {
      const auto counted = camera.why_not.find(why_not_[static_cast<std::size_t>(k)]);
      if (--counted->second == 0) camera.why_not.erase(counted);
      ++camera.why_not[motion_blur_reason];
    }
    why_not_.clear();
  }

 private:
  MotionBlurDetector board_;
  std::vector<std::string> why_not_;  // reasons of the possibly blurred images since the last detection
};

// The views of a batch, per set; counts the images.
std::vector<BoardSet> views_of(const std::vector<PictureSet>& batch, const std::vector<Task>& tasks, FoundBoards& found,
                               Misses& misses, BoardEvidence& evidence, std::vector<Smears>& smears) {
  std::vector<BoardSet> seen(batch.size());
  for (std::size_t s = 0; s < batch.size(); ++s) seen[s].at_s = batch[s].at_s;
  for (const Task& task : tasks) {
    const LabelledPicture& picture = *batch[task.set].pictures[task.camera];
    PictureTally& camera = found.cameras[task.camera];
    count_picture(camera, picture);
    evidence.add(task.detection, picture.grey);
    if (!task.detection.found()) {
      ++camera.why_not[task.detection.why_not];
      smears[task.camera].missed(picture.grey, task.detection.why_not);
      misses.add(task.camera, picture.grey);
      continue;
    }
    ++camera.boards;
    smears[task.camera].found(picture.grey, task.detection.px, camera);
    seen[task.set].views.push_back({static_cast<int>(task.camera), 0, picture.label, task.detection.ids,
                                    task.detection.px, picture.stamp_s, task.detection.blur_px});
    seen[task.set].thumbnails.push_back(task.thumbnail);
  }
  found.sets_looked_at += static_cast<int>(batch.size());
  return seen;
}

// Updates the page once all cameras have an image.
void show(DetectionPage& page, std::vector<ShownPicture>& shown, const std::vector<PictureSet>& batch,
          const std::vector<Task>& tasks, const std::vector<BoardSet>& sets, const FoundBoards& found,
          const board::Board& board) {
  std::vector<std::string> names;
  std::vector<calib::ImageSize> sizes;
  for (const PictureTally& camera : found.cameras) {
    names.push_back(camera.name);
    sizes.push_back(camera.image_size);
  }
  for (const Task& task : tasks) {
    const auto& corners = task.detection.px;
    shown[task.camera] = {found.cameras[task.camera].name, batch[task.set].pictures[task.camera]->grey,
                          corners.empty() ? "no board" : std::to_string(corners.size()) + " corners", corners};
  }
  if (std::ranges::any_of(sizes, [](calib::ImageSize size) { return size.width == 0; })) return;
  ViewCoverage coverage(board, names, sizes);
  for (const BoardSet& set : sets) coverage.add(set.views);
  page.show(shown, coverage, "processed " + std::to_string(found.sets_looked_at) + " frame sets");
}

// Number of detections per camera, for the progress line.
std::string boards_text(const FoundBoards& found) {
  std::vector<std::string> boards;
  for (const PictureTally& camera : found.cameras) boards.push_back(camera.name + " " + std::to_string(camera.boards));
  return fmt::to_string(fmt::join(boards, ", "));
}

}  // namespace

int PictureTally::motion_blurred() const {
  const auto known = why_not.find(motion_blur_reason);
  return known == why_not.end() ? 0 : known->second;
}

void require_views(const FoundBoards& found, int least) {
  for (std::size_t c = 0; c < found.cameras.size(); ++c) {
    const PictureTally& camera = found.cameras[c];
    const auto views = std::ranges::count(found.views, static_cast<int>(c), &solver::BoardView::camera);
    if (views >= least) continue;
    const std::string why = reasons(camera);
    throw InputError("camera " + camera.name + ": only " + std::to_string(views) + (views == 1 ? " view" : " views") +
                     " of the board, from " + std::to_string(camera.pictures) + " images" +
                     (why.empty() ? "" : "; in most others " + why) +
                     (found.board_doubt.empty() ? "" : "; " + found.board_doubt) + ". At least " +
                     std::to_string(least) +
                     " are needed, some 15 with the board tilted and in all parts of the image are good");
  }
}

std::optional<double> moved_px(const solver::BoardView& a, const solver::BoardView& b) {
  std::vector<double> moved;
  for (std::size_t i = 0, j = 0; i < a.ids.size() && j < b.ids.size();) {
    if (a.ids[i] < b.ids[j]) {
      ++i;
    } else if (b.ids[j] < a.ids[i]) {
      ++j;
    } else {
      moved.push_back((a.px[i++] - b.px[j++]).norm());
    }
  }
  if (moved.empty()) return std::nullopt;
  return calib::median(std::move(moved));
}

report::EmbeddedPicture thumbnail_of(const cv::Mat& grey) {
  constexpr double width = 480;
  report::EmbeddedPicture thumbnail;
  thumbnail.scale = std::min(1.0, width / grey.cols);
  cv::Mat small = grey;
  if (thumbnail.scale < 1) cv::resize(grey, small, {}, thumbnail.scale, thumbnail.scale, cv::INTER_AREA);
  cv::imencode(".jpg", small, thumbnail.jpeg, {cv::IMWRITE_JPEG_QUALITY, 80});
  return thumbnail;
}

FoundBoards find_boards(PictureSource& source, const board::BoardDetector& detector, const FindBoardsOptions& options,
                        std::stop_token stop) {
  FoundBoards found;
  for (const std::string& name : source.cameras()) {
    found.cameras.emplace_back();
    found.cameras.back().name = name;
  }
  const auto expected = source.expected_sets();
  const int every = options.every > 0 ? options.every : expected ? std::max(1, *expected / options.look_at) : 1;
  // Pairs of consecutive sets give the board's motion.
  const int at_a_time = source.has_stamps() && options.every == 0 && every > 1 ? 2 : 1;
  ProgressLine line(options.progress);
  Misses misses;
  BoardEvidence evidence(detector.board());
  std::vector<Smears> smears(found.cameras.size());
  std::vector<BoardSet> sets;
  DetectionPage page(options.page);
  std::vector<ShownPicture> shown(found.cameras.size());
  for (bool ended = false; !ended;) {
    constexpr std::size_t batch_size = 8;  // capacity: enough for all cores, little memory
    std::vector<PictureSet> batch;
    while (batch.size() < batch_size && !ended) {
      auto set = source.next(stop);
      if (stop.stop_requested()) throw InputError("stopped before all images were processed");
      ended = !set;
      if (set && found.sets_seen++ % (every * at_a_time) < at_a_time) batch.push_back(std::move(*set));
    }
    const std::vector<Task> tasks = detected(batch, detector);
    for (BoardSet& set : views_of(batch, tasks, found, misses, evidence, smears)) {
      if (set.views.empty()) continue;
      if (!sets.empty() && is_same(sets.back(), set)) {
        ++found.duplicates;
        continue;
      }
      sets.push_back(std::move(set));
    }
    if (page.due()) show(page, shown, batch, tasks, sets, found, detector.board());
    if (line.due()) line.show("looking for the board", found.sets_seen, expected, boards_text(found));
  }
  line.clear();
  page.close("processed all " + std::to_string(found.sets_looked_at) + " frame sets");
  found.warnings = source.take_warnings();
  evidence.refuse_wrong_board();
  found.board = evidence.board();
  found.board_doubt = evidence.doubt();
  if (found.board_doubt.empty()) found.board_doubt = doubt_of_misses(found, detector.board(), misses);
  found.without_boards = without_boards(found, detector.board(), misses);
  if (!found.without_boards.empty() && found.without_boards.size() + options.least_cameras > found.cameras.size())
    throw InputError(with_first(found.warnings, found.without_boards.front().second));
  const std::size_t before = sets.size();
  sets = thinned(std::move(sets), static_cast<std::size_t>(options.max_sets), source.has_stamps());
  found.thinned = static_cast<int>(before - sets.size());
  for (BoardSet& set : sets) {
    for (std::size_t v = 0; v < set.views.size(); ++v) {
      set.views[v].set = static_cast<int>(found.set_at_s.size());
      found.views.push_back(std::move(set.views[v]));
      found.thumbnails.push_back(std::move(set.thumbnails[v]));
    }
    found.set_at_s.push_back(set.at_s);
  }
  return found;
}

}  // namespace huetrack::gather
