#include "calib/solver/adjustment_steps.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "solver/near_truth.h"
#include "solver/synthetic_rig.h"

namespace huetrack::solver {
namespace {

using Eigen::Vector3d;

// At the truth, everything known.
Adjustment at_truth(const SyntheticCapture& capture) {
  Adjustment a;
  a.board = capture.board;
  a.views = capture.views;
  a.world_from_board = capture.world_from_board;
  a.noise_px = 0.1;
  for (const calib::Camera& camera : capture.rig.cameras) a.cameras.push_back(adjusted_camera(camera));
  a.fits = evaluate(a);
  return a;
}

// A board that keeps its orientation and moves with a constant velocity (world), one set per frame.
Adjustment carried(const Vector3d& velocity, double frame_s, int sets) {
  SyntheticCapture capture = synthetic_capture({.cameras = 2, .sets = 1});
  const calib::Rigid3d first = capture.world_from_board.front();
  capture.world_from_board.clear();
  capture.views.clear();
  for (int s = 0; s < sets; ++s) {
    calib::Rigid3d pose = first;
    pose.translation += (s - sets / 2) * frame_s * velocity;
    capture.world_from_board.push_back(pose);
    for (int c = 0; c < 2; ++c) {
      BoardView view{c, s, "", {}, {}, s * frame_s};
      const calib::Camera& camera = capture.rig.cameras[static_cast<std::size_t>(c)];
      for (int id = 0; id < capture.board.point_count(); ++id) {
        const auto px = camera.project_world(pose * capture.board.point(id));
        if (!px || !camera.contains(*px)) continue;
        view.ids.push_back(id);
        view.px.push_back(px->px);
      }
      capture.views.push_back(std::move(view));
    }
  }
  Adjustment a = at_truth(capture);
  a.motions.resize(static_cast<std::size_t>(sets));
  return a;
}

TEST(OwnEquations, GradientAgreesWithDifferencesOfTheCost) {
  Adjustment a = at_truth(synthetic_capture({.cameras = 3, .sets = 1, .noise_px = 0.5}));
  const BoardShape shape(a.board);
  calib::Tangent6d off;
  off << 0.01, -0.02, 0.015, 0.004, 0.002, -0.003;
  a.world_from_board[0] = a.world_from_board[0] * calib::exp(off);
  const SetEquations at = own_equations(a, shape, 0, a.views.size());
  ASSERT_EQ(at.by_own.rows(), own_course_at);
  for (int i = 0; i < 6; ++i) {
    constexpr double h = 1e-6;
    const auto cost = [&](double step) {
      calib::Tangent6d t = calib::Tangent6d::Zero();
      t(i) = step;
      Adjustment moved = a;
      moved.world_from_board[0] = a.world_from_board[0] * calib::exp(t);
      return own_equations(moved, shape, 0, a.views.size()).cost;
    };
    const double difference = (cost(h) - cost(-h)) / (2 * h);
    EXPECT_NEAR(2 * at.own_gradient(i), difference, 1e-3 * std::abs(difference) + 1e-2) << i;
  }
}

TEST(OwnEquations, GaussNewtonStepReachesTheTruth) {
  Adjustment a = at_truth(synthetic_capture({.cameras = 3, .sets = 1, .noise_px = 0}));
  const BoardShape shape(a.board);
  const calib::Rigid3d truth = a.world_from_board[0];
  calib::Tangent6d off;
  off << 0.01, -0.02, 0.015, 0.004, 0.002, -0.003;
  a.world_from_board[0] = truth * calib::exp(off);
  for (int step = 0; step < 4; ++step) {
    const SetEquations at = own_equations(a, shape, 0, a.views.size());
    const Eigen::VectorXd delta = -at.by_own.ldlt().solve(at.own_gradient);
    a.world_from_board[0] = a.world_from_board[0] * calib::exp(calib::Tangent6d(delta));
  }
  EXPECT_LT(calib::log(calib::inverse(truth) * a.world_from_board[0]).norm(), 1e-9);
}

TEST(OwnEquations, InformationIsPositiveDefiniteAndUnusedCornersDoNotCount) {
  Adjustment a = at_truth(synthetic_capture({.cameras = 2, .sets = 1}));
  const BoardShape shape(a.board);
  const SetEquations all = own_equations(a, shape, 0, a.views.size());
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(all.by_own).eigenvalues().minCoeff(), 0);
  for (std::size_t k = 0; k < a.fits[0].used.size(); k += 2) a.fits[0].used[k] = false;
  EXPECT_LT(own_equations(a, shape, 0, a.views.size()).residuals, all.residuals);
  for (ViewFit& fit : a.fits) fit.used.assign(fit.used.size(), false);
  EXPECT_EQ(own_equations(a, shape, 0, a.views.size()).residuals, 0);
}

TEST(DetermineMotion, NeedsStampsAndSetsCloseInTime) {
  const auto views = [](double gap_s, bool has_stamps) {
    std::vector<BoardView> out;
    for (int s = 0; s < 4; ++s) {
      out.push_back({0, s, "", {}, {}});
      if (has_stamps || s > 0) out.back().stamp_s = s * gap_s;
    }
    return out;
  };
  EXPECT_TRUE(determine_motion(views(0.1, true)));
  EXPECT_FALSE(determine_motion(views(1, true)));
  EXPECT_FALSE(determine_motion(views(0.1, false))) << "one of them has no stamp";
  EXPECT_FALSE(determine_motion({}));
}

TEST(RenewMotions, FindsTheVelocityOfACarriedBoard) {
  const Vector3d velocity(0.3, -0.2, 0.1);
  Adjustment a = carried(velocity, 1.0 / 15, 15);
  renew_motions(a, BoardShape(a.board), false);
  const BoardMotion& middle = a.motions[7];
  ASSERT_TRUE(middle.is_known);
  EXPECT_NEAR(middle.at_s, 7 / 15.0, 1e-9);
  const Vector3d expected = a.world_from_board[7].rotation.conjugate() * velocity;  // in the board's own axes
  EXPECT_LT((middle.expected.col(0).tail<3>() - expected).norm(), 0.02);
  EXPECT_LT(middle.expected.col(0).head<3>().norm(), 0.05) << "it does not turn";
  EXPECT_LT(middle.expected.col(1).tail<3>().norm(), 0.3) << "and is not accelerated";
  for (const Eigen::Matrix2d& information : middle.information)
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(information).eigenvalues().minCoeff(), 0);
}

