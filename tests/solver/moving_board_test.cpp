// A board that is carried before cameras that are not in step and read their rows one after the other: simulated with
// exact truth.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>

#include "calib/solver/extrinsics.h"
#include "drawn.h"
#include "solver/synthetic_rig.h"

namespace huetrack::solver {
namespace {

struct MovingOptions {
  double speed_m_s = 0.3, turning_deg_s = 60;  // rms
  std::array<double, 4> latency_s{0.012, 0.045, 0.0, 0.028}, readout_s{0.030, 0.015, 0.022, -0.027};
  double stamp_jitter_s = 1e-4;
  // The stamps of each are late by up to that, evenly distributed: a program took pictures that had waited.
  std::array<double, 4> age_s{};
  bool in_step = false;
  int bursts = 16, frames_of_burst = 2;
  double between_s = 0.7, frame_s = 1 / 30.0;  // of bursts, and of the frames that are looked at
  std::uint64_t seed = 1;
};

// Sines of several frequencies in place and in attitude.
class Path {
 public:
  Path(const MovingOptions& options, const Eigen::Vector3d& board_centre) : centre_(board_centre) {
    std::mt19937_64 rng(options.seed + 100);
    constexpr std::array<double, 4> hertz{0.13, 0.29, 0.47, 0.71};
    for (int axis = 0; axis < 6; ++axis) {
      const double rms =
          (axis < 3 ? options.speed_m_s : options.turning_deg_s * std::numbers::pi / 180) / std::sqrt(3.0);
      for (std::size_t k = 0; k < hertz.size(); ++k) {
        const double omega = 2 * std::numbers::pi * hertz[k] * (0.9 + 0.2 * uniform(rng));
        waves_[static_cast<std::size_t>(axis)][k] = {rms * std::sqrt(2.0 / hertz.size()) / omega, omega,
                                                     2 * std::numbers::pi * uniform(rng)};
      }
    }
  }
  calib::Rigid3d at(double t) const {
    Eigen::Matrix<double, 6, 1> x = Eigen::Matrix<double, 6, 1>::Zero();
    for (int axis = 0; axis < 6; ++axis) {
      for (const auto& [size, omega, phase] : waves_[static_cast<std::size_t>(axis)])
        x(axis) += size * std::sin(omega * t + phase);
    }
    Eigen::Matrix3d facing;
    facing.col(2) = -Eigen::Vector3d::UnitX();
    facing.col(0) = Eigen::Vector3d::UnitY();
    facing.col(1) = facing.col(2).cross(facing.col(0));
    const Eigen::Vector3d turn = x.tail<3>();
    const Eigen::Quaterniond rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * Eigen::Quaterniond(facing);
    return {rotation, Eigen::Vector3d(0, 0, 1) + x.head<3>() - rotation * centre_};
  }

