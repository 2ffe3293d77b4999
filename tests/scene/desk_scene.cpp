#include "scene/desk_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "particle_filter/random.h"

namespace huetrack::scene {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float room_half_m = 1.6f, room_height_m = 2.4f;
constexpr float sheet_half_x_m = 0.14f, sheet_half_y_m = 0.115f, rectangle_half_x_m = 0.1f, rectangle_half_y_m = 0.075f;
constexpr float white = 0.75f, black = 0.02f;
constexpr int print_side = 2048;
constexpr float texel_m = 0.0014f;

// Equal numbers on every platform, unlike the distributions of <random>.
double uniform(std::mt19937_64& random, double from, double to) {
  return from + (to - from) * static_cast<double>(random() >> 11) / 9007199254740992.0;
}

// Pieces of paper of all sizes, one over the other.
std::vector<std::uint8_t> printed_sheet(std::mt19937_64& random) {
  std::vector<std::uint8_t> sheet(static_cast<std::size_t>(print_side) * print_side, 75);
  constexpr int pieces = 6000;
  for (int i = 0; i < pieces; ++i) {
    const double larger = 1 - static_cast<double>(i) / pieces;  // the small ones come last, on top
    const double half_x = uniform(random, 4, 9 + 80 * larger * larger), half_y = uniform(random, 4, 9 + 60 * larger);
    const double angle = uniform(random, 0, std::numbers::pi), c = std::cos(angle), s = std::sin(angle);
    const double cx = uniform(random, 0, print_side), cy = uniform(random, 0, print_side);
    const auto light = static_cast<std::uint8_t>(255 * std::pow(uniform(random, 0.15, 0.95), 2.0));
    const int reach = static_cast<int>(std::hypot(half_x, half_y)) + 1;
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        if (std::abs(c * dx + s * dy) > half_x || std::abs(c * dy - s * dx) > half_y) continue;
        const int x = (static_cast<int>(cx) + dx) & (print_side - 1),
                  y = (static_cast<int>(cy) + dy) & (print_side - 1);
        sheet[static_cast<std::size_t>(y * print_side + x)] = light;
      }
    }
  }
  return sheet;
}

// What a cheap lens does: 1 2 1 twice along rows and columns, a standard deviation of a pixel.
void blur(std::vector<float>& light, std::vector<float>& other, int width) {
  const auto pass = [](const std::vector<float>& from, std::vector<float>& to, std::ptrdiff_t step) {
    const auto n = static_cast<std::ptrdiff_t>(from.size());
    const auto at = [&](std::ptrdiff_t i) {
      return from[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i, 0, n - 1))];
    };
    for (std::ptrdiff_t i = 0; i < n; ++i)
      to[static_cast<std::size_t>(i)] = 0.25f * at(i - step) + 0.5f * at(i) + 0.25f * at(i + step);
  };
  for (const std::ptrdiff_t step : {std::ptrdiff_t{1}, static_cast<std::ptrdiff_t>(width)})
    pass(light, other, step), pass(other, light, step);
}

}  // namespace

DeskScene::DeskScene(std::uint64_t seed) {
  std::mt19937_64 random(seed * 7919 + 17);
  print_ = printed_sheet(random);
  while (boxes_.size() < 11) {
    const double angle = uniform(random, 0, 2 * std::numbers::pi), away = uniform(random, 0.25, 0.85);
    // One after the other: the order in which arguments are evaluated is the compiler's choice.
    const double half_z = uniform(random, 0.01, 0.07), half_y = uniform(random, 0.02, 0.07);
    const Vector3d half(uniform(random, 0.03, 0.08), half_y, half_z);
    const double turn = uniform(random, 0, std::numbers::pi);
    boxes_.push_back({Vector3d(away * std::cos(angle), away * std::sin(angle), half.z()).cast<float>(),
                      half.cast<float>(),
                      static_cast<float>(std::cos(turn)),
                      static_cast<float>(std::sin(turn)),
                      {static_cast<float>(uniform(random, 0, 2)), static_cast<float>(uniform(random, 0, 2))}});
  }
  camera.name = "cam0";
  camera.image_size = {320, 240};
  camera.model = calib::CameraModel(calib::PinholeRadtan{
      .fx = 246.4, .fy = 246.1, .cx = 157.8, .cy = 122.1, .distortion = {-0.125, 0.024, -0.0004, 0.0005}});
}

std::vector<Vector3d> DeskScene::rectangle_corners() {
  const double x = static_cast<double>(rectangle_half_x_m), y = static_cast<double>(rectangle_half_y_m);
  return {{-x, y, 0}, {x, y, 0}, {x, -y, 0}, {-x, -y, 0}};
}

