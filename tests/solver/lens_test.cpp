#include "calib/solver/lens.h"

#include <gtest/gtest.h>

#include <cmath>

namespace huetrack::solver {
namespace {

struct NamedLens {
  LensModel lens;
  LensParameters parameters;
};
std::ostream& operator<<(std::ostream& out, const NamedLens& l) {
  return out << name(l.lens);
}

LensParameters values(std::initializer_list<double> list) {
  LensParameters l = LensParameters::Zero();
  std::ranges::copy(list, l.data());
  return l;
}

class EveryLens : public testing::TestWithParam<NamedLens> {};
INSTANTIATE_TEST_SUITE_P(
    All, EveryLens,
    testing::Values(NamedLens{LensModel::radtan4, values({600, 610, 320, 240, -0.3, 0.1, 0.001, -0.002})},
                    NamedLens{LensModel::radtan5, values({600, 610, 320, 240, -0.3, 0.1, 0.001, -0.002, 0.03})},
                    NamedLens{LensModel::radtan8,
                              values({600, 610, 320, 240, 0.3, 0.1, 0.001, -0.002, 0.03, 0.4, 0.15, 0.02})},
                    NamedLens{LensModel::fisheye, values({300, 310, 320, 240, 0.05, -0.01, 0.003, -0.001})},
                    NamedLens{LensModel::stereographic,
                              values({300, 310, 320, 240, 0.1, -0.05, 0.001, -0.002, 0.02, -0.004, 0.003, -0.001})}),
    [](const auto& param_info) { return std::string(name(param_info.param.lens)); });

TEST_P(EveryLens, ProjectsLikeCameraModel) {
  const auto& [lens, parameters] = GetParam();
  const calib::CameraModel model = camera_model(lens, parameters);
  EXPECT_EQ(parameters_of(model), parameters);
  EXPECT_EQ(lens_model_of(model), lens);
  for (double x = -0.6; x <= 0.6; x += 0.15) {
    for (double y = -0.6; y <= 0.6; y += 0.15) {
      const Eigen::Vector3d p = 1.7 * Eigen::Vector3d(x, y, 1);
      Eigen::Vector2d px;
      PixelByPoint by_point;
      calib::CameraModel::Jacobian expected;
      ASSERT_TRUE(project(lens, parameters, p, px, &by_point, nullptr));
      const auto finished = model.project(p, expected);
      ASSERT_TRUE(finished);
      EXPECT_NEAR((px - finished->px).norm(), 0, 1e-10);
      EXPECT_NEAR((by_point - expected).norm(), 0, 1e-9);
    }
  }
}

TEST_P(EveryLens, DerivativesByTheLensAgreeWithDifferences) {
  const auto& [lens, parameters] = GetParam();
  for (const Eigen::Vector3d& p :
       {Eigen::Vector3d(0.3, -0.2, 1.1), Eigen::Vector3d(-0.5, 0.6, 1.3), Eigen::Vector3d(0, 0, 1)}) {
    Eigen::Vector2d px;
    PixelByLens by_lens;
    ASSERT_TRUE(project(lens, parameters, p, px, nullptr, &by_lens));
    for (int i = 0; i < parameter_count(lens); ++i) {
      const double step = i < 4 ? 1e-3 : 1e-6;
      LensParameters more = parameters, less = parameters;
      more(i) += step;
      less(i) -= step;
      Eigen::Vector2d px_more, px_less;
      ASSERT_TRUE(project(lens, more, p, px_more, nullptr, nullptr));
      ASSERT_TRUE(project(lens, less, p, px_less, nullptr, nullptr));
      EXPECT_NEAR(((px_more - px_less) / (2 * step) - by_lens.col(i)).norm(), 0, 1e-5) << parameter_name(lens, i);
    }
    EXPECT_TRUE(by_lens.rightCols(12 - parameter_count(lens)).isZero() || lens != LensModel::fisheye);
  }
}

TEST_P(EveryLens, HasNoPixelBehindTheCamera) {
  const auto& [lens, parameters] = GetParam();
  Eigen::Vector2d px;
  EXPECT_FALSE(project(lens, parameters, {0, 0, -1}, px, nullptr, nullptr));
  EXPECT_FALSE(project(lens, parameters, {0, 0, std::nan("")}, px, nullptr, nullptr));
}

}  // namespace
}  // namespace huetrack::solver
