// Every figure of merit of calibration, on the captures in shared/data and on synthetic ones:
//   calibration_figures [stereo] [charuco] [red_square] [rendered] [bounds] [speed]      (none given: all)
// Ends with 1 when one falls short of what is asked of it.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <string>
#include <vector>

#include "calib/board/board_yaml.h"
#include "calib/gather/find_boards.h"
#include "calib/model/rig_yaml.h"
#include "calib/report/sentences.h"
#include "calib/solver/extrinsics.h"
#include "calib/solver/world_frame.h"
#include "drawn.h"
#include "solver/synthetic_rig.h"

namespace {

using namespace huetrack;
using Eigen::Vector2d;
using Eigen::Vector3d;
namespace fs = std::filesystem;

int short_of = 0;

// Prints a figure beside what is asked for.
void figure(const std::string& what, double value, const char* unit, double low, double high) {
  const bool good = value >= low && value <= high;
  short_of += good ? 0 : 1;
  if (low > -1e100 && high < 1e100) {
    std::printf("  %-66s %9.3f %-4s (%g .. %g)%s\n", what.c_str(), value, unit, low, high, good ? "" : "  FALLS SHORT");
  } else {
    std::printf("  %-66s %9.3f %-4s (%s %g)%s\n", what.c_str(), value, unit,
                high < 1e100 ? "<=" : ">=", high < 1e100 ? high : low, good ? "" : "  FALLS SHORT");
  }
}
constexpr double any_low = -1e200, any_high = 1e200;

fs::path data(const std::string& path) {
  return fs::path(HUETRACK_SHARED_DATA) / path;
}

bool is_there(const std::string& path) {
  if (fs::exists(data(path))) return true;
  std::printf("  %s is not there: skipped\n", data(path).c_str());
  return false;
}

gather::FoundBoards look(const board::Board& board, const std::vector<std::string>& inputs) {
  const auto source = gather::open_pictures(inputs, {});
  return gather::find_boards(*source, board::BoardDetector(board), {.progress = false}, {});
}

std::vector<solver::CameraToCalibrate> unknown(const gather::FoundBoards& found) {
  std::vector<solver::CameraToCalibrate> cameras;
  for (const gather::PictureTally& camera : found.cameras) cameras.push_back({camera.name, camera.image_size, {}});
  return cameras;
}

std::vector<solver::BoardView> views_of(const gather::FoundBoards& found, int camera) {
  std::vector<solver::BoardView> own;
  for (const solver::BoardView& view : found.views) {
    if (view.camera == camera) own.push_back(view);
  }
  return own;
}

// ---- opencv_chessboard_stereo

void stereo() {
  std::printf("opencv_chessboard_stereo\n");
  if (!is_there("opencv_chessboard_stereo")) return;
  const board::Board board{.columns = 9, .rows = 6, .pitch = {0.025, 0.025}};
  const gather::FoundBoards found = look(board, {"left=" + data("opencv_chessboard_stereo/left*.jpg").string(),
                                                 "right=" + data("opencv_chessboard_stereo/right*.jpg").string()});
  for (int c = 0; c < 2; ++c) {
    const gather::PictureTally& camera = found.cameras[std::size_t(c)];
    figure(camera.name + ": boards found of 13", camera.boards, "", 13, 13);
    const solver::Intrinsics lens =
        solver::calibrate_intrinsics(board, camera.name, camera.image_size, views_of(found, c));
    figure(camera.name + ": views used", lens.adjustment.views_used(0), "", 13, 13);
    figure(camera.name + ": rms", lens.adjustment.rms_px, "px", any_low, c == 0 ? 0.20 : 0.21);
    figure(camera.name + ": fx", lens.adjustment.cameras[0].parameters(0), "px", 0.995 * 534, 1.005 * 536);
    figure(camera.name + ": fy", lens.adjustment.cameras[0].parameters(1), "px", 0.995 * 534, 1.005 * 536);
  }
  const solver::Extrinsics rig = solver::calibrate_extrinsics(board, unknown(found), found.views);
  std::map<int, std::array<std::vector<cv::Point2f>, 2>> px;
  for (const solver::BoardView& view : found.views) {
    for (const auto& p : view.px) px[view.set][std::size_t(view.camera)].emplace_back(float(p.x()), float(p.y()));
  }
  std::vector<cv::Point3f> flat;
  for (int id = 0; id < board.point_count(); ++id)
    flat.emplace_back(float(board.point(id).x()), float(board.point(id).y()), 0.0F);
  std::vector<std::vector<cv::Point3f>> points;
  std::array<std::vector<std::vector<cv::Point2f>>, 2> both;
  for (const auto& [set, of] : px) {
    if (of[0].size() != flat.size() || of[1].size() != flat.size()) continue;
    points.push_back(flat);
    both[0].push_back(of[0]);
    both[1].push_back(of[1]);
  }
  cv::Mat k1, d1, k2, d2, r, t, e, f, rv, tv;
  const cv::Size size(640, 480);
  cv::calibrateCamera(points, both[0], size, k1, d1, rv, tv);
  cv::calibrateCamera(points, both[1], size, k2, d2, rv, tv);
  cv::stereoCalibrate(points, both[0], both[1], k1, d1, k2, d2, size, r, t, e, f, cv::CALIB_USE_INTRINSIC_GUESS);
  Eigen::Matrix3d rotation;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rotation(i, j) = r.at<double>(i, j);
  }
  const calib::Rigid3d right_from_left =
      rig.adjustment.cameras[1].cam_from_world * calib::inverse(rig.adjustment.cameras[0].cam_from_world);
  figure("rotation against stereoCalibrate",
         180 / std::numbers::pi * right_from_left.rotation.angularDistance(Eigen::Quaterniond(rotation)), "deg",
         any_low, 0.1);
  figure("baseline against stereoCalibrate", 100 * (right_from_left.translation.norm() / cv::norm(t) - 1), "%", -0.5,
         0.5);
}

