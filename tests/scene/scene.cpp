#include "scene/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "particle_filter/random.h"

namespace huetrack::scene {
namespace {

using Eigen::Vector3d;

// Full-range Y, U, V of BT.601, chroma about 0.
Vector3d yuv_of(const Vector3d& rgb) {
  const double y = 0.299 * rgb.x() + 0.587 * rgb.y() + 0.114 * rgb.z();
  return {y, (rgb.z() - y) / 1.772, (rgb.x() - y) / 1.402};
}

// A dull room: grey and brown patches, darker towards the floor. No lime, no pink.
Vector3d background(double u, double v, int camera) {
  const double wave =
      std::sin(0.021 * u + camera) * std::cos(0.017 * v - 2 * camera) + 0.4 * std::sin(0.11 * u + 0.07 * v);
  const double light = 0.45 + 0.12 * wave;
  return {light * 1.04, light, light * 0.93};
}

bool hidden(const Scene& scene, const Vector3d& eye, const Vector3d& point) {
  return std::ranges::any_of(scene.walls, [&](const Wall& w) {
    const Vector3d normal = w.along.cross(w.up);
    const double to = normal.dot(point - eye);
    if (std::abs(to) < 1e-12) return false;
    const double s = normal.dot(w.corner - eye) / to;
    if (s <= 0 || s >= 1) return false;
    const Vector3d hit = eye + s * (point - eye) - w.corner;
    const double a = hit.dot(w.along) / w.along.squaredNorm(), b = hit.dot(w.up) / w.up.squaredNorm();
    return a >= 0 && a <= 1 && b >= 0 && b <= 1;
  });
}

// The rays of a camera's pixels, 4x4 of each, kept: to find one through the lens is nearly all that a picture takes.
class PixelRays {
 public:
  using Rays = std::array<std::optional<Vector3d>, 16>;
  explicit PixelRays(const calib::Camera& camera)
      : camera_(camera), where_(static_cast<std::size_t>(camera.image_size.width * camera.image_size.height), -1) {}

  // Valid until the next call.
  const Rays& of(int u, int v) {
    int& where = where_[static_cast<std::size_t>(v * camera_.image_size.width + u)];
    if (where < 0) {
      where = static_cast<int>(known_.size());
      Rays& rays = known_.emplace_back();
      for (int s = 0; s < 16; ++s)
        rays[static_cast<std::size_t>(s)] = camera_.model.ray({{u + (s % 4 - 1.5) / 4, v + (s / 4 - 1.5) / 4}});
    }
    return known_[static_cast<std::size_t>(where)];
  }

