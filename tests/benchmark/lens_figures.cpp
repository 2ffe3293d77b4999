// Calibrations of three cameras with unknown lenses from boards whose corners were detected in pictures; the true error
// over 2 x 2 x 2 m beside the stated one, and beside OpenCV's calibrateCamera (five coefficients) and stereoCalibrate
// on the same corners:
//   lens_figures [chessboard] [ordinary] [wide] [--seeds FIRST LAST] [--lens MODEL] [--trials] [--only-ours]
// (nothing given: all, seeds 1 to 8). --trials: log evidence of every lens model. --only-ours: without OpenCV.
// chessboard: shared/data/rendered/chessboard. ordinary: lenses of 50 to 90 degrees, distorted as published
// calibrations of webcams are. wide: fisheyes of 100 to 150 degrees like those of action cameras, and a Brown-Conrady
// lens of 100 to 112. Boards are drawn with blur and noise at 640x480.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <set>
#include <string>
#include <vector>

#include "board/captures.h"
#include "calib/model/rig_yaml.h"
#include "calib/solver/extrinsics.h"
#include "calib/solver/volume_accuracy.h"
#include "calib/solver/world_frame.h"
#include "solver/synthetic_rig.h"

namespace {

using namespace huetrack;
using calib::CameraModel;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Random = std::mt19937_64;

constexpr calib::ImageSize image_size{640, 480};
const Vector3d low(-1, -1, 0.1), high(1, 1, 2.1);

double between(Random& rng, double from, double to) {
  return from + (to - from) * solver::uniform(rng);
}

// ---- lenses

// Distortion of published calibrations of webcams (ROS camera_info files): shares of the radius by k1 and by k2 at half
// the picture's diagonal over the focal length.
constexpr std::array<std::array<double, 2>, 10> webcams{{{-0.264, 0.061},
                                                         {0.064, -0.070},
                                                         {-0.254, 0.050},
                                                         {-0.356, 0.095},
                                                         {-0.387, 0.093},
                                                         {-0.045, 0.044},
                                                         {-0.129, 0.059},
                                                         {-0.103, 0.082},
                                                         {0.019, -0.017},
                                                         {-0.071, 0.003}}};
// Of action cameras, as fisheyes (gyroflow/lens_profiles: GoPro HERO10 and HERO11 Wide, HERO3 Silver, AKASO EK7000
// Pro).
constexpr std::array<std::array<double, 4>, 4> action_cameras{{{0.034, 0.068, -0.074, 0.030},
                                                               {0.031, 0.060, -0.043, 0.010},
                                                               {-0.017, 0.120, -0.075, 0.031},
                                                               {-0.034, 0.008, -0.018, 0.014}}};

// Horizontal field of view, degrees.
double field_of(const CameraModel& lens, calib::ImageSize size = image_size) {
  const auto left = lens.ray({{0, lens.cy()}}), right = lens.ray({{size.width - 1.0, lens.cy()}});
  return left && right ? 180 / std::numbers::pi * std::acos(left->dot(*right)) : 0;
}

// make(f), with the focal length that gives the field of view.
template <typename Make>
CameraModel with_field(double degrees, const Make& make) {
  double wide = 100, tele = 2000;
  for (int i = 0; i < 50; ++i) {
    const double middle = std::sqrt(wide * tele), field = field_of(make(middle));
    (field == 0 || field > degrees ? wide : tele) = middle;
  }
  return make(tele);
}

CameraModel ordinary_lens(Random& rng) {
  for (;;) {
    const auto share = webcams[rng() % webcams.size()];
    const double k3_share = 0.005 * solver::normal(rng), cx = 319.5 + 8 * solver::normal(rng),
                 cy = 239.5 + 6 * solver::normal(rng), p1 = 7e-4 * solver::normal(rng), p2 = 7e-4 * solver::normal(rng),
                 aspect = 1 + 1e-3 * solver::normal(rng), field = between(rng, 50, 90);
    const CameraModel lens = with_field(field, [&](double f) {
      const double s = std::pow(400 / f, 2);
      return CameraModel(calib::PinholeRadtan{
          f, f * aspect, cx, cy, {share[0] / s, share[1] / (s * s), p1, p2, k3_share / (s * s * s)}});
    });
    if (solver::covers_image(lens, image_size) && std::abs(field_of(lens) - field) < 1) return lens;
  }
}

CameraModel wide_lens(Random& rng, int camera) {
  for (;;) {
    const double cx = 319.5 + 8 * solver::normal(rng), cy = 239.5 + 6 * solver::normal(rng);
    const double field = camera == 1 ? between(rng, 100, 112) : between(rng, 100, 150);
    const auto k = action_cameras[rng() % action_cameras.size()];
    const double k1 = between(rng, -0.3, -0.24), p1 = 4e-4 * solver::normal(rng), p2 = 4e-4 * solver::normal(rng);
    const CameraModel lens = with_field(field, [&](double f) {
      if (camera != 1) return CameraModel(calib::FisheyeKannalaBrandt{f, f, cx, cy, k});
      return CameraModel(calib::PinholeRadtan{f, f, cx, cy, {k1, 0.95 * k1 * k1, p1, p2, -0.008}});
    });
    if (solver::covers_image(lens, image_size) && std::abs(field_of(lens) - field) < 1) return lens;
  }
}

// ---- pictures

// Blur of the lens, standard deviation in px; noise of the sensor, grey levels.
constexpr double blur_px = 0.7, noise_levels = 3;

// Share of white of stripes of width 1 (white for -1..0), through a blur: two edges at most count.
double stripes(double x, double sigma) {
  const double nearest = std::round(x);
  const double edge = std::erf((x - nearest) / (std::numbers::sqrt2 * std::max(sigma, 1e-6)));
  return std::fmod(std::abs(nearest), 2) < 0.5 ? -edge : edge;
}

struct Painter {
  const board::Board& board;
  std::vector<Vector3d> rays;  // by pixel; zero: none

