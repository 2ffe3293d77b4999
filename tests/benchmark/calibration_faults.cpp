// What a calibration says where something is wrong, and where its lens models are not the truth:
//   calibration_faults lenses [SEEDS] [FIRST]    lenses that no model holds, of 70, 100 and 130 degrees
//   (solver/odd_lens.h) calibration_faults faults [SEEDS]            rendered boards with one fault each; is it named,
//   and is the verdict right? calibration_faults given [SEEDS]             lenses that are given, and wrong by some; is
//   what is stated true?
// Ends with 1 when a figure falls short.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "calib/board/board_detector.h"
#include "calib/report/advice.h"
#include "calib/report/calibration_report.h"
#include "calib/solver/extrinsics.h"
#include "calib/solver/world_frame.h"
#include "solver/odd_lens.h"

namespace {

using namespace huetrack;
using Eigen::Vector2d;
using Eigen::Vector3d;

int short_of = 0;

void figure(const char* what, double value, const char* unit, double low, double high) {
  const bool good = value >= low && value <= high;
  short_of += good ? 0 : 1;
  std::printf("  %-64s %9.3f %-3s (%g .. %g)%s\n", what, value, unit, low, high, good ? "" : "  FALLS SHORT");
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[std::size_t(share * double(values.size() - 1) + 0.5)];
}

// ---- what a rig makes of a volume that the true lenses see

struct VolumeError {
  double rms_m = 0;
  int inside = 0, all = 0;  // components inside their 95 % bounds
  double centres_m = 0;     // rms of the cameras' centres
};

using Project = std::function<std::optional<Vector2d>(std::size_t camera, const Vector3d& p_cam)>;

// stated: for places in the found world; may be empty.
VolumeError volume_error(const calib::CameraRig& truth, const Project& project, const calib::CameraRig& found,
                         const Vector3d& low, const Vector3d& high) {
  std::vector<Vector3d> true_points, found_points;
  std::vector<std::vector<calib::PlaceView>> views;
  constexpr int steps = 6;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      for (int k = 0; k <= steps; ++k) {
        const Vector3d p = low + (high - low).cwiseProduct(Vector3d(i, j, k) / steps);
        std::vector<std::pair<int, Vector2d>> pixels;
        std::vector<calib::PlaceView> seen;
        for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
          const auto px = project(c, truth.cameras[c].cam_from_world * p);
          if (!px || !truth.cameras[c].contains({*px})) continue;
          pixels.emplace_back(int(c), *px);
          seen.push_back({int(c), Eigen::Matrix2d::Identity()});
        }
        if (pixels.size() < 2) continue;
        true_points.push_back(p);
        found_points.push_back(solver::triangulate(found, pixels));
        views.push_back(seen);
      }
    }
  }
  const solver::WorldChange change = solver::align_points(found_points, true_points, false);
  VolumeError error;
  for (std::size_t k = 0; k < true_points.size(); ++k) {
    const Vector3d off = change * found_points[k] - true_points[k];
    error.rms_m += off.squaredNorm() / double(true_points.size());
    if (!found.uncertainty) continue;
    const Eigen::Matrix3d covariance = calib::rig_covariance_at(found, found_points[k], views[k]);
    const Eigen::Matrix3d turn = change.new_from_old.rotation.toRotationMatrix();
    const Eigen::Matrix3d there = turn * covariance * turn.transpose();
    for (int axis = 0; axis < 3; ++axis) {
      error.inside += std::abs(off[axis]) <= 1.96 * std::sqrt(there(axis, axis)) ? 1 : 0;
      ++error.all;
    }
  }
  error.rms_m = std::sqrt(error.rms_m);
  for (std::size_t c = 0; c < truth.cameras.size(); ++c)
    error.centres_m += (change * found.cameras[c].centre() - truth.cameras[c].centre()).squaredNorm();
  error.centres_m = std::sqrt(error.centres_m / double(truth.cameras.size()));
  return error;
}

struct Calibrated {
  calib::CameraRig rig;
  report::CalibrationReport report;
  solver::Extrinsics result;
};

