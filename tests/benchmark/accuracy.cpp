// Every figure of accuracy that huetrack states, beside those of OpenCV's blob, of the paper's filter and of regions
// (`shape: blob`) on the same frames, and what the pixels of one set allow:
//   build/release/tests/benchmark/accuracy [seeds [SCENE...]]
// SCENE: further recordings, by scenes.py still of ../shared/tools/scenes, with their own huetrackd.yaml.
// Exit status 1 when one of ours misses what it must reach.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <functional>

#include "benchmark/outline_views.h"
#include "benchmark/tracking_figures.h"
#include "config/service_config.h"

using namespace huetrack;

namespace {

bool all_reached = true;
constexpr double learning_s = 1;  // what is behind the ball is not known before

object_tracking::ObjectTrackerOptions options_of(object_tracking::ObjectTrackerOptions options,
                                                 object_tracking::Observation observation, int seed) {
  options.observation = observation, options.seed = static_cast<std::uint64_t>(seed);
  return options;
}

void check(const char* what, double value, const char* unit, double low, double high) {
  const bool reached = value >= low && value <= high;
  all_reached = all_reached && reached;
  std::printf("    %-52s %8.2f %-4s", what, value, unit);
  if (low > -1e8) std::printf("  at least %g", low);
  if (high < 1e8) std::printf("  at most %g", high);
  std::printf("  %s\n", reached ? "reached" : "MISSED");
}

void print_header(const figures::Sequence& s, const std::string& target) {
  std::printf("\n%s, %s: %zu frame sets, %zu cameras\n", s.name.c_str(), target.c_str(), s.sets.size(),
              s.rig.cameras.size());
  std::printf("  %-18s %5s %9s %9s | %9s %9s | %7s %6s %6s | %5s %5s\n", "", "lock", "rms mm", "max mm", "2+ rms mm",
              "2+ max mm", "none", "wrong", "return", "NEES", "in95");
}

void print_row(const char* who, const figures::TrackingFigures& f, bool with_covariance) {
  std::printf("  %-18s %5s %9.1f %9.1f | %9.1f %9.1f | %3zu/%3zu %6zu %6zu |", who,
              f.lock_set ? std::to_string(*f.lock_set).c_str() : "never", 1e3 * f.rms_m, 1e3 * f.max_m,
              1e3 * f.rms_two_views_m, 1e3 * f.max_two_views_m, f.without_answer, f.sets, f.wrong_tracking,
              f.longest_return);
  if (with_covariance)
    std::printf(" %5.2f %4.0f%%\n", f.mean_nees, 100 * f.share_inside_95);
  else
    std::printf("     -     -\n");
}

// Sums up what `honest` reads; mean_nees and share_inside_95 become sums over the compared sets.
void add(figures::TrackingFigures& sum, const figures::TrackingFigures& f) {
  const double n = static_cast<double>(f.compared);
  sum.compared += f.compared;
  sum.mean_nees += n * f.mean_nees;
  sum.share_inside_95 += n * f.share_inside_95;
  sum.wrong_tracking += f.wrong_tracking;
  sum.largest_jump_m = std::max(sum.largest_jump_m, f.largest_jump_m);
  for (std::size_t v = 0; v < 3; ++v) {
    figures::TrackingFigures::Seen& s = sum.by_views[v];
    const figures::TrackingFigures::Seen& t = f.by_views[v];
    s.sets += t.sets, s.compared += t.compared, s.inside_95 += t.inside_95, s.tracking += t.tracking;
    s.sum_error2 += t.sum_error2, s.sum_nees += t.sum_nees;
    s.max_m = std::max(s.max_m, t.max_m);
  }
}

struct Case {
  std::filesystem::path folder;
  int every;
  std::vector<unsigned> phases;  // each a play of the recording; the covariance is judged over all of them together
  std::vector<object_tracking::TargetOptions> targets;
  std::function<void(const figures::TrackingFigures& ours, const figures::TrackingFigures& blob)> must;
  double outlines_at_most_m = 1e9;  // rms after the first second, where two or more views see the ball
  object_tracking::ObjectTrackerOptions options = figures::rendered_options(object_tracking::Observation::huetrack, 1);
};

std::vector<Case> shared_cases() {
  return {
      {figures::shared_data() / "rendered/two_cams",
       1,
       {0},
       {figures::lime_ball()},
       [](const figures::TrackingFigures& f, const figures::TrackingFigures& blob) {
         check("lock", f.lock_set ? static_cast<double>(*f.lock_set) : 1e6, "set", -1e9, 3);
         check("rms, against the blob's", 1e3 * f.rms_m, "mm", -1e9, 1e3 * blob.rms_m);
         check("max", 1e3 * f.max_m, "mm", -1e9, 12);
       },
       0.0015},
      {figures::shared_data() / "rendered/occlusion",
       1,
       {0},
       {figures::pink_ball(), figures::lime_ball()},
       [](const figures::TrackingFigures& f, const figures::TrackingFigures&) {
         check("rms where two or more views see the ball", 1e3 * f.rms_two_views_m, "mm", -1e9, 5);
         check("sets until `tracking` when two views see it", static_cast<double>(f.longest_return), "sets", -1e9, 3);
       },
       0.002},
      {figures::shared_data() / "rendered/fast_60fps",
       1,
       {0},
       {figures::pink_ball()},
       [](const figures::TrackingFigures& f, const figures::TrackingFigures& blob) {
         check("rms, against 1.2 times the blob's", 1e3 * f.rms_m, "mm", -1e9, 1.2e3 * blob.rms_m);
       },
       0.002},
      // Every way in which three free-running cameras of half the rate can share the frames out.
      {figures::shared_data() / "rendered/fast_60fps",
       2,
       {0b010, 0b101, 0b001, 0b110, 0b100, 0b011},
       {figures::pink_ball()},
       [](const figures::TrackingFigures& f, const figures::TrackingFigures&) {
         check("rms", 1e3 * f.rms_m, "mm", -1e9, 12);
       }},
  };
}

Case case_of_scene(const std::filesystem::path& folder) {
  const config::ServiceConfig service = config::load_service_config(folder / "huetrackd.yaml");
  return {folder, 1, {0}, service.targets, [](const auto&, const auto&) {}, 0.0006, service.object_tracking};
}

// Of what add() summed up.
void judge_honesty(const figures::TrackingFigures& f) {
  const double n = static_cast<double>(f.compared);
  check("mean NEES", f.mean_nees / n, "", 1.5, 6);
  check("truth inside the 95 % ellipsoid", 100 * f.share_inside_95 / n, "%", 85, 99);
  check("`tracking` and over 10 cm off", static_cast<double>(f.wrong_tracking), "sets", -1e9, 0);
  constexpr const char* who[] = {"half of it: no view", "half of it: one view", "half of it: 2+ views"};
  for (std::size_t v = 0; v < 3; ++v) {
    const figures::TrackingFigures::Seen& s = f.by_views[v];
    if (s.sets == 0) continue;
    std::printf("    %-21s %4zu sets, `tracking` in %4zu, a position in %4zu", who[v], s.sets, s.tracking, s.compared);
    if (s.compared > 0) {
      const double m = static_cast<double>(s.compared);
      std::printf(": %6.1f mm rms, %6.1f mm max, NEES %4.1f, %3.0f %% in95", 1e3 * std::sqrt(s.sum_error2 / m),
                  1e3 * s.max_m, s.sum_nees / m, 100 * static_cast<double>(s.inside_95) / m);
    }
    std::printf("\n");
  }
  if (f.by_views[0].sets + f.by_views[1].sets > 0)
    std::printf("    largest jump where fewer than two do: %.1f mm\n", 1e3 * f.largest_jump_m);
}

// The others' rows, and ours.
class CaseRows {
 public:
  CaseRows(const Case& c, const object_tracking::TargetOptions& target, int seeds)
      : case_(c), target_(target), seeds_(seeds), all_(static_cast<std::size_t>(seeds)) {}