 private:
  const calib::Camera& camera_;
  std::vector<int> where_;  // in known_, per pixel
  std::vector<Rays> known_;
};

// Share and shade of each ball over the pixels that it may cover: 4x4 rays per pixel against the sphere.
void draw_ball(const Scene& scene, const calib::Camera& camera, PixelRays& rays, const BallOptions& ball,
               const Vector3d& centre, std::vector<Vector3d>& yuv) {
  const Vector3d p_cam = camera.cam_from_world * centre;
  const auto at = camera.model.project(p_cam);
  if (!at) return;
  const double reach = 2 + 1.6 * ball.radius_m * std::max(camera.model.fx(), camera.model.fy()) / p_cam.norm();
  const Eigen::Matrix3d world_from_cam = camera.cam_from_world.rotation.toRotationMatrix().transpose();
  const Vector3d eye = camera.centre();
  const Vector3d light = Vector3d(0.3, -0.2, 1).normalized();
  const auto clip = [](double x, int size) { return std::clamp(static_cast<int>(std::lround(x)), 0, size - 1); };
  for (int v = clip(at->px.y() - reach, camera.image_size.height);
       v <= clip(at->px.y() + reach, camera.image_size.height); ++v) {
    for (int u = clip(at->px.x() - reach, camera.image_size.width);
         u <= clip(at->px.x() + reach, camera.image_size.width); ++u) {
      Vector3d color = Vector3d::Zero();
      int hits = 0;
      for (const std::optional<Vector3d>& ray : rays.of(u, v)) {
        if (!ray) continue;
        const double along = ray->dot(p_cam);
        const double miss2 = p_cam.squaredNorm() - along * along;
        if (along <= 0 || miss2 > ball.radius_m * ball.radius_m) continue;
        const Vector3d on_ball_cam = *ray * (along - std::sqrt(ball.radius_m * ball.radius_m - miss2));
        const Vector3d normal = (world_from_cam * (on_ball_cam - p_cam)).normalized();
        if (hidden(scene, eye, centre + ball.radius_m * normal)) continue;
        color += ball.rgb * (0.55 + 0.45 * std::max(0.0, normal.dot(light)));
        ++hits;
      }
      Vector3d& pixel = yuv[static_cast<std::size_t>(v * camera.image_size.width + u)];
      if (hits > 0) pixel = (yuv_of(color / hits) * hits + pixel * (16 - hits)) / 16;
    }
  }
}

capture::Image encode(const std::vector<Vector3d>& yuv, const RenderOptions& options, calib::ImageSize size,
                      particle_filter::Rng& rng, std::vector<float>& noise) {
  capture::WritableImage out = capture::make_image(options.format, options.range, size.width, size.height);
  const bool limited = options.range == capture::ColorRange::limited;
  noise.resize(3 * yuv.size());
  rng.fill_normal(noise);
  const auto byte = [](double x) { return static_cast<std::uint8_t>(std::clamp(std::lround(x), 0L, 255L)); };
  const auto index = [&](int u, int v) { return static_cast<std::size_t>(v * size.width + u); };
  const auto y_of = [&](int u, int v) {
    const std::size_t i = index(u, v);
    return byte((limited ? 16 + 219 * yuv[i].x() : 255 * yuv[i].x()) +
                options.pixel_noise_stddev * static_cast<double>(noise[i]));
  };
  // Chroma is the mean over the pixels that share the sample, as a camera's is.
  const auto chroma = [&](int u, int v, int du, int dv, int which) {
    double sum = 0;
    for (int j = 0; j < dv; ++j) {
      for (int i = 0; i < du; ++i) sum += yuv[index(u + i, v + j)](which);
    }
    const double n = static_cast<double>(noise[static_cast<std::size_t>(which) * yuv.size() + index(u, v)]);
    return byte(128 + (limited ? 224 : 255) * sum / (du * dv) + options.pixel_noise_stddev * n);
  };
  const auto at = [&](int plane, int row, int offset) -> std::uint8_t& {
    return out
        .data[static_cast<std::size_t>(plane)][row * out.image.planes[static_cast<std::size_t>(plane)].stride + offset];
  };
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      switch (options.format) {
        case capture::PixelFormat::yuyv:
          at(0, v, 2 * u) = y_of(u, v);
          if (u % 2 == 0) at(0, v, 2 * u + 1) = chroma(u, v, 2, 1, 1), at(0, v, 2 * u + 3) = chroma(u, v, 2, 1, 2);
          break;
        case capture::PixelFormat::nv12:
          at(0, v, u) = y_of(u, v);
          if (u % 2 == 0 && v % 2 == 0)
            at(1, v / 2, u) = chroma(u, v, 2, 2, 1), at(1, v / 2, u + 1) = chroma(u, v, 2, 2, 2);
          break;
        case capture::PixelFormat::i420:
        case capture::PixelFormat::i422: {
          const int rows = options.format == capture::PixelFormat::i420 ? 2 : 1;
          at(0, v, u) = y_of(u, v);
          if (u % 2 == 0 && v % rows == 0)
            at(1, v / rows, u / 2) = chroma(u, v, 2, rows, 1), at(2, v / rows, u / 2) = chroma(u, v, 2, rows, 2);
          break;
        }
        case capture::PixelFormat::i444:
          at(0, v, u) = y_of(u, v), at(1, v, u) = chroma(u, v, 1, 1, 1), at(2, v, u) = chroma(u, v, 1, 1, 2);
          break;
        case capture::PixelFormat::bgr: {
          const std::size_t i = index(u, v);
          const Vector3d p = 255 * yuv[i];
          const double n = options.pixel_noise_stddev;
          at(0, v, 3 * u) = byte(p.x() + 1.772 * p.y() + n * static_cast<double>(noise[i]));
          at(0, v, 3 * u + 1) =
              byte(p.x() - 0.344136 * p.y() - 0.714136 * p.z() + n * static_cast<double>(noise[yuv.size() + i]));
          at(0, v, 3 * u + 2) = byte(p.x() + 1.402 * p.z() + n * static_cast<double>(noise[2 * yuv.size() + i]));
          break;
        }
        case capture::PixelFormat::grey:
          at(0, v, u) = y_of(u, v);
          break;
      }
    }
  }
  return out.image;
}

}  // namespace