// box: in the true world; stated for it as it lies in the found one, by the true cameras' places.
Calibrated calibrated(const board::Board& board, const std::vector<solver::CameraToCalibrate>& cameras,
                      const std::vector<solver::BoardView>& views, const calib::CameraRig& truth,
                      const solver::WorldBox& box, solver::RefineLens refine = solver::RefineLens::automatic) {
  solver::Extrinsics result = solver::calibrate_extrinsics(board, cameras, views, {.refine_lens = refine});
  std::vector<Vector3d> from, to;
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    const calib::Rigid3d world_from_cam = calib::inverse(result.adjustment.cameras[c].cam_from_world),
                         true_from_cam = calib::inverse(truth.cameras[c].cam_from_world);
    for (const Vector3d& p : {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)}) {
      from.push_back(world_from_cam * p);
      to.push_back(true_from_cam * p);
    }
  }
  result.adjustment =
      solver::in_world(std::move(result.adjustment), solver::align_points(from, to, false).new_from_old);
  report::ReportInput input;
  input.volume = box;
  Calibrated out{solver::rig_of(result.adjustment), report::report_on(result, input), {}};
  if (out.report.volume) out.rig.uncertainty = solver::uncertainty_of(result.adjustment, *out.report.volume);
  out.result = std::move(result);
  return out;
}

double stated_rms_m(const report::CalibrationReport& report) {
  double sum = 0;
  int seen = 0;
  for (const solver::PointAccuracy& point : report.volume->points) {
    if (point.views < 2) continue;
    sum += point.by_calibration_m * point.by_calibration_m;
    ++seen;
  }
  return std::sqrt(sum / std::max(1, seen));
}

// ---- lenses

void lenses(int seeds, int first) {
  const std::vector<int> widths{70, 100, 130};
  const Vector3d low(-0.4, -0.6, 0.5), high(0.4, 0.6, 1.5);
  std::vector<double> rays[3], volumes, stated;
  int inside = 0, all = 0;
  double cpu = 0;
  std::string chosen;
  for (int seed = first; seed < first + seeds; ++seed) {
    const solver::OddCapture capture = solver::odd_capture(widths, 0.1, std::uint64_t(seed), 120);
    std::vector<solver::CameraToCalibrate> cameras;
    for (const calib::Camera& camera : capture.of.rig.cameras) cameras.push_back({camera.name, camera.image_size, {}});
    const std::clock_t before = std::clock();
    const Calibrated found = calibrated(capture.of.board, cameras, capture.of.views, capture.of.rig, {low, high});
    cpu += double(std::clock() - before) / CLOCKS_PER_SEC;
    for (std::size_t c = 0; c < 3; ++c) {
      rays[c].push_back(
          solver::rays_off_px(capture.lenses[c], found.rig.cameras[c].model, capture.of.views, int(c), {1280, 720}));
      if (seed == first) chosen += " " + std::string(solver::name(found.result.adjustment.cameras[c].lens));
    }
    const VolumeError error = volume_error(
        capture.of.rig, [&](std::size_t c, const Vector3d& p) { return capture.lenses[c].project(p); }, found.rig, low,
        high);
    volumes.push_back(error.rms_m);
    stated.push_back(stated_rms_m(found.report));
    inside += error.inside;
    all += error.all;
    std::printf("  seed %d: rays off %.2f %.2f %.2f px (95 %%), volume %.2f mm rms, stated %.2f mm, %s\n", seed,
                rays[0].back(), rays[1].back(), rays[2].back(), 1000 * error.rms_m, 1000 * stated.back(),
                std::string(report::name(found.report.verdict)).c_str());
    if (found.report.verdict != report::Verdict::usable) std::fputs(report::to_text(found.report).c_str(), stdout);
  }
  std::printf("  lenses chosen:%s\n", chosen.c_str());
  for (std::size_t c = 0; c < 3; ++c) {
    const std::string what = std::to_string(widths[c]) + " degrees: rays where boards were, 95 %, mean over seeds";
    double mean = 0;
    for (const double r : rays[c]) mean += r / double(rays[c].size());
    figure(what.c_str(), mean, "px", 0, 0.3);
  }
  double squares = 0, stated_squares = 0;
  for (std::size_t k = 0; k < volumes.size(); ++k) {
    squares += volumes[k] * volumes[k] / double(volumes.size());
    stated_squares += stated[k] * stated[k] / double(volumes.size());
  }
  figure("the volume, worst seed, rms", 1000 * quantile(volumes, 1), "mm", 0, 1);
  figure("stated / true", std::sqrt(stated_squares / squares), "", 1 / 1.5, 1.5);
  figure("inside their 95 % bounds", 100.0 * inside / all, "%", 90, 99);
  figure("time of a core, each", cpu / seeds, "s", 0, 10);
}

