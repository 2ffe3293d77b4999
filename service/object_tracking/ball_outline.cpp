#include "object_tracking/ball_outline.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>

namespace huetrack::object_tracking {

outline::Picture picture_of(const capture::Image& image) {
  using capture::PixelFormat;
  outline::Picture out;
  out.width = image.width, out.height = image.height;
  out.on_demand = image.on_demand.get();
  out.is_limited = image.range == capture::ColorRange::limited && image.format != PixelFormat::bgr;
  const auto plane = [&](std::size_t i, std::ptrdiff_t offset, std::ptrdiff_t step) {
    return outline::Samples{image.planes[i].data + offset, image.planes[i].stride, step};
  };
  switch (image.format) {
    case PixelFormat::yuyv:
      out.light = plane(0, 0, 2), out.blue = plane(0, 1, 4), out.red = plane(0, 3, 4);
      out.columns = 2;
      break;
    case PixelFormat::nv12:
      out.light = plane(0, 0, 1), out.blue = plane(1, 0, 2), out.red = plane(1, 1, 2);
      out.columns = out.rows = 2;
      break;
    case PixelFormat::i420:
    case PixelFormat::i422:
    case PixelFormat::i444:
      out.light = plane(0, 0, 1), out.blue = plane(1, 0, 1), out.red = plane(2, 0, 1);
      out.columns = image.format == PixelFormat::i444 ? 1 : 2;
      out.rows = image.format == PixelFormat::i420 ? 2 : 1;
      break;
    case PixelFormat::bgr:
      out.light = plane(0, 0, 3);
      out.is_bgr = true;
      break;
    case PixelFormat::grey:
      out.light = plane(0, 0, 1);
      out.is_grey = true;
      break;
  }
  return out;
}

outline::Picture picture_of(const capture::Matches::Patch& patch, int width, int height) {
  outline::Picture out = picture_of(patch.image);
  out.width = width, out.height = height;
  out.part_u = patch.at.u, out.part_v = patch.at.v, out.part_width = patch.at.width, out.part_height = patch.at.height;
  out.light.first_u = patch.at.u, out.light.first_v = patch.at.v;
  for (outline::Samples* chroma : {&out.blue, &out.red})
    chroma->first_u = patch.at.u / out.columns, chroma->first_v = patch.at.v / out.rows;
  return out;
}

std::optional<BallOutline> outline_of(const calib::Camera& camera, const Eigen::Vector3d& p_world, double radius_m) {
  const Eigen::Vector3d p = camera.cam_from_world * p_world;
  const double distance = p.norm(), sine = radius_m / distance;
  if (!(sine < 1)) return std::nullopt;  // inside of the ball
  const auto centre = camera.model.project(p);
  if (!centre) return std::nullopt;
  const double cosine = std::sqrt(1 - sine * sine);
  const Eigen::Vector3d ahead = p / distance;
  const Eigen::Vector3d aside = ahead.cross(Eigen::Vector3d::UnitY()).normalized(), below = ahead.cross(aside);
  std::array<Eigen::Vector2d, 4> edge;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d across = (i < 2 ? 1.0 : -1.0) * (i % 2 == 0 ? aside : below);
    const auto px = camera.model.project(cosine * ahead + sine * across);
    if (!px) return std::nullopt;
    edge[i] = px->px;
  }
  BallOutline out;
  out.centre_px = centre->px;
  out.ellipse.centre = (edge[0] + edge[1] + edge[2] + edge[3]) / 4;
  out.ellipse.axes << (edge[0] - edge[2]) / 2, (edge[1] - edge[3]) / 2;
  return out;
}

std::optional<outline::Picture> picture_around(const TargetView& view, const Eigen::Vector2d& px) {
  if (capture::has_pixels(*view.image)) return picture_of(*view.image);
  if (!view.frame->matches) return std::nullopt;
  const capture::Matches::Patch* best = nullptr;
  double best_px = 0;
  for (const auto& patch : view.frame->matches->patches) {
    const double from_left = px.x() - patch.at.u, from_top = px.y() - patch.at.v;
    const double inside_px = std::min({from_left, patch.at.width - from_left, from_top, patch.at.height - from_top});
    if (inside_px > best_px) best = &patch, best_px = inside_px;
  }
  if (best == nullptr) return std::nullopt;
  return picture_of(*best, view.image->width, view.image->height);
}

}  // namespace huetrack::object_tracking
