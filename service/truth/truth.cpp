#include "truth/truth.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include "calib/files/csv_table.h"
#include "calib/files/joined.h"
#include "truth/motion_capture.h"

namespace huetrack::truth {
namespace {

constexpr std::chrono::nanoseconds longest_gap = std::chrono::milliseconds(100);

double seconds(std::chrono::nanoseconds d) {
  return std::chrono::duration<double>(d).count();
}

}  // namespace

Truth Truth::read(const std::filesystem::path& file) {
  if (auto samples = read_motion_capture(file)) {
    Truth truth;
    truth.targets_ = std::move(*samples);
    return truth;
  }
  static constexpr std::string_view columns[] = {"ball|target?", "t|@time", "x", "y", "z"};
  files::CsvTable table(file, columns);
  Truth truth;
  while (table.next()) {
    const Sample sample{table.time(1), {table.number(2), table.number(3), table.number(4)}};
    if (sample.position.array().isNaN().all())
      continue;  // before the look-up: a target with only such rows has no truth
    auto& samples = truth.targets_[table.has(0) ? std::string(table.text(0)) : std::string()];
    if (!samples.empty() && sample.at <= samples.back().at)
      table.fail(table.has(0)
                     ? "t must grow from row to row of one target"
                     : "t must grow from row to row; for several targets add a column ball or target with their names");
    if (!sample.position.allFinite()) table.fail("x, y and z must be finite, or all three nan if unknown");
    samples.push_back(sample);
  }
  return truth;
}

std::vector<std::string> Truth::objects_of(std::string_view target, bool is_only_target) const {
  std::vector<std::string> balls;
  for (const auto& [name, _] : targets_) {
    const bool is_own = name.starts_with(target);
    std::string_view rest = name;
    if (is_own) rest.remove_prefix(target.size());
    if (rest.starts_with('_')) rest.remove_prefix(1);
    if (is_only_target || (is_own && rest.find_first_not_of("0123456789") == rest.npos)) balls.push_back(name);
  }
  return balls;
}

std::string target_of(const std::string& name) {
  const auto end = name.find_last_not_of("0123456789");
  return end != name.npos && end > 0 && end + 1 < name.size() && name[end] == '_' ? name.substr(0, end) : name;
}

std::vector<std::string> Truth::assign(const std::map<std::string, std::vector<Sample>>& objects) {
  std::set<std::string> targets;
  for (const auto& [name, _] : objects) targets.insert(target_of(name));
  std::map<std::string, std::string> balls;  // by object
  for (const auto& [name, samples] : objects) {
    if (target_of(name) == name || targets_.contains(name)) continue;
    std::map<std::string, std::size_t> next_to;
    for (const Sample& sample : samples) {
      double nearest_m = wrong_beyond_m;
      const std::string* next = nullptr;
      for (const std::string& ball : objects_of(target_of(name), targets.size() == 1)) {
        const auto at = position(ball, sample.at);
        if (!at || !((*at - sample.position).norm() < nearest_m)) continue;
        nearest_m = (*at - sample.position).norm();
        next = &targets_.find(ball)->first;
      }
      if (next != nullptr) ++next_to[*next];
    }
    const auto most = std::ranges::max_element(next_to, {}, [](const auto& ball) { return ball.second; });
    if (most != next_to.end()) balls[name] = most->first;
  }
  std::vector<std::string> sentences;
  for (const auto& [name, ball] : balls) {
    targets_[name] = targets_.find(ball)->second;
    sentences.push_back(name + " is next to " + (ball.empty() ? "the ball without a name" : ball) +
                        " of the truth, with which it is compared");
  }
  return sentences;
}

std::vector<std::string> Truth::match(std::span<const std::string> targets, std::span<const int> counts) {
  if (targets.size() == 1 && targets_.size() == 1 && !targets_.contains(targets.front())) {
    auto only = targets_.extract(targets_.begin());
    const std::string ball = std::exchange(only.key(), targets.front());
    targets_.insert(std::move(only));
    return {"the truth has a single ball " + (ball.empty() ? "without a name" : "named " + ball) +
            "; it is compared with the only target, " + targets.front()};
  }
  // A loop, because clang 14 (fuzzing) does not compile views::keys.
  std::vector<std::string> names;
  for (const auto& [name, _] : targets_) names.push_back(name.empty() ? "one without a name" : name);
  const std::string balls = names.empty() ? "none" : files::joined(names);
  std::vector<std::string> sentences;
  for (std::size_t t = 0; t < targets.size(); ++t) {
    const std::string& target = targets[t];
    const bool is_several = t < counts.size() && counts[t] > 1;
    if (targets_.contains(target) || (is_several && !objects_of(target, targets.size() == 1).empty())) continue;
    sentences.push_back("the truth has no ball named " + target + (is_several ? " or " + target + "_1" : "") +
                        ", so this target is not compared: it has " + balls +
                        (!is_several && !objects_of(target, false).empty()
                             ? ": are these several balls of one colour? Give the target their count"
                             : ""));
  }
  return sentences;
}

namespace {

// Whether times of this length may be milliseconds that were read as seconds, next to a recording of that length.
bool are_milliseconds(double own_s, double length_s) {
  constexpr double much_longer = 100;  // a unit is a thousand
  return length_s > 0 && own_s > much_longer * length_s;
}

}  // namespace

std::vector<std::string> Truth::contradictions(Timestamp first, Timestamp last, const Eigen::AlignedBox3d& room) const {
  std::optional<Timestamp> from, to;
  Eigen::AlignedBox3d places;
  for (const auto& [_, samples] : targets_)
    for (const Sample& sample : samples) {
      from = std::min(from.value_or(sample.at), sample.at);
      to = std::max(to.value_or(sample.at), sample.at);
      places.extend(sample.position);
    }
  std::vector<std::string> sentences;
  if (!from) return sentences;
  const double length_s = seconds(last - first), own_s = seconds(*to - *from);
  const auto text = [](double s) { return fmt::format("{:.3f}", s); };
  const std::string spans = text(seconds(from->time_since_epoch())) + " to " + text(seconds(to->time_since_epoch())) +
                            " s, and the recording's from " + text(seconds(first.time_since_epoch())) + " to " +
                            text(seconds(last.time_since_epoch())) + " s";
  if (are_milliseconds(own_s, length_s))
    sentences.push_back("its times are from " + spans + ": if they are milliseconds, name the column t_ms");
  else if (*to < first || *from > last)
    sentences.push_back("its times are from " + spans +
                        ": nothing can be compared; it needs the recording's clock, in seconds");
  // Most of its extent beyond ten times the room's, and within it when divided by a thousand.
  const Eigen::AlignedBox3d reach(room.center() - 5 * room.sizes(), room.center() + 5 * room.sizes());
  const Eigen::AlignedBox3d smaller(places.min() / 1000, places.max() / 1000);
  if (!reach.intersects(places) || (!reach.contains(places) && reach.contains(smaller)))
    sentences.push_back(fmt::format("its positions are up to {:.6g} m from the origin{}",
                                    places.max().cwiseAbs().cwiseMax(places.min().cwiseAbs()).maxCoeff(),
                                    reach.contains(smaller) ? ": they look like millimetres: divide x, y and z by 1000"
                                                            : ", far from the room: other axes, or another unit?"));
  return sentences;
}

std::string Truth::apart_text(std::span<const std::string> targets, Timestamp first, Timestamp last,
                              bool is_shifted) const {
  Timestamp from = Timestamp::max(), to = Timestamp::min();
  for (const std::string& target : targets)
    if (const auto known = targets_.find(target); known != targets_.end()) {
      from = std::min(from, known->second.front().at);
      to = std::max(to, known->second.back().at);
    }
  const auto span = [](Timestamp a, Timestamp b) {
    return fmt::format("{:.3f} to {:.3f} s", seconds(a.time_since_epoch()), seconds(b.time_since_epoch()));
  };
  const bool is_unit = are_milliseconds(seconds(to - from), seconds(last - first));
  return fmt::format(
      "nothing can be compared: the tracks are at {}, the truth at {}{}; {}--clock-offset says how many seconds the "
      "tracks' clock is ahead of the truth's",
      span(first, last), span(from, to), is_shifted ? " with this --clock-offset" : "",
      is_unit ? "if the truth's times are milliseconds, name their column t_ms; if not, " : "");
}

void Truth::transform(const std::function<void(Eigen::Vector3d& position)>& change) {
  for (auto& [_, samples] : targets_)
    for (Sample& sample : samples) change(sample.position);
}

void Truth::shift(std::chrono::nanoseconds ahead) {
  for (auto& [_, samples] : targets_)
    for (Sample& sample : samples) sample.at += ahead;
}

std::optional<Eigen::Vector3d> Truth::position(std::string_view target, Timestamp at) const {
  const auto it = targets_.find(target);
  if (it == targets_.end()) return std::nullopt;
  const auto& samples = it->second;
  // Times in the file may be rounded: allow 0.5 ms beyond either end.
  constexpr std::chrono::nanoseconds rounding = std::chrono::microseconds(500);
  const auto after = std::ranges::lower_bound(samples, at, {}, &Sample::at);
  if (after == samples.end())
    return at - samples.back().at <= rounding ? std::optional(samples.back().position) : std::nullopt;
  if (after == samples.begin()) return after->at - at <= rounding ? std::optional(after->position) : std::nullopt;
  const auto before = std::prev(after);
  if (after->at - before->at > longest_gap) {
    if (after->at - at <= rounding) return after->position;
    if (at - before->at <= rounding) return before->position;
    return std::nullopt;
  }
  const double share = seconds(at - before->at) / seconds(after->at - before->at);
  return before->position + share * (after->position - before->position);
}

double nees(const Eigen::Vector3d& error_m, const Eigen::Matrix3d& covariance) {
  const Eigen::LLT<Eigen::Matrix3d> cholesky(covariance);
  if (!covariance.allFinite() || cholesky.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  return error_m.dot(cholesky.solve(error_m));
}

}  // namespace huetrack::truth
