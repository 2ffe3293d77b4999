#include "truth/truth.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "calib/files/config_error.h"
#include "drawn.h"
#include "truth/truth_file.h"

namespace huetrack::truth {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

TEST_F(TruthFile, ASingleBallMatchesASingleTarget) {
  Truth t = truth(along_x);
  const std::vector<std::string> lime{"lime"};
  EXPECT_THAT(t.match(lime), testing::ElementsAre(testing::AllOf(HasSubstr("ball named ball"), HasSubstr("lime"))));
  EXPECT_TRUE(t.position("lime", Timestamp(100ms)).has_value());
  EXPECT_THAT(t.match(lime), testing::IsEmpty());
}

TEST_F(TruthFile, NamesItsBallsForAMissingTarget) {
  Truth t = truth(along_x + "0,0,red,0,0,0,1\n");
  const std::vector<std::string> lime{"lime"}, both{"ball", "lime"};
  const std::string sentence = "the truth has no ball named lime, so this target is not compared: it has ball, red";
  EXPECT_THAT(t.match(lime), testing::ElementsAre(sentence));
  EXPECT_THAT(t.match(both), testing::ElementsAre(sentence));
  EXPECT_FALSE(t.position("lime", Timestamp(100ms)).has_value());
}

TEST_F(TruthFile, NamesTheCountForNumberedBalls) {
  Truth t = truth("t,ball,x,y,z\n0,ball0,0,0,0\n0,ball1,1,0,0\n");
  const std::vector<std::string> ball{"ball"}, two{"ball", "cube"};
  EXPECT_THAT(t.match(ball),
              testing::ElementsAre("the truth has no ball named ball, so this target is not compared: it "
                                   "has ball0, ball1: are these several balls of one colour? Give the "
                                   "target their count"));
  EXPECT_THAT(t.match(two)[1], testing::EndsWith("it has ball0, ball1"));
}

TEST_F(TruthFile, IsLinearBetweenItsSamplesAndNotBeyond) {
  const Truth t = truth(along_x);
  EXPECT_THAT(*t.position("ball", Timestamp(100ms)), testing::Eq(Eigen::Vector3d(0.1, 2, 3)));
  EXPECT_NEAR((*t.position("ball", Timestamp(123ms)) - Eigen::Vector3d(0.123, 2, 3)).norm(), 0, 1e-12);
  EXPECT_TRUE(t.position("ball", Timestamp(2000400us)).has_value());  // rounding of a time in a file
  EXPECT_FALSE(t.position("ball", Timestamp(2010ms)).has_value());
  EXPECT_FALSE(t.position("ball", Timestamp(-10ms)).has_value());
  EXPECT_FALSE(t.position("cube", Timestamp(100ms)).has_value());
}

TEST_F(TruthFile, HasNoPositionInsideAGap) {
  const Truth t = truth("ball,t,x,y,z\nb,0,0,0,0\nb,1,1,0,0\n");
  EXPECT_FALSE(t.position("b", Timestamp(500ms)).has_value());
  EXPECT_EQ(t.position("b", Timestamp(1s)), Eigen::Vector3d(1, 0, 0));
}

TEST_F(TruthFile, ErrorsNameTheLine) {
  const auto error = [&](const std::string& text) -> std::string {
    try {
      truth(text);
    } catch (const files::ConfigError& e) {
      return e.what();
    }
    return "no error";
  };
  EXPECT_EQ(error("ball,x,y,z\n"), file_.string() + ":1: the header has no column t: it has ball, x, y, z");
  EXPECT_EQ(error("t,x,y,z\n0,0,0,0\n0,1,1,1\n"),
            file_.string() +
                ":3: t must grow from row to row; for several targets add a column ball or target with their names");
  EXPECT_EQ(error("ball,t,x,y,z\nb,0,0,0,0\nb,0,1,1,1\n"),
            file_.string() + ":3: t must grow from row to row of one target");
  EXPECT_EQ(error("ball,t,x,y,z\nb,0,nan,0,0\n"),
            file_.string() + ":2: x, y and z must be finite, or all three nan if unknown");
}

TEST_F(TruthFile, AcceptsTheColumnTarget) {
  const Truth t = truth("target,t,x,y,z\nlime,0,1,2,3\nlime,0.1,1,2,3\n");
  EXPECT_TRUE(t.targets().contains("lime"));
}

TEST_F(TruthFile, MayBeOfOneTargetWithoutAName) {
  Truth t = truth("t,x,y,z\n0,1,2,3\n0.1,1,2,3\n");
  const std::vector<std::string> two{"lime", "pink"}, one{"lime"};
  EXPECT_THAT(t.match(two), testing::ElementsAre(testing::HasSubstr("it has one without a name"), testing::_));
  EXPECT_THAT(t.match(one), testing::ElementsAre(testing::HasSubstr("a single ball without a name")));
  EXPECT_EQ(t.position("lime", Timestamp(100ms)), Eigen::Vector3d(1, 2, 3));
}

TEST_F(TruthFile, SkipsRowsWithoutAPosition) {
  const Truth t = truth(
      "target,t,x,y,z\nlime,0,nan,nan,nan\nlime,0.1,1,2,3\nlime,0.15,nan,nan,nan\nlime,0.2,2,2,3\nred,0,nan,nan,nan\n");
  EXPECT_FALSE(t.position("lime", Timestamp(0s)).has_value());
  EXPECT_EQ(t.position("lime", Timestamp(100ms)), Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(t.targets().contains("red"));
}

TEST_F(TruthFile, ReadsNumpysExponentsAndASpreadsheetsCommas) {
  for (const char* text : {"t,x,y,z\n2.0e+01,1.5e+00,-2,3\n2.003e+01,1.5,-2,3\n",
                           "t;x;y;z\n20,0;1,5;-2;3\n20,03;1,5;-2;3\n", "t_ms,x,y,z\n20000,1.5,-2,3\n20030,1.5,-2,3\n"})
    EXPECT_EQ(truth(text).position("", Timestamp(20030ms)), Eigen::Vector3d(1.5, -2, 3)) << text;
}

TEST_F(TruthFile, NamesOtherUnitsThanTheRecordings) {
  using testing::ElementsAre, testing::HasSubstr, testing::IsEmpty;
  const Eigen::AlignedBox3d room(Eigen::Vector3d(-2, -2, 0), Eigen::Vector3d(2, 2, 2.5));
  const auto said = [&](const std::string& text, Timestamp from = Timestamp(0s)) {
    return truth(text).contradictions(from, from + 5s, room);
  };
  EXPECT_THAT(said("t,x,y,z\n0,0.4,-0.3,1.6\n4.9,0.5,0.2,1.5\n"), IsEmpty());
  EXPECT_THAT(said("t,x,y,z\n0,435.1,-272.6,1618.4\n4.9,400,200,1500\n"), ElementsAre(HasSubstr("millimetres")));
  EXPECT_THAT(said("t,x,y,z\n0,0.4,-0.3,1.6\n4900,0.5,0.2,1.5\n"), ElementsAre(HasSubstr("name the column t_ms")));
  EXPECT_THAT(said("t,x,y,z\n0,0.4,-0.3,1.6\n4.9,0.5,0.2,1.5\n", Timestamp(20s)),
              ElementsAre(HasSubstr("from 0.000 to 4.900 s, and the recording's from 20.000 to 25.000 s")));
}

TEST_F(TruthFile, CanBeMovedToAnotherClock) {
  Truth t = truth(along_x);
  t.shift(10s);
  EXPECT_THAT(*t.position("ball", Timestamp(10100ms)), testing::Eq(Eigen::Vector3d(0.1, 2, 3)));
  EXPECT_FALSE(t.position("ball", Timestamp(100ms)).has_value());
}

TEST(Nees, IsChiSquareForATrueCovariance) {
  Eigen::Matrix3d factor;
  factor << 0.02, 0, 0, 0.01, 0.005, 0, -0.003, 0.004, 0.03;
  const Eigen::Matrix3d covariance = factor * factor.transpose();
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  double sum = 0;
  int inside = 0;
  constexpr int n = 20000;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d error = factor * drawn<3>(random, normal);
    const double squared = nees(error, covariance);
    sum += squared;
    inside += squared <= 7.815 ? 1 : 0;
  }
  EXPECT_NEAR(sum / n, 3, 0.06);
  EXPECT_NEAR(double(inside) / n, 0.95, 0.006);
}

TEST(Nees, IsInfiniteForAnInvalidCovariance) {
  EXPECT_TRUE(std::isinf(nees({1, 0, 0}, Eigen::Matrix3d::Zero())));
  EXPECT_TRUE(std::isinf(nees({1, 0, 0}, -Eigen::Matrix3d::Identity())));
  EXPECT_TRUE(std::isinf(nees({1, 0, 0}, Eigen::Matrix3d::Constant(std::nan("")))));
}

}  // namespace
}  // namespace huetrack::truth
