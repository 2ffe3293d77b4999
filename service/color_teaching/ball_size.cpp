#include "color_teaching/ball_size.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/model/median.h"
#include "object_tracking/ball_outline.h"
#include "outline/background.h"
#include "outline/outline_fit.h"

namespace huetrack::color_teaching {
namespace {

using object_tracking::outline_of;

// Two regions are of one ball if their rays meet to so many pixels, or so much of their radius: the frames may not be
// of one moment, and thresholds cut off the dark side.
constexpr double meets_px = 3, meets_radii = 0.5;

// A disc's box is as wide as it is high, and pi/4 of it is filled. Motion and a rolling shutter stretch it by a third.
constexpr double most_stretched = 1.45, least_filled = 0.75, most_filled = 1.2;

// An outline that counts: enough of its edge is seen, and its size is known.
constexpr double least_visible = 0.75, least_sure = 0.08;
constexpr int rounds = 3;              // of fit and distance, each beginning with the radius of the one before
constexpr double settled_log = 0.003;  // of the logarithm
constexpr double ahead_px = 0;         // no motion is predicted here
constexpr double hidden_radii = 1.15, hidden_px = 4;  // around the ball, which is not what is behind it there
constexpr double least_fitted = 0.3;                  // of a ball's outlines, that fit
constexpr std::size_t enough_tried = 4;               // to say that it is no ball

// What remains in every outline of a camera, from its light and its lens' blur: the spread of proposals about the truth
// (EXPERIMENTS.md).
constexpr double bias_sigma = 0.012, bias_sigma_px = 0.12;
// Light from one side makes small balls too small (design.md, "Size"; EXPERIMENTS.md). It is that of all cameras,
// however many vote: half of the error is corrected, half is in the sigma.
constexpr double too_small_px = 0.3, too_small_less = 0.03, expected_of_light = 0.5, unknown_of_light = 0.5;

double too_small_by_px(double radius_px) {
  return std::max(0.0, too_small_px - too_small_less * radius_px);
}

// Of regions, whose thresholds remove or leave some of the edge.
constexpr double of_regions = 0.1, of_regions_px = 0.6;
// Of one moment nothing shows whether the regions are whole: an error of 20 % is usual where hands hide a part.
constexpr double of_one_moment = 0.15;
constexpr double most_apart = 0.2;  // of logarithms: views that are inconsistent

// A clear difference: three sigmas of the proposal, and the error of a ruler laid on a ball.
constexpr double clear_sigmas = 3, ruler = 0.05;

struct Seen {
  const calib::Camera* camera;
  const MaskRegion* region;
};

std::optional<Eigen::Vector3d> meeting_point(std::span<const Seen> views) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const auto& [camera, region] : views) {
    const auto ray = camera->model.ray({region->centre});
    if (!ray) return std::nullopt;
    const Eigen::Vector3d direction = camera->cam_from_world.rotation.conjugate() * ray->normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - direction * direction.transpose();
    a += across;
    b += across * camera->centre();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(a);
  if (solver.eigenvalues()[0] < 1e-3) return std::nullopt;  // nearly parallel
  const Eigen::Vector3d at = a.ldlt().solve(b);
  for (const auto& [camera, region] : views) {
    const auto px = camera->project_world(at);
    if (!px || (px->px - region->centre).norm() > std::max(meets_px, meets_radii * region->radius_px()))
      return std::nullopt;
  }
  return at;
}

// Of a ball there, with an outline of the region's area.
std::optional<double> radius_there(const Seen& view, const Eigen::Vector3d& at, double about_m) {
  const auto ball = outline_of(*view.camera, at, about_m);
  if (!ball) return std::nullopt;
  return about_m * view.region->radius_px() / std::sqrt(std::abs(ball->ellipse.axes.determinant()));
}

std::vector<Seen> seen_of(const calib::CameraRig& rig, std::span<const ColoredRegion> views) {
  std::vector<Seen> seen;
  for (const ColoredRegion& view : views) seen.push_back({&rig.cameras[view.camera], &view.region});
  return seen;
}

// One moment's views of a ball, by their regions.
struct RegionRadii {
  Eigen::Vector3d at;                           // where the views meet
  std::vector<std::optional<double>> of_views;  // nullopt: a ball there has no outline in it

