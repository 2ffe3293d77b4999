#include "camera_tracking/keyframes/pose_proof.h"

#include <gtest/gtest.h>

#include <limits>

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

}  // namespace
}  // namespace huetrack::keyframes