// ---- faults

struct Fault {
  std::string name;
  double blur_px = 0;                  // of camera 1
  Vector2d bend = Vector2d::Zero();    // m
  double stretch = 0;                  // x against y
  double moved_m = 0, turned_deg = 0;  // camera 1, from the middle on
  int frames_late = 0;                 // camera 1, of a board that moves; no stamps
  std::vector<std::string> words;      // one of these has to be in the report, with cam1 where it is a camera's
};

// What a camera sees of a chessboard: rays once per camera, then a plane for each picture.
class Renderer {
 public:
  explicit Renderer(const calib::Camera& camera) : camera_(camera) {
    for (int y = 0; y < over * camera.image_size.height; ++y) {
      for (int x = 0; x < over * camera.image_size.width; ++x) {
        const auto ray = camera.model.ray({{(x + 0.5) / over - 0.5, (y + 0.5) / over - 0.5}});
        rays_.push_back(ray ? Eigen::Vector3f(ray->cast<float>()) : Eigen::Vector3f(0, 0, -1));
      }
    }
  }

  cv::Mat picture(const calib::Rigid3d& cam_from_board, const board::Board& board, const Fault& fault, double blur_px,
                  std::mt19937_64& rng) const {
    const int width = over * camera_.image_size.width, height = over * camera_.image_size.height;
    cv::Mat large(height, width, CV_32F);
    const calib::Rigid3d board_from_cam = calib::inverse(cam_from_board);
    const Eigen::Matrix3f turn = board_from_cam.rotation.toRotationMatrix().cast<float>();
    const Eigen::Vector3f at = board_from_cam.translation.cast<float>();
    const auto pitch = float(board.pitch.x());
    const float w = float(board.columns - 1) * pitch, h = float(board.rows - 1) * pitch;
    const auto stretch = float(fault.stretch);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const Eigen::Vector3f d = turn * rays_[std::size_t(y) * std::size_t(width) + std::size_t(x)];
        float grey = 0.45F, depth = 0;
        float bx = 0, by = 0;
        for (int step = 0; step < 3; ++step) {  // onto the paraboloid
          const float u = 2 * bx / w - 1, v = 2 * by / h - 1;
          const float z = float(fault.bend.x()) * (1 - u * u) + float(fault.bend.y()) * (1 - v * v);
          depth = (z - at.z()) / d.z();
          bx = at.x() + depth * d.x();
          by = at.y() + depth * d.y();
          if (fault.bend.isZero()) break;
        }
        // As the print is stretched, its squares are elsewhere.
        const float sx = (bx - w / 2) / (1 + stretch / 2) + w / 2, sy = (by - h / 2) / (1 - stretch / 2) + h / 2;
        const float i = sx / pitch, j = sy / pitch;
        if (depth > 0 && i > -1.6F && j > -1.6F && i < float(board.columns) + 0.6F && j < float(board.rows) + 0.6F) {
          grey = 0.85F;
          if (i > -1 && j > -1 && i < float(board.columns) && j < float(board.rows))
            grey = ((int(std::floor(i)) + int(std::floor(j))) % 2 == 0) ? 0.08F : 0.85F;
        }
        large.at<float>(y, x) = grey;
      }
    }
    cv::Mat small;
    cv::resize(large, small, {camera_.image_size.width, camera_.image_size.height}, 0, 0, cv::INTER_AREA);
    cv::GaussianBlur(small, small, {}, blur_px);
    cv::Mat out(small.size(), CV_8U);
    for (int y = 0; y < small.rows; ++y) {
      for (int x = 0; x < small.cols; ++x)
        out.at<unsigned char>(y, x) =
            cv::saturate_cast<unsigned char>(double(255 * small.at<float>(y, x)) + 2 * solver::normal(rng));
    }
    return out;
  }

 private:
  static constexpr int over = 2;
  calib::Camera camera_;
  std::vector<Eigen::Vector3f> rays_;
};