  Painter(const board::Board& of, const CameraModel& lens) : board(of) {
    for (int y = 0; y < image_size.height; ++y) {
      for (int x = 0; x < image_size.width; ++x) rays.push_back(lens.ray({Vector2d(x, y)}).value_or(Vector3d::Zero()));
    }
  }

  // In squares, from the board's corner 0; nullopt: not on its plane.
  std::optional<Vector2d> on_board(std::size_t pixel, const Eigen::Matrix3d& board_from_plane) const {
    const Vector3d p = board_from_plane * rays[pixel];
    if (!(p.z() > 1e-9)) return std::nullopt;
    return Vector2d(p.x() / p.z() / board.pitch.x(), p.y() / p.z() / board.pitch.y());
  }

  cv::Mat picture(const calib::Rigid3d& cam_from_board, Random& rng) const {
    Eigen::Matrix3d plane_from_board;
    plane_from_board << cam_from_board.rotation.toRotationMatrix().leftCols<2>(), cam_from_board.translation;
    const Eigen::Matrix3d board_from_plane = plane_from_board.inverse();
    cv::Mat image(image_size.height, image_size.width, CV_8UC1);
    for (int y = 0; y < image_size.height; ++y) {
      for (int x = 0; x < image_size.width; ++x) {
        const auto pixel = static_cast<std::size_t>(y * image_size.width + x);
        double grey = 90 + 30 * std::sin(0.02 * x + 0.013 * y);
        const auto at = on_board(pixel, board_from_plane);
        const auto right = on_board(x + 1 < image_size.width ? pixel + 1 : pixel - 1, board_from_plane);
        const auto below =
            on_board(y + 1 < image_size.height ? pixel + image_size.width : pixel - image_size.width, board_from_plane);
        if (at && right && below) {
          const Vector2d sigma = blur_px * ((*right - *at).cwiseAbs2() + (*below - *at).cwiseAbs2()).cwiseSqrt();
          const auto inside = [&](double margin) {
            const Vector2d beyond = (*at - Vector2d(board.columns - 1, board.rows - 1) / 2).cwiseAbs() -
                                    Vector2d(board.columns + margin, board.rows + margin) / 2;
            return 0.25 * std::erfc(beyond.x() / (std::numbers::sqrt2 * std::max(sigma.x(), 1e-6))) *
                   std::erfc(beyond.y() / (std::numbers::sqrt2 * std::max(sigma.y(), 1e-6)));
          };
          const double squares = 125 - 85 * stripes(at->x(), sigma.x()) * stripes(at->y(), sigma.y());
          const double printed = inside(1), paper = inside(3);
          grey = (1 - paper) * grey + paper * (printed * squares + (1 - printed) * 210);
        }
        image.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(grey + noise_levels * solver::normal(rng));
      }
    }
    return image;
  }
};

struct Capture {
  calib::CameraRig truth;
  board::Board board;
  std::vector<solver::BoardView> views;
};

// Facing `to` from `from`, tilted by up to some 40 degrees. The board's middle is at `from`.
calib::Rigid3d board_at(Random& rng, const board::Board& board, const Vector3d& from, const Vector3d& to) {
  Eigen::Matrix3d facing;
  facing.col(2) = (from - to).normalized();
  facing.col(0) = facing.col(2).cross(Vector3d::UnitZ()).normalized();
  facing.col(1) = facing.col(2).cross(facing.col(0));
  const Vector3d tilt = 0.6 * Vector3d(between(rng, -1, 1), between(rng, -1, 1), between(rng, -1, 1));
  const Eigen::Quaterniond rotation =
      Eigen::AngleAxisd(tilt.norm(), tilt.normalized()) * Eigen::Quaterniond(facing).normalized();
  const Vector3d middle(board.pitch.x() * (board.columns - 1) / 2, board.pitch.y() * (board.rows - 1) / 2, 0);
  return {rotation, from - rotation * middle};
}

Capture capture_of(bool wide, int seed) {
  Random rng(static_cast<std::uint64_t>(seed) * 7919 + (wide ? 1 : 0));
  Capture capture;
  capture.board = {.columns = 9, .rows = 6, .pitch = {0.06, 0.06}};
  for (int c = 0; c < 3; ++c) {
    const double angle = (c - 1) * between(rng, 0.7, 1.0),
                 away = wide ? between(rng, 1.5, 1.9) : between(rng, 2.4, 2.9);
    const Vector3d place(away * std::cos(angle), away * std::sin(angle), between(rng, 1.5, 2.2));
    capture.truth.cameras.push_back({"cam" + std::to_string(c),
                                     image_size,
                                     wide ? wide_lens(rng, c) : ordinary_lens(rng),
                                     solver::looking_at(place, {0, 0, 1.0}),
                                     {}});
  }
  std::vector<Painter> painters;
  for (const calib::Camera& camera : capture.truth.cameras) painters.emplace_back(capture.board, camera.model);
  const board::BoardDetector detector(capture.board);
  // 25 sets amid the cameras; with wide lenses 15 more before one camera after another, out to its picture's corners.
  const int shared = 25, sets = wide ? 40 : shared;
  for (int set = 0; set < sets; ++set) {
    calib::Rigid3d pose;
    if (set < shared) {
      const Vector3d at(between(rng, -0.6, 0.6), between(rng, -0.8, 0.8), between(rng, 0.4, 1.7));
      pose = board_at(rng, capture.board, at, Vector3d(2.5, between(rng, -1.5, 1.5), 1.8));
    } else {
      const calib::Camera& camera = capture.truth.cameras[static_cast<std::size_t>(set % 3)];
      const auto ray = camera.model.ray({Vector2d(between(rng, 60, 580), between(rng, 60, 420))});
      const Vector3d at = calib::inverse(camera.cam_from_world) * Vector3d(between(rng, 0.5, 0.8) * *ray);
      pose = board_at(rng, capture.board, at, camera.centre());
    }
    for (std::size_t c = 0; c < painters.size(); ++c) {
      const cv::Mat image = painters[c].picture(capture.truth.cameras[c].cam_from_world * pose, rng);
      board::BoardDetection found = detector.detect(board::view_of(image));
      if (!found.found()) continue;
      capture.views.push_back({static_cast<int>(c), set, "cam" + std::to_string(c) + " set " + std::to_string(set),
                               std::move(found.ids), std::move(found.px)});
    }
  }
  return capture;
}

Capture shared_capture() {
  Capture capture;
  capture.truth = calib::read_rig(board::shared_data("rendered/chessboard/rig.yaml"));
  capture.board = board::rendered_board();
  capture.views = board::rendered_views();
  return capture;
}

// ---- figures

struct Options {
  std::optional<solver::LensModel> lens{};
  bool trials = false, only_ours = false;
};

struct Figures {
  double error_mm = 0, stated_mm = 0;
  std::string lenses;
};

double error_mm(const calib::CameraRig& truth, const calib::CameraRig& found) {
  return 1000 * solver::volume_rms_m(truth, found, low, high);
}

// Moves the rig into the true world, for the box of what is stated.
solver::Adjustment in_true_world(const solver::Adjustment& found, const calib::CameraRig& truth) {
  std::vector<Vector3d> from, to;
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    for (const Vector3d& p : {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)}) {
      from.push_back(calib::inverse(found.cameras[c].cam_from_world) * p);
      to.push_back(calib::inverse(truth.cameras[c].cam_from_world) * p);
    }
  }
  return solver::in_world(found, solver::align_points(from, to, false).new_from_old);
}