  // nullopt: fewer than two views have one
  std::optional<double> median() const {
    std::vector<double> known;
    for (const auto& radius : of_views)
      if (radius) known.push_back(*radius);
    return known.size() < 2 ? std::nullopt : std::optional(calib::median(std::move(known)));
  }
};

// nullopt: they do not meet.
std::optional<RegionRadii> radii_of_regions(const calib::CameraRig& rig, std::span<const ColoredRegion> views) {
  const auto seen = seen_of(rig, views);
  const auto at = meeting_point(seen);
  if (!at) return std::nullopt;
  constexpr double any_m = 0.01;  // only the outline's shape is of interest
  RegionRadii radii{.at = *at, .of_views = {}};
  for (const Seen& view : seen) radii.of_views.push_back(radius_there(view, *at, any_m));
  return radii;
}

// The background behind the ball in one view, from the same camera's pictures of all other moments.
outline::Background behind_in(std::span<const BallMoment> moments, std::size_t moment, const ColoredRegion& view) {
  const capture::Image& image = *moments[moment].pictures[view.camera];
  outline::Background behind(image.width, image.height);
  const outline::ObjectDisc there{view.region.centre, view.region.radius_px()};
  for (std::size_t m = 0; m < moments.size(); ++m) {
    const capture::Image* other = moments[m].pictures[view.camera];
    if (other == nullptr || m == moment) continue;
    const auto own = std::ranges::find(moments[m].views, view.camera, &ColoredRegion::camera);
    if (own == moments[m].views.end()) continue;  // it is unknown where the ball hides it
    const outline::ObjectDisc hidden{own->region.centre, hidden_radii * own->region.radius_px() + hidden_px};
    behind.learn(object_tracking::picture_of(*other), there, Eigen::Vector2d::Constant(ahead_px), &hidden, 1);
  }
  return behind;
}

struct Vote {
  std::size_t moment, camera;
  double log_radius, sigma;
  double of_light = 0;  // 1 sigma of the effect of light from one side, of the logarithm
};

struct Outlines {
  std::vector<Vote> votes;
  std::size_t tried = 0, misfits = 0;
};

// Each fit teaches the next of the same camera how soft its edges are.
//   radii  per moment, by its regions
Outlines outlines_of(const calib::CameraRig& rig, std::span<const BallMoment> moments,
                     std::span<const std::optional<RegionRadii>> radii) {
  Outlines out;
  const auto fit = std::make_unique<outline::OutlineFit>();
  std::vector<outline::AppearanceModel> looks(rig.cameras.size());
  for (std::size_t m = 0; m < moments.size(); ++m) {
    const auto begun = radii[m] ? radii[m]->median() : std::nullopt;
    if (!begun) continue;
    for (const ColoredRegion& view : moments[m].views) {
      const outline::Background behind = behind_in(moments, m, view);
      const outline::Picture picture = object_tracking::picture_of(*moments[m].pictures[view.camera]);
      double radius_m = *begun;
      for (int round = 0; round < rounds; ++round) {
        auto ball = outline_of(rig.cameras[view.camera], radii[m]->at, radius_m);
        if (!ball) break;
        ball->ellipse.centre += view.region.centre - ball->centre_px;
        const outline::Fit found = fit->fit(picture, behind, ball->ellipse, {}, looks[view.camera], {});
        if (found.outcome != outline::FitOutcome::fits) {
          const bool is_misfit =
              found.outcome == outline::FitOutcome::misfit || found.outcome == outline::FitOutcome::lost;
          out.tried += is_misfit ? 1 : 0;
          out.misfits += is_misfit ? 1 : 0;
          break;
        }
        fit->learn(looks[view.camera]);
        const bool counts = found.visible > least_visible && found.log_size.sigma < least_sure;
        if (!counts) break;
        radius_m *= std::exp(found.log_size.value);
        if (round + 1 < rounds && std::abs(found.log_size.value) > settled_log) continue;
        ++out.tried;
        const double radius_px =
            std::max(1.0, std::sqrt(std::abs(ball->ellipse.axes.determinant())) * std::exp(found.log_size.value));
        const double too_small = too_small_by_px(radius_px) / radius_px;
        out.votes.push_back({m, view.camera, std::log(radius_m * (1 + expected_of_light * too_small)),
                             std::hypot(found.log_size.sigma, bias_sigma_px / radius_px),
                             unknown_of_light * too_small});
        break;
      }
    }
  }
  return out;
}

struct Median {
  double middle = 0, spread = 0;
  std::size_t count = 0;
};

Median median_of(std::vector<double> values) {
  Median out{.count = values.size()};
  out.middle = calib::median(values);
  for (double& value : values) value = std::abs(value - out.middle);
  out.spread = 1.4826 * calib::median(std::move(values));
  return out;
}

// The median of each camera first, as its errors are the same in all of its pictures; then the mean over cameras.
RadiusProposal combined(const calib::CameraRig& rig, std::span<const Vote> votes, double usual) {
  RadiusProposal out;
  std::vector<std::size_t> moments;
  std::vector<Median> of_cameras;
  std::vector<std::size_t> cameras;
  double of_pixels = 0, of_light = 0;
  for (const Vote& vote : votes) of_light += vote.of_light / double(votes.size());
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    std::vector<double> values;
    double sigma = 0;
    for (const Vote& vote : votes) {
      if (vote.camera != c) continue;
      values.push_back(vote.log_radius);
      sigma += vote.sigma;
      if (std::ranges::find(moments, vote.moment) == moments.end()) moments.push_back(vote.moment);
    }
    if (values.empty()) continue;
    of_pixels += std::pow(sigma / double(values.size()), 2);
    of_cameras.push_back(median_of(std::move(values)));
    cameras.push_back(c);
  }
  out.moments = moments.size();
  out.cameras = cameras.size();
  const auto [least, most] = std::ranges::minmax_element(of_cameras, {}, &Median::middle);
  if (most->middle - least->middle > most_apart) {
    const auto name = [&](auto at) { return rig.cameras[cameras[std::size_t(at - of_cameras.begin())]].name; };
    out.why_not = fmt::format(
        "by {} the ball has a radius of {:.0f} mm, by {} of {:.0f} mm: in one of them a part of it is in shade, glares "
        "or is hidden; or it moved between the pictures of cameras that are not synchronised, or whose timing is not "
        "known yet; or the calibration is not right. Choose a moment at which it rests in even light{}",
        name(least), 1e3 * std::exp(least->middle), name(most), 1e3 * std::exp(most->middle),
        moments.size() == 1 ? ", or let it be seen at more moments than this one" : "");
    return out;
  }
  const double n = double(of_cameras.size());
  double mean = 0, between = 0, within = 0;
  for (const Median& camera : of_cameras) mean += camera.middle / n;
  for (const Median& camera : of_cameras) {
    between += std::pow(camera.middle - mean, 2);
    within += std::pow(camera.spread, 2) / double(camera.count) / (n * n);
  }
  between /= std::max(1.0, n - 1) * n;
  const double sigma = std::sqrt(usual * usual + of_light * of_light + of_pixels / (n * n) + between + within);
  out.radius_m = std::exp(mean);
  out.sigma_m = *out.radius_m * sigma;
  return out;
}

}  // namespace

