#include "tracks/objects_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>

#include "object_tracking/objects/assignment.h"

namespace huetrack::tracks {
namespace {}  // namespace

ObjectsComparison::ObjectsComparison(const truth::Truth& truth, std::vector<std::string> balls,
                                     const Eigen::AlignedBox3d& volume)
    : truth_(&truth), balls_(std::move(balls)), volume_(volume) {}

Eigen::MatrixXd ObjectsComparison::distances(const std::vector<std::size_t>& balls, const Objects& objects) const {
  Eigen::MatrixXd out(balls.size(), objects.size());
  for (std::size_t b = 0; b < balls.size(); ++b)
    for (std::size_t o = 0; o < objects.size(); ++o) {
      const auto truth = truth_->position(balls_[balls[b]], objects[o]->at);
      out(Eigen::Index(b), Eigen::Index(o)) =
          truth ? (objects[o]->position - *truth).norm() : std::numeric_limits<double>::max();
    }
  return out;
}

// Per ball its object, or -1: the same as before if that is near enough, the others at the least sum of distances.
std::vector<int> ObjectsComparison::matches(const std::vector<std::size_t>& balls, const Objects& objects,
                                            const Eigen::MatrixXd& distances_m) const {
  Eigen::MatrixXd costs = distances_m;
  for (std::size_t b = 0; b < balls.size(); ++b) {
    const auto before = last_.find(balls[b]);
    if (before == last_.end()) continue;
    for (std::size_t o = 0; o < objects.size(); ++o) {
      double& cost = costs(Eigen::Index(b), Eigen::Index(o));
      // Below every sum of distances.
      if (objects[o]->object == before->second && cost <= truth::wrong_beyond_m)
        cost = -truth::wrong_beyond_m * double(balls.size());
    }
  }
  return objects::assignment_of(costs, truth::wrong_beyond_m);
}

void ObjectsComparison::add(truth::Timestamp at, std::span<const object_tracking::ObjectEstimate> estimates) {
  std::vector<std::size_t> balls;
  std::vector<bool> counts;
  for (std::size_t b = 0; b < balls_.size(); ++b) {
    const auto truth = truth_->position(balls_[b], at);
    if (!truth) continue;
    balls.push_back(b);
    counts.push_back(volume_.contains(*truth));
  }
  if (balls.empty()) return;
  Objects objects;
  for (const auto& estimate : estimates)
    if (estimate.state == object_tracking::TrackState::tracking) objects.push_back(&estimate);
  const Eigen::MatrixXd distances_m = distances(balls, objects);
  const std::vector<int> matched = matches(balls, objects, distances_m);
  std::vector<std::optional<std::size_t>> ball_of(objects.size());
  for (std::size_t b = 0; b < balls.size(); ++b) {
    if (counts[b]) ++sums_.ball_sets, ++ball_sets_[balls[b]];
    if (matched[b] < 0) continue;
    const auto o = std::size_t(matched[b]);
    ball_of[o] = b;
    const auto [before, is_first] = last_.try_emplace(balls[b], objects[o]->object);
    if (!is_first && std::exchange(before->second, objects[o]->object) != objects[o]->object) ++sums_.switches;
    if (!counts[b]) continue;
    ++sums_.found;
    squares_m2_ += std::pow(distances_m(Eigen::Index(b), Eigen::Index(o)), 2);
    ++together_[{balls[b], objects[o]->object}];
  }
  for (std::size_t o = 0; o < objects.size(); ++o) {
    bool is_counted = ball_of[o] ? bool(counts[*ball_of[o]]) : true;
    for (std::size_t b = 0; b < balls.size() && !ball_of[o]; ++b)
      if (!counts[b] && distances_m(Eigen::Index(b), Eigen::Index(o)) <= truth::wrong_beyond_m) is_counted = false;
    if (!is_counted) continue;
    if (!ball_of[o]) ++sums_.false_positions;
    ++object_sets_[objects[o]->object];
  }
}

ObjectsFigures ObjectsComparison::figures() const {
  ObjectsFigures out = sums_;
  out.balls = ball_sets_.size();
  if (out.ball_sets == 0) return out;
  if (out.found > 0) out.rms_m = std::sqrt(squares_m2_ / double(out.found));
  const std::size_t wrong = out.ball_sets - out.found + out.false_positions + out.switches;
  out.mota = 1 - double(wrong) / double(out.ball_sets);
  // IDF1: one object for each ball, the ones that are together for the most sets.
  std::size_t object_sets = 0;
  for (const auto& [_, sets] : object_sets_) object_sets += sets;
  Eigen::MatrixXd costs = Eigen::MatrixXd::Zero(Eigen::Index(balls_.size()), Eigen::Index(object_sets_.size()));
  for (const auto& [pair, sets] : together_) {
    const auto column = std::distance(object_sets_.begin(), object_sets_.find(pair.second));
    costs(Eigen::Index(pair.first), column) = -double(sets);
  }
  const std::vector<int> identity = objects::assignment_of(costs, 0);
  double same = 0;
  for (std::size_t b = 0; b < identity.size(); ++b)
    if (identity[b] >= 0) same -= costs(Eigen::Index(b), identity[b]);
  out.idf1 = 2 * same / double(out.ball_sets + object_sets);
  return out;
}

std::string to_text(const ObjectsFigures& f) {
  if (f.ball_sets == 0) return "no ball of the truth is in the volume at a time of the track";
  return fmt::format(
      "{} balls of the truth, matched within {:.0f} cm while tracking: found in {:.1f} % of their sets, rms error "
      "{:.1f} mm; false positions {}, identity switches {}; MOTA {:.3f}, IDF1 {:.3f}",
      f.balls, 1e2 * truth::wrong_beyond_m, 100.0 * double(f.found) / double(f.ball_sets), 1e3 * f.rms_m,
      f.false_positions, f.switches, f.mota, f.idf1);
}

}  // namespace huetrack::tracks