Figures ours(const Capture& capture, const Options& options) {
  std::vector<solver::CameraToCalibrate> cameras;
  for (const calib::Camera& camera : capture.truth.cameras) cameras.push_back({camera.name, camera.image_size, {}});
  const solver::Extrinsics found =
      solver::calibrate_extrinsics(capture.board, cameras, capture.views, {.intrinsics = {.lens = options.lens}});
  for (std::size_t c = 0; options.trials && c < found.lenses.size(); ++c) {
    for (const solver::LensTrial& trial : found.lenses[c]->trials)
      std::printf("    cam%zu %-13s %9.1f  rms %.4f px, %d left out %s\n", c,
                  std::string(solver::name(trial.lens)).c_str(), trial.log_evidence, trial.rms_px, trial.left_out,
                  solver::facts(solver::reasons_of(trial)).c_str());
  }
  const solver::Adjustment a = in_true_world(found.adjustment, capture.truth);
  Figures figures{error_mm(capture.truth, solver::rig_of(a)), 0, {}};
  const solver::VolumeAccuracy stated = solver::predict_accuracy(a, {low, high}, {5, 5, 5});
  int seen = 0;
  for (const solver::PointAccuracy& point : stated.points) {
    if (point.views < 2) continue;
    figures.stated_mm += std::pow(1000 * point.by_calibration_m, 2);
    ++seen;
  }
  figures.stated_mm = std::sqrt(figures.stated_mm / std::max(1, seen));
  for (const solver::AdjustedCamera& camera : a.cameras) figures.lenses += " " + std::string(solver::name(camera.lens));
  return figures;
}

