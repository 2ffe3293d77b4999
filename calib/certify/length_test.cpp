#include "calib/certify/length_test.h"

#include <algorithm>
#include <cmath>

namespace huetrack::certify {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// At 30 frames per second two balls of one frame set are told for moments less than a frame apart.
constexpr double most_apart_s = 0.035;
// A bar that moved or turned by so much since a measurement began, or after so long, is at another one.
constexpr double other_place_m = 0.15, other_direction_cos = 0.94, longest_s = 1.0;

// How a position moves with the rig's parameters, times their standard deviations; all cameras whose image it is in
// see it, and alike.
Eigen::MatrixXd by_rig(const calib::CameraRig& rig, const Vector3d& p) {
  std::vector<calib::PlaceView> views;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const auto px = rig.cameras[c].project_world(p);
    if (px && rig.cameras[c].contains(*px)) views.push_back({static_cast<int>(c), Eigen::Matrix2d::Identity()});
  }
  return calib::moved_by_cameras(rig, *rig.uncertainty, p, views) * rig.uncertainty->factor();
}

double stated_sigma(const Vector3d& a, const Matrix3d& covariance_a, const Vector3d& b, const Matrix3d& covariance_b,
                    const calib::CameraRig& rig) {
  const Vector3d along = (b - a).normalized();
  const double apart = along.dot((covariance_a + covariance_b) * along);  // if their errors had nothing in common
  if (!rig.uncertainty || rig.uncertainty->size() == 0) return std::sqrt(std::max(0.0, apart));
  const Eigen::RowVectorXd ga = along.transpose() * by_rig(rig, a), gb = along.transpose() * by_rig(rig, b);
  const double by_frames = apart - ga.squaredNorm() - gb.squaredNorm();
  return std::sqrt(std::max({apart - 2 * ga.dot(gb), by_frames, 0.0}));
}

}  // namespace

std::vector<Rest> rests_of(const BallTrack& track) {
  std::vector<Rest> rests;
  for (std::size_t from = 0; from < track.size();) {
    std::size_t to = from;
    while (to < track.size() && track[to].velocity.norm() < Rest::rest_m_s &&
           (to == from || track[to].t_s - track[to - 1].t_s < Rest::rest_s))
      ++to;
    if (to > from + 1 && track[to - 1].t_s - track[from].t_s >= Rest::rest_s) {
      Rest rest{.from_s = track[from].t_s, .to_s = track[to - 1].t_s};
      const auto n = static_cast<double>(to - from);
      for (std::size_t k = from; k < to; ++k) {
        rest.position += track[k].position / n;
        rest.covariance += track[k].covariance / n;
      }
      for (std::size_t k = from; k < to; ++k) rest.scatter_m += (track[k].position - rest.position).squaredNorm() / n;
      rest.scatter_m = std::sqrt(rest.scatter_m);
      rests.push_back(rest);
    }
    from = std::max(to, from + 1);
  }
  return rests;
}

std::vector<MeasuredLength> bar_lengths(const BallTrack& a, const BallTrack& b, double length_m,
                                        const calib::CameraRig& rig) {
  std::vector<MeasuredLength> out;
  double began_s = 0;
  Vector3d began_at = Vector3d::Zero(), began_along = Vector3d::Zero();
  int measurement = -1;
  auto other = b.begin();
  for (const BallFix& fix : a) {
    while (other != b.end() && std::next(other) != b.end() &&
           std::abs(std::next(other)->t_s - fix.t_s) <= std::abs(other->t_s - fix.t_s))
      ++other;
    if (other == b.end() || std::abs(other->t_s - fix.t_s) > most_apart_s) continue;
    const Vector3d p = other->position + (fix.t_s - other->t_s) * other->velocity, between = p - fix.position;
    MeasuredLength m{.t_s = fix.t_s, .middle = (fix.position + p) / 2, .direction = between.normalized()};
    m.error_m = between.norm() - length_m;
    m.stated_sigma_m = stated_sigma(fix.position, fix.covariance, p, other->covariance, rig);
    m.speed_m_s = std::max(fix.velocity.norm(), other->velocity.norm());
    const bool is_other = measurement < 0 || (m.middle - began_at).norm() > other_place_m ||
                          std::abs(m.direction.dot(began_along)) < other_direction_cos || m.t_s - began_s > longest_s;
    if (is_other) {
      ++measurement;
      began_s = m.t_s, began_at = m.middle, began_along = m.direction;
    }
    m.measurement = measurement;
    out.push_back(m);
  }
  return out;
}

std::vector<Visit> visits_of(const std::vector<Rest>& rests, const std::vector<MarkedPlace>& places) {
  std::vector<Visit> visits;
  for (const Rest& rest : rests) {
    std::vector<std::pair<double, std::size_t>> away;
    for (std::size_t k = 0; k < places.size(); ++k) away.emplace_back((places[k].p_world - rest.position).norm(), k);
    std::ranges::sort(away);
    if (away.empty() || (away.size() > 1 && 3 * away[0].first > away[1].first)) continue;
    visits.push_back({away[0].second, rest});
  }
  return visits;
}

std::vector<MeasuredLength> place_lengths(const std::vector<Visit>& visits, const std::vector<MarkedPlace>& places,
                                          const calib::CameraRig& rig) {
  std::vector<MeasuredLength> out;
  for (std::size_t i = 0; i < visits.size(); ++i) {
    for (std::size_t k = i + 1; k < visits.size(); ++k) {
      if (visits[i].place == visits[k].place) continue;
      const Rest &a = visits[i].rest, &b = visits[k].rest;
      const Vector3d between = b.position - a.position;
      MeasuredLength m{.t_s = b.from_s, .middle = (a.position + b.position) / 2, .direction = between.normalized()};
      m.error_m = between.norm() - (places[visits[k].place].p_world - places[visits[i].place].p_world).norm();
      m.stated_sigma_m = stated_sigma(a.position, a.covariance, b.position, b.covariance, rig);
      m.measurement = static_cast<int>(out.size());
      out.push_back(m);
    }
  }
  return out;
}

}  // namespace huetrack::certify