Vector3d Scene::ball_at(std::size_t ball, capture::Timestamp at) const {
  const double t = capture::seconds(at);
  if (balls[ball].path) return balls[ball].path(t);
  return {0.45 * std::sin(1.3 * t + static_cast<double>(ball)), 0.40 * std::cos(1.1 * t), 1 + 0.25 * std::sin(1.7 * t)};
}

SceneBuilder& SceneBuilder::camera(calib::Camera camera) {
  scene_.rig.cameras.push_back(std::move(camera));
  return *this;
}

SceneBuilder& SceneBuilder::ball(BallOptions options) {
  scene_.balls.push_back(std::move(options));
  return *this;
}

SceneBuilder& SceneBuilder::wall(const Wall& wall) {
  scene_.walls.push_back(wall);
  return *this;
}

SceneBuilder& SceneBuilder::cameras_on_ring(const RingOptions& o) {
  for (int i = 0; i < o.count; ++i) {
    // 80 degrees from one to the next for two or three cameras, evenly around for more: never two that face each other.
    const double angle = o.count <= 3 ? i * 80 * std::numbers::pi / 180 : 2 * std::numbers::pi * i / (o.count + 0.5);
    const Vector3d eye(o.radius_m * std::cos(angle), o.radius_m * std::sin(angle), o.height_m);
    const Vector3d forward = (Vector3d(0, 0, o.look_at_height_m) - eye).normalized();
    const Vector3d right = forward.cross(Vector3d::UnitZ()).normalized();
    Eigen::Matrix3d rotation;
    rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    calib::PinholeRadtan lens{
        o.focal_px, o.focal_px, (o.image_size.width - 1) / 2.0, (o.image_size.height - 1) / 2.0, {}};
    std::ranges::copy(o.distortion, lens.distortion.begin());
    calib::Camera camera;
    camera.name = "cam" + std::to_string(i);
    camera.image_size = o.image_size;
    camera.model = calib::CameraModel(lens);
    camera.cam_from_world = {Eigen::Quaterniond(rotation), -(rotation * eye)};
    scene_.rig.cameras.push_back(std::move(camera));
  }
  return *this;
}

std::vector<capture::FrameSet> render(const Scene& scene, const RenderOptions& options) {
  std::vector<capture::FrameSet> out;
  particle_filter::Rng rng(options.seed);
  std::vector<std::vector<Vector3d>> rooms;
  std::vector<PixelRays> rays(scene.rig.cameras.begin(), scene.rig.cameras.end());
  for (std::size_t c = 0; c < scene.rig.cameras.size(); ++c) {
    const calib::ImageSize size = scene.rig.cameras[c].image_size;
    std::vector<Vector3d>& room =
        rooms.emplace_back(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height));
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u)
        room[static_cast<std::size_t>(v * size.width + u)] =
            yuv_of(background(320.0 * u / size.width, 320.0 * v / size.width, static_cast<int>(c)));
    }
  }
  std::vector<float> noise;
  for (int s = 0; s < options.set_count; ++s) {
    capture::FrameSet set;
    set.number = static_cast<std::uint64_t>(s);
    for (std::size_t c = 0; c < scene.rig.cameras.size(); ++c) {
      const calib::Camera& camera = scene.rig.cameras[c];
      const double offset_s = c < options.offset_s.size() ? options.offset_s[c] : 0;
      const capture::Timestamp at(capture::duration_of(s / options.fps + offset_s));
      set.at = std::max(set.at, at);
      if (rng.uniform() < options.dropped_frames) {
        set.frames.emplace_back();
        continue;
      }
      std::vector<Vector3d> yuv = rooms[c];
      for (std::size_t b = 0; b < scene.balls.size(); ++b)
        draw_ball(scene, camera, rays[c], scene.balls[b], scene.ball_at(b, at), yuv);
      set.frames.push_back(capture::Frame{.camera = static_cast<int>(c),
                                          .sequence = static_cast<std::uint32_t>(s),
                                          .captured_at = at,
                                          .pixels = encode(yuv, options, camera.image_size, rng, noise)});
    }
    out.push_back(std::move(set));
  }
  return out;
}

}  // namespace huetrack::scene