// ---- caliscope_charuco_4cam

std::vector<double> numbers_in(const std::string& line) {
  std::vector<double> numbers;
  const char* at = line.c_str() + line.find('=') + 1;
  while (*at != '\0') {
    char* end = nullptr;
    const double value = std::strtod(at, &end);
    if (end == at) {
      ++at;
    } else {
      numbers.push_back(value);
      at = end;
    }
  }
  return numbers;
}

calib::CameraRig reference_rig(const fs::path& toml) {
  calib::CameraRig rig;
  std::ifstream file(toml);
  std::string line;
  while (std::getline(file, line)) {
    if (line.starts_with("[cameras.")) {
      rig.cameras.emplace_back();
      rig.cameras.back().name = "cam_" + line.substr(9, line.find(']') - 9);
    }
    if (rig.cameras.empty()) continue;
    calib::Camera& camera = rig.cameras.back();
    const auto n = numbers_in(line);
    const auto lens = [&] { return std::get<calib::PinholeRadtan>(camera.model.lens()); };
    if (line.starts_with("size")) camera.image_size = {int(n[0]), int(n[1])};
    if (line.starts_with("matrix")) {
      calib::PinholeRadtan l = lens();
      l.fx = n[0], l.cx = n[2], l.fy = n[4], l.cy = n[5];
      camera.model = calib::CameraModel(l);
    }
    if (line.starts_with("distortions")) {
      calib::PinholeRadtan l = lens();
      std::copy_n(n.begin(), 5, l.distortion.begin());
      camera.model = calib::CameraModel(l);
    }
    if (line.starts_with("translation")) camera.cam_from_world.translation = {n[0], n[1], n[2]};
    if (line.starts_with("rotation =")) {
      Eigen::Matrix3d m;
      for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = n[std::size_t(i)];
      camera.cam_from_world.rotation = Eigen::Quaterniond(m).normalized();
    }
  }
  return rig;
}

// What a rig makes of corners: triangulated from every set of two or more views.
struct RigOnCorners {
  std::vector<double> rms_px;                // per camera
  double pitch_mm = 0, pitch_spread_mm = 0;  // mean and standard deviation of the distances of neighbouring corners
  double flatness_mm = 0;  // rms distance of a set's corners from the true board, after the best motion
};