float DeskScene::print(float x, float y) const {
  const float u = x / texel_m, v = y / texel_m;
  const float fu = std::floor(u), fv = std::floor(v), a = u - fu, b = v - fv;
  const int u0 = static_cast<int>(fu) & (print_side - 1), v0 = static_cast<int>(fv) & (print_side - 1);
  const int u1 = (u0 + 1) & (print_side - 1), v1 = (v0 + 1) & (print_side - 1);
  const auto at = [this](int column, int row) {
    return static_cast<float>(print_[static_cast<std::size_t>(row * print_side + column)]) / 255;
  };
  return (1 - b) * ((1 - a) * at(u0, v0) + a * at(u1, v0)) + b * ((1 - a) * at(u0, v1) + a * at(u1, v1));
}

float DeskScene::seen(const Vector3f& from, const Vector3f& direction) const {
  // The room from within: on each axis the wall that the ray goes towards.
  const Vector3f walls(std::copysign(room_half_m, direction.x()), std::copysign(room_half_m, direction.y()),
                       direction.z() > 0 ? room_height_m : 0);
  const Vector3f to_wall = (walls - from).cwiseQuotient(direction);
  int axis = 0;
  float nearest = to_wall.minCoeff(&axis);
  const Box* in_front = nullptr;
  const float length2 = direction.squaredNorm();
  for (const Box& box : boxes_) {
    const Vector3f off = box.centre - from;
    const float along = off.dot(direction);
    if (along <= 0 || (off.squaredNorm() - box.half.squaredNorm()) * length2 > along * along) continue;
    const Vector3f o = box.turned(-off), slope = box.turned(direction).cwiseInverse();
    const Vector3f a = (-box.half - o).cwiseProduct(slope), b = (box.half - o).cwiseProduct(slope);
    int face = 0;
    const float enter = a.cwiseMin(b).maxCoeff(&face);
    if (!(enter > 0 && enter < nearest && enter < a.cwiseMax(b).minCoeff())) continue;
    nearest = enter, axis = face, in_front = &box;
  }
  if (in_front) {
    constexpr std::array shade{0.75f, 0.55f, 1.0f};
    const Vector3f p = in_front->turned(from + nearest * direction - in_front->centre);
    const auto side = static_cast<float>(axis);
    return shade[static_cast<std::size_t>(axis)] * print(in_front->printed.x() + 0.4f * side + p[axis == 0 ? 1 : 0],
                                                         in_front->printed.y() + p[axis == 2 ? 1 : 2]);
  }
  const Vector3f p = from + nearest * direction;
  if (axis < 2) return 0.8f * print(p[1 - axis] + 0.7f, p.z() + 0.3f * static_cast<float>(axis));
  if (direction.z() > 0) return 0.5f;  // the ceiling
  if (std::abs(p.x()) < rectangle_half_x_m && std::abs(p.y()) < rectangle_half_y_m) return black;
  if (std::abs(p.x()) < sheet_half_x_m && std::abs(p.y()) < sheet_half_y_m) return white;
  return print(p.x(), p.y());
}

HandHeld::HandHeld(const HandHeldOptions& options) : options_(options) {
  std::mt19937_64 random(options.seed * 104729 + 5);
  for (std::size_t axis = 0; axis < 6; ++axis) {
    // Roll moves less than the two others, as hands do it.
    const double size = axis == 2 ? 0.4 : axis < 3 ? 1.0 : options.sway_m;
    waves_[axis][0] = {size, uniform(random, 0.35, 0.65), uniform(random, 0, 2 * std::numbers::pi)};
    waves_[axis][1] = {0.3 * size, uniform(random, 1.0, 1.8), uniform(random, 0, 2 * std::numbers::pi)};
  }
  double fastest = 0;
  constexpr double step_s = 0.005;
  for (double t = 0; t < options.length_s; t += step_s) {
    std::array<double, 3> rate{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const Wave& w : waves_[axis])
        rate[axis] +=
            w.amplitude * 2 * std::numbers::pi * w.hertz * std::cos(2 * std::numbers::pi * w.hertz * t + w.phase);
    }
    fastest = std::max(fastest, envelope(t) * std::hypot(rate[0], rate[1], rate[2]));
  }
  const double scale = options.fastest_deg_s * std::numbers::pi / 180 / fastest;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (Wave& w : waves_[axis]) w.amplitude *= scale;
  }
  for (Wave& w : tremor_)
    w = {options.tremor_deg * std::numbers::pi / 180, uniform(random, 6, 10), uniform(random, 0, 2 * std::numbers::pi)};
}