  void play(const figures::Sequence& sequence) {
    print_header(sequence, target_.name);
    const figures::TrackingFigures blob =
        figures::figures_of(sequence, target_.name, figures::track_blob(sequence, target_));
    print_row("OpenCV blob", blob, false);
    print_seeds("paper", sequence, target_, object_tracking::Observation::paper);
    object_tracking::TargetOptions as_blob = target_;
    as_blob.shape = object_tracking::TargetShape::blob;
    print_seeds("regions", sequence, as_blob, object_tracking::Observation::huetrack);
    const auto bound_m = figures::bound_of_sets_m(figures::fit_outlines(sequence, target_));
    for (int seed = 1; seed <= seeds_; ++seed) play_ours(sequence, seed, blob, bound_m);
  }

  void judge() const {
    for (int seed = 1; seed <= seeds_; ++seed) {
      std::printf("  huetrack, seed %d, honesty%s\n", seed, case_.phases.size() > 1 ? " over all of these plays" : "");
      judge_honesty(all_[static_cast<std::size_t>(seed - 1)]);
    }
  }

 private:
  void print_seeds(const std::string& name, const figures::Sequence& sequence,
                   const object_tracking::TargetOptions& target, object_tracking::Observation observation) const {
    for (int seed = 1; seed <= seeds_; ++seed) {
      const auto options = options_of(case_.options, observation, seed);
      print_row((name + ", seed " + std::to_string(seed)).c_str(),
                figures::figures_of(sequence, target.name, figures::track(sequence, target, options)), true);
    }
  }
  void play_ours(const figures::Sequence& sequence, int seed, const figures::TrackingFigures& blob,
                 const std::optional<double>& bound_m) {
    const auto options = options_of(case_.options, object_tracking::Observation::huetrack, seed);
    const auto track = figures::track(sequence, target_, options);
    const figures::TrackingFigures ours = figures::figures_of(sequence, target_.name, track);
    const figures::TrackingFigures learnt = figures::figures_of(sequence, target_.name, track, learning_s);
    print_row(("huetrack, seed " + std::to_string(seed)).c_str(), ours, true);
    print_row("  after a second", learnt, true);
    if (bound_m) std::printf("  what the pixels of one set allow  %29.2f mm\n", 1e3 * *bound_m);
    case_.must(ours, blob);
    if (case_.outlines_at_most_m < 1)
      check("after a second, where two or more views see the ball", 1e3 * learnt.rms_two_views_m, "mm", -1e9,
            1e3 * case_.outlines_at_most_m);
    add(all_[static_cast<std::size_t>(seed - 1)], ours);
  }