RigOnCorners on_corners(const calib::CameraRig& rig, const board::Board& board,
                        const std::vector<solver::BoardView>& views) {
  std::map<int, std::map<int, std::vector<std::pair<int, Vector2d>>>> sets;  // set -> corner -> (camera, px)
  for (const solver::BoardView& view : views) {
    for (std::size_t k = 0; k < view.ids.size(); ++k) sets[view.set][view.ids[k]].emplace_back(view.camera, view.px[k]);
  }
  std::vector<std::vector<double>> errors(rig.cameras.size());
  std::vector<double> pitches;
  double off = 0;
  int corners = 0;
  for (const auto& [set, seen] : sets) {
    std::map<int, Vector3d> points;
    for (const auto& [id, pixels] : seen) {
      if (pixels.size() < 2) continue;
      const Vector3d p = solver::measure_point(rig, pixels).p_world;
      points[id] = p;
      for (const auto& [c, px] : pixels) {
        if (const auto projected = rig.cameras[std::size_t(c)].project_world(p))
          errors[std::size_t(c)].push_back((projected->px - px).norm());
      }
    }
    for (const auto& [id, p] : points) {
      const int columns = board.corner_columns();
      if (id % columns + 1 < columns && points.contains(id + 1)) pitches.push_back((points[id + 1] - p).norm());
      if (points.contains(id + columns)) pitches.push_back((points[id + columns] - p).norm());
    }
    if (points.size() < 6) continue;
    Eigen::Matrix3Xd from(3, points.size()), to(3, points.size());
    Eigen::Index k = 0;
    for (const auto& [id, p] : points) {
      from.col(k) = board.point(id);
      to.col(k++) = p;
    }
    const Eigen::Matrix4d t = Eigen::umeyama(from, to, false);
    off += (((t.topLeftCorner<3, 3>() * from).colwise() + t.topRightCorner<3, 1>()) - to).squaredNorm();
    corners += int(points.size());
  }
  RigOnCorners result;
  for (auto& own : errors) {
    double sum = 0;
    for (const double e : own) sum += e * e;
    result.rms_px.push_back(std::sqrt(sum / double(std::max<std::size_t>(1, own.size()))));
  }
  double sum = 0, squares = 0;
  for (const double p : pitches) {
    sum += p;
    squares += p * p;
  }
  const double n = double(pitches.size());
  result.pitch_mm = 1000 * sum / n;
  result.pitch_spread_mm = 1000 * std::sqrt(std::max(0.0, squares / n - sum / n * sum / n));
  result.flatness_mm = 1000 * std::sqrt(off / std::max(1, corners));
  return result;
}

std::string rms_list(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) {
    std::array<char, 16> one{};
    std::snprintf(one.data(), one.size(), "%s%.2f", text.empty() ? "" : " / ", value);
    text += one.data();
  }
  return text;
}

// Views of the third of the sets in which the corners move least from set to set.
std::vector<solver::BoardView> stillest_third(const std::vector<solver::BoardView>& views) {
  std::map<int, std::map<int, const solver::BoardView*>> sets;
  for (const solver::BoardView& view : views) sets[view.set][view.camera] = &view;
  std::vector<std::pair<double, int>> speeds;
  for (const auto& [set, seen] : sets) {
    double fastest = 0;
    for (const auto& [camera, view] : seen) {
      for (const int other : {set - 1, set + 1}) {
        if (!sets.contains(other) || !sets[other].contains(camera)) continue;
        if (const auto moved = gather::moved_px(*view, *sets[other][camera])) fastest = std::max(fastest, *moved);
      }
    }
    speeds.emplace_back(fastest, set);
  }
  std::ranges::sort(speeds);
  speeds.resize(speeds.size() / 3);
  std::vector<solver::BoardView> still;
  for (const solver::BoardView& view : views) {
    if (std::ranges::find(speeds, view.set, &std::pair<double, int>::second) != speeds.end()) still.push_back(view);
  }
  return still;
}