struct Rendered {
  solver::SyntheticCapture of;  // its views are what the detector found
};

// Three cameras of 640x480, a board of 9 x 6 corners at 40 places, held still unless it is the frames that are late.
Rendered rendered(const Fault& fault, std::uint64_t seed) {
  Rendered out{solver::synthetic_capture({.cameras = 3, .sets = 40, .seed = seed})};
  solver::SyntheticCapture& of = out.of;
  std::mt19937_64 rng(seed + 1000);
  std::vector<Renderer> renderers;
  for (const calib::Camera& camera : of.rig.cameras) renderers.emplace_back(camera);
  const board::BoardDetector detector(of.board);
  of.views.clear();
  const calib::Rigid3d moved = calib::exp(
      (calib::Tangent6d() << 0, fault.turned_deg * std::numbers::pi / 180, 0, fault.moved_m, 0, 0).finished());
  const double usual_blur_px = 0.6;
  for (int s = 0; s < 40; ++s) {
    // Carried: 0.25 m/s and 20 degrees/s at the moment that it is seen.
    calib::Tangent6d speed;
    for (int i = 0; i < 6; ++i)
      speed(i) = (i < 3 ? 20 * std::numbers::pi / 180 : 0.25) / std::sqrt(3.0) * solver::normal(rng);
    for (int c = 0; c < 3; ++c) {
      calib::Rigid3d cam_from_world = of.rig.cameras[std::size_t(c)].cam_from_world;
      if (c == 1 && s >= 20) cam_from_world = moved * cam_from_world;
      calib::Rigid3d world_from_board = of.world_from_board[std::size_t(s)];
      if (c == 1 && fault.frames_late > 0)
        world_from_board = world_from_board * calib::exp(calib::Tangent6d(-speed * fault.frames_late / 30.0));
      const calib::Rigid3d cam_from_board = cam_from_world * world_from_board;
      if ((cam_from_board.rotation * Vector3d::UnitZ()).dot(cam_from_board.translation.normalized()) < 0.35) continue;
      const cv::Mat picture = renderers[std::size_t(c)].picture(
          cam_from_board, of.board, fault, c == 1 && fault.blur_px > 0 ? fault.blur_px : usual_blur_px, rng);
      const board::BoardDetection found =
          detector.detect({picture.data, picture.cols, picture.rows, std::ptrdiff_t(picture.step)});
      if (!found.found()) continue;
      of.views.push_back(
          {c, s, "cam" + std::to_string(c) + " set " + std::to_string(s), found.ids, found.px, {}, found.blur_px});
    }
  }
  return out;
}

