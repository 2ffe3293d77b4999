// Every figure of accuracy that huetrack states, beside those of OpenCV's blob and of the paper's filter on the same
// frames:   build/release/tests/benchmark/accuracy [seeds]
// Exit status 1 when one of ours misses what it must reach.
#include <cstdio>
#include <cstdlib>
#include <functional>

#include "benchmark/tracking_figures.h"

using namespace huetrack;

namespace {

bool all_reached = true;

void check(const char* what, double value, const char* unit, double low, double high) {
  const bool reached = value >= low && value <= high;
  all_reached = all_reached && reached;
  std::printf("    %-52s %8.2f %-4s", what, value, unit);
  if (low > -1e8) std::printf("  at least %g", low);
  if (high < 1e8) std::printf("  at most %g", high);
  std::printf("  %s\n", reached ? "reached" : "MISSED");
}

void print_header(const Sequence& s, const std::string& target) {
  std::printf("\n%s, %s: %zu frame sets, %zu cameras\n", s.name.c_str(), target.c_str(), s.sets.size(), s.rig.cameras.size());
  std::printf("  %-18s %5s %9s %9s | %9s %9s | %7s %6s %6s | %5s %5s\n", "", "lock", "rms mm", "max mm", "2+ rms mm", "2+ max mm",
              "none", "wrong", "return", "NEES", "in95");
}

void print_row(const char* who, const TrackingFigures& f, bool with_covariance) {
  std::printf("  %-18s %5s %9.1f %9.1f | %9.1f %9.1f | %3zu/%3zu %6zu %6zu |", who,
              f.lock_set ? std::to_string(*f.lock_set).c_str() : "never", 1e3 * f.rms_m, 1e3 * f.max_m, 1e3 * f.rms_two_views_m,
              1e3 * f.max_two_views_m, f.without_answer, f.sets, f.wrong_tracking, f.longest_return);
  if (with_covariance) std::printf(" %5.2f %4.0f%%\n", f.mean_nees, 100 * f.share_inside_95);
  else std::printf("     -     -\n");
}

}  // namespace

int main(int argc, char** argv) {
  const int seeds = argc > 1 ? std::atoi(argv[1]) : 3;
  if (seeds < 1) {
    std::fprintf(stderr, "usage: accuracy [number of seeds >= 1]\n");
    return 2;
  }
  if (!have("rendered/two_cams")) {
    std::fprintf(stderr, "accuracy: no recordings in %s\n", shared_data().c_str());
    return 2;
  }
  std::puts("lock: first frame set in `tracking` within 50 mm of the truth. rms, max: every set with a position from then on.\n"
            "2+: of those, where two or more views see more than half of the ball. none: sets without a position.\n"
            "wrong: sets that say `tracking` and are over 10 cm off. return: longest wait in sets for `tracking` while two\n"
            "views see the ball. NEES: 3 is perfect. in95: truth inside the 95 % ellipsoid.");

  struct Case {
    const char* folder;
    int every, phase;
    std::vector<TargetOptions> targets;
    std::function<void(const TrackingFigures& ours, const TrackingFigures& blob)> must;
  };
  const auto honest = [](const TrackingFigures& f) {
    check("mean NEES", f.mean_nees, "", 1.5, 6);
    check("truth inside the 95 % ellipsoid", 100 * f.share_inside_95, "%", 85, 99);
    check("`tracking` and over 10 cm off", static_cast<double>(f.wrong_tracking), "sets", -1e9, 0);
  };
  const std::vector<Case> cases{
      {"rendered/two_cams", 1, 0, {lime_ball()},
       [&](const TrackingFigures& f, const TrackingFigures& blob) {
         check("lock", f.lock_set ? static_cast<double>(*f.lock_set) : 1e6, "set", -1e9, 3);
         check("rms, against the blob's", 1e3 * f.rms_m, "mm", -1e9, 1e3 * blob.rms_m);
         check("max", 1e3 * f.max_m, "mm", -1e9, 12);
         honest(f);
       }},
      {"rendered/occlusion", 1, 0, {pink_ball(), lime_ball()},
       [&](const TrackingFigures& f, const TrackingFigures&) {
         check("rms where two or more views see the ball", 1e3 * f.rms_two_views_m, "mm", -1e9, 5);
         check("sets until `tracking` when two views see it", static_cast<double>(f.longest_return), "sets", -1e9, 3);
         honest(f);
       }},
      {"rendered/fast_60fps", 1, 0, {pink_ball()},
       [&](const TrackingFigures& f, const TrackingFigures& blob) {
         check("rms, against 1.2 times the blob's", 1e3 * f.rms_m, "mm", -1e9, 1.2e3 * blob.rms_m);
         honest(f);
       }},
      {"rendered/fast_60fps", 2, 0, {pink_ball()},
       [&](const TrackingFigures& f, const TrackingFigures&) {
         check("rms", 1e3 * f.rms_m, "mm", -1e9, 12);
         honest(f);
       }},
      {"rendered/fast_60fps", 2, 1, {pink_ball()},
       [&](const TrackingFigures& f, const TrackingFigures&) {
         check("rms", 1e3 * f.rms_m, "mm", -1e9, 12);
         honest(f);
       }},
  };
  for (const Case& c : cases) {
    const Sequence sequence = load_sequence(shared_data() / c.folder, c.every, c.phase);
    for (const TargetOptions& target : c.targets) {
      print_header(sequence, target.name);
      const TrackingFigures blob = figures_of(sequence, target.name, track_blob(sequence, target));
      print_row("OpenCV blob", blob, false);
      for (int seed = 1; seed <= seeds; ++seed) {
        const auto options = rendered_options(Observation::paper, static_cast<std::uint64_t>(seed));
        print_row(("paper, seed " + std::to_string(seed)).c_str(),
                  figures_of(sequence, target.name, track(sequence, target, options)), true);
      }
      for (int seed = 1; seed <= seeds; ++seed) {
        const auto options = rendered_options(Observation::huetrack, static_cast<std::uint64_t>(seed));
        const TrackingFigures ours = figures_of(sequence, target.name, track(sequence, target, options));
        print_row(("huetrack, seed " + std::to_string(seed)).c_str(), ours, true);
        c.must(ours, blob);
      }
    }
  }
  if (have("red_square_stereo")) {
    const Sequence sequence = load_sequence(shared_data() / "red_square_stereo");
    const TargetOptions target = red_square();
    std::printf("\nred_square_stereo (real): sets of %zu whose estimate projects inside the red square in both views\n", sequence.sets.size());
    std::printf("  OpenCV blob        %zu\n", inside_red_square(sequence, track_blob(sequence, target)));
    for (int seed = 1; seed <= seeds; ++seed) {
      const auto s = static_cast<std::uint64_t>(seed);
      std::printf("  paper, seed %d      %zu\n", seed,
                  inside_red_square(sequence, track(sequence, target, red_square_options(Observation::paper, s))));
      const auto inside = inside_red_square(sequence, track(sequence, target, red_square_options(Observation::huetrack, s)));
      std::printf("  huetrack, seed %d   %zu\n", seed, inside);
      check("inside the red square in both views", static_cast<double>(inside), "sets", 112, 1e9);
    }
  }
  std::printf("\n%s\n", all_reached ? "every figure is reached" : "NOT every figure is reached");
  return all_reached ? 0 : 1;
}