std::vector<double> centre_distances_mm(const calib::CameraRig& a, const calib::CameraRig& b) {
  std::vector<Vector3d> from, to;
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    from.push_back(a.cameras[c].centre());
    to.push_back(b.cameras[c].centre());
  }
  const solver::WorldChange change = solver::align_points(from, to, false);
  std::vector<double> off;
  for (std::size_t c = 0; c < from.size(); ++c) off.push_back(1000 * (change * from[c] - to[c]).norm());
  return off;
}

void charuco() {
  std::printf("caliscope_charuco_4cam/post_optimization\n");
  const std::string folder = "caliscope_charuco_4cam/post_optimization/";
  if (!is_there(folder)) return;
  const board::Board board{.type = board::BoardType::charuco,
                           .columns = 4,
                           .rows = 5,
                           .pitch = {0.054, 0.054},
                           .marker = 0.0405,
                           .dictionary = "DICT_4X4_1000",
                           .inverted = true};
  const gather::FoundBoards found = look(board, {data(folder + "calibration/extrinsic").string()});
  const calib::CameraRig reference = reference_rig(data(folder + "camera_array.toml"));
  // The board is carried around, and the cameras do not expose together: only where it (nearly) rests do they see the
  // same. The third of the sets in which it moves least tells rigs apart.
  const std::vector<solver::BoardView> resting = stillest_third(found.views);
  std::printf("  %-34s %-31s %-31s %s\n", "", "rms px, all corners", "rms px, stillest third",
              "pitch and shape of the board (stillest third)");
  const auto print = [&](const char* name, const calib::CameraRig& rig) {
    const RigOnCorners all = on_corners(rig, board, found.views), still = on_corners(rig, board, resting);
    std::printf("  %-34s %-31s %-31s %.2f +- %.2f mm, off by %.2f mm\n", name, rms_list(all.rms_px).c_str(),
                rms_list(still.rms_px).c_str(), still.pitch_mm, still.pitch_spread_mm, still.flatness_mm);
    return all;
  };
  const RigOnCorners reference_all = print("the reference", reference);
  const solver::Extrinsics scratch = solver::calibrate_extrinsics(board, unknown(found), found.views);
  print("huetrack, lenses from these views", solver::rig_of(scratch.adjustment));
  std::printf("    centres off the reference's: %s mm; %s\n",
              rms_list(centre_distances_mm(solver::rig_of(scratch.adjustment), reference)).c_str(),
              report::refinement_text(scratch).c_str());
  // As its own users do: the lenses are known from recordings of their own.
  auto cameras = unknown(found);
  for (std::size_t c = 0; c < cameras.size(); ++c) cameras[c].model = reference.cameras[c].model;
  const solver::Extrinsics rig = solver::calibrate_extrinsics(board, cameras, found.views);
  const RigOnCorners ours_all = print("huetrack, the reference's lenses", solver::rig_of(rig.adjustment));
  std::printf("    %s; %d corners used, %d views dropped\n", report::refinement_text(rig).c_str(),
              rig.adjustment.corners_used,
              int(std::ranges::count_if(rig.adjustment.fits,
                                        [](const solver::ViewFit& fit) { return fit.dropped.has_value(); })));
  const RigOnCorners every =
      print("the same, no view dropped", solver::rig_of(solver::adjust(rig.adjustment, {.find_outliers = false})));
  const auto off = centre_distances_mm(solver::rig_of(rig.adjustment), reference);
  for (std::size_t c = 0; c < 4; ++c) {
    const std::string name = "cam_" + std::to_string(c);
    figure(name + ": views used", rig.adjustment.views_used(int(c)), "", 1, any_high);
    figure(name + ": rms of the corners used; limit: the reference's", rig.adjustment.rms_of_camera(int(c)), "px",
           any_low, reference_all.rms_px[c]);
    figure(name + ": rms of all corners, no view dropped; limit: the same", every.rms_px[c], "px", any_low,
           reference_all.rms_px[c]);
    figure(name + ": centre against the reference's", off[c], "mm", any_low, 15);
  }
  figure("corner pitch, all sets", ours_all.pitch_mm, "mm", 53.7, 54.3);
}

