#include "calib/model/batch_projector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <ostream>
#include <random>
#include <string>
#include <vector>

namespace huetrack::calib {
namespace {

struct Points {
  std::vector<float> x, y, z;
};

struct Pixels {
  std::vector<float> u, v;
};

struct BatchLens {
  std::string name;
  CameraModel model;
};

void PrintTo(const BatchLens& lens, std::ostream* out) {
  *out << lens.name;
}

std::vector<BatchLens> batch_lenses() {
  const auto pinhole = [](std::array<double, 8> k) { return CameraModel(PinholeRadtan{500, 501, 322, 241, k}); };
  return {{"pinhole", pinhole({})},
          {"k1_k2", pinhole({-0.145, 0.033, -4e-4, 5e-4})},
          {"k1_folding", pinhole({-0.28, 0, 1e-3, -2e-3})},
          {"k3", pinhole({-0.35, 0.15, 1e-3, -2e-3, 0.05})},
          {"rational", pinhole({0.5, -0.3, 5e-4, 3e-4, 0.02, 0.85, -0.2, 0.03})},
          {"fisheye", CameraModel(FisheyeKannalaBrandt{290, 291, 322, 241, {-0.0034, 0.0011, -0.0005, 0.00002}})},
          {"stereographic",
           CameraModel(Stereographic{290, 291, 322, 241, {-0.03, 0.02, 1e-3, -2e-3, -0.002, 1e-4, 2e-3, 1e-3}})},
          {"stereographic_folding", CameraModel(Stereographic{290, 291, 322, 241, {-0.12, 0.02, 0, 0, -0.005}})},
          {"fisheye_plain", CameraModel(FisheyeKannalaBrandt{290, 291, 322, 241, {}})}};
}

Camera camera(const CameraModel& model) {
  const Rigid3d pose{Eigen::Quaterniond(0.9, 0.1, -0.3, 0.2).normalized(), {0.1, -0.2, 0.4}};
  return {.name = "c", .image_size = {640, 480}, .model = model, .cam_from_world = pose, .timing = {}};
}

// All around the camera: in front, at the side and behind.
Points random_points(std::size_t n, std::uint64_t seed) {
  std::mt19937_64 rng(seed);
  const auto uniform = [&] { return static_cast<float>(static_cast<double>(rng() >> 11) * 0x1p-52 - 1); };
  Points p{std::vector<float>(n), std::vector<float>(n), std::vector<float>(n)};
  for (std::size_t i = 0; i < n; ++i) p.x[i] = 2 * uniform(), p.y[i] = 2 * uniform(), p.z[i] = 2 * uniform();
  return p;
}

Pixels project(const BatchProjector& projector, const Points& p) {
  Pixels out{std::vector<float>(p.x.size()), std::vector<float>(p.x.size())};
  projector.project(p.x.data(), p.y.data(), p.z.data(), p.x.size(), out.u.data(), out.v.data());
  return out;
}

class BatchProjectorContract : public testing::TestWithParam<BatchLens> {};

TEST_P(BatchProjectorContract, AgreesWithTheReferenceInDoublePrecision) {
  const Camera c = camera(GetParam().model);
  const Points p = random_points(20'000, 1);
  const Pixels pixels = project(BatchProjector(c), p);
  int in_image = 0, outside = 0;
  for (std::size_t i = 0; i < p.x.size(); ++i) {
    const Eigen::Vector3d p_cam = c.cam_from_world * Eigen::Vector3d(double(p.x[i]), double(p.y[i]), double(p.z[i]));
    const bool pinhole = c.model.name() == "pinhole_radtan";
    const double theta = std::atan2(p_cam.head<2>().norm(), p_cam.z()), tangent = 2 * std::tan(theta / 2);
    const bool stereographic = c.model.name() == "stereographic";
    const double reach = pinhole         ? p_cam.head<2>().squaredNorm() / (p_cam.z() * p_cam.z())
                         : stereographic ? tangent * tangent
                                         : theta;
    if (std::abs(reach - c.model.limit()) < 1e-4 * (1 + (stereographic ? reach : 0)) || p_cam.norm() < 0.05)
      continue;  // either answer is right
    const auto truth = c.model.project(p_cam);
    const bool found = pixels.u[i] != BatchProjector::outside;
    ASSERT_EQ(pixels.v[i] != BatchProjector::outside, found);
    if (pinhole && reach > 1e5) continue;  // nearly sideways
    ASSERT_EQ(truth.has_value(), found) << p_cam.transpose();
    if (!truth) {
      ++outside;
      continue;
    }
    // Single precision: to 1e-3 px in the image and to as many digits around it.
    const double size = 1 + (truth->px - Eigen::Vector2d(320, 240)).norm() / 1000;
    ASSERT_NEAR(pixels.u[i], truth->px.x(), 1e-3 * size * size * size) << p_cam.transpose();
    ASSERT_NEAR(pixels.v[i], truth->px.y(), 1e-3 * size * size * size) << p_cam.transpose();
    in_image += c.contains(*truth);
  }
  EXPECT_GT(in_image, 500);
  if (c.model.limit() < 3.14 || c.model.name() == "pinhole_radtan") {
    EXPECT_GT(outside, 50);
  }
}

TEST_P(BatchProjectorContract, AnyCountAndAnyAlignmentGiveTheSameBits) {
  const BatchProjector projector(camera(GetParam().model));
  const Points p = random_points(100, 2);
  const Pixels all = project(projector, p);
  for (std::size_t first = 0; first < 20; ++first) {
    for (std::size_t n = 0; first + n <= 70; ++n) {
      std::vector<float> u(n + 2, 7.0f), v(n + 2, 7.0f);
      projector.project(&p.x[first], &p.y[first], &p.z[first], n, &u[1], &v[1]);
      for (std::size_t i = 0; i < n; ++i) {
        ASSERT_EQ(u[i + 1], all.u[first + i]);
        ASSERT_EQ(v[i + 1], all.v[first + i]);
      }
      ASSERT_TRUE(u[0] == 7 && v[0] == 7 && u[n + 1] == 7 && v[n + 1] == 7);  // nothing beside the n is touched
    }
  }
}

TEST_P(BatchProjectorContract, WhatHasNoPixelIsOutside) {
  Camera c = camera(GetParam().model);
  c.cam_from_world = {};
  constexpr float unbounded = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  const Points p{{0, 0, nan, 1, 0, unbounded, 0, unbounded},
                 {0, 0, 0, nan, 0, 0, unbounded, unbounded},
                 {0, -1, 1, 1, nan, 1, 1, unbounded}};
  const Pixels pixels = project(BatchProjector(c), p);
  for (std::size_t i = 0; i < p.x.size(); ++i) {
    EXPECT_EQ(pixels.u[i], BatchProjector::outside) << i;
    EXPECT_EQ(pixels.v[i], BatchProjector::outside) << i;
  }
  const Points axis{{0, 0}, {0, 0}, {1e-6f, 1e6f}};
  const Pixels centre = project(BatchProjector(c), axis);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(centre.u[i], static_cast<float>(c.model.cx()));
    EXPECT_EQ(centre.v[i], static_cast<float>(c.model.cy()));
  }
}

INSTANTIATE_TEST_SUITE_P(Lenses, BatchProjectorContract, testing::ValuesIn(batch_lenses()),
                         [](const auto& test) { return test.param.name; });

// The same recording must give the same track on every machine, so the bits are pinned: AVX-512, AVX2, SSE2 and a
// sanitizer's build all have to arrive at this number.
TEST(BatchProjector, GivesTheSameBitsOnEveryInstructionSet) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const BatchLens& lens : batch_lenses()) {
    const Pixels pixels = project(BatchProjector(camera(lens.model)), random_points(5000, 3));
    for (const auto* values : {&pixels.u, &pixels.v}) {
      for (const float value : *values) hash = (hash ^ std::bit_cast<std::uint32_t>(value)) * 0x100000001b3u;
    }
  }
  EXPECT_EQ(hash, 0x1d520ed29d0aeaf6u) << std::hex << hash;
}

TEST(BatchProjector, AnEmptyBatchIsFine) {
  BatchProjector(camera(CameraModel())).project(nullptr, nullptr, nullptr, 0, nullptr, nullptr);
}

}  // namespace
}  // namespace huetrack::calib
