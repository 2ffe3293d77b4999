#include "calib/wave/wave.h"
#include "calib/report/advice.h"
#include "calib/report/wave_report.h"
#include "calib/wave/wave_adjustment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "calib/model/rig_yaml.h"
#include "calib/solver/bundle_adjustment.h"
#include "drawn.h"
#include "wave/throwing.h"
#include "wave/waving.h"

namespace huetrack::wave {
namespace {

using Eigen::Vector3d;
using solver::Fault;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::StartsWith;

WaveOptions taped(const calib::CameraRig& rig) {
  WaveOptions options;
  options.camera_distance = CameraDistance{0, 1, (rig.cameras[0].centre() - rig.cameras[1].centre()).norm()};
  return options;
}

bool is_usable(const WaveResult& result) {
  return report::report_on(result).verdict == report::Verdict::usable;
}

solver::CalibrationError failure(const calib::CameraRig& rig, const std::vector<BallFrame>& frames,
                                 const WaveOptions& options) {
  try {
    calibrate_wave(rig, frames, options);
  } catch (const solver::CalibrationError& error) {
    return error;
  }
  return solver::CalibrationError("no failure");
}

auto finds(Fault fault, const testing::Matcher<std::string>& fact) {
  return AllOf(
      testing::Property(&solver::CalibrationError::fault, fault),
      testing::ResultOf([](const solver::CalibrationError& error) { return std::string(error.what()); }, fact));
}

// What people read: the fact, and what to do.
auto advises(const testing::Matcher<std::string>& text) {
  return testing::ResultOf([](const solver::CalibrationError& error) { return report::with_advice(error); }, text);
}

TEST(Wave, CorrectsSpoiltPoses) {
  const calib::CameraRig truth = rig_of(3);
  const WaveResult r = calibrate_wave(spoilt(truth, 0.1, 3), waved(truth, {.wrong = 0.2}), taped(truth));
  EXPECT_LT(off(r.rig, truth).metres, 0.003);
  EXPECT_LT(off(r.rig, truth).degrees, 0.05);
  EXPECT_TRUE(is_usable(r)) << report::to_text(report::report_on(r), r);
  EXPECT_LT(r.expected_m, 0.003);
  EXPECT_GT(r.expected_m, 0.00005);
}

// A shirt or an arm: in every picture something of the colour that is larger than the ball.
TEST(Wave, FindsTheBallAmongLargerRegions) {
  const calib::CameraRig truth = rig_of(3);
  const WaveResult r = calibrate_wave(spoilt(truth, 0.05, 2), waved(truth, {.wrong = 1}), taped(truth));
  EXPECT_LT(off(r.rig, truth).metres, 0.003);
  for (const WaveCamera& camera : r.cameras) EXPECT_GT(camera.used, 0.8 * camera.frames);
  // With exact poses, too: what else has the colour does not speak against them.
  WaveOptions timed;
  timed.radius_m = taped(truth).radius_m, timed.hold_poses = true;
  EXPECT_GT(calibrate_wave(truth, waved(truth, {.wrong = 1}), timed).cameras[0].used, 100);
}

calib::CameraRig with_lenses(calib::CameraRig rig, const std::function<void(calib::PinholeRadtan&)>& change) {
  for (calib::Camera& camera : rig.cameras) {
    auto lens = std::get<calib::PinholeRadtan>(camera.model.lens());
    change(lens);
    camera.model = calib::CameraModel(lens);
  }
  return rig;
}

TEST(Wave, AGivenLensThatFitsStays) {
  const calib::CameraRig truth = rig_of(3);
  const WaveResult r = calibrate_wave(truth, waved(truth, {.seconds = 12}), taped(truth));
  for (const WaveCamera& camera : r.cameras) {
    EXPECT_LT(camera.lens_px, 0.2);
    EXPECT_LT(std::abs(camera.longer), 5e-4);
  }
  EXPECT_THAT(report::report_on(r).notes, testing::Not(Contains(HasSubstr("lens does not fit"))));
}

TEST(Wave, CorrectsAndNamesAWrongLens) {
  const calib::CameraRig truth = rig_of(3);
  calib::CameraRig given = spoilt(truth, 0.05, 1);
  auto lens = std::get<calib::PinholeRadtan>(given.cameras[1].model.lens());
  lens.fx *= 1.04, lens.fy *= 1.04;
  given.cameras[1].model = calib::CameraModel(lens);
  const WaveResult r = calibrate_wave(given, waved(truth, {.seconds = 12}), taped(truth));
  EXPECT_NEAR(r.cameras[1].longer, 1 / 1.04 - 1, 0.004);
  EXPECT_LT(off(r.rig, truth).metres, 0.004);
  EXPECT_THAT(report::report_on(r).notes,
              Contains(AllOf(StartsWith("cam1's lens does not fit"), HasSubstr("shorter"))));
  EXPECT_THAT(report::report_on(r).doubts, Contains(StartsWith("cam1's focal length was given wrong")));
  EXPECT_LT(r.cameras[0].lens_px, 0.5);
}

// Of nothing but the size of the pictures: lenses of 60 degrees without distortion. Pixels are squares.
TEST(Wave, FindsLensesFromNothing) {
  for (const double focal : {320.0, 480.0, 640.0}) {
    const auto squared = [focal](calib::PinholeRadtan& lens) { lens.fx = lens.fy = focal + lens.fx - 480; };
    const calib::CameraRig truth = with_lenses(rig_of(3), squared);
    const calib::CameraRig guess = with_lenses(
        rig_of(3), [](calib::PinholeRadtan& lens) { lens = {.fx = 554, .fy = 554, .cx = 319.5, .cy = 239.5}; });
    WaveOptions options = taped(truth);
    options.has_poses = false, options.guessed_lenses = true;
    const WaveResult r = calibrate_wave(guess, waved(truth, {.seconds = 16}), options);
    for (std::size_t c = 0; c < 3; ++c) {
      const double longer = r.rig.cameras[c].model.fx() / truth.cameras[c].model.fx() - 1;
      EXPECT_LT(std::abs(longer), 3 * r.cameras[c].longer_sigma) << focal << ", camera " << c;
      EXPECT_LT(r.cameras[c].longer_sigma, 0.02) << focal << ", camera " << c;
    }
    EXPECT_LT(off(r.rig, truth).metres, 0.03) << focal;
  }
}

// The rig's own poses are a few centimetres off, and the tape a tenth.
TEST(Wave, MeasuredDistanceThatContradictsTheRigIsDoubtful) {
  const calib::CameraRig truth = rig_of(3);
  WaveOptions options = taped(truth);
  for (const double factor : {0.9, 1.1}) {
    options.camera_distance->metres = factor * taped(truth).camera_distance->metres;
    const WaveResult r = calibrate_wave(spoilt(truth, 0.03, 1), waved(truth, {}), options);
    EXPECT_NEAR(r.scale.over_rig, factor, 0.03);
    EXPECT_LT(r.scale.rig_sigma, 0.03);
    const report::WaveReport report = report::report_on(r);
    EXPECT_EQ(report.verdict, report::Verdict::doubtful);
    EXPECT_THAT(report::to_text(report, r), testing::HasSubstr("measured from lens to lens, in metres?"));
  }
}

// A wrong size draws path and cameras together: what is said is the size, not that nothing moved.
TEST(Wave, ReportsWrongRadiusOrDistanceInsteadOfTooLittleMotion) {
  const calib::CameraRig truth = rig_of(3);
  const calib::CameraRig start = spoilt(truth, 0.03, 1);
  WaveOptions options = taped(truth);
  const double right_m = options.radius_m;
  for (const double factor : {2.0, 10.0}) {
    options.radius_m = factor * right_m;
    EXPECT_THAT(failure(start, waved(truth, {}), options),
                AllOf(finds(Fault::wrong_radius, AllOf(StartsWith("by the rig the ball has a radius of about 4"),
                                                       HasSubstr("mm was given."))),
                      advises(HasSubstr("was given: measure it, and correct it. As it was given, no rig was found"))));
  }
  options.radius_m = right_m;
  options.camera_distance->metres /= 1000;
  EXPECT_THAT(failure(start, waved(truth, {}), options),
              AllOf(finds(Fault::wrong_distance, StartsWith("the distance between ")),
                    advises(HasSubstr("by the rig: was it measured from lens to lens, in metres?"))));
  // Two things that are wrong, each with what to do about it; and what came of them.
  WaveOptions both = options;
  both.radius_m = 10 * right_m;
  EXPECT_THAT(failure(start, waved(truth, {}), both),
              AllOf(finds(Fault::wrong_distance, HasSubstr("m by the rig; and by the rig the ball has a radius of")),
                    advises(AllOf(HasSubstr("correct it first; and by the rig the ball"),
                                  HasSubstr("was given: measure it, and correct it. As it was given, no rig was")))));
  options.has_poses = false;
  EXPECT_THAT(failure(truth, waved(truth, {}), options),
              AllOf(finds(Fault::wrong_scale, StartsWith("at the scale that was given the ball has a radius of ")),
                    advises(AllOf(HasSubstr("mm was given: correct the radius, or the measured distance, which is in "
                                            "metres"),
                                  testing::Not(HasSubstr("no rig was found"))))));
}

TEST(Wave, PredictsErrorInTheWholeVolume) {
  const calib::CameraRig truth = rig_of(3);
  WaveOptions options = taped(truth);
  options.volume = solver::WorldBox{{-1, -1, 0.2}, {1, 1, 1.8}};
  int calls = 0, last = -1;
  options.progress = [&](const std::string&, int done, int total) {
    EXPECT_LE(last, done);
    EXPECT_LT(done, total);
    last = done;
    ++calls;
  };
  const WaveResult r = calibrate_wave(truth, waved(truth, {.seconds = 4}), options);
  EXPECT_GT(calls, 5);
  ASSERT_TRUE(r.expected_in_volume_m);
  EXPECT_GT(*r.expected_in_volume_m, r.expected_m);  // where the ball was not, it is worse
  EXPECT_LT(*r.expected_in_volume_m, 10 * r.expected_m);
  EXPECT_LT(r.halves_m, 3 * r.halves_sigma_m);
}

// Errors that are correlated as the model says: the covariance says how wrong the poses are then.
TEST(Wave, CovarianceMatchesCorrelatedErrors) {
  const calib::CameraRig truth = rig_of(3);
  constexpr double noise_px = 0.15, step_s = 1.0 / 30;
  const OutlineCorrelation correlation;
  WaveState start;
  for (const calib::Camera& camera : truth.cameras) start.cam_from_world.push_back(camera.cam_from_world);
  start.path = BallPath::over(0, 3, step_s);
  for (std::size_t k = 0; k < start.path.control.size(); ++k)
    start.path.control[k] = lissajous((static_cast<double>(k) - 1) * step_s);
  std::mt19937_64 rng(5);
  std::normal_distribution<double> normal;
  const auto pair = [&] { return drawn<2>(rng, normal); };
  constexpr int trials = 20;
  double independent = 0, correlated = 0;  // squared errors of a camera's pose in their own standard deviations
  for (int trial = 0; trial < trials; ++trial) {
    std::vector<BallObservation> seen;
    for (int c = 0; c < 3; ++c) {
      const calib::Camera& camera = truth.cameras[static_cast<std::size_t>(c)];
      const Eigen::Vector2d lasting = pair();
      Eigen::Vector2d slow = pair();
      const double kept = std::exp(-step_s / correlation.slow_s);
      for (int i = 0; i < 90; ++i) {
        const double t = i * step_s;
        const auto px = outline_centre(camera.model, camera.cam_from_world * lissajous(t), 0.04);
        ASSERT_TRUE(px);
        slow = kept * slow + std::sqrt(1 - kept * kept) * pair();
        const Eigen::Vector2d error = std::sqrt(correlation.constant_share) * lasting +
                                      std::sqrt(correlation.slow_share) * slow +
                                      std::sqrt(1 - correlation.constant_share - correlation.slow_share) * pair();
        seen.push_back({c, t, *px + noise_px * error, noise_px * noise_px * Eigen::Matrix2d::Identity()});
      }
    }
    for (const bool with_correlation : {true, false}) {
      WaveState state = start;
      WaveAdjustmentOptions options{.loss = 1000, .with_covariance = true};
      if (!with_correlation) options.correlation = {.constant_share = 0, .slow_share = 0};
      const WaveFit fit = adjust_wave(truth, seen, state, options);
      const calib::Rigid3d &found = state.cam_from_world[2], &was = truth.cameras[2].cam_from_world;
      const Eigen::AngleAxisd turn(found.rotation.conjugate() * was.rotation);
      Eigen::Matrix<double, 6, 1> error;
      error << calib::inverse(was).translation - calib::inverse(found).translation, turn.angle() * turn.axis();
      const Eigen::Matrix<double, 6, 6> own = fit.covariance.block<6, 6>(12, 12);
      (with_correlation ? correlated : independent) += error.dot(own.ldlt().solve(error)) / 6 / trials;
    }
  }
  EXPECT_NEAR(correlated, 1, 0.35);
  EXPECT_GT(independent, 2);  // so one would believe too much
}

TEST(Wave, CamerasNeedNotBeSynchronised) {
  const calib::CameraRig truth = rig_of(3);
  const auto frames = waved(truth, {.offset_s = {0, 0.011, 0.023}});
  EXPECT_LT(off(calibrate_wave(spoilt(truth, 0.1, 3), frames, taped(truth)).rig, truth).metres, 0.003);
}

const std::vector<CameraTime> webcam_times{{0.012, 0.024}, {0.045, 0.031}, {0.002, -0.018}};

// Latencies against the first camera's, and readouts; in their own standard deviations and as such.
void expect_times(const WaveResult& found, const std::vector<CameraTime>& truth) {
  for (std::size_t c = 0; c < truth.size(); ++c) {
    const calib::CameraTiming& timing = found.rig.cameras[c].timing;
    ASSERT_TRUE(timing.latency_s && timing.readout_s && timing.latency_sigma_s && timing.readout_sigma_s);
    const double latency_off = *timing.latency_s - (truth[c].latency_s - truth[0].latency_s);
    const double readout_off = *timing.readout_s - truth[c].readout_s;
    EXPECT_LE(std::abs(latency_off), 3 * *timing.latency_sigma_s) << "camera " << c;
    EXPECT_LT(std::abs(readout_off), 3 * *timing.readout_sigma_s) << "camera " << c;
    EXPECT_LT(std::abs(latency_off), 0.001) << "camera " << c;
    EXPECT_LT(std::abs(readout_off), 0.002) << "camera " << c;
  }
  EXPECT_EQ(*found.rig.cameras[0].timing.latency_s, 0);
  EXPECT_EQ(*found.rig.cameras[0].timing.latency_sigma_s, 0);
}

TEST(Wave, FindsLatenciesAndReadoutsWithThePoses) {
  const calib::CameraRig truth = rig_of(3);
  const auto frames = waved(truth, {.offset_s = {0, 0.011, 0.023}, .times = webcam_times});
  const WaveResult r = calibrate_wave(spoilt(truth, 0.1, 3), frames, taped(truth));
  EXPECT_LT(off(r.rig, truth).metres, 0.003);
  EXPECT_TRUE(is_usable(r)) << report::to_text(report::report_on(r), r);
  expect_times(r, webcam_times);
}

TEST(Wave, ReadoutLongerThanAFrameIsDoubtful) {
  const calib::CameraRig truth = rig_of(3);
  WaveResult r = calibrate_wave(spoilt(truth, 0.1, 3), waved(truth, {.times = webcam_times}), taped(truth));
  ASSERT_TRUE(is_usable(r));
  ASSERT_NEAR(r.cameras[1].frame_s, 1.0 / 30, 0.002);
  r.rig.cameras[1].timing.readout_s = -0.055;
  const report::WaveReport report = report::report_on(r);
  EXPECT_EQ(report.verdict, report::Verdict::doubtful);
  EXPECT_THAT(report::to_text(report, r), HasSubstr("its readout would take 55 ms"));
}

TEST(Wave, SynchronisedCamerasHaveNoLatency) {
  const calib::CameraRig truth = rig_of(3);
  expect_times(calibrate_wave(spoilt(truth, 0.1, 3), waved(truth, {}), taped(truth)), {{}, {}, {}});
}

TEST(Wave, FindsTimesAndPosesFromNothing) {
  const calib::CameraRig truth = rig_of(3);
  WaveOptions options = taped(truth);
  options.has_poses = false;
  const WaveResult r = calibrate_wave(truth, waved(truth, {.times = webcam_times}), options);
  EXPECT_LT(off(r.rig, truth).metres, 0.003);
  expect_times(r, webcam_times);
}

TEST(Wave, FindsTimesWithThePosesHeld) {
  const calib::CameraRig truth = rig_of(3);
  WaveOptions options;
  options.hold_poses = true;
  const WaveResult r = calibrate_wave(truth, waved(truth, {.times = webcam_times}), options);
  expect_times(r, webcam_times);
  EXPECT_TRUE(is_usable(r)) << report::to_text(report::report_on(r), r);
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_EQ((r.rig.cameras[c].centre() - truth.cameras[c].centre()).norm(), 0) << "camera " << c;
  // The times are all that it is for: where they stay open it has found nothing.
  WaveResult open = r;
  open.rig.cameras[1].timing.latency_sigma_s = 0.011;
  const report::WaveReport report = report::report_on(open);
  EXPECT_EQ(report.verdict, report::Verdict::doubtful);
  EXPECT_THAT(report.doubts, Contains("cam1: its latency is known to only +- 11 ms: wave faster, for longer, and in "
                                      "every direction"));
  // Poses that are not right are found out.
  EXPECT_THAT(failure(spoilt(truth, 0.05, 1), waved(truth, {.times = webcam_times}), options),
              finds(Fault::wrong_poses, HasSubstr("agree with the poses that the rig has")));
}

TEST(Wave, ALargeErrorIsSaidOnceWithItsLimit) {
  const calib::CameraRig truth = rig_of(3);
  WaveResult r = calibrate_wave(truth, waved(truth, {.times = webcam_times}), taped(truth));
  r.camera_distance_m = 2;
  r.expected_m = 0.008;
  r.by_scale_m = 0.006;
  r.expected_in_volume_m.reset();
  const report::WaveReport report = report::report_on(r);
  ASSERT_EQ(report.doubts.size(), 1u) << report::to_text(report, r);
  EXPECT_THAT(report.doubts[0], HasSubstr("positions is 10.0 mm, 8.0 mm without the scale's part, above the limit of "
                                          "6.0 mm, 0.3 % of the cameras' distance: wave for longer"));
  const auto times_in = [](const std::string& text) {
    int count = 0;
    for (auto at = text.find("is 10.0 mm"); at != std::string::npos; at = text.find("is 10.0 mm", at + 1)) ++count;
    return count;
  };
  EXPECT_EQ(times_in(report::summary(report, r)), 1);
  EXPECT_EQ(times_in(report::to_text(report, r)), 1);
}

struct TimeFault {
  const char* what;
  std::function<void(std::vector<BallFrame>&)> put;  // in camera 1
  const char* doubt;                                 // "": none is needed
};

std::function<void(std::vector<BallFrame>&)> late(const std::function<double(double)>& by) {
  return [by](std::vector<BallFrame>& frames) {
    for (BallFrame& f : frames) f.t_s += f.camera == 1 ? by(f.t_s) : 0;
  };
}

// Nothing is called usable that is off by more than three times what is stated; what is wrong is named.
TEST(Wave, ReportsTimingFaults) {
  const calib::CameraRig truth = rig_of(3);
  const Waving waving{.offset_s = {0, 0.011, 0.023}, .times = webcam_times};
  const auto repeat = [](std::vector<BallFrame>& frames) {
    BallFrame* before = nullptr;
    int number = 0;
    for (BallFrame& f : frames) {
      if (f.camera != 1) continue;
      if (before != nullptr && ++number % 3 == 0) f.regions = before->regions;
      before = &f;
    }
  };
  for (const TimeFault& fault : {
           TimeFault{"nothing", late([](double) { return 0.0; }), ""},
           TimeFault{"late by much", late([](double) { return 0.12; }), ""},
           TimeFault{"a step", late([](double t) { return t > 4 ? 0.015 : 0.0; }), "as if its time stamps drift"},
           TimeFault{"a swing", late([](double t) { return 0.012 * std::sin(2 * t); }), "as if its time stamps drift"},
           TimeFault{"another rate", late([](double t) { return 0.01 * t; }), "as if its time stamps drift"},
           TimeFault{"repeated frames", repeat, "as if it repeated frames"},
       }) {
    SCOPED_TRACE(fault.what);
    std::vector<BallFrame> frames = waved(truth, waving);
    fault.put(frames);
    const WaveResult r = calibrate_wave(spoilt(truth, 0.1, 3), frames, taped(truth));
    const report::WaveReport report = report::report_on(r);
    if (fault.doubt[0] == '\0') {
      EXPECT_TRUE(is_usable(r)) << report::to_text(report, r);
      double stated = 0;
      for (const WaveCamera& camera : r.cameras) stated = std::max(stated, camera.centre_sigma_m.norm());
      EXPECT_LT(off(r.rig, truth).metres, 1.5 * stated);
      EXPECT_LT(off(r.rig, truth).metres, 3 * stated);
    } else {
      EXPECT_THAT(report.doubts, testing::Contains(AllOf(testing::StartsWith("cam1"), HasSubstr(fault.doubt))));
    }
  }
}

// Poses and path follow a camera whose stamps swing, and leave a third of it in the residuals.
TEST(Wave, StatedUncertaintyCoversOscillatingLatency) {
  const calib::CameraRig truth = rig_of(3);
  for (const double by_s : {0.0015, 0.0025, 0.004}) {
    for (const double once_in_s : {1.7, 3.0}) {
      SCOPED_TRACE(testing::Message() << 1e3 * by_s << " ms, once in " << once_in_s << " s");
      std::vector<BallFrame> frames =
          waved(truth, {.seconds = 10, .noise_px = 0.04, .offset_s = {0, 0.011, 0.023}, .times = webcam_times});
      late([=](double t) { return by_s * std::sin(2 * std::numbers::pi * t / once_in_s); })(frames);
      const WaveResult r = calibrate_wave(spoilt(truth, 0.1, 3), frames, taped(truth));
      EXPECT_GT(r.cameras[1].wander_s, 0.6 * by_s / std::numbers::sqrt2);
      EXPECT_LT(r.cameras[1].wander_s, 2 * by_s / std::numbers::sqrt2);
      double stated = 0;
      for (const WaveCamera& camera : r.cameras) stated = std::max(stated, camera.centre_sigma_m.norm());
      EXPECT_LT(off(r.rig, truth).metres, 1.5 * stated);
    }
  }
}

// What the rig says of the times is believed as far as its own uncertainty says, unless the recording contradicts it.
TEST(Wave, TimingOfTheRigIsAPrior) {
  calib::CameraRig rig = rig_of(3);
  const auto frames = waved(rig, {.times = webcam_times});
  rig.cameras[0].timing = {0.012, 0.0, 0.024, 1e-5};
  WaveOptions options;
  options.hold_poses = true;
  const WaveResult sure = calibrate_wave(rig, frames, options);
  EXPECT_EQ(*sure.rig.cameras[0].timing.latency_s, 0.012);
  EXPECT_NEAR(*sure.rig.cameras[0].timing.readout_s, 0.024, 3e-5);
  EXPECT_NEAR(*sure.rig.cameras[1].timing.latency_s, 0.045, 0.001);
  rig.cameras[1].timing = {0.001, 1e-5, 0.031, 1e-5};
  EXPECT_NEAR(*calibrate_wave(rig, frames, options).rig.cameras[1].timing.latency_s, 0.045, 0.001);
}

TEST(Wave, FindsPosesFromNothing) {
  const calib::CameraRig truth = rig_of(4);
  WaveOptions options = taped(truth);
  options.has_poses = false;
  const WaveResult r =
      calibrate_wave(truth, waved(truth, {.hidden = [](int c, double t) { return c == 3 && t < 3; }}), options);
  EXPECT_LT(off(r.rig, truth).metres, 0.003);
  EXPECT_LT(r.rig.cameras[0].centre().norm(), 1e-9);  // the world's origin
  // Without a distance only the ball's size tells the scale, and that is said.
  options.camera_distance.reset();
  const WaveResult rough = calibrate_wave(truth, waved(truth, {}), options);
  EXPECT_FALSE(is_usable(rough));
  EXPECT_THAT(report::report_on(rough).doubts, testing::Contains(AllOf(HasSubstr("the scale is from the ball's radius"),
                                                                       HasSubstr("--camera-distance"))));
}

TEST(Wave, ReportsSwappedCameras) {
  const calib::CameraRig truth = rig_of(2);
  calib::CameraRig swapped = truth;
  std::swap(swapped.cameras[0].cam_from_world, swapped.cameras[1].cam_from_world);
  const WaveResult r = calibrate_wave(swapped, waved(truth, {}), taped(truth));
  EXPECT_FALSE(is_usable(r));
  EXPECT_LT(off(r.rig, truth).metres, 0.003);
}

TEST(Wave, MarkedPointsDefineTheWorld) {
  const calib::CameraRig truth = rig_of(3);
  WaveOptions options;
  for (const double t : {0.5, 2.0, 4.5}) options.marks.push_back({t, lissajous(t)});
  const WaveResult r = calibrate_wave(spoilt(truth, 0.1, 3), waved(truth, {.noise_px = 0.02}), options);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_LT((r.rig.cameras[c].centre() - truth.cameras[c].centre()).norm(), 0.005);
  EXPECT_TRUE(is_usable(r)) << report::to_text(report::report_on(r), r);
  options.marks[1].t_s = 50;
  EXPECT_THAT(failure(truth, waved(truth, {}), options), finds(Fault::none, HasSubstr("the mark at 50.000 s")));
}

TEST(Wave, TwoRestsSetTheScale) {
  const calib::CameraRig truth = rig_of(3);
  const auto path = [](double t) {  // holds still at 2 s and at 6 s, a second and a half each
    const auto eased = [](double from, double to, double u) {
      return from + (to - from) * (3 * u * u - 2 * u * u * u);
    };
    const double s = t < 2 ? t : t < 3.5 ? 2 : t < 6 ? eased(2, 4.2, (t - 3.5) / 2.5) : t < 7.5 ? 4.2 : 4.2 + (t - 7.5);
    return lissajous(s);
  };
  WaveOptions options;
  options.rest_distance_m = (lissajous(2) - lissajous(4.2)).norm();
  const WaveResult r = calibrate_wave(spoilt(truth, 0.1, 3), waved(truth, {.seconds = 10, .path = path}), options);
  EXPECT_LT(off(r.rig, truth).metres, 0.01);
  EXPECT_THAT(failure(truth, waved(truth, {}), options),
              finds(Fault::no_rests, HasSubstr("did not rest at two places")));
  // It rested on the floor.
  options.floor = true;
  const WaveResult r_floor = calibrate_wave(truth, waved(truth, {.seconds = 10, .path = path}), options);
  const double floor_z = std::min(lissajous(2).z(), lissajous(4.2).z()) - options.radius_m;
  EXPECT_NEAR(r_floor.rig.cameras[0].centre().z(), truth.cameras[0].centre().z() - floor_z, 0.01);
  options.has_poses = false;  // two places leave the vertical open
  EXPECT_THAT(failure(truth, waved(truth, {.seconds = 10, .path = path}), options),
              finds(Fault::no_rests, HasSubstr("the floor leaves the vertical open")));
}

double scale_of(const calib::CameraRig& found, const calib::CameraRig& truth) {
  return (found.cameras[0].centre() - found.cameras[1].centre()).norm() /
         (truth.cameras[0].centre() - truth.cameras[1].centre()).norm();
}

WaveResult waved_and_thrown(const calib::CameraRig& truth, const WaveOptions& options) {
  const ThrownPath path = thrown({.seed = 4, .waved_s = 8});
  return calibrate_wave(truth, waved(truth, {.seconds = path.seconds(), .offset_s = {0, 0.007, 0.02}, .path = path}),
                        options);
}

// Neither tape nor poses: the throws set both.
TEST(Wave, FiveThrowsSetScaleAndVertical) {
  const calib::CameraRig truth = rig_of(3);
  WaveOptions options;
  options.has_poses = false, options.g_m_s2 = 9.81;
  const WaveResult r = waved_and_thrown(truth, options);
  ASSERT_TRUE(r.vertical) << report::to_text(report::report_on(r), r);
  EXPECT_GE(r.vertical->flights, 6u);
  EXPECT_EQ(r.scale.sources.front().kind, ScaleSource::Kind::throws);
  const double error = scale_of(r.rig, truth) - 1;
  EXPECT_LT(std::abs(error), 0.007);
  EXPECT_LT(std::abs(error), 3 * r.scale.sigma);
  EXPECT_LT(r.scale.sigma, 0.007);
  // The found world's z axis in the first camera, and the true one.
  const Vector3d up = r.rig.cameras[0].cam_from_world.rotation * Vector3d::UnitZ(),
                 true_up = truth.cameras[0].cam_from_world.rotation * Vector3d::UnitZ();
  const double tilt_rad = std::acos(up.dot(true_up));
  EXPECT_LT(tilt_rad, 0.5 * std::numbers::pi / 180);
  EXPECT_LT(tilt_rad, 3 * r.vertical->sigma_rad);
  EXPECT_TRUE(is_usable(r)) << report::to_text(report::report_on(r), r);
  EXPECT_THAT(report::report_on(r).notes, Contains(StartsWith("the world's z axis is vertical")));
}

// Of the ball nothing is known but its colour: the throws show its radius. The one that was guessed does not count.
TEST(Wave, ThrowsShowTheRadius) {
  const calib::CameraRig truth = rig_of(3);
  WaveOptions options;
  options.has_poses = false, options.radius_m = 0.06, options.guessed_radius = true;  // of 40 mm
  const WaveResult r = waved_and_thrown(truth, options);
  EXPECT_LT(std::abs(scale_of(r.rig, truth) - 1), 0.007);
  EXPECT_NEAR(r.radius_m * r.size_ratio, 0.04, 0.001);
  EXPECT_TRUE(is_usable(r)) << report::to_text(report::report_on(r), r);
}

// The page has no options of a command.
TEST(Wave, AdvisesOfTheScaleInTheWordsOfItsReader) {
  const calib::CameraRig truth = rig_of(3);
  WaveOptions options;
  options.has_poses = false, options.guessed_radius = true;
  const WaveResult r = calibrate_wave(truth, waved(truth, {.seconds = 10}), options);
  EXPECT_THAT(report::report_on(r).doubts,
              Contains(AllOf(StartsWith("the scale is from a guess of the ball's radius"),
                             HasSubstr("or give --camera-distance, --rest-distance or two marked points"))));
  const report::WaveReport on_page = report::report_on(r, report::Reader::page);
  EXPECT_THAT(on_page.doubts, Contains(HasSubstr("let it bounce, or type the distance of two cameras")));
  EXPECT_THAT(report::to_text(on_page, r), testing::Not(testing::AnyOf(HasSubstr("--"), HasSubstr("huetrack-cal"))));
}

TEST(Wave, NamesATapeThatContradictsTheThrows) {
  const calib::CameraRig truth = rig_of(3);
  WaveOptions options = taped(truth);
  options.has_poses = false, options.g_m_s2 = 9.81;
  const WaveResult agrees = waved_and_thrown(truth, options);
  EXPECT_THAT(report::report_on(agrees).doubts, testing::Not(Contains(HasSubstr("contradictory"))));
  EXPECT_LT(agrees.scale.sigma, 0.002);  // of the tape; surer with the throws
  EXPECT_GT(agrees.scale.sources.back().weight, -0.01);
  options.camera_distance->metres *= 1.04;
  const WaveResult r = waved_and_thrown(truth, options);
  EXPECT_THAT(report::report_on(r).doubts,
              Contains(AllOf(HasSubstr("the tape between the cameras says"), HasSubstr("the throws say"))));
  EXPECT_GT(r.scale.sigma, agrees.scale.sigma);
}

TEST(Wave, ScaleFromTheRigAloneIsDoubtful) {
  const calib::CameraRig truth = rig_of(3);
  const WaveResult r = calibrate_wave(spoilt(truth, 0.1, 3), waved(truth, {}), {});
  EXPECT_THAT(report::report_on(r).doubts, testing::Contains(HasSubstr("the scale is from the rig's own poses")));
  // A rig that was right, but for one camera that was bumped, keeps its world.
  calib::CameraRig bumped = truth;
  bumped.cameras[2].cam_from_world.translation += Vector3d(0.05, 0.02, 0);
  const WaveResult kept = calibrate_wave(bumped, waved(truth, {}), taped(truth));
  EXPECT_LT(kept.cameras[0].moved_m, 0.01);
  EXPECT_LT(kept.cameras[1].moved_m, 0.01);
  EXPECT_GT(kept.cameras[2].moved_m, 0.04);
}

TEST(Wave, IsDeterministic) {
  const calib::CameraRig truth = rig_of(3);
  auto frames = waved(truth, {.seconds = 4, .wrong = 0.1});
  const std::string once = calib::to_yaml(calibrate_wave(spoilt(truth, 0.1, 3), frames, taped(truth)).rig);
  std::ranges::reverse(frames);
  EXPECT_EQ(once, calib::to_yaml(calibrate_wave(spoilt(truth, 0.1, 3), frames, taped(truth)).rig));
}

TEST(Wave, ReportsWhatIsMissing) {
  const calib::CameraRig truth = rig_of(3);
  const WaveOptions options = taped(truth);
  EXPECT_THAT(failure(truth, waved(truth, {.hidden = [](int c, double) { return c == 1; }}), options),
              finds(Fault::target_unseen, HasSubstr("cam1 never saw the target")));
  // Each sees it, but cam2 never together with the others.
  EXPECT_THAT(
      failure(truth, waved(truth, {.hidden = [](int c, double t) { return c == 2 ? t < 4.2 : t > 4; }}), options),
      finds(Fault::unconnected_cameras, AllOf(HasSubstr("not connected: cam2"), HasSubstr("share 0 frames"))));
  EXPECT_THAT(
      failure(truth, waved(truth, {.path = [](double t) { return Vector3d(0.03 * lissajous(t) + Vector3d(0, 0, 1)); }}),
              options),
      finds(Fault::too_little_motion, HasSubstr("too little motion")));
  EXPECT_THAT(failure(truth, waved(truth, {.path = [](double) { return Vector3d(0, 0, 1); }}), options),
              finds(Fault::too_little_motion, HasSubstr("too little motion")));
  EXPECT_THAT(
      failure(truth, waved(truth, {.path = [](double t) { return Vector3d(0.7 * std::sin(t), 0.2 * std::sin(t), 1); }}),
              options),
      finds(Fault::too_little_motion, HasSubstr("along one line")));
}

TEST(Wave, PlanarMotionIsDoubtfulAndCannotStartFromNothing) {
  const calib::CameraRig truth = rig_of(3);
  const auto frames = waved(truth, {.path = [](double t) { return Vector3d(lissajous(t).x(), lissajous(t).y(), 1); }});
  const WaveResult r = calibrate_wave(spoilt(truth, 0.1, 3), frames, taped(truth));
  EXPECT_THAT(report::report_on(r).doubts,
              testing::Contains(AllOf(StartsWith("the ball moved in one plane ("),
                                      testing::EndsWith("thick): wave it through the whole volume, up and down and "
                                                        "towards the cameras too"))));
  WaveOptions nothing = taped(truth);
  nothing.has_poses = false;
  EXPECT_THAT(failure(truth, frames, nothing),
              testing::AnyOf(finds(Fault::motion_in_a_plane, HasSubstr("in one plane")),
                             finds(Fault::unplaced_camera, HasSubstr("cannot be placed")),
                             finds(Fault::contradicting_motion, HasSubstr("no two cameras agree"))));
}

// One camera has only a patch of the colour that flickers about one place: it is no static clutter, and no ball.
// Whatever the start makes of it, the user gets a named error or a doubtful result.
TEST(Wave, FlickeringPatchInsteadOfTheBallIsNeverUsable) {
  const calib::CameraRig truth = rig_of(3);
  std::mt19937_64 rng(4);
  std::normal_distribution<double> jitter(0, 3);
  std::vector<BallFrame> frames = waved(truth, {.seconds = 4});
  for (BallFrame& frame : frames) {
    if (frame.camera != 2 || frame.regions.empty()) continue;
    frame.regions.resize(1);
    frame.regions.front().centre = {300 + jitter(rng), 200 + jitter(rng)};
  }
  for (const bool has_poses : {true, false}) {
    WaveOptions options = taped(truth);
    options.has_poses = has_poses;
    try {
      const WaveResult r = calibrate_wave(truth, frames, options);
      EXPECT_FALSE(is_usable(r)) << report::to_text(report::report_on(r), r);
    } catch (const solver::CalibrationError& error) {
      EXPECT_STRNE(error.what(), "");
    }
  }
}

// Fingers cover a fifth of the width of one camera's ball in some of its frames.
TEST(Wave, AHandThatHidesAPartIsNamed) {
  const calib::CameraRig truth = rig_of(3);
  for (const int every : {3, 20}) {
    std::vector<BallFrame> frames = waved(truth, {});
    for (std::size_t f = 0; f < frames.size(); ++f) {
      if (frames[f].camera != 1 || f % static_cast<std::size_t>(every) != 0) continue;
      for (color::ColorRegion& region : frames[f].regions) {
        region.centre.x() += 0.2 * 2 * std::sqrt(region.spread(0, 0));
        region.spread(0, 0) *= 0.8 * 0.8;
      }
    }
    const WaveResult r = calibrate_wave(spoilt(truth, 0.03, 1), frames, taped(truth));
    const report::WaveReport report = report::report_on(r);
    EXPECT_NEAR(r.cameras[1].partly_seen, 1.0 / every, 0.03);
    EXPECT_EQ(r.cameras[0].partly_seen, 0);
    EXPECT_EQ(report.verdict, every == 3 ? report::Verdict::doubtful : report::Verdict::usable);
    EXPECT_EQ(testing::Matches(HasSubstr("a hand"))(report::to_text(report, r)), every == 3);
  }
}

// A hand moves each end of both axes of the outline by itself, by a third of the radius (rms), in half of the frames.
std::vector<BallFrame> held(std::vector<BallFrame> frames) {
  std::mt19937_64 rng(5);
  std::normal_distribution<double> moved(0, 0.33);
  for (BallFrame& frame : frames) {
    if (frame.regions.empty() || rng() % 2 == 0) continue;
    color::ColorRegion& ball = frame.regions.back();
    for (const int axis : {0, 1}) {
      const double r = 2 * std::sqrt(ball.spread(axis, axis)), from = moved(rng), to = moved(rng);
      ball.centre[axis] += r * (to + from) / 2;
      ball.spread(axis, axis) *= std::pow(std::max(0.2, 1 + (to - from) / 2), 2);
    }
  }
  return frames;
}

// While the ball is hidden, each frame has something else of the colour: most agree with no poses.
TEST(Wave, HeldBallThatIsOftenHidden) {
  const calib::CameraRig truth = rig_of(3);
  const auto hidden = [](int, double t) { return std::fmod(t, 2) < 0.8; };
  const std::vector<BallFrame> frames =
      held(waved(truth, {.seconds = 6, .times = webcam_times, .hidden = hidden, .wrong = 1}));
  WaveOptions options;
  options.hold_poses = true;
  const WaveResult timed = calibrate_wave(truth, frames, options);
  for (std::size_t c = 1; c < 3; ++c) {
    const calib::CameraTiming& timing = timed.rig.cameras[c].timing;
    const double off_s = timing.latency_s.value_or(1) - (webcam_times[c].latency_s - webcam_times[0].latency_s);
    EXPECT_LT(std::abs(off_s), 3 * timing.latency_sigma_s.value_or(0)) << "camera " << c;
    EXPECT_LT(timing.latency_sigma_s.value_or(1), 0.005) << "camera " << c;
  }
  EXPECT_THAT(failure(spoilt(truth, 0.05, 2), frames, options),
              finds(Fault::wrong_poses, HasSubstr("agree with the poses that the rig has")));
  // A start at the exact rig is left by no more than is stated; so are poses that a wrong one holds back.
  for (const double start_m : {0.0, 0.1}) {
    const WaveResult r = calibrate_wave(spoilt(truth, start_m, 30 * start_m), frames, taped(truth));
    Vector3d sigma_m = Vector3d::Zero();
    for (const WaveCamera& camera : r.cameras) sigma_m = sigma_m.cwiseMax(camera.centre_sigma_m);
    EXPECT_LT(off(r.rig, truth).metres, 2 * sigma_m.norm()) << start_m;
    EXPECT_TRUE(start_m > 0 || sigma_m.norm() < 0.05) << sigma_m.norm();
  }
}

TEST(Wave, RejectsInvalidOptions) {
  const calib::CameraRig rig = rig_of(2);
  EXPECT_TRUE(WaveOptions{}.problems(rig).empty());
  EXPECT_FALSE(WaveOptions{.radius_m = 0}.problems(rig).empty());
  EXPECT_FALSE((WaveOptions{.camera_distance = CameraDistance{0, 0, 1}}.problems(rig).empty()));
  EXPECT_FALSE((WaveOptions{.camera_distance = CameraDistance{0, 1, 369.3}}.problems(rig).empty()));
  EXPECT_TRUE((WaveOptions{.camera_distance = CameraDistance{0, 1, 1}, .rest_distance_m = 1}.problems(rig).empty()));
  EXPECT_FALSE(WaveOptions{.g_m_s2 = 0}.problems(rig).empty());
  EXPECT_FALSE(WaveOptions{.latitude_deg = 91}.problems(rig).empty());
  EXPECT_FALSE(WaveOptions{.ball_kg = -1}.problems(rig).empty());
  EXPECT_FALSE((WaveOptions{.marks = {{1, {0, 0, 0}}}}.problems(rig).empty()));
  EXPECT_FALSE(WaveOptions{}.problems(rig_of(1)).empty());
}

}  // namespace
}  // namespace huetrack::wave