// ---- red_square_stereo

void red_square() {
  std::printf("red_square_stereo/calibration_images\n");
  if (!is_there("red_square_stereo/calibration_images")) return;
  const std::string folder = data("red_square_stereo/calibration_images/").string();
  const board::Board board{.columns = 6, .rows = 6, .pitch = {0.0354, 0.0358}};
  const gather::FoundBoards found =
      look(board, {"cam1=" + folder + "camera_1_*.png", "cam2=" + folder + "camera_2_*.png"});
  figure("boards found of 14", found.cameras[0].boards + found.cameras[1].boards, "", 14, 14);
  int opencv = 0;
  for (const char* camera : {"1", "2"}) {
    for (int cm = 60; cm <= 120; cm += 10) {
      const cv::Mat grey =
          cv::imread(folder + "camera_" + camera + "_" + std::to_string(cm) + "cm.png", cv::IMREAD_GRAYSCALE);
      std::vector<cv::Point2f> corners;
      opencv += cv::findChessboardCorners(grey, {6, 6}, corners) ? 1 : 0;
    }
  }
  std::printf("  (cv::findChessboardCorners finds %d)\n", opencv);
}

// ---- rendered/chessboard

const board::Board& rendered_board() {
  static const board::Board board{.columns = 9, .rows = 6, .pitch = {0.06, 0.06}};
  return board;
}

const gather::FoundBoards& rendered_found() {
  static const gather::FoundBoards found = look(rendered_board(), {data("rendered/chessboard").string()});
  return found;
}

void rendered() {
  std::printf("rendered/chessboard\n");
  if (!is_there("rendered/chessboard")) return;
  const calib::CameraRig truth = calib::read_rig(data("rendered/chessboard/rig.yaml"));
  const gather::FoundBoards& found = rendered_found();
  constexpr std::array least{20, 25, 17};
  for (std::size_t c = 0; c < 3; ++c)
    figure(found.cameras[c].name + ": boards found", found.cameras[c].boards, "", least[c], any_high);
  const solver::Extrinsics rig = solver::calibrate_extrinsics(rendered_board(), unknown(found), found.views);
  for (std::size_t c = 0; c < 3; ++c) {
    const solver::LensParameters l = rig.adjustment.cameras[c].parameters,
                                 t = solver::parameters_of(truth.cameras[c].model);
    figure(found.cameras[c].name + ": fx off by", 100 * (l(0) / t(0) - 1), "%", -0.4, 0.4);
    figure(found.cameras[c].name + ": fy off by", 100 * (l(1) / t(1) - 1), "%", -0.4, 0.4);
    figure(found.cameras[c].name + ": principal point off by", (l - t).segment<2>(2).norm(), "px", any_low, 2);
  }
  figure("volume of 2x2x2 m, after rigid alignment",
         1000 * solver::volume_rms_m(truth, solver::rig_of(rig.adjustment), {-1, -1, 0.1}, {1, 1, 2.1}), "mm", any_low,
         2);
}

// ---- are the bounds true?