using Corners = std::map<std::pair<int, int>, std::map<int, Vector2d>>;  // (set, camera) -> id

struct OpenCvViews {
  std::vector<std::vector<cv::Point3f>> points;
  std::array<std::vector<std::vector<cv::Point2f>>, 2> px;
};

// Views of camera a, or the corners that a and b saw at once.
OpenCvViews opencv_views(const board::Board& board, const Corners& corners, int a, int b) {
  OpenCvViews views;
  for (const auto& [key, own] : corners) {
    if (key.second != a) continue;
    const auto other = corners.find({key.first, b});
    if (other == corners.end()) continue;
    std::vector<cv::Point3f> points;
    std::array<std::vector<cv::Point2f>, 2> px;
    for (const auto& [id, at] : own) {
      const auto there = other->second.find(id);
      if (there == other->second.end()) continue;
      const Vector3d p = board.point(id);
      points.emplace_back(float(p.x()), float(p.y()), 0.0F);
      px[0].emplace_back(float(at.x()), float(at.y()));
      px[1].emplace_back(float(there->second.x()), float(there->second.y()));
    }
    constexpr std::size_t least = 8;
    if (points.size() < least) continue;
    views.points.push_back(std::move(points));
    for (std::size_t i : {0U, 1U}) views.px[i].push_back(std::move(px[i]));
  }
  return views;
}

