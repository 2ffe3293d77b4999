// Our chessboard detector beside OpenCV's two and mrgingham (its command, where it is installed; it knows square boards
// only): boards found, wrong ones, distance from the truth and processor time, on the captures in shared/data and on
// drawn boards, of which everything is known. Prints the table of calib/board/EXPERIMENTS.md:
//   board_figures [WORD...]      only the captures whose name has one of the words; all takes half an hour, most of it
//                                findChessboardCorners, which searches long where it finds nothing
#include <sys/resource.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "board/drawn_board.h"
#include "board/rendered_corners.h"
#include "calib/board/board_detector.h"
#include "calib/board/grey_view.h"

namespace {

using namespace huetrack;
using board::Board;
using Eigen::Vector2d;
namespace fs = std::filesystem;

// A board that is further off than this share of a square, on average or in its shape, is not the board.
constexpr double wrong_by_squares = 0.25;

struct Picture {
  fs::path file;
  int camera = 0;
  std::vector<Vector2d> truth;  // by id; empty: not known
};

struct Capture {
  std::string name;
  Board board;
  std::vector<Picture> pictures;
  bool has_board = true;
};

// Corners by id; an id that was not found is absent.
using Corners = std::map<int, Vector2d>;

struct Detector {
  std::string name;
  bool numbers_corners = false;  // which is corner 0 is part of its answer
  std::function<Corners(const cv::Mat&, const Board&)> find;
};

double processor_time() {
  timespec t{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

double processor_time_of_children() {
  rusage usage{};
  ::getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

Corners by_id(const std::vector<cv::Point2f>& px) {
  Corners corners;
  for (std::size_t i = 0; i < px.size(); ++i) corners[int(i)] = {px[i].x, px[i].y};
  return corners;
}

// ---- The detectors

Corners find_ours(const cv::Mat& image, const Board& board) {
  const board::BoardDetection found = board::BoardDetector(board).detect(board::view_of(image));
  Corners corners;
  for (std::size_t i = 0; i < found.ids.size(); ++i) corners[found.ids[i]] = found.px[i];
  return corners;
}

Corners find_sector_based(const cv::Mat& image, const Board& board) {
  std::vector<cv::Point2f> px;
  if (!cv::findChessboardCornersSB(image, {board.columns, board.rows}, px,
                                   cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY))
    return {};
  return by_id(px);
}

// As OpenCV's samples use it: found roughly, then cornerSubPix, in a window that stays off the neighbouring corners.
Corners find_by_quads(const cv::Mat& image, const Board& board) {
  std::vector<cv::Point2f> px;
  if (!cv::findChessboardCorners(image, {board.columns, board.rows}, px,
                                 cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE))
    return {};
  double step = 1e9;
  for (std::size_t i = 0; i + 1 < px.size(); ++i) step = std::min(step, cv::norm(px[i + 1] - px[i]));
  const int half = std::clamp(int(step / 3), 1, 11);
  cv::cornerSubPix(image, px, {half, half}, {-1, -1}, {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 0.001});
  return by_id(px);
}

bool has_mrgingham() {
  return std::system("command -v mrgingham >/dev/null 2>&1") == 0;
}

// Of all pictures of a capture in one call; by file.
std::map<std::string, Corners> find_with_mrgingham(const Capture& capture) {
  std::string command = "mrgingham --gridn " + std::to_string(capture.board.columns);
  for (const Picture& picture : capture.pictures) command += " '" + picture.file.string() + "'";
  std::map<std::string, std::vector<cv::Point2f>> px;
  const auto close = [](FILE* pipe) { ::pclose(pipe); };
  const std::unique_ptr<FILE, decltype(close)> pipe(::popen((command + " 2>/dev/null").c_str(), "r"), close);
  std::array<char, 4096> line{};
  while (pipe && std::fgets(line.data(), int(line.size()), pipe.get())) {
    std::istringstream words(line.data());
    std::string file;
    double x = 0, y = 0;
    if (words >> file >> x >> y) px[file].emplace_back(float(x), float(y));
  }
  std::map<std::string, Corners> found;
  for (const auto& [file, corners] : px) found[file] = by_id(corners);
  return found;
}

// ---- The captures

fs::path data(const std::string& path) {
  return fs::path(HUETRACK_SHARED_DATA) / path;
}

std::vector<fs::path> pictures_in(const fs::path& folder, const std::string& start) {
  std::vector<fs::path> files;
  if (!fs::is_directory(folder)) return files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string extension = entry.path().extension();
    if (entry.path().filename().string().starts_with(start) && (extension == ".jpg" || extension == ".png"))
      files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

void add(Capture& capture, int camera, const std::vector<fs::path>& files) {
  for (const fs::path& file : files) capture.pictures.push_back({file, camera, {}});
}

Capture stereo() {
  Capture capture{"opencv_chessboard_stereo, 9x6", {.columns = 9, .rows = 6, .pitch = {0.025, 0.025}}, {}};
  add(capture, 0, pictures_in(data("opencv_chessboard_stereo"), "left0"));
  add(capture, 0, pictures_in(data("opencv_chessboard_stereo"), "left1"));
  add(capture, 1, pictures_in(data("opencv_chessboard_stereo"), "right"));
  return capture;
}

Capture rows_cut_off() {
  Capture capture{"red_square_stereo, 6x6, rows cut off", {.columns = 6, .rows = 6, .pitch = {0.0354, 0.0358}}, {}};
  add(capture, 0, pictures_in(data("red_square_stereo/calibration_images"), "camera_1"));
  add(capture, 1, pictures_in(data("red_square_stereo/calibration_images"), "camera_2"));
  return capture;
}

Capture no_board() {
  Capture capture{"hand_held_7scenes, no board", {.columns = 6, .rows = 6}, {}, false};
  const auto files = pictures_in(data("hand_held_7scenes/cam0"), "");
  for (std::size_t i = 0; i < files.size(); i += std::max<std::size_t>(1, files.size() / 25))
    capture.pictures.push_back({files[i], 0, {}});
  return capture;
}

Capture rendered() {
  const Board board{.columns = 9, .rows = 6, .pitch = {0.06, 0.06}};
  Capture capture{"rendered/chessboard, 9x6", board, {}};
  for (const board::RenderedCorners& seen : board::rendered_corners(data("rendered/chessboard"))) {
    std::vector<Vector2d> corners(std::size_t(board.point_count()),
                                  Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
    for (std::size_t i = 0; i < seen.ids.size(); ++i) corners[std::size_t(seen.ids[i])] = seen.px[i];
    std::array<char, 64> name{};
    std::snprintf(name.data(), name.size(), "rendered/chessboard/cam%d/%06d.jpg", seen.camera, seen.pose);
    capture.pictures.push_back({data(name.data()), seen.camera, std::move(corners)});
  }
  return capture;
}

struct Spoiling {
  std::string name;
  double square_px = 32;      // of the board seen from the front
  double blur_px = 0;         // beyond the lens's 0.75
  double noise = 2;           // standard deviation, grey values
  double tilt_deg = 25;       // at most
  bool is_at_border = false;  // no white margin, and the outer squares run out of the image
};

// The drawn board under random poses; a 7x7 board, for mrgingham's sake.
Capture drawn(const Spoiling& spoil, const fs::path& folder, int count) {
  const Board board{.columns = 7, .rows = 7, .pitch = {0.03, 0.03}};
  const board::DrawnBoard flat = board::draw_board(board, 48, spoil.is_at_border ? 0 : 1);
  const cv::Size size(640, 480);
  Capture capture{"drawn, 7x7, " + spoil.name, board, {}};
  std::mt19937_64 rng(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const double focal_px = 600, distance_m = focal_px * board.pitch.x() / spoil.square_px;
  while (int(capture.pictures.size()) < count) {
    const double turn = 0.4 * uniform(rng), way = std::numbers::pi * uniform(rng);
    const double tilt = spoil.tilt_deg * std::numbers::pi / 180 * (spoil.tilt_deg > 40 ? 1 : std::abs(uniform(rng)));
    const Eigen::Matrix3d rotation = (Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(way), std::sin(way), 0)) *
                                      Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()))
                                         .toRotationMatrix();
    const double reach = spoil.is_at_border ? 1 : 0.25;
    const Eigen::Vector3d shift(0.4 * distance_m * reach * uniform(rng), 0.3 * distance_m * reach * uniform(rng),
                                distance_m);
    const Eigen::Vector3d middle(3 * board.pitch.x(), 3 * board.pitch.y(), 0);
    const auto project = [&](const Eigen::Vector3d& p) {
      const Eigen::Vector3d c = rotation * (p - middle) + shift;
      return Vector2d(focal_px * c.x() / c.z() + 319.5, focal_px * c.y() / c.z() + 239.5);
    };
    std::vector<Vector2d> truth;
    for (int id = 0; id < board.point_count(); ++id) truth.push_back(project(board.point(id)));
    const auto margin = [&](const Vector2d& p) {
      return std::min({p.x(), p.y(), size.width - 1 - p.x(), size.height - 1 - p.y()});
    };
    double least = 1e9;
    for (const Vector2d& p : truth) least = std::min(least, margin(p));
    const double white_px = 2.2 * spoil.square_px;
    if (spoil.is_at_border ? least < 4 || least > 0.8 * spoil.square_px : least < white_px) continue;
    std::vector<cv::Point2d> from, to;
    for (const Eigen::Vector3d& p : {board.point(0), board.point(6), board.point(42), board.point(48)}) {
      const Vector2d a = flat.pixel(p), b = project(p);
      from.emplace_back(a.x(), a.y());
      to.emplace_back(b.x(), b.y());
    }
    cv::Mat image = board::seen_through(flat.image, cv::findHomography(from, to), size, 0, 1);
    if (spoil.blur_px > 0) cv::GaussianBlur(image, image, {}, spoil.blur_px);
    cv::Mat_<float> sum, grain(size);
    image.convertTo(sum, CV_32F);
    cv::RNG(rng()).fill(grain, cv::RNG::NORMAL, 0, spoil.noise);
    sum += grain;
    sum.convertTo(image, CV_8U);
    std::string name = spoil.name + " " + std::to_string(capture.pictures.size()) + ".png";
    std::ranges::replace(name, ' ', '_');
    const fs::path file = folder / name;
    cv::imwrite(file.string(), image);
    capture.pictures.push_back({file, 0, truth});
  }
  return capture;
}

// ---- The verdict

double step_px(const Corners& corners, const Board& board) {
  std::vector<double> steps;
  for (const auto& [id, px] : corners) {
    if (id % board.columns + 1 < board.columns && corners.contains(id + 1))
      steps.push_back((corners.at(id + 1) - px).norm());
    if (corners.contains(id + board.columns)) steps.push_back((corners.at(id + board.columns) - px).norm());
  }
  if (steps.empty()) return 0;
  std::ranges::nth_element(steps, steps.begin() + std::ptrdiff_t(steps.size() / 2));
  return steps[steps.size() / 2];
}

// rms distance of the corners, renumbered in the best of the ways allowed, from the truth.
double distance_from_truth(const Corners& found, const std::vector<Vector2d>& truth, const Board& board,
                           bool numbers_corners) {
  std::vector<std::vector<int>> ways;
  if (numbers_corners) {
    ways = board.symmetries();
  } else {
    const int columns = board.columns, rows = board.rows;
    std::vector<int> same, half, quarter, three;
    for (int id = 0; id < columns * rows; ++id) {
      const int x = id % columns, y = id / columns;
      same.push_back(id);
      half.push_back(columns * rows - 1 - id);
      quarter.push_back(x * columns + (rows - 1 - y));
      three.push_back((columns - 1 - x) * columns + y);
    }
    ways = {same, half};
    if (columns == rows) ways.insert(ways.end(), {quarter, three});
  }
  double best = 1e9;
  for (const std::vector<int>& way : ways) {
    double sum = 0;
    for (const auto& [id, px] : found) sum += (px - truth[std::size_t(way[std::size_t(id)])]).squaredNorm();
    best = std::min(best, std::sqrt(sum / double(found.size())));
  }
  return best;
}

// Whether the corners lie as a flat board's do, but for the lens.
bool is_lattice(const Corners& found, const Board& board) {
  std::vector<cv::Point2d> from, to;
  for (const auto& [id, px] : found) {
    from.emplace_back(id % board.columns, id / board.columns);
    to.emplace_back(px.x(), px.y());
  }
  const cv::Mat h = cv::findHomography(from, to);
  if (h.empty()) return false;
  std::vector<cv::Point2d> fitted;
  cv::perspectiveTransform(from, fitted, h);
  double sum = 0;
  for (std::size_t i = 0; i < to.size(); ++i) sum += std::pow(cv::norm(fitted[i] - to[i]), 2);
  return std::sqrt(sum / double(to.size())) < wrong_by_squares * step_px(found, board);
}

struct Tally {
  int found = 0, wrong = 0;
  double squares = 0;  // of the distances from the truth, summed over the boards
  int measured = 0;
  double ms = 0;  // of processor time per picture
  std::map<int, std::vector<Corners>> by_camera;
};

void count(const Capture& capture, const Picture& picture, const Corners& corners, bool numbers_corners, Tally& tally) {
  if (corners.empty()) return;
  if (!capture.has_board) {
    ++tally.wrong;
    return;
  }
  if (picture.truth.empty()) {
    if (!is_lattice(corners, capture.board)) {
      ++tally.wrong;
      return;
    }
    tally.by_camera[picture.camera].push_back(corners);
  } else {
    const double off = distance_from_truth(corners, picture.truth, capture.board, numbers_corners);
    if (!(off < wrong_by_squares * step_px(corners, capture.board))) {
      ++tally.wrong;
      return;
    }
    tally.squares += off * off;
    ++tally.measured;
  }
  ++tally.found;
}

// Where there is no truth: what OpenCV's calibration of these corners leaves, over all cameras.
std::optional<double> calibration_rms(const Capture& capture, const Tally& tally) {
  double sum = 0;
  int cameras = 0;
  for (const auto& [camera, views] : tally.by_camera) {
    if (views.size() < 5) continue;
    std::vector<std::vector<cv::Point3f>> points(views.size());
    std::vector<std::vector<cv::Point2f>> px(views.size());
    for (std::size_t v = 0; v < views.size(); ++v) {
      for (const auto& [id, at] : views[v]) {
        const Eigen::Vector3d p = capture.board.point(id);
        points[v].emplace_back(float(p.x()), float(p.y()), 0.0F);
        px[v].emplace_back(float(at.x()), float(at.y()));
      }
    }
    cv::Mat k, d, r, t;
    const double rms = cv::calibrateCamera(points, px, {640, 480}, k, d, r, t);
    sum += rms * rms;
    ++cameras;
  }
  if (cameras == 0) return std::nullopt;
  return std::sqrt(sum / cameras);
}

void print_row(const Capture& capture, const std::string& detector, const Tally& tally) {
  std::string error = "-";
  std::array<char, 32> text{};
  if (tally.measured > 0) {
    std::snprintf(text.data(), text.size(), "%.3f", std::sqrt(tally.squares / tally.measured));
    error = text.data();
  } else if (const auto rms = calibration_rms(capture, tally)) {
    std::snprintf(text.data(), text.size(), "(%.3f)", *rms);
    error = text.data();
  }
  std::printf("| %s | %s | %d of %zu | %d | %s | %.0f |\n", capture.name.c_str(), detector.c_str(), tally.found,
              capture.pictures.size(), tally.wrong, error.c_str(), tally.ms);
  std::fflush(stdout);
}

void compare(const Capture& capture, const std::vector<Detector>& detectors, bool with_mrgingham) {
  if (capture.pictures.empty()) {
    std::printf("| %s | not there | | | | |\n", capture.name.c_str());
    return;
  }
  const double pictures = double(capture.pictures.size());
  for (const Detector& detector : detectors) {
    Tally tally;
    for (const Picture& picture : capture.pictures) {
      const cv::Mat image = cv::imread(picture.file.string(), cv::IMREAD_GRAYSCALE);
      const double begun = processor_time();
      const Corners corners = detector.find(image, capture.board);
      tally.ms += 1e3 * (processor_time() - begun) / pictures;
      count(capture, picture, corners, detector.numbers_corners, tally);
    }
    print_row(capture, detector.name, tally);
  }
  if (with_mrgingham && capture.board.columns == capture.board.rows) {
    Tally tally;
    const double begun = processor_time_of_children();
    const auto found = find_with_mrgingham(capture);
    tally.ms = 1e3 * (processor_time_of_children() - begun) / pictures;
    for (const Picture& picture : capture.pictures)
      if (const auto corners = found.find(picture.file.string()); corners != found.end())
        count(capture, picture, corners->second, false, tally);
    print_row(capture, "mrgingham", tally);
  }
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  const std::vector<Detector> detectors{{"ours", true, find_ours},
                                        {"findChessboardCornersSB", false, find_sector_based},
                                        {"findChessboardCorners", false, find_by_quads}};
  const bool with_mrgingham = has_mrgingham();
  const fs::path folder = fs::temp_directory_path() / ("board_figures_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  std::vector<Capture> captures{stereo(), rendered(), rows_cut_off(), no_board()};
  constexpr int boards_each = 25;
  for (const Spoiling& spoil : std::vector<Spoiling>{{.name = "32 px squares"},
                                                     {.name = "blur of 2 px", .blur_px = 2},
                                                     {.name = "blur of 4 px", .blur_px = 4},
                                                     {.name = "noise of 10", .noise = 10},
                                                     {.name = "noise of 25", .noise = 25},
                                                     {.name = "tilted by 60 degrees", .tilt_deg = 60},
                                                     {.name = "tilted by 75 degrees", .tilt_deg = 75},
                                                     {.name = "8 px squares", .square_px = 8},
                                                     {.name = "5 px squares", .square_px = 5},
                                                     {.name = "at the border", .is_at_border = true}})
    captures.push_back(drawn(spoil, folder, boards_each));
  std::printf("| pictures | detector | found | wrong | error px | ms |\n|---|---|---|---|---|---|\n");
  const std::vector<std::string> words(argv + 1, argv + argc);
  for (const Capture& capture : captures) {
    const auto is_in_name = [&](const std::string& word) { return capture.name.find(word) != std::string::npos; };
    if (words.empty() || std::ranges::any_of(words, is_in_name)) compare(capture, detectors, with_mrgingham);
  }
  if (!with_mrgingham) std::printf("mrgingham is not installed: left out\n");
  fs::remove_all(folder);
  return 0;
}
