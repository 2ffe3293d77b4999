#include "camera_tracking/keyframes/pose_proof.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <random>

namespace huetrack::keyframes {
namespace {

// Of a map that has long grown: many points, all over the image, and little left open.
PoseEvidence good() {
  PoseEvidence e;
  e.sought = 100, e.found = 60;
  e.spread_px = 50;
  e.position_sigma_m = 0.001, e.rotation_sigma_rad = 0.002, e.depth_m = 0.5;
  e.map_points = 300, e.keyframes = 12;
  return e;
}
PoseEvidence guess(PoseEvidence e) {
  e.is_guess = true;
  return e;
}

TEST(PoseProof, ManySpreadPointsProve) {
  EXPECT_EQ(proof_of(good()), Proof::by_points);
  EXPECT_EQ(proof_of(guess(good())), Proof::by_points);
}

TEST(PoseProof, NoEvidenceIsNoProof) {
  EXPECT_EQ(proof_of({}), Proof::none);
}

TEST(PoseProof, LargeSigmasAreNoProof) {
  PoseEvidence e = good();
  e.position_sigma_m = 0.0101;  // of 0.5 m
  EXPECT_EQ(proof_of(e), Proof::none);
  e.depth_m = 0.51;
  EXPECT_EQ(proof_of(e), Proof::by_points);
  e.rotation_sigma_rad = 0.021;
  EXPECT_EQ(proof_of(e), Proof::none);
  e.rotation_sigma_rad = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(proof_of(e), Proof::none);
}

TEST(PoseProof, LargeResidualsAreNoProof) {
  PoseEvidence e = good();
  e.scale = 3.4;
  EXPECT_EQ(proof_of(e), Proof::by_points);
  e.scale = 3.5;
  EXPECT_EQ(proof_of(e), Proof::none);
}

TEST(PoseProof, NumberShareAndSpreadAreAllNeeded) {
  PoseEvidence few = good();
  few.sought = 50, few.found = 15;
  EXPECT_EQ(proof_of(few), Proof::by_points);
  few.found = 14;
  EXPECT_EQ(proof_of(few), Proof::none);

  PoseEvidence chance = good();
  chance.sought = 220, chance.found = 56;
  EXPECT_EQ(proof_of(chance), Proof::by_points);
  chance.found = 55;  // a quarter, and no more
  EXPECT_EQ(proof_of(chance), Proof::none);

  PoseEvidence heap = good();
  heap.spread_px = 11.1;
  EXPECT_EQ(proof_of(heap), Proof::by_points);
  heap.image_width_px = 640;  // of which it is half as much
  EXPECT_EQ(proof_of(heap), Proof::none);
  heap.image_width_px = 320, heap.spread_px = 11;
  EXPECT_EQ(proof_of(heap), Proof::none);
}

TEST(PoseProof, AGuessNeedsMoreEvidence) {
  PoseEvidence e = good();
  e.sought = 50, e.found = 24;
  EXPECT_EQ(proof_of(e), Proof::by_points);
  EXPECT_EQ(proof_of(guess(e)), Proof::none);
  e.found = 25;
  EXPECT_EQ(proof_of(guess(e)), Proof::by_points);
  e.spread_px = 16;
  EXPECT_EQ(proof_of(guess(e)), Proof::none);
  e.spread_px = 17, e.sought = 100, e.found = 35;
  EXPECT_EQ(proof_of(guess(e)), Proof::none);
}

TEST(PoseProof, AYoungMapNeedsFewerPointsButNearlyAll) {
  PoseEvidence e = good();
  e.keyframes = 3, e.sought = 11, e.found = 7;
  EXPECT_EQ(proof_of(e), Proof::by_few);
  EXPECT_EQ(proof_of(guess(e)), Proof::none);
  PoseEvidence grown = e;
  grown.keyframes = 4;
  EXPECT_EQ(proof_of(grown), Proof::none);
  PoseEvidence fewer = e;
  fewer.sought = 6, fewer.found = 6;
  EXPECT_EQ(proof_of(fewer), Proof::none);
  PoseEvidence half = e;
  half.sought = 12;
  EXPECT_EQ(proof_of(half), Proof::none);
  PoseEvidence heap = e;
  heap.spread_px = 16;
  EXPECT_EQ(proof_of(heap), Proof::none);
  PoseEvidence most = e;
  most.sought = 22, most.found = 14;  // too few to be proof by themselves
  EXPECT_EQ(proof_of(most), Proof::by_few);
}

TEST(PoseProof, AllGivenPointsProveInABareMap) {
  PoseEvidence e = good();
  e.keyframes = 1, e.map_points = 4, e.sought = 4, e.found = 4, e.spread_px = 5;
  EXPECT_EQ(proof_of(e), Proof::by_all_given);
  EXPECT_EQ(proof_of(guess(e)), Proof::none);
  PoseEvidence three = e;
  three.sought = three.found = 3;
  EXPECT_EQ(proof_of(three), Proof::none);
  PoseEvidence one_missed = e;
  one_missed.sought = 5;
  EXPECT_EQ(proof_of(one_missed), Proof::none);
  e.map_points = 12;
  EXPECT_EQ(proof_of(e), Proof::none);
}

TEST(PoseProof, ARectangleProvesUnlessPointsContradict) {
  PoseEvidence e = good();
  e.sought = 7, e.found = 0, e.corners = 4, e.spread_px = 5;
  EXPECT_EQ(proof_of(e), Proof::by_rectangle);
  EXPECT_EQ(proof_of(guess(e)), Proof::none);  // another one of its shape may lie about
  e.map_points = 11;
  EXPECT_EQ(proof_of(guess(e)), Proof::by_rectangle);
  PoseEvidence three = e;
  three.corners = 3;
  EXPECT_EQ(proof_of(three), Proof::none);
  PoseEvidence objected = good();
  objected.corners = 4, objected.spread_px = 5;
  objected.sought = 10, objected.found = 4;
  EXPECT_EQ(proof_of(objected), Proof::none);
  objected.found = 5;
  EXPECT_EQ(proof_of(objected), Proof::by_rectangle);
  EXPECT_EQ(proof_of(guess(objected)), Proof::by_rectangle);
}

// ---- Properties, over random evidence near the thresholds.

class RandomEvidence {
 public:
  explicit RandomEvidence(std::uint64_t seed) : random_(seed) {}
  PoseEvidence draw() {
    PoseEvidence e;
    e.sought = integer(0, integer(0, 2) == 0 ? 220 : 40);
    e.found = integer(0, 2) == 0 ? e.sought : integer(0, e.sought);
    e.corners = integer(0, 4);
    e.image_width_px = 160 << integer(0, 3);
    e.spread_px = real(0, 40) * e.image_width_px / 320;
    e.scale = real(0.5, 4);
    e.depth_m = real(0.2, 5);
    e.position_sigma_m = real(0, 0.03) * e.depth_m;
    e.rotation_sigma_rad = real(0, 0.03);
    e.map_points = integer(0, 1) == 0 ? integer(4, 16) : integer(17, 300);
    e.keyframes = integer(1, 8);
    e.is_guess = integer(0, 1) == 0;
    return e;
  }
  int integer(int low, int high) { return std::uniform_int_distribution(low, high)(random_); }
  double real(double low, double high) { return std::uniform_real_distribution(low, high)(random_); }