TEST(RenewMotions, DoNotDependOnTheWorldFrame) {
  Adjustment here = carried({0.3, -0.2, 0.1}, 1.0 / 15, 15), there = here;
  const calib::Rigid3d move{Eigen::Quaterniond(Eigen::AngleAxisd(1.2, Vector3d(1, -1, 2).normalized())), {4, 5, -6}};
  for (AdjustedCamera& camera : there.cameras) camera.cam_from_world = camera.cam_from_world * calib::inverse(move);
  for (calib::Rigid3d& pose : there.world_from_board) pose = move * pose;
  renew_motions(here, BoardShape(here.board), false);
  renew_motions(there, BoardShape(there.board), false);
  for (std::size_t s = 0; s < here.motions.size(); ++s) {
    ASSERT_EQ(here.motions[s].is_known, there.motions[s].is_known);
    EXPECT_LT((here.motions[s].expected - there.motions[s].expected).norm(), 1e-6) << s;
  }
}

TEST(RenewMotions, LeaveBoardsAtRestWhereSetsAreFarApart) {
  Adjustment a = carried({0.3, 0, 0}, 2.0, 6);
  renew_motions(a, BoardShape(a.board), false);
  for (const BoardMotion& motion : a.motions) EXPECT_FALSE(motion.is_known);
}

TEST(CalibrationErrors, JoinTheirFactsAndHaveTheFirstFault) {
  const std::vector<Reason> reasons{{"one thing", Fault::none}, {"; and another", Fault::wrong_radius, {"cam0"}}};
  const CalibrationError error(reasons);
  EXPECT_STREQ(error.what(), "one thing; and another");
  EXPECT_EQ(error.fault(), Fault::wrong_radius);
  EXPECT_EQ(facts(after("camera cam1: ", error.reasons())), "camera cam1: one thing; and another");
  EXPECT_EQ(facts(after("nothing is known", {})), "nothing is known");
  EXPECT_EQ(CalibrationError("a fact").fault(), Fault::none);
}

}  // namespace
}  // namespace huetrack::solver