bool differs_clearly(const RadiusProposal& proposal, double radius_m) {
  if (!proposal.radius_m) return false;
  return std::abs(*proposal.radius_m - radius_m) > clear_sigmas * proposal.sigma_m + ruler * radius_m;
}

bool has_disc_shape(const MaskRegion& region) {
  const double width = region.box.u_max - region.box.u_min + 1, height = region.box.v_max - region.box.v_min + 1;
  const double filled = region.area / (0.785 * width * height);
  const double coarse = 1 / std::min(width, height);  // of a few pixels every shape is a square
  return std::max(width, height) <= most_stretched * std::min(width, height) + 1 && filled >= least_filled - coarse &&
         filled <= most_filled + coarse;
}

std::optional<double> radius_of_regions(const calib::CameraRig& rig, std::span<const ColoredRegion> views) {
  const auto radii = radii_of_regions(rig, views);
  return radii ? radii->median() : std::nullopt;
}

std::optional<Eigen::Vector3d> meeting_point(const calib::CameraRig& rig, std::span<const ColoredRegion> views) {
  return meeting_point(seen_of(rig, views));
}

RadiusProposal voted_radius(const calib::CameraRig& rig, std::span<const BallMoment> moments) {
  RadiusProposal out;
  if (moments.empty() || moments.front().views.size() < 2) {
    out.why_not = "only one camera shows the object: how far it is, and so how large, takes a second view";
    return out;
  }
  // In one view it may be cut off, or merged with something of its colour.
  const auto edged = std::ranges::find_if_not(moments.front().views, has_disc_shape, &ColoredRegion::region);
  if (std::ranges::count_if(moments.front().views, has_disc_shape, &ColoredRegion::region) < 2) {
    out.why_not = fmt::format("what {} shows is not round", rig.cameras[edged->camera].name);
    return out;
  }
  std::vector<std::optional<RegionRadii>> radii;
  for (const BallMoment& moment : moments) radii.push_back(radii_of_regions(rig, moment.views));
  if (!radii.front() || !radii.front()->median()) {
    out.why_not =
        "the views do not meet in one place: another thing was pointed at, the calibration is not right, or the object "
        "moved between the pictures of cameras that are not synchronised, like webcams: let it rest, or choose a "
        "moment at which it rests";
    return out;
  }
  const Outlines outlines = outlines_of(rig, moments, radii);
  if (outlines.tried >= enough_tried && double(outlines.misfits) > (1 - least_fitted) * double(outlines.tried)) {
    out.why_not = "its outline is not a ball's";
    return out;
  }
  std::vector<std::size_t> cameras;
  for (const Vote& vote : outlines.votes)
    if (std::ranges::find(cameras, vote.camera) == cameras.end()) cameras.push_back(vote.camera);
  const auto is_first = [](const Vote& vote) { return vote.moment == 0; };
  const auto proposed = [&](const std::vector<Vote>& votes, double usual, bool is_of_one_moment) {
    out = combined(rig, votes, is_of_one_moment ? of_one_moment : usual);
    out.is_rough = is_of_one_moment && out.radius_m;
    return out;
  };
  // Of one moment nothing is known of what is behind the ball: a hand at its edge passes for a part of it.
  if (cameras.size() >= 2) return proposed(outlines.votes, bias_sigma, std::ranges::all_of(outlines.votes, is_first));
  // Outlines are too small, or have too little contrast: regions, then.
  std::vector<Vote> votes;
  for (std::size_t m = 0; m < moments.size(); ++m) {
    for (std::size_t v = 0; radii[m] && v < moments[m].views.size(); ++v) {
      const ColoredRegion& view = moments[m].views[v];
      if (const auto& radius = radii[m]->of_views[v])
        votes.push_back({m, view.camera, std::log(*radius), of_regions_px / std::max(1.0, view.region.radius_px())});
    }
  }
  const auto has_radius = [](const auto& of_moment) { return of_moment && of_moment->median(); };
  return proposed(votes, of_regions, std::ranges::count_if(radii, has_radius) == 1);
}

}  // namespace huetrack::color_teaching
