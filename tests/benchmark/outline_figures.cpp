// How far outlines and regions are off the truth in single views, in pixels, beside what the pixels allow:
//   build/release/tests/benchmark/outline_figures FOLDER TARGET [every]
// The background is learnt as the tracker does it; each fit begins a third of the radius beside the truth.
#include <Eigen/LU>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include "benchmark/sequence.h"
#include "benchmark/tracking_figures.h"
#include "config/service_config.h"
#include "object_tracking/ball_outline.h"
#include "object_tracking/color_region.h"
#include "object_tracking/target_views.h"
#include "outline/outline_fit.h"

using namespace huetrack;

namespace {

struct Sum {
  int n = 0;
  double e2 = 0, u = 0, v = 0, nees = 0, bound = 0, formal = 0, region2 = 0, misfit = 0, size = 0, size2 = 0, new2 = 0,
         steps = 0, max = 0, pixels = 0, seconds = 0;
  Eigen::Vector2d before = Eigen::Vector2d::Zero();
  bool has_before = false;
  std::map<int, int> outcomes;
};

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path folder = argv[1];
  const std::string name = argc > 2 ? argv[2] : "lime";
  const bool verbose = argc > 3;
  figures::Sequence sequence = figures::load_sequence(folder);
  object_tracking::TargetOptions target = name == "pink" ? figures::pink_ball() : figures::lime_ball();
  target.name = name;
  if (std::filesystem::exists(folder / "huetrackd.yaml")) {
    const config::ServiceConfig service = config::load_service_config(folder / "huetrackd.yaml");
    target = service.targets.front();
  }
  const double radius = target.radius_m;
  object_tracking::TargetViews views(sequence.rig, target);
  object_tracking::RegionFinder finder;
  outline::OutlineFit fit;
  std::vector<outline::Background> backgrounds;
  std::vector<outline::Look> looks(sequence.rig.cameras.size());
  for (const auto& camera : sequence.rig.cameras)
    backgrounds.emplace_back(camera.image_size.width, camera.image_size.height);
  std::vector<Sum> sums(sequence.rig.cameras.size());
  const capture::Timestamp begin = sequence.sets.front().at;
  int count = 0;
  for (const capture::FrameSet& set : sequence.sets) {
    ++count;
    for (const object_tracking::TargetView& view : views.look_at(set)) {
      const auto c = static_cast<std::size_t>(view.index);
      const auto t = view.frame->captured_at;
      const auto row = sequence.row(sequence.truth.contains(name) ? name : sequence.truth.begin()->first, t);
      const auto next = sequence.row(sequence.truth.contains(name) ? name : sequence.truth.begin()->first,
                                     t + std::chrono::milliseconds(17));
      if (!row) continue;
      const auto ball = object_tracking::outline_of(*view.camera, row->position, radius);
      const Eigen::Vector3d ahead = next ? next->position : row->position;
      const auto then = object_tracking::outline_of(*view.camera, ahead, radius);
      if (!ball || !then) continue;
      const outline::Picture picture = object_tracking::picture_of(view.frame->pixels);
      const double dt = next ? capture::seconds(next->at - row->at) : 0.017;
      const Eigen::Vector2d velocity =
          dt > 0 ? Eigen::Vector2d((then->centre_px - ball->centre_px) / dt) : Eigen::Vector2d::Zero();
      const double r = std::sqrt(std::abs(ball->ellipse.axes.determinant()));
      Sum& s = sums[c];
      if (capture::seconds(t - begin) > 1 && (row->visible.empty() || row->visible[c] > 0.3)) {
        outline::Ellipse start = ball->ellipse;
        start.centre +=
            (getenv("OFF") ? atof(getenv("OFF")) : 0.3) * r * Eigen::Vector2d(std::cos(count), std::sin(count));
        outline::Fit f;
        for (int repeat = 0; repeat < 3; ++repeat) {
          const auto t0 = std::chrono::steady_clock::now();
          f = fit.fit(picture, backgrounds[c], start, {velocity, 0}, looks[c],
                      {.log_size = {0, getenv("SIZE") ? atof(getenv("SIZE")) : 0.1},
                       .most_steps = getenv("STEPS") ? atoi(getenv("STEPS")) : 6});
          const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - t0).count();
          if (repeat > 0) s.seconds += took / 2;
        }
        ++s.outcomes[static_cast<int>(f.outcome)];
        const Eigen::Vector2d off = f.centre - ball->ellipse.centre;
        if (verbose)
          std::printf(
              "%d %zu %d off %.3f %.3f sigma %.3f misfit %.2f visible %.2f size %.3f+-%.3f steps %d blur %.2f %.2f exp "
              "%.4f true vis %.2f\n",
              count, c, static_cast<int>(f.outcome), off.x(), off.y(), std::sqrt(f.covariance.trace() / 2), f.misfit,
              f.visible, f.log_size.value, f.log_size.sigma, f.steps, std::exp(looks[c].log_blur_light.value),
              std::exp(looks[c].log_blur_chroma.value), looks[c].exposure_s.value,
              row->visible.empty() ? 1.0 : row->visible[c]);
        if (f.outcome == outline::FitOutcome::fits) {
          fit.learn(looks[c]);
          ++s.n;
          s.e2 += off.squaredNorm(), s.u += off.x(), s.v += off.y();
          s.max = std::max(s.max, off.norm());
          s.nees += off.dot(f.covariance.inverse() * off);
          s.bound += f.bound.trace(), s.formal += f.covariance.trace();
          s.misfit += f.misfit, s.size += f.log_size.value, s.size2 += f.log_size.value * f.log_size.value;
          s.steps += f.steps;
          s.pixels += f.pixels;
          if (s.has_before) s.new2 += (off - s.before).squaredNorm() / 2;
          s.before = off, s.has_before = true;
          const auto px = ball->ellipse.centre;
          const int reach = static_cast<int>(2 * r + 3);
          const auto& regions = finder.find(
              *view.matches, {int(px.x()) - reach, int(px.y()) - reach, int(px.x()) + reach, int(px.y()) + reach}, 4,
              1.3 * r);
          if (!regions.empty()) s.region2 += (regions.front().centre - px).squaredNorm();
        }
      }
      const outline::Disc disc{ball->centre_px, r}, hidden{ball->centre_px, 1.1 * r + 4 + 0.01 * velocity.norm()};
      backgrounds[c].learn(picture, disc, 0.3 * velocity, &hidden, 1);
    }
  }
  for (std::size_t c = 0; c < sums.size(); ++c) {
    const Sum& s = sums[c];
    const double n = std::max(1, s.n);
    std::printf(
        "%-10.10s %s n %3d off %.3f (%+.3f %+.3f max %.2f d %.3f) region %.3f formal %.3f bound %.3f nees %5.2f misfit "
        "%.2f size %+.4f sd %.4f steps %.1f px %.0f %.0f us noise %.1f %.1f",
        folder.filename().c_str(), sequence.rig.cameras[c].name.c_str(), s.n, std::sqrt(s.e2 / n / 2), s.u / n, s.v / n,
        s.max, std::sqrt(s.new2 / n / 2), std::sqrt(s.region2 / n / 2), std::sqrt(s.formal / n / 2),
        std::sqrt(s.bound / n / 2), s.nees / n, s.misfit / n, s.size / n,
        std::sqrt(std::max(0.0, s.size2 / n - s.size / n * s.size / n)), s.steps / n, s.pixels / n,
        1e6 * s.seconds / std::max(1, s.n), double(backgrounds[c].light_noise()),
        double(backgrounds[c].chroma_noise()));
    for (const auto& [outcome, k] : s.outcomes) std::printf(" %d:%d", outcome, k);
    std::printf("\n");
  }
}