 private:
  std::mt19937_64 random_;
};

bool proven(const PoseEvidence& e) {
  return proof_of(e) != Proof::none;
}

constexpr int draws = 20000;

TEST(PoseProofProperties, EveryVerdictOccurs) {
  RandomEvidence evidence(1);
  std::array<int, 5> count{};
  for (int i = 0; i < draws; ++i) ++count[static_cast<std::size_t>(proof_of(evidence.draw()))];
  for (const int n : count) EXPECT_GT(n, draws / 2000);
}

TEST(PoseProofProperties, MoreMatchesNeverDisprove) {
  RandomEvidence evidence(2);
  for (int i = 0; i < draws; ++i) {
    const PoseEvidence e = evidence.draw();
    if (!proven(e)) continue;
    PoseEvidence better = e;
    better.found = evidence.integer(e.found, e.sought);
    EXPECT_TRUE(proven(better));
    better = e, better.corners = evidence.integer(e.corners, 4);
    EXPECT_TRUE(proven(better));
    better = e, better.spread_px *= evidence.real(1, 3);
    EXPECT_TRUE(proven(better));
  }
}

TEST(PoseProofProperties, LessUncertaintyNeverDisproves) {
  RandomEvidence evidence(3);
  for (int i = 0; i < draws; ++i) {
    PoseEvidence e = evidence.draw();
    if (!proven(e)) continue;
    e.position_sigma_m *= evidence.real(0, 1);
    e.rotation_sigma_rad *= evidence.real(0, 1);
    e.scale *= evidence.real(0, 1);
    EXPECT_TRUE(proven(e));
  }
}

TEST(PoseProofProperties, AProvenGuessIsProvenWithAPredecessor) {
  RandomEvidence evidence(4);
  int guesses = 0;
  for (int i = 0; i < draws; ++i) {
    PoseEvidence e = evidence.draw();
    if (!e.is_guess || !proven(e)) continue;
    ++guesses;
    e.is_guess = false;
    EXPECT_TRUE(proven(e));
  }
  EXPECT_GT(guesses, 100);
}

TEST(PoseProofProperties, InvariantToTheUnitOfLengthAndTheImageSize) {
  RandomEvidence evidence(5);
  for (int i = 0; i < draws; ++i) {
    const PoseEvidence e = evidence.draw();
    PoseEvidence other = e;
    other.position_sigma_m *= 8, other.depth_m *= 8;  // a power of two: exact
    EXPECT_EQ(proof_of(other), proof_of(e));
    other.image_width_px *= 4, other.spread_px *= 4;
    EXPECT_EQ(proof_of(other), proof_of(e));
  }
}

TEST(PoseProofProperties, NoVerdictWithoutThreeMatchesOrFourCorners) {
  RandomEvidence evidence(6);
  for (int i = 0; i < draws; ++i) {
    PoseEvidence e = evidence.draw();
    e.corners = std::min(e.corners, 3), e.found = std::min(e.found, 3);
    EXPECT_FALSE(proven(e));
  }
}

}  // namespace
}  // namespace huetrack::keyframes
