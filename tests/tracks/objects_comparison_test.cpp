#include "tracks/objects_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "truth/truth_file.h"

namespace huetrack::tracks {
namespace {

using object_tracking::ObjectEstimate;
using object_tracking::TrackState;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using truth::TruthFile;

const Eigen::AlignedBox3d room(Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(1, 1, 1));

// Two balls that stand at x = 0 and 0.5 for ten sets of 0.1 s.
const std::string two_balls = [] {
  std::string text = "ball,t,x,y,z\n";
  for (const char* ball : {"ball0,", "ball1,"})
    for (int k = 0; k < 10; ++k) text += ball + std::to_string(0.1 * k) + (ball[4] == '0' ? ",0,0,0\n" : ",0.5,0,0\n");
  return text;
}();

ObjectEstimate object(int set, std::uint32_t number, double x, TrackState state = TrackState::tracking) {
  ObjectEstimate e;
  e.object = number;
  e.at = truth::Timestamp(std::chrono::milliseconds(100 * set));
  e.state = state;
  e.position = {x, 0, 0};
  return e;
}

ObjectsFigures figures_of(const truth::Truth& truth, const std::vector<std::vector<ObjectEstimate>>& sets) {
  ObjectsComparison comparison(truth, {"ball0", "ball1"}, room);
  for (std::size_t k = 0; k < sets.size(); ++k)
    comparison.add(truth::Timestamp(std::chrono::milliseconds(100 * k)), sets[k]);
  return comparison.figures();
}

TEST_F(TruthFile, ObjectsAreMatchedWithBallsOfAnyName) {
  const truth::Truth t = truth(two_balls);
  std::vector<std::vector<ObjectEstimate>> sets;
  for (int k = 0; k < 10; ++k) sets.push_back({object(k, 7, 0.5), object(k, 8, 0.003)});
  const ObjectsFigures f = figures_of(t, sets);
  EXPECT_EQ(f.balls, 2u);
  EXPECT_EQ(f.ball_sets, 20u);
  EXPECT_EQ(f.found, 20u);
  EXPECT_NEAR(f.rms_m, 0.003 / std::sqrt(2), 1e-9);
  EXPECT_EQ(f.mota, 1);
  EXPECT_EQ(f.idf1, 1);
}

TEST_F(TruthFile, MissesFalsePositionsAndSwitchesCostMota) {
  const truth::Truth t = truth(two_balls);
  std::vector<std::vector<ObjectEstimate>> sets;
  for (int k = 0; k < 10; ++k) sets.push_back({object(k, 1, k < 4 ? 0 : 0.5), object(k, 2, k < 4 ? 0.5 : 0)});
  sets[0][1].state = TrackState::coasting;      // a miss
  sets[9].push_back(object(9, 3, 0.25));        // of no ball
  sets[9].push_back(object(9, 4, 0.5 + 0.05));  // the ball has its object already
  const ObjectsFigures f = figures_of(t, sets);
  EXPECT_EQ(f.found, 19u);
  EXPECT_EQ(f.false_positions, 2u);
  EXPECT_EQ(f.switches, 2u);
  EXPECT_NEAR(f.mota, 1 - 5.0 / 20, 1e-9);
  EXPECT_NEAR(f.idf1, 2.0 * 12 / (20 + 21), 1e-9);  // each ball with its object of the last six sets
}

TEST_F(TruthFile, KeepsAMatchThatIsStillNear) {
  const truth::Truth t = truth(two_balls);
  std::vector<std::vector<ObjectEstimate>> sets(10);
  sets[0] = {object(0, 1, 0.0)};
  sets[1] = {object(1, 1, 0.08), object(1, 2, 0.01)};
  const ObjectsFigures f = figures_of(t, sets);
  EXPECT_EQ(f.switches, 0u);
  EXPECT_EQ(f.false_positions, 1u);
}

TEST_F(TruthFile, BallsOutsideTheVolumeCountNeitherWay) {
  const truth::Truth t = truth("ball,t,x,y,z\nball0,0,3,0,0\nball1,0,0.5,0,0\n");
  const ObjectsFigures f = figures_of(t, {{object(0, 1, 3), object(0, 2, 0.5)}});
  EXPECT_EQ(f.ball_sets, 1u);
  EXPECT_EQ(f.false_positions, 0u);
  EXPECT_EQ(f.mota, 1);
  EXPECT_THAT(to_text(f), HasSubstr("1 balls of the truth"));
}

TEST_F(TruthFile, ObjectsOfATargetAreAllOrThoseOfItsName) {
  truth::Truth t = truth("ball,t,x,y,z\nswarm0,0,0,0,0\nswarm_12,0,0,0,0\nswarms,0,0,0,0\nlime,0,0,0,0\n");
  EXPECT_THAT(t.objects_of("swarm", false), ElementsAre("swarm0", "swarm_12"));
  EXPECT_THAT(t.objects_of("pink", true), ElementsAre("lime", "swarm0", "swarm_12", "swarms"));
  const std::vector<std::string> targets{"swarm", "lime"}, others{"pink", "lime"};
  const std::vector<int> counts{3, 1};
  EXPECT_THAT(t.match(targets, counts), IsEmpty());
  EXPECT_THAT(t.match(others, counts), ElementsAre(HasSubstr("no ball named pink or pink_1")));
}

}  // namespace
}  // namespace huetrack::tracks
