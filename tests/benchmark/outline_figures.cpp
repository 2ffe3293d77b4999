// How far outlines and regions are off the truth in single views, in pixels, beside what the pixels allow:
//   build/release/tests/benchmark/outline_figures SCENE [OFF_RADII [VIEWS.csv]]
// SCENE: a folder with huetrackd.yaml and groundtruth.csv (../shared/data/rendered, ../shared/tools/scenes); its first
// target. OFF_RADII: by how much of its radius each fit begins beside the truth, 0.3. VIEWS.csv: where every view goes.
#include <Eigen/LU>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <map>
#include <string>

#include "benchmark/outline_views.h"
#include "config/service_config.h"

using namespace huetrack;

namespace {

struct Sums {
  int views = 0, fits = 0, regions = 0;
  double off2 = 0, most = 0, nees = 0, stated = 0, bound = 0, region2 = 0, misfit = 0, size = 0, size2 = 0, steps = 0,
         pixels = 0, took_s = 0;
  Eigen::Vector2d off = Eigen::Vector2d::Zero();
  std::map<outline::FitOutcome, int> not_fitted;

  void add(const figures::OutlineView& view) {
    ++views;
    took_s += view.took_s;
    if (view.region_off_px) ++regions, region2 += view.region_off_px->squaredNorm();
    if (view.fit.outcome != outline::FitOutcome::fits) {
      ++not_fitted[view.fit.outcome];
      return;
    }
    ++fits;
    off += view.off_px, off2 += view.off_px.squaredNorm(), most = std::max(most, view.off_px.norm());
    nees += view.off_px.dot(view.fit.covariance.inverse() * view.off_px);
    stated += view.fit.covariance.trace(), bound += view.fit.bound.trace();
    misfit += view.fit.misfit, steps += view.fit.steps, pixels += view.fit.pixels;
    size += view.fit.log_size.value, size2 += view.fit.log_size.value * view.fit.log_size.value;
  }
};

const char* name(outline::FitOutcome outcome) {
  switch (outcome) {
    case outline::FitOutcome::fits:
      return "fits";
    case outline::FitOutcome::too_small:
      return "too small";
    case outline::FitOutcome::unknown:
      return "unknown";
    case outline::FitOutcome::no_contrast:
      return "no contrast";
    case outline::FitOutcome::lost:
      return "lost";
    case outline::FitOutcome::misfit:
      return "misfit";
  }
  return "?";
}

void write_views(const char* file, const std::vector<std::vector<figures::OutlineView>>& sets) {
  std::ofstream out(file);
  out << "set,camera,outcome,off_u,off_v,region_u,region_v,radius,u_px_s,v_px_s,visible,log_size,sigma,misfit,steps\n";
  for (std::size_t s = 0; s < sets.size(); ++s) {
    for (const figures::OutlineView& view : sets[s]) {
      const Eigen::Vector2d region = view.region_off_px.value_or(Eigen::Vector2d::Constant(std::nan("")));
      out << s << ',' << view.camera << ',' << name(view.fit.outcome) << ',' << view.off_px.x() << ','
          << view.off_px.y() << ',' << region.x() << ',' << region.y() << ',' << view.radius_px << ','
          << view.px_per_s.x() << ',' << view.px_per_s.y() << ',' << view.fit.visible << ',' << view.fit.log_size.value
          << ',' << std::sqrt(view.fit.covariance.trace() / 2) << ',' << view.fit.misfit << ',' << view.fit.steps
          << '\n';
    }
  }
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 2 || argc > 4) {
    std::fprintf(stderr, "usage: outline_figures SCENE [OFF_RADII [VIEWS.csv]]\n");
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  const figures::Sequence sequence = figures::load_sequence(folder);
  const config::ServiceConfig service = config::load_service_config(folder / "huetrackd.yaml");
  const auto sets = figures::fit_outlines(sequence, service.targets.front(), argc > 2 ? std::atof(argv[2]) : 0.3);
  std::vector<Sums> sums(sequence.rig.cameras.size());
  for (const auto& views : sets)
    for (const figures::OutlineView& view : views) sums[static_cast<std::size_t>(view.camera)].add(view);
  if (argc > 3) write_views(argv[3], sets);
  std::puts("per axis, px: rms of the outline's error, of the region's, what the fit states, what the pixels allow");
  for (std::size_t c = 0; c < sums.size(); ++c) {
    const Sums& s = sums[c];
    if (s.fits == 0) continue;
    const double n = s.fits;
    const auto per_axis = [](double sum2, double of) { return std::sqrt(sum2 / of / 2); };
    std::printf(
        "%-8s %3d of %3d fit: %.3f (mean %+.3f %+.3f, most %.2f), region %.3f, stated %.3f, bound %.3f, NEES %.2f of "
        "2, misfit %.2f, size %+.4f +- %.4f, %.1f steps, %.0f px, %.0f us",
        sequence.rig.cameras[c].name.c_str(), s.fits, s.views, per_axis(s.off2, n), s.off.x() / n, s.off.y() / n,
        s.most, per_axis(s.region2, std::max(1, s.regions)), per_axis(s.stated, n), per_axis(s.bound, n), s.nees / n,
        s.misfit / n, s.size / n, std::sqrt(std::max(0.0, s.size2 / n - s.size / n * s.size / n)), s.steps / n,
        s.pixels / n, 1e6 * s.took_s / s.views);
    for (const auto& [outcome, k] : s.not_fitted) std::printf(", %d %s", k, name(outcome));
    std::printf("\n");
  }
  if (const auto bound_m = figures::bound_of_sets_m(sets))
    std::printf("positions: pixels of one set allow %.2f mm rms\n", 1e3 * *bound_m);
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "outline_figures: %s\n", e.what());
  return 1;
}