void faults(int seeds) {
  const std::vector<Fault> all{
      {.name = "nothing", .words = {}},
      {.name = "blur, sigma 3 px",
       .blur_px = 3,
       .words = {"cam1: its pictures are blurred", "cam1: its corners scatter"}},
      {.name = "board bent by 4 mm", .bend = {0.004, 0}, .words = {"the board is bent"}},
      {.name = "board bent by 2 mm both ways", .bend = {0.002, -0.002}, .words = {"the board is bent"}},
      {.name = "print 0.7 % longer one way", .stretch = 0.007, .words = {"the print is stretched"}},
      {.name = "moved by 5 mm and 0.3 degrees half way",
       .moved_m = 0.005,
       .turned_deg = 0.3,
       .words = {"cam1 moved during the recording"}},
      {.name = "moved by 2 mm half way", .moved_m = 0.002, .words = {"cam1 moved during the recording"}},
      {.name = "one frame late",
       .frames_late = 1,
       .words = {"most in cam1", "cam1: its corners scatter", "views of the board contradict"}},
      {.name = "three frames late",
       .frames_late = 3,
       .words = {"most in cam1", "cam1: its corners scatter", "views of the board contradict"}},
  };
  const Vector3d low(-0.4, -0.6, 0.6), high(0.4, 0.6, 1.4);
  std::printf("  %-42s %8s %12s %12s %14s\n", "fault", "named", "true mm", "stated mm", "usable & > 2x");
  int named_all = 0, of_all = 0, dishonest_all = 0;
  for (const Fault& fault : all) {
    int named = 0, dishonest = 0, usable = 0;
    std::vector<double> truths, stated;
    std::string missed;
    for (int seed = 1; seed <= seeds; ++seed) {
      const Rendered capture = rendered(fault, std::uint64_t(seed));
      std::vector<solver::CameraToCalibrate> cameras;
      for (const calib::Camera& camera : capture.of.rig.cameras)
        cameras.push_back({camera.name, camera.image_size, {}});
      try {
        const Calibrated found = calibrated(capture.of.board, cameras, capture.of.views, capture.of.rig, {low, high});
        const VolumeError error = volume_error(
            capture.of.rig,
            [&](std::size_t c, const Vector3d& p) -> std::optional<Vector2d> {
              const auto px = capture.of.rig.cameras[c].model.project(p);
              if (!px) return std::nullopt;
              return px->px;
            },
            found.rig, low, high);
        truths.push_back(error.rms_m);
        stated.push_back(stated_rms_m(found.report));
        const bool is_usable = found.report.verdict == report::Verdict::usable;
        usable += is_usable ? 1 : 0;
        dishonest += is_usable && error.rms_m > 2 * stated.back() ? 1 : 0;
        std::string doubts;
        for (const report::Check& check : found.report.checks) {
          if (check.verdict != report::Verdict::usable) doubts += "    " + check.finding + "\n";
        }
        const bool is_named =
            fault.words.empty() ? is_usable : std::ranges::any_of(fault.words, [&](const std::string& word) {
              return doubts.find(word) != std::string::npos;
            });
        named += is_named ? 1 : 0;
        if (!is_named && missed.empty()) missed = doubts.empty() ? "    (no doubt)\n" : doubts;
      } catch (const solver::CalibrationError& error) {
        const std::string why = report::with_advice(error);
        const bool is_named = why.find("cam1") != std::string::npos;
        named += is_named ? 1 : 0;
        if (!is_named && missed.empty()) missed = "    " + why + "\n";
      }
    }
    std::printf("  %-42s %3d / %2d %12.2f %12.2f %8d  (%d usable)\n", fault.name.c_str(), named, seeds,
                1000 * quantile(truths, 0.5), 1000 * quantile(stated, 0.5), dishonest, usable);
    if (!missed.empty()) std::printf("%s", missed.c_str());
    std::fflush(stdout);
    if (!fault.words.empty()) {
      named_all += named;
      of_all += seeds;
    }
    dishonest_all += dishonest;
  }
  figure("faults named right", 100.0 * named_all / of_all, "%", 90, 100);
  figure("usable with a true error over twice the stated", dishonest_all, "", 0, 0);
}

// ---- given lenses

struct Given {
  const char* name;
  double share = 0;       // by which focal lengths are wrong
  bool all = false;       // of all cameras, in turn up and down; otherwise of camera 1
  double noise_px = 0.1;  // of corners
  double shift_px = 0;    // of all corners of a view of camera 1, as if it were not in step
  int sets = 40;
};