 private:
  Eigen::Vector3d centre_;
  std::array<std::array<std::array<double, 3>, 4>, 6> waves_;
};

struct MovingCapture {
  SyntheticCapture of;  // rig, board, views
  std::vector<double> set_at_s;
};

MovingCapture moving_capture(const MovingOptions& options = {}) {
  MovingCapture capture{synthetic_capture({.sets = 1, .columns = 8}), {}};
  capture.of.views.clear();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (int id = 0; id < capture.of.board.point_count(); ++id)
    centre += capture.of.board.point(id) / capture.of.board.point_count();
  const Path path(options, centre);
  std::mt19937_64 rng(options.seed);
  std::array<double, 4> phase_s{}, period_s{};
  for (std::size_t c = 0; c < 4; ++c) {
    phase_s[c] = options.in_step ? 0 : uniform(rng) / 30;
    period_s[c] = options.in_step ? 1 / 30.0 : (1 + 0.004 * (uniform(rng) - 0.5)) / 30;
  }
  for (int burst = 0; burst < options.bursts; ++burst) {
    for (int frame = 0; frame < options.frames_of_burst; ++frame) {
      const double around_s = burst * options.between_s + frame * options.frame_s;  // by the stamps
      const int set = static_cast<int>(capture.set_at_s.size());
      capture.set_at_s.push_back(around_s);
      for (std::size_t c = 0; c < 4; ++c) {
        const calib::Camera& camera = capture.of.rig.cameras[c];
        const double count = std::round((around_s - options.latency_s[c] - phase_s[c]) / period_s[c]);
        const double middle_s = phase_s[c] + count * period_s[c];
        BoardView view{static_cast<int>(c), set, camera.name + " set " + std::to_string(set), {}, {}};
        view.stamp_s = middle_s + options.latency_s[c] + options.stamp_jitter_s * normal(rng) +
                       options.age_s[c] * (options.age_s[c] > 0 ? uniform(rng) : 0);
        for (int id = 0; id < capture.of.board.point_count(); ++id) {
          double at_s = middle_s;
          std::optional<calib::RawPixel> px;
          for (int iteration = 0; iteration < 6; ++iteration) {
            px = camera.project_world(path.at(at_s) * capture.of.board.point(id));
            if (!px) break;
            at_s = middle_s + (px->px.y() / (camera.image_size.height - 1) - 0.5) * options.readout_s[c];
          }
          const Eigen::Vector2d error = 0.1 * drawn<2>(rng, normal);
          if (!px || !camera.contains({px->px + error})) continue;
          view.ids.push_back(id);
          view.px.push_back(px->px + error);
        }
        if (view.ids.size() >= 12) capture.of.views.push_back(std::move(view));
      }
    }
  }
  return capture;
}

std::vector<CameraToCalibrate> cameras_as_known(const calib::CameraRig& rig) {
  std::vector<CameraToCalibrate> cameras;
  for (const calib::Camera& camera : rig.cameras) cameras.push_back({camera.name, camera.image_size, camera.model});
  return cameras;
}

int dropped(const Adjustment& a) {
  return static_cast<int>(std::ranges::count_if(a.fits, [](const ViewFit& fit) { return fit.dropped.has_value(); }));
}

// Squared errors of the poses, in standard deviations, per number: about 1 where what is stated is true.
double mean_square_in_sigmas(const MovingCapture& capture, const Adjustment& a) {
  double sum = 0;
  const calib::Rigid3d first_from_world = capture.of.rig.cameras[0].cam_from_world;
  for (std::size_t c = 1; c < 4; ++c) {
    const calib::Tangent6d error =
        calib::log(capture.of.rig.cameras[c].cam_from_world * calib::inverse(first_from_world) *
                   calib::inverse(a.cameras[c].cam_from_world * calib::inverse(a.cameras[0].cam_from_world)));
    const Eigen::Matrix<double, 6, 6> covariance = a.covariance.block<6, 6>(a.pose_offset[c], a.pose_offset[c]);
    sum += error.dot(covariance.ldlt().solve(error));
  }
  return sum / 18;
}

void print(const char* what, const MovingCapture& capture, const MovingOptions& options, const Adjustment& a) {
  std::printf("%s: %zu views, %d dropped, noise %.3f px, volume %.2f mm, poses %.2f, stamps +- %.3f ms\n", what,
              a.views.size(), dropped(a), a.noise_px,
              1000 * volume_rms_m(capture.of.rig, rig_of(a), {-0.5, -0.5, 0.5}, {0.5, 0.5, 1.5}),
              mean_square_in_sigmas(capture, a), 1000 * a.stamp_sigma_s);
  for (std::size_t c = 0; c < 4; ++c) {
    std::printf("  cam%zu: latency off by %.3f +- %.3f ms, readout by %.3f +- %.3f ms\n", c,
                1000 * (a.cameras[c].latency.value_s - options.latency_s[c] + options.latency_s[0]),
                1000 * a.cameras[c].latency.sigma_s, 1000 * (a.cameras[c].readout.value_s - options.readout_s[c]),
                1000 * a.cameras[c].readout.sigma_s);
  }
}

constexpr double volume_limit_m = 0.0006;

double volume_error_m(const MovingCapture& capture, const Adjustment& a) {
  return volume_rms_m(capture.of.rig, rig_of(a), {-0.5, -0.5, 0.5}, {0.5, 0.5, 1.5});
}

Adjustment found(const MovingCapture& capture) {
  return calibrate_extrinsics(capture.of.board, cameras_as_known(capture.of.rig), capture.of.views).adjustment;
}

TEST(MovingBoard, EstimatesTimesAndPosesFromAHandCarriedBoard) {
  double off = 0;
  for (const std::uint64_t seed : {1, 2}) {
    const MovingOptions options{.bursts = 20, .seed = seed};
    const MovingCapture capture = moving_capture(options);
    const Adjustment a = found(capture);
    print("carried", capture, options, a);
    EXPECT_EQ(dropped(a), 0);
    EXPECT_NEAR(a.noise_px, 0.1, 0.02);
    EXPECT_LT(volume_error_m(capture, a), volume_limit_m);
    off += mean_square_in_sigmas(capture, a) / 2;
    const calib::CameraRig rig = rig_of(a);
    for (std::size_t c = 0; c < 4; ++c) {
      const calib::CameraTiming& timing = rig.cameras[c].timing;
      ASSERT_TRUE(timing.latency_s && timing.readout_s);
      EXPECT_NEAR(*timing.latency_s, options.latency_s[c] - options.latency_s[0], 0.001);
      EXPECT_NEAR(*timing.readout_s, options.readout_s[c], 0.002);
      EXPECT_LT(std::abs(*timing.readout_s - options.readout_s[c]), 4 * *timing.readout_sigma_s);
      EXPECT_EQ(timing.latency_sigma_s.has_value(), c > 0);  // the first one's clock is the rig's
    }
  }
  EXPECT_LT(off, 2);
}

// A program that takes six pictures a second of cameras that make thirty, and notes when it took them.
const MovingOptions fetched_six_times_a_second{.speed_m_s = 0.2,
                                               .turning_deg_s = 30,
                                               .age_s = {0.033, 0.033, 0.033, 0.033},
                                               .bursts = 1,
                                               .frames_of_burst = 36,
                                               .frame_s = 1 / 6.0};
TEST(MovingBoard, EstimatesLargeErrorsOfFetchStamps) {
  const MovingOptions& options = fetched_six_times_a_second;
  const MovingCapture capture = moving_capture(options);
  const Adjustment a = found(capture);
  print("fetched", capture, options, a);
  EXPECT_EQ(dropped(a), 0);
  EXPECT_NEAR(a.noise_px, 0.1, 0.03);
  EXPECT_LT(volume_error_m(capture, a), 0.0015);
  EXPECT_NEAR(a.stamp_sigma_s, 0.033 / std::sqrt(12.0), 0.004);
  // Their mean is the program's as much as the cameras'.
  for (const calib::Camera& camera : rig_of(a).cameras) EXPECT_EQ(camera.timing, calib::CameraTiming{});
}

// One of them makes ten pictures a second, so that the one that is taken may be a tenth of a second old.
TEST(MovingBoard, EstimatesStampErrorsPerCamera) {
  double off = 0;
  for (const std::uint64_t seed : {4, 5}) {
    const MovingOptions options{.speed_m_s = 0.12,
                                .turning_deg_s = 25,
                                .age_s = {0.033, 0.1, 0.033, 0.033},
                                .bursts = 1,
                                .frames_of_burst = 48,
                                .frame_s = 1 / 6.0,
                                .seed = seed};
    const MovingCapture capture = moving_capture(options);
    const Adjustment a = found(capture);
    print("ten a second", capture, options, a);
    EXPECT_EQ(dropped(a), 0);
    EXPECT_NEAR(a.noise_px, 0.1, 0.02);
    EXPECT_LT(volume_error_m(capture, a), volume_limit_m);
    for (std::size_t c = 0; c < 4; ++c)
      EXPECT_NEAR(a.cameras[c].stamp_sigma_s, options.age_s[c] / std::sqrt(12.0),
                  0.4 * options.age_s[c] / std::sqrt(12.0));
    // A hand's real changes, not what hands may do: 25 degrees/s at some 0.5 Hz, and 0.12 m/s.
    EXPECT_LT(a.motion_prior.change[0], 3);
    EXPECT_LT(a.motion_prior.change[1], 0.6);
    off += mean_square_in_sigmas(capture, a) / 2;
  }
  EXPECT_LT(off, 2);
}

// Held, what is wrong in them would go into the times and the poses. A camera's own views cannot tell it from its rows.
TEST(MovingBoard, RefinesGivenLensesThatContradictOneAnother) {
  MovingOptions options = fetched_six_times_a_second;
  options.seed = 6;
  const MovingCapture capture = moving_capture(options);
  auto wrong = cameras_as_known(capture.of.rig);
  for (const std::size_t c : {0, 2}) {
    auto lens = std::get<calib::PinholeRadtan>(wrong[c].model->lens());
    lens.fx *= c == 0 ? 1.009 : 0.991;
    lens.fy *= c == 0 ? 1.011 : 0.987;
    lens.distortion[0] += c == 0 ? 0.01 : -0.01;
    wrong[c].model = calib::CameraModel(lens);
  }
  const auto calibrate = [&](const std::vector<CameraToCalibrate>& cameras, RefineLens refine) {
    return calibrate_extrinsics(capture.of.board, cameras, capture.of.views, {.refine_lens = refine});
  };
  const Extrinsics held = calibrate(wrong, RefineLens::no), refined = calibrate(wrong, RefineLens::automatic);
  print("held", capture, options, held.adjustment);
  print("refined", capture, options, refined.adjustment);
  EXPECT_FALSE(refined.contradictions[0] || refined.contradictions[2]);
  EXPECT_EQ(refined.refinement, LensRefinement::given_refined);
  EXPECT_NEAR(refined.held_px, held.adjustment.noise_px, 1e-9);
  EXPECT_NEAR(refined.adjustment.noise_px, 0.1, 0.02);
  EXPECT_LT(volume_error_m(capture, refined.adjustment), 0.0015);
  EXPECT_LT(volume_error_m(capture, refined.adjustment), 0.4 * volume_error_m(capture, held.adjustment));
  // The lenses that were held counted as exact: over a hundred.
  EXPECT_LT(mean_square_in_sigmas(capture, refined.adjustment), 5);
  const Extrinsics right = calibrate(cameras_as_known(capture.of.rig), RefineLens::automatic);
  EXPECT_EQ(right.refinement, LensRefinement::kept_as_given);
  EXPECT_EQ(right.adjustment.cameras[0].parameters, parameters_of(capture.of.rig.cameras[0].model));
}

// Sets 33 ms apart tell well how the board moves: what a lens changes moves all boards, and is not to be held by where
// they were found to be with another lens.
TEST(MovingBoard, RefinesGivenLensesWithDenseSets) {
  const MovingOptions options{.bursts = 30, .seed = 1};
  const MovingCapture capture = moving_capture(options);
  // One that is wrong bends the others' times so that nearly all is explained.
  for (const bool both : {false, true}) {
    auto wrong = cameras_as_known(capture.of.rig);
    for (const std::size_t c : {0, 2}) {
      auto lens = std::get<calib::PinholeRadtan>(wrong[c].model->lens());
      lens.fx *= c == 0 ? 1.009 : both ? 0.991 : 1;
      lens.fy *= c == 0 ? 1.011 : both ? 0.987 : 1;
      wrong[c].model = calib::CameraModel(lens);
    }
    const Extrinsics refined = calibrate_extrinsics(capture.of.board, wrong, capture.of.views);
    print("refined, carried", capture, options, refined.adjustment);
    EXPECT_EQ(refined.refinement, LensRefinement::given_refined) << both;
    EXPECT_NEAR(refined.adjustment.noise_px, 0.1, 0.01);
    EXPECT_LT(mean_square_in_sigmas(capture, refined.adjustment), 2.5) << both;
    const double true_px = capture.of.rig.cameras[0].model.fx();
    EXPECT_NEAR(refined.adjustment.cameras[0].parameters(0) / true_px, 1, 0.004) << both;
  }
}

TEST(MovingBoard, SynchronisedCamerasStaySynchronised) {
  const MovingOptions options{.latency_s = {}, .readout_s = {}, .stamp_jitter_s = 0, .in_step = true, .bursts = 20};
  const MovingCapture capture = moving_capture(options);
  const Adjustment a = found(capture);
  print("in step", capture, options, a);
  MovingCapture still = capture;
  for (BoardView& view : still.of.views) view.stamp_s.reset();
  const Adjustment without = found(still);
  EXPECT_TRUE(without.motions.empty());
  EXPECT_LT(volume_error_m(capture, without), volume_limit_m);
  EXPECT_LT(volume_error_m(capture, a), volume_limit_m);
  EXPECT_NEAR(a.noise_px, without.noise_px, 0.003);
  for (const AdjustedCamera& camera : a.cameras) {
    EXPECT_NEAR(camera.latency.value_s, 0, 0.0005);
    EXPECT_NEAR(camera.readout.value_s, 0, 0.002);
  }
}

// Sets too far apart to tell how the board moves in between: as stills.
TEST(MovingBoard, RestingBoardsDoNotDetermineTimes) {
  SyntheticCapture capture = synthetic_capture({.sets = 15});
  const Adjustment stills =
      calibrate_extrinsics(capture.board, cameras_as_known(capture.rig), capture.views).adjustment;
  for (BoardView& view : capture.views) view.stamp_s = view.set + 0.01 * view.camera;
  auto cameras = cameras_as_known(capture.rig);
  cameras[2].timing = {0.02, 0.001, 0.03, {}};
  const Adjustment a = calibrate_extrinsics(capture.board, cameras, capture.views).adjustment;
  EXPECT_TRUE(a.motions.empty());
  for (std::size_t c = 0; c < 4; ++c)
    EXPECT_EQ(a.cameras[c].cam_from_world.translation, stills.cameras[c].cam_from_world.translation);
  const calib::CameraRig rig = rig_of(a);  // keeps what was given, and makes nothing up
  EXPECT_EQ(rig.cameras[2].timing, cameras[2].timing);
  EXPECT_EQ(rig.cameras[1].timing, calib::CameraTiming{});
}

TEST(MovingBoard, GivenTimingIsHeldOrRefined) {
  const MovingOptions options{.seed = 3};
  const MovingCapture capture = moving_capture(options);
  auto cameras = cameras_as_known(capture.of.rig);
  cameras[1].timing = {options.latency_s[1], {}, options.readout_s[1], {}};  // exactly
  cameras[3].timing = {options.latency_s[3] + 0.002, 0.003, {}, {}};
  const Adjustment a = calibrate_extrinsics(capture.of.board, cameras, capture.of.views).adjustment;
  print("given", capture, options, a);
  const calib::CameraRig rig = rig_of(a);
  EXPECT_EQ(rig.cameras[1].timing, cameras[1].timing);
  for (const std::size_t c : {0, 2, 3}) EXPECT_NEAR(*rig.cameras[c].timing.latency_s, options.latency_s[c], 0.001);
  EXPECT_LT(*rig.cameras[3].timing.latency_sigma_s, 0.001);
}

}  // namespace
}  // namespace huetrack::solver
