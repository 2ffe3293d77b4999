#include "tracks/truth_comparison.h"
#include "truth/truth_file.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

namespace huetrack::tracks {
namespace {

using testing::HasSubstr;

using truth::along_x;
using truth::TruthFile;

object_tracking::ObjectEstimate estimate(double t, const Eigen::Vector3d& position,
                                         object_tracking::TrackState state = object_tracking::TrackState::tracking) {
  object_tracking::ObjectEstimate e;
  e.at = capture::Timestamp(capture::duration_of(t));
  e.state = state;
  if (!e.has_position()) return e;
  e.position = position;
  e.covariance = Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal();  // sigma 1 cm
  return e;
}

TEST_F(TruthFile, FiguresCoverTheSetsAfterTheLock) {
  const Truth t = truth(along_x);
  TruthComparison comparison(t, "ball");
  EXPECT_EQ(comparison.add(estimate(0.0, {}, object_tracking::TrackState::searching)), std::nullopt);
  EXPECT_NEAR(*comparison.add(estimate(0.1, {0.1, 2, 3.5})), 0.5, 1e-9);  // tracking, and wrong
  EXPECT_NEAR(*comparison.add(estimate(0.2, {0.2, 2, 3.01}, object_tracking::TrackState::coasting)), 0.01,
              1e-9);                              // near, but not tracking
  comparison.add(estimate(0.3, {0.3, 2.03, 3}));  // locks, 3 cm off
  comparison.add(estimate(0.4, {0.4, 2, 3.04}, object_tracking::TrackState::coasting));
  comparison.add(estimate(0.5, {}, object_tracking::TrackState::lost));
  comparison.add(estimate(0.6, {0.6, 2, 3}));
  comparison.add(estimate(99, {0, 0, 0}));  // no truth there
  const TruthFigures f = comparison.figures();
  EXPECT_EQ(f.sets, 7u);
  EXPECT_EQ(f.lock_set, 4u);
  EXPECT_NEAR(f.lock_s, 0.3, 1e-9);
  EXPECT_EQ(f.samples, 3u);
  EXPECT_NEAR(f.rms_m, std::sqrt((0.03 * 0.03 + 0.04 * 0.04) / 3), 1e-9);
  EXPECT_NEAR(f.max_m, 0.04, 1e-9);
  EXPECT_EQ(f.wrong_tracking, 1u);
  EXPECT_NEAR(f.mean_nees, (9.0 + 16.0 + 0.0) / 3, 1e-6);
  EXPECT_NEAR(f.share_inside_95, 1.0 / 3, 1e-9);
  EXPECT_EQ(f.tracking_samples, 2u);
  EXPECT_NEAR(f.tracking_rms_m, 0.03 / std::sqrt(2), 1e-9);
  EXPECT_THAT(to_text(f), HasSubstr("locked in set 4 (0.300 s); then 3 samples, rms error 28.9 mm (21.2 mm while "
                                    "tracking), max 40.0 mm"));
}

TEST_F(TruthFile, WithoutALockThereAreNoFigures) {
  const Truth t = truth(along_x);
  TruthComparison comparison(t, "ball");
  comparison.add(estimate(0.1, {0.1, 2, 3.06}));  // 6 cm off
  EXPECT_EQ(comparison.figures().lock_set, std::nullopt);
  EXPECT_EQ(comparison.figures().samples, 0u);
  EXPECT_THAT(to_text(comparison.figures()), HasSubstr("never within 50 mm"));
}

}  // namespace
}  // namespace huetrack::tracks