void given(int seeds) {
  const std::vector<Given> cases{
      {.name = "right"},
      {.name = "right, corners to 0.3 px", .noise_px = 0.3},
      {.name = "right, 12 moments", .sets = 12},
      {.name = "cam1's focal length 0.2 % off", .share = 0.002},
      {.name = "cam1's focal length 0.5 % off", .share = 0.005},
      {.name = "cam1's focal length 1 % off", .share = 0.01},
      {.name = "cam1's focal length 2 % off", .share = 0.02},
      {.name = "all 0.5 % off", .share = 0.005, .all = true},
      {.name = "all 1 % off", .share = 0.01, .all = true},
      {.name = "cam1's 0.5 % off, corners to 0.3 px", .share = 0.005, .noise_px = 0.3},
      {.name = "cam1's 1 % off, corners to 0.3 px", .share = 0.01, .noise_px = 0.3},
      {.name = "cam1's 1 % off, 12 moments", .share = 0.01, .sets = 12},
      {.name = "right, cam1's views 0.05 px aside", .shift_px = 0.05},
      {.name = "right, cam1's views 0.1 px aside", .shift_px = 0.1},
      {.name = "right, cam1's views 0.3 px aside", .shift_px = 0.3},
      {.name = "right, cam1's views 1 px aside", .shift_px = 1},
  };
  const Vector3d low(-0.4, -0.6, 0.6), high(0.4, 0.6, 1.4);
  std::printf("  %-38s %-5s %9s %9s %8s %9s %9s %9s\n", "given", "lens", "true mm", "stated", "inside", "centres",
              "stated", "refined");
  for (const Given& is : cases) {
    for (const auto refine : {solver::RefineLens::automatic, solver::RefineLens::no}) {
      double squares = 0, stated_squares = 0, centre_squares = 0, stated_centre_squares = 0;
      int inside = 0, all = 0, refined = 0, usable = 0;
      for (int seed = 1; seed <= seeds; ++seed) {
        solver::SyntheticCapture of = solver::synthetic_capture(
            {.cameras = 3, .sets = is.sets, .noise_px = is.noise_px, .seed = std::uint64_t(seed)});
        std::mt19937_64 rng(std::uint64_t(seed) + 500);
        for (solver::BoardView& view : of.views) {
          if (view.camera != 1 || is.shift_px == 0) continue;
          const Vector2d shift(is.shift_px * solver::normal(rng), is.shift_px * solver::normal(rng));
          for (Vector2d& px : view.px) px += shift;
        }
        std::vector<solver::CameraToCalibrate> cameras;
        for (std::size_t c = 0; c < 3; ++c) {
          auto lens = std::get<calib::PinholeRadtan>(of.rig.cameras[c].model.lens());
          const double factor = 1 + is.share * (is.all ? (c == 1 ? 1 : -1) : (c == 1 ? 1 : 0));
          lens.fx *= factor;
          lens.fy *= factor;
          cameras.push_back({of.rig.cameras[c].name, of.rig.cameras[c].image_size, calib::CameraModel(lens)});
        }
        const Calibrated found = calibrated(of.board, cameras, of.views, of.rig, {low, high}, refine);
        const VolumeError error = volume_error(
            of.rig,
            [&](std::size_t c, const Vector3d& p) -> std::optional<Vector2d> {
              const auto px = of.rig.cameras[c].model.project(p);
              if (!px) return std::nullopt;
              return px->px;
            },
            found.rig, low, high);
        squares += error.rms_m * error.rms_m / seeds;
        stated_squares += std::pow(stated_rms_m(found.report), 2) / seeds;
        centre_squares += error.centres_m * error.centres_m / seeds;
        for (const report::CameraReport& camera : found.report.cameras)
          stated_centre_squares += camera.centre_sigma_m * camera.centre_sigma_m / (3.0 * seeds);
        inside += error.inside;
        all += error.all;
        refined += found.result.refinement == solver::LensRefinement::kept_as_given ? 0 : 1;
        usable += found.report.verdict == report::Verdict::usable ? 1 : 0;
      }
      std::printf("  %-38s %-5s %9.2f %9.2f %7.1f%% %9.2f %9.2f %4d / %d (%d usable)\n", is.name,
                  refine == solver::RefineLens::no ? "no" : "auto", 1000 * std::sqrt(squares),
                  1000 * std::sqrt(stated_squares), 100.0 * inside / std::max(1, all), 1000 * std::sqrt(centre_squares),
                  1000 * std::sqrt(stated_centre_squares), refined, seeds, usable);
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  const int seeds = argc > 2 ? std::atoi(argv[2]) : 0;
  if (what == "lenses")
    lenses(seeds > 0 ? seeds : 30, argc > 3 ? std::atoi(argv[3]) : 1);
  else if (what == "faults")
    faults(seeds > 0 ? seeds : 10);
  else if (what == "given")
    given(seeds > 0 ? seeds : 10);
  else {
    std::fprintf(stderr, "calibration_faults lenses|faults|given [SEEDS]\n");
    return 1;
  }
  std::printf("%d figures fall short\n", short_of);
  return short_of == 0 ? 0 : 1;
}