double opencv_mm(const Capture& capture) {
  Corners corners;
  for (const solver::BoardView& view : capture.views) {
    for (std::size_t k = 0; k < view.ids.size(); ++k) corners[{view.set, view.camera}][view.ids[k]] = view.px[k];
  }
  calib::CameraRig rig = capture.truth;
  std::vector<cv::Mat> k(3), d(3);
  for (std::size_t c = 0; c < 3; ++c) {
    const auto own = opencv_views(capture.board, corners, int(c), int(c));
    cv::Mat rv, tv;
    const cv::Size size(rig.cameras[c].image_size.width, rig.cameras[c].image_size.height);
    cv::calibrateCamera(own.points, own.px[0], size, k[c], d[c], rv, tv);
    calib::PinholeRadtan lens{
        k[c].at<double>(0, 0), k[c].at<double>(1, 1), k[c].at<double>(0, 2), k[c].at<double>(1, 2), {}};
    std::copy_n(d[c].ptr<double>(), 5, lens.distortion.begin());
    rig.cameras[c].model = CameraModel(lens);
    rig.cameras[c].cam_from_world = {};
    if (c == 0) continue;
    const auto both = opencv_views(capture.board, corners, 0, int(c));
    cv::Mat r, t, e, f;
    cv::stereoCalibrate(both.points, both.px[0], both.px[1], k[0], d[0], k[c], d[c], size, r, t, e, f);
    Eigen::Matrix3d rotation;
    for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = r.at<double>(i / 3, i % 3);
    rig.cameras[c].cam_from_world = {Eigen::Quaterniond(rotation).normalized(),
                                     {t.at<double>(0), t.at<double>(1), t.at<double>(2)}};
  }
  return error_mm(capture.truth, rig);
}

struct Sums {
  double ours = 0, stated = 0, opencv = 0, worst = 0, most_too_sure = 0;
  int count = 0;
};

void print_row(const std::string& name, const Capture& capture, const Options& options, Sums& sums) {
  const Figures found = ours(capture, options);
  const double opencv = options.only_ours ? 0 : opencv_mm(capture);
  std::string fields;
  for (const calib::Camera& camera : capture.truth.cameras)
    fields += " " + std::to_string(std::lround(field_of(camera.model, camera.image_size)));
  std::printf("  %-12s %8.2f %8.2f %8.2f  %s (%s degrees, %zu views)\n", name.c_str(), found.error_mm, found.stated_mm,
              opencv, found.lenses.c_str(), fields.c_str() + 1, capture.views.size());
  std::fflush(stdout);
  sums.ours += found.error_mm * found.error_mm;
  sums.stated += found.stated_mm * found.stated_mm;
  sums.opencv += opencv * opencv;
  sums.worst = std::max(sums.worst, found.error_mm);
  sums.most_too_sure = std::max(sums.most_too_sure, found.error_mm / found.stated_mm);
  ++sums.count;
}

void print_seeds(const char* kind, bool wide, int first, int last, const Options& options) {
  Sums sums;
  for (int seed = first; seed <= last; ++seed)
    print_row(kind + std::string(" ") + std::to_string(seed), capture_of(wide, seed), options, sums);
  const double n = sums.count;
  std::printf("  %-12s %8.2f %8.2f %8.2f   rms over seeds; worst %.2f mm; at most %.1f times the stated\n", kind,
              std::sqrt(sums.ours / n), std::sqrt(sums.stated / n), std::sqrt(sums.opencv / n), sums.worst,
              sums.most_too_sure);
}

}  // namespace

int main(int argc, char** argv) {
  std::set<std::string> wanted;
  int first = 1, last = 8;
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--seeds" && i + 2 < argc) {
      first = std::atoi(argv[++i]);
      last = std::atoi(argv[++i]);
    } else if (word == "--trials") {
      options.trials = true;
    } else if (word == "--only-ours") {
      options.only_ours = true;
    } else if (word == "--lens" && i + 1 < argc) {
      const auto named = std::ranges::find(solver::all_lens_models, std::string_view(argv[++i]), &solver::name);
      if (named != solver::all_lens_models.end()) options.lens = *named;
    } else if (word == "chessboard" || word == "ordinary" || word == "wide") {
      wanted.insert(word);
    } else {
      std::fprintf(
          stderr,
          "lens_figures: %s is not chessboard, ordinary, wide, --seeds FIRST LAST, --lens, --trials or --only-ours\n",
          word.c_str());
      return 1;
    }
  }
  const auto is_wanted = [&](const char* kind) { return wanted.empty() || wanted.contains(kind); };
  std::printf("  %-12s %8s %8s %8s   lenses\n", "mm, rms", "error", "stated", "OpenCV");
  Sums ignored;
  if (is_wanted("chessboard")) print_row("chessboard", shared_capture(), options, ignored);
  if (is_wanted("ordinary")) print_seeds("ordinary", false, first, last, options);
  if (is_wanted("wide")) print_seeds("wide", true, first, last, options);
  return 0;
}