  const Case& case_;
  const object_tracking::TargetOptions& target_;
  const int seeds_;
  std::vector<figures::TrackingFigures> all_;  // per seed, over the phases
};

void judge_red_square(int seeds) {
  const figures::Sequence sequence = figures::load_sequence(figures::shared_data() / "red_square_stereo");
  const object_tracking::TargetOptions target = figures::red_square();
  std::printf("\nred_square_stereo (real): sets of %zu whose estimate projects inside the red square in both views\n",
              sequence.sets.size());
  std::printf("  OpenCV blob        %zu\n",
              figures::inside_red_square(sequence, figures::track_blob(sequence, target)));
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto inside = [&](object_tracking::Observation observation) {
      return figures::inside_red_square(
          sequence,
          figures::track(sequence, target, figures::red_square_options(observation, static_cast<std::uint64_t>(seed))));
    };
    std::printf("  paper, seed %d      %zu\n", seed, inside(object_tracking::Observation::paper));
    const auto ours = inside(object_tracking::Observation::huetrack);
    std::printf("  huetrack, seed %d   %zu\n", seed, ours);
    check("inside the red square in both views", static_cast<double>(ours), "sets", 112, 1e9);
  }
}

}  // namespace

int main(int argc, char** argv) try {
  const int seeds = argc > 1 ? std::atoi(argv[1]) : 3;
  if (seeds < 1) {
    std::fprintf(stderr, "usage: accuracy [number of seeds >= 1 [SCENE...]]\n");
    return 2;
  }
  if (!figures::have("rendered/two_cams")) {
    std::fprintf(stderr, "accuracy: no recordings in %s\n", figures::shared_data().c_str());
    return 2;
  }
  std::puts(
      "lock: first frame set in `tracking` within 50 mm of the truth. rms, max: every set with a position from then "
      "on.\n"
      "2+: of those, where two or more views see more than half of the ball. none: sets without a position.\n"
      "wrong: sets that say `tracking` and are over 10 cm off. return: longest wait in sets for `tracking` while two\n"
      "views see the ball. NEES: 3 is perfect. in95: truth inside the 95 % ellipsoid.");
  std::vector<Case> cases = shared_cases();
  for (int i = 2; i < argc; ++i) cases.push_back(case_of_scene(argv[i]));
  for (const Case& c : cases) {
    for (const object_tracking::TargetOptions& target : c.targets) {
      CaseRows rows(c, target, seeds);
      for (const unsigned phases : c.phases) rows.play(figures::load_sequence(c.folder, c.every, phases));
      rows.judge();
    }
  }
  if (figures::have("red_square_stereo")) judge_red_square(seeds);
  std::printf("\n%s\n", all_reached ? "every figure is reached" : "NOT every figure is reached");
  return all_reached ? 0 : 1;
} catch (const std::exception& e) {
  std::fprintf(stderr, "accuracy: %s\n", e.what());
  return 2;
}