double HandHeld::envelope(double t_s) const {
  if (options_.still_s <= 0) return 1;
  constexpr double ramp_s = 1.8;
  const double x =
      std::clamp(std::min(t_s - options_.still_s, options_.length_s - options_.still_s - t_s) / ramp_s, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

calib::Rigid3d HandHeld::world_from_camera(double t_s) const {
  // From (0.02, -0.36, 0.44) at the rectangle, and about that.
  const Vector3d from(0.02, -0.36, 0.44), z = (Vector3d(0.01, 0.02, 0) - from).normalized();
  const Vector3d x = z.cross(Vector3d::UnitZ()).normalized(), y = z.cross(x);
  Eigen::Matrix3d facing;
  facing << x, y, z;
  std::array<double, 6> wave{};
  const double e = envelope(t_s);
  for (std::size_t axis = 0; axis < 6; ++axis) {
    for (const Wave& w : waves_[axis]) {
      const double at_start = options_.still_s > 0 ? 0 : w.amplitude * std::sin(w.phase);
      wave[axis] += e * (w.amplitude * std::sin(2 * std::numbers::pi * w.hertz * t_s + w.phase) - at_start);
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Wave& w = tremor_[axis];
    wave[axis] += e * w.amplitude * std::sin(2 * std::numbers::pi * w.hertz * t_s + w.phase);
  }
  const Vector3d turn(wave[0], wave[1], wave[2]);
  const double angle = turn.norm();
  const Eigen::Quaterniond turned =
      angle > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle)) : Eigen::Quaterniond::Identity();
  return {(Eigen::Quaterniond(facing) * turned).normalized(), from + Vector3d(wave[3], wave[4], 0.5 * wave[5])};
}

std::vector<capture::Frame> render(const DeskScene& scene, const HandHeld& hand, const DeskRenderOptions& options) {
  const int width = scene.camera.image_size.width, height = scene.camera.image_size.height;
  constexpr int samples = 4;  // per pixel, each at its own place and moment of the exposure
  constexpr std::array<float, samples> du{-0.25f, 0.25f, 0.25f, -0.25f}, dv{-0.25f, 0.25f, -0.25f, 0.25f};
  std::vector<Vector3f> rays(static_cast<std::size_t>(width * height * samples));
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      for (std::size_t k = 0; k < samples; ++k)
        rays[static_cast<std::size_t>((v * width + u) * samples) + k] =
            scene.camera.model.ray({{u + static_cast<double>(du[k]), v + static_cast<double>(dv[k])}})
                .value_or(Vector3d::UnitZ())
                .cast<float>();
    }
  }
  // sRGB's curve, by table.
  std::array<float, 4097> code{};
  for (std::size_t i = 0; i < code.size(); ++i) {
    const double light = static_cast<double>(i) / 4096;
    code[i] = static_cast<float>(255 * (light < 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055));
  }
  particle_filter::Rng rng(options.seed);
  std::vector<float> noise(static_cast<std::size_t>(width * height)), light(noise.size()), blurred(noise.size());
  std::vector<capture::Frame> frames;
  for (int index = 0; index < options.frames; ++index) {
    capture::WritableImage image =
        capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, width, height);
    rng.fill_normal(noise);
    for (int v = 0; v < height; ++v) {
      const double row_s = index / options.fps + (static_cast<double>(v) / (height - 1) - 0.5) * options.readout_s;
      std::array<Eigen::Matrix3f, samples> turn;
      std::array<Vector3f, samples> from;
      for (std::size_t k = 0; k < samples; ++k) {
        const double moment = (static_cast<double>(k) + 0.5) / samples - 0.5;
        const calib::Rigid3d pose = hand.world_from_camera(row_s + moment * options.exposure_s);
        turn[k] = pose.rotation.toRotationMatrix().cast<float>(), from[k] = pose.translation.cast<float>();
      }
      for (int u = 0; u < width; ++u) {
        const auto pixel = static_cast<std::size_t>(v * width + u);
        light[pixel] = 0;
        for (std::size_t k = 0; k < samples; ++k)
          light[pixel] += scene.seen(from[k], turn[k] * rays[pixel * samples + k]) / samples;
      }
    }
    blur(light, blurred, width);
    for (std::size_t i = 0; i < light.size(); ++i) {
      const float level = code[static_cast<std::size_t>(std::clamp(light[i], 0.0f, 1.0f) * 4096)] +
                          static_cast<float>(options.noise_stddev) * noise[i];
      image.data[0][i] = static_cast<std::uint8_t>(std::clamp(std::lround(level), 0L, 255L));
    }
    capture::Frame frame;
    frame.sequence = static_cast<std::uint32_t>(index);
    frame.captured_at = capture::Timestamp(capture::duration_of(index / options.fps));
    frame.pixels = image.image;
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace huetrack::scene