void bounds() {
  std::printf("rendered/chessboard: 95 %% bounds, over resampled views and noise\n");
  if (!is_there("rendered/chessboard")) return;
  const calib::CameraRig truth = calib::read_rig(data("rendered/chessboard/rig.yaml"));
  std::vector<solver::CameraToCalibrate> cameras;
  for (const calib::Camera& camera : truth.cameras) cameras.push_back({camera.name, camera.image_size, camera.model});
  std::mt19937_64 rng(5);
  std::array<int, 5> inside{}, all{};
  constexpr std::array names{"focal lengths", "principal points", "distortion", "rotations", "positions"};
  for (int trial = 0; trial < 60; ++trial) {
    const double noise_px = 0.1 * (trial % 3);  // on top of what the detector leaves
    std::vector<int> sets(25);
    std::iota(sets.begin(), sets.end(), 0);
    std::ranges::shuffle(sets, rng);
    sets.resize(18);
    std::vector<solver::BoardView> views;
    for (solver::BoardView view : rendered_found().views) {
      if (std::ranges::find(sets, view.set) == sets.end()) continue;
      for (auto& px : view.px) px += noise_px * drawn<2>(rng, solver::normal);
      views.push_back(std::move(view));
    }
    const solver::Adjustment a =
        solver::calibrate_extrinsics(rendered_board(), cameras, views, {.refine_lens = solver::RefineLens::yes})
            .adjustment;
    const auto count = [&](std::size_t kind, double error, double sigma) {
      ++all[kind];
      inside[kind] += std::abs(error) <= 1.96 * sigma ? 1 : 0;
    };
    for (int c = 0; c < 3; ++c) {
      const solver::LensParameters off =
          a.cameras[std::size_t(c)].parameters - solver::parameters_of(truth.cameras[std::size_t(c)].model);
      const solver::LensParameters sigma = a.lens_sigma(c);
      for (int i = 0; i < solver::parameter_count(a.cameras[std::size_t(c)].lens); ++i)
        count(i < 2 ? 0U : i < 4 ? 1U : 2U, off(i), sigma(i));
      if (c == 0) continue;  // the reference
      const auto relative = [](const calib::Rigid3d& camera, const calib::Rigid3d& reference) {
        return camera * calib::inverse(reference);
      };
      const calib::Tangent6d error =
          calib::log(relative(truth.cameras[std::size_t(c)].cam_from_world, truth.cameras[0].cam_from_world) *
                     calib::inverse(relative(a.cameras[std::size_t(c)].cam_from_world, a.cameras[0].cam_from_world)));
      for (int i = 0; i < 3; ++i) {
        count(3, error(i), a.rotation_sigma(c)(i));
        count(4, error(3 + i), a.centre_sigma(c)(i));
      }
    }
  }
  int of = 0, in = 0;
  for (std::size_t k = 0; k < names.size(); ++k) {
    std::printf("  %-66s %9.1f %%\n", names[k], 100.0 * inside[k] / all[k]);
    in += inside[k];
    of += all[k];
  }
  figure("all parameters inside their 95 % bounds", 100.0 * in / of, "%", 90, 99);
}

// ---- speed

void speed() {
  std::printf("300 views x 4 cameras x 48 corners\n");
  const solver::SyntheticCapture capture = solver::synthetic_capture({.sets = 300, .noise_px = 0.2, .columns = 8});
  std::vector<solver::CameraToCalibrate> cameras;
  for (const calib::Camera& camera : capture.rig.cameras)
    cameras.push_back({camera.name, camera.image_size, camera.model});
  const auto before = std::chrono::steady_clock::now();
  const std::clock_t cpu_before = std::clock();
  const solver::Extrinsics found =
      solver::calibrate_extrinsics(capture.board, cameras, capture.views, {.refine_lens = solver::RefineLens::yes});
  const double cpu = double(std::clock() - cpu_before) / CLOCKS_PER_SEC;
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - before;
  std::printf("  %zu views, %d corners used; %.2f s by the wall clock\n", capture.views.size(),
              found.adjustment.corners_used, taken.count());
  figure("solved, lenses refined, with covariance: CPU time of one core", cpu, "s", any_low, 10);
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::pair<std::string, void (*)()>> sections{{"stereo", stereo},         {"charuco", charuco},
                                                                 {"red_square", red_square}, {"rendered", rendered},
                                                                 {"bounds", bounds},         {"speed", speed}};
  const std::set<std::string> wanted(argv + 1, argv + argc);
  for (const std::string& name : wanted) {
    if (std::ranges::find(sections, name, &std::pair<std::string, void (*)()>::first) != sections.end()) continue;
    std::fprintf(stderr, "calibration_figures: there is no section %s\n", name.c_str());
    return 1;
  }
  for (const auto& [name, run] : sections) {
    if (wanted.empty() || wanted.contains(name)) run();
  }
  std::printf("%d figures fall short\n", short_of);
  return short_of == 0 ? 0 : 1;
}
