#include "tracks/truth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "calib/yaml/yaml_reader.h"

namespace huetrack::tracks {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::HasSubstr;

class TruthFile : public testing::Test {
 protected:
  TruthFile()
      : file_(fs::path(testing::TempDir()) /
              ("truth_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".csv")) {}
  ~TruthFile() override { fs::remove(file_); }
  Truth truth(const std::string& text) const {
    std::ofstream(file_) << text;
    return Truth::read(file_);
  }
  fs::path file_;
};

// A ball that goes along x at 1 m/s, 10 samples a second.
const std::string along_x = [] {
  std::string text = "frame,t,ball,x,y,z,more\n";
  for (int i = 0; i <= 20; ++i) {
    char row[96];
    std::snprintf(row, sizeof row, "%d,%.6f,ball,%.6f,2,3,1\n", i, 0.1 * i, 0.1 * i);
    text += row;
  }
  return text;
}();

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

TEST_F(TruthFile, TheOnlyBallIsTheOnlyTargetWhateverItsName) {
  Truth t = truth(along_x);
  const std::vector<std::string> lime{"lime"};
  EXPECT_THAT(t.match(lime), testing::ElementsAre(testing::AllOf(HasSubstr("ball named ball"), HasSubstr("lime"))));
  EXPECT_TRUE(t.position("lime", capture::Timestamp(100ms)).has_value());
  EXPECT_THAT(t.match(lime), testing::IsEmpty());
}

TEST_F(TruthFile, SaysWhichBallsItHasForTargetsThatItHasNot) {
  Truth t = truth(along_x + "0,0,red,0,0,0,1\n");
  const std::vector<std::string> lime{"lime"}, both{"ball", "lime"};
  const std::string sentence = "the truth has no ball named lime, which is not compared: it has ball, red";
  EXPECT_THAT(t.match(lime), testing::ElementsAre(sentence));
  EXPECT_THAT(t.match(both), testing::ElementsAre(sentence));
  EXPECT_FALSE(t.position("lime", capture::Timestamp(100ms)).has_value());
}

TEST_F(TruthFile, IsLinearBetweenItsSamplesAndNotBeyond) {
  const Truth t = truth(along_x);
  EXPECT_THAT(*t.position("ball", capture::Timestamp(100ms)), testing::Eq(Eigen::Vector3d(0.1, 2, 3)));
  EXPECT_NEAR((*t.position("ball", capture::Timestamp(123ms)) - Eigen::Vector3d(0.123, 2, 3)).norm(), 0, 1e-12);
  EXPECT_TRUE(t.position("ball", capture::Timestamp(2000400us)).has_value());  // rounding of a time in a file
  EXPECT_FALSE(t.position("ball", capture::Timestamp(2010ms)).has_value());
  EXPECT_FALSE(t.position("ball", capture::Timestamp(-10ms)).has_value());
  EXPECT_FALSE(t.position("cube", capture::Timestamp(100ms)).has_value());
}

TEST_F(TruthFile, IsNotInventedInsideAGap) {
  const Truth t = truth("ball,t,x,y,z\nb,0,0,0,0\nb,1,1,0,0\n");
  EXPECT_FALSE(t.position("b", capture::Timestamp(500ms)).has_value());
  EXPECT_EQ(t.position("b", capture::Timestamp(1s)), Eigen::Vector3d(1, 0, 0));
}

TEST_F(TruthFile, MistakesAreNamedWithTheLine) {
  const auto error = [&](const std::string& text) -> std::string {
    try {
      truth(text);
    } catch (const yaml::ConfigError& e) {
      return e.what();
    }
    return "no error";
  };
  EXPECT_EQ(error("t,x,y,z\n"), file_.string() + ":1: the header has no column ball");
  EXPECT_EQ(error("ball,t,x,y,z\nb,0,0,0,0\nb,0,1,1,1\n"),
            file_.string() + ":3: t must grow from row to row of one target");
  EXPECT_EQ(error("ball,t,x,y,z\nb,0,nan,0,0\n"), file_.string() + ":2: x, y and z must be finite");
}

TEST_F(TruthFile, FiguresAreThoseOfTheSetsAfterTheLock) {
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
  EXPECT_THAT(to_text(f), HasSubstr("locked in set 4 (0.300 s); then 3 samples, rms error 28.9 mm, max 40.0 mm"));
}

TEST_F(TruthFile, WithoutALockThereAreNoFigures) {
  const Truth t = truth(along_x);
  TruthComparison comparison(t, "ball");
  comparison.add(estimate(0.1, {0.1, 2, 3.06}));  // 6 cm off
  EXPECT_EQ(comparison.figures().lock_set, std::nullopt);
  EXPECT_EQ(comparison.figures().samples, 0u);
  EXPECT_THAT(to_text(comparison.figures()), HasSubstr("never within 50 mm"));
}

TEST(Nees, IsChiSquaredWhenTheCovarianceIsTrue) {
  Eigen::Matrix3d factor;
  factor << 0.02, 0, 0, 0.01, 0.005, 0, -0.003, 0.004, 0.03;
  const Eigen::Matrix3d covariance = factor * factor.transpose();
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  double sum = 0;
  int inside = 0;
  constexpr int n = 20000;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d error = factor * Eigen::Vector3d(normal(random), normal(random), normal(random));
    const double squared = nees(error, covariance);
    sum += squared;
    inside += squared <= 7.815 ? 1 : 0;
  }
  EXPECT_NEAR(sum / n, 3, 0.06);
  EXPECT_NEAR(double(inside) / n, 0.95, 0.006);
}

TEST(Nees, IsInfiniteForWhatIsNoCovariance) {
  EXPECT_TRUE(std::isinf(nees({1, 0, 0}, Eigen::Matrix3d::Zero())));
  EXPECT_TRUE(std::isinf(nees({1, 0, 0}, -Eigen::Matrix3d::Identity())));
  EXPECT_TRUE(std::isinf(nees({1, 0, 0}, Eigen::Matrix3d::Constant(std::nan("")))));
}

}  // namespace
}  // namespace huetrack::tracks
