// Speed as ratios, in one run, on one thread, to what a user would write instead with OpenCV: YUYV to BGR to HSV,
// inRange, moments, undistort, triangulate.   build/release/tests/benchmark/speed [--quick] A whole iteration is
// measured (predict, score, estimate, resample; lens included), on rendered scenes (tests/scene). Then ns per particle
// and view, and the scaling over N, M and image size. These machines are noisy: each figure is the median of rounds
// that alternate with OpenCV's.
// Which vector instructions run is said; speed_vectors.sh beside this file runs it with all that the machine has.
//   build/release/tests/benchmark/speed --profile small|large [ROUNDS] [paper]
// The default tracker (or the paper's filter) alone in one of the two cases, for perf, callgrind or a count of
// instructions: ROUNDS rounds of 20 updates after 120.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "benchmark/blob_tracker.h"
#include "benchmark/sequence.h"
#include "benchmark/speed_run.h"
#include "calib/model/batch_projector.h"
#include "calib/model/median.h"
#include "color/color_window.h"
#include "object_tracking/trackers/object_tracker.h"
#include "particle_filter/random.h"
#include "scene/scene.h"

using namespace huetrack;

namespace {

using figures::OpenCvPass;
using figures::scene_at;
using figures::time_update;
using figures::Timing;

constexpr int small_particle_count = 200, large_particle_count = 2000;
figures::Sequence small_scene() {
  return scene_at(2, 320, 240, 30);
}
figures::Sequence large_scene(int set_count) {
  return scene_at(4, 1920, 1080, set_count);
}

int profile(const std::string& which, int rounds, object_tracking::Observation observation) {
  const bool is_small = which == "small";
  if (!is_small && which != "large") {
    std::fprintf(stderr, "--profile small|large [ROUNDS] [paper]\n");
    return 2;
  }
  const Timing t = time_update(is_small ? small_scene() : large_scene(8), observation,
                               is_small ? small_particle_count : large_particle_count, rounds, 20);
  std::printf("%.2f us/update, tracking %.0f %%\n", t.us, 100 * t.tracking);
  return 0;
}

// Which instructions the kernels take, of what this processor has and this build is made for (HUETRACK_VECTORS).
std::string vectors_text() {
  std::string has = "none of them", takes = "none";
#ifdef __x86_64__
  if (__builtin_cpu_supports("avx2")) has = "AVX2";
  if (__builtin_cpu_supports("avx512f")) has = "AVX2 and AVX-512";
#ifndef HUETRACK_NO_AVX2
  if (__builtin_cpu_supports("avx2")) takes = "AVX2";
#endif
#ifndef HUETRACK_NO_AVX512
  if (__builtin_cpu_supports("avx512f")) takes = "AVX-512";
#endif
#endif
  return "vectors: this build takes " + takes + "; of AVX2 and AVX-512 this processor has " + has;
}

bool all_reached = true;

void ratios(const char* title, const figures::Sequence& s, int particle_count, int rounds, double paper_at_least,
            double ours_at_least, double regions_at_least) {
  std::printf("\n%s\n", title);
  using object_tracking::Observation;
  using object_tracking::TargetShape;
  for (const auto& [name, observation, shape, least] :
       {std::tuple{"the paper's filter", Observation::paper, TargetShape::automatic, paper_at_least},
        {"huetrack's default", Observation::huetrack, TargetShape::automatic, ours_at_least},
        {"with shape: blob", Observation::huetrack, TargetShape::blob, regions_at_least}}) {
    OpenCvPass pass(s.rig, figures::lime_ball());
    std::vector<double> opencv_us;
    const auto opencv = [&](const capture::FrameSet& set) {
      opencv_us.push_back(figures::microseconds_of([&] { pass.run(set); }));
    };
    const Timing t = time_update(s, observation, particle_count, rounds, 20, opencv, shape);
    const double ratio = calib::median(opencv_us) / t.us;
    const bool reached = ratio >= least;
    all_reached = all_reached && reached;
    std::printf(
        "  %-20s %8.2f us/update, OpenCV %9.1f us: %6.0f times faster (at least %.0f: %s)  %5.2f ns per particle and "
        "view, tracking %3.0f %%\n",
        name, t.us, calib::median(opencv_us), ratio, least, reached ? "reached" : "MISSED",
        1e3 * t.us / particle_count / static_cast<double>(s.rig.cameras.size()), 100 * t.tracking);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::string(argv[1]) == "--quick";
  cv::setNumThreads(1);
  std::puts(vectors_text().c_str());
  if (argc > 2 && std::string(argv[1]) == "--profile") {
    const bool paper = argc > 4 && std::string(argv[4]) == "paper";
    return profile(argv[2], argc > 3 ? std::stoi(argv[3]) : 50,
                   paper ? object_tracking::Observation::paper : object_tracking::Observation::huetrack);
  }
  const figures::Sequence small = small_scene();
  const figures::Sequence large = large_scene(quick ? 4 : 8);
  ratios("2 cameras, 320x240, 200 particles", small, small_particle_count, quick ? 50 : 400, 150, 30, 40);
  ratios("4 cameras, 1920x1080, 2000 particles", large, large_particle_count, quick ? 8 : 40, 400, 150, 200);

  if (quick) return 0;
  std::puts("\nscaling of one update, us (2 cameras 320x240 and 200 particles, but for what varies)");
  std::printf("  %-20s", "particles");
  for (const int n : {100, 200, 400, 800, 1600, 3200}) std::printf(" %9d", n);
  for (const auto& [name, observation] : {std::pair{"paper", object_tracking::Observation::paper},
                                          {"huetrack", object_tracking::Observation::huetrack}}) {
    std::printf("\n  %-20s", name);
    for (const int n : {100, 200, 400, 800, 1600, 3200})
      std::printf(" %9.2f", time_update(small, observation, n, 60, 20).us);
  }
  std::printf("\n  %-20s", "cameras");
  for (const int m : {2, 4, 8}) std::printf(" %9d", m);
  for (const auto& [name, observation] : {std::pair{"paper", object_tracking::Observation::paper},
                                          {"huetrack", object_tracking::Observation::huetrack}}) {
    std::printf("\n  %-20s", name);
    for (const int m : {2, 4, 8})
      std::printf(" %9.2f", time_update(scene_at(m, 320, 240, 30), observation, 200, 60, 20).us);
  }
  // Cost follows the pixels that are looked at, not those of the image: flat when the same lens gets a larger sensor. A
  // finer picture of the same view has more pixels in the cloud of particles.
  for (const auto& [title, focal_px] : {std::pair{"image, same lens", 240.0}, {"image, same view", 0.0}}) {
    std::printf("\n  %-20s", title);
    for (const int h : {240, 480, 1080}) std::printf(" %5dx%-4d", h == 1080 ? 1920 : h * 4 / 3, h);
    for (const auto& [name, observation] : {std::pair{"paper", object_tracking::Observation::paper},
                                            {"huetrack", object_tracking::Observation::huetrack}}) {
      std::printf("\n  %-20s", name);
      for (const int h : {240, 480, 1080}) {
        std::printf(
            " %10.2f",
            time_update(scene_at(2, h == 1080 ? 1920 : h * 4 / 3, h, 8, focal_px), observation, 200, 60, 20).us);
      }
    }
  }

  std::puts("\n\nkernels, ns per item");
  const std::size_t n = 2000;
  std::vector<float> noise(3 * n), u(n), v(n), x(n), y(n), z(n);
  std::vector<std::uint8_t> k(n);
  particle_filter::Rng rng(1);
  const auto kernel = [&](const char* name, std::size_t items, const std::function<void()>& work) {
    std::vector<double> us;
    for (int i = 0; i < 400; ++i) us.push_back(figures::microseconds_of(work));
    std::printf("  %-44s %6.2f\n", name, 1e3 * calib::median(us) / static_cast<double>(items));
  };
  kernel("fill_normal, per number", 3 * n, [&] { rng.fill_normal(noise); });
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = 0.06f * noise[i], y[i] = 0.06f * noise[n + i], z[i] = 1 + 0.06f * noise[2 * n + i];
  }
  const calib::BatchProjector projector(small.rig.cameras[0]);
  kernel("project, lens included, per point", n,
         [&] { projector.project(x.data(), y.data(), z.data(), n, u.data(), v.data()); });
  const capture::Image& image = small.sets[0].frames[0]->pixels;
  const color::ColorTable table(figures::lime_ball().color, image.format, image.range);
  color::MatchBits matches(image.width, image.height);
  matches.look_at(image, table);
  kernel("count_5x5, tiles known, per window", n, [&] { matches.count_5x5(u.data(), v.data(), n, k.data()); });
  kernel("count_5x5, with first look at its tiles", n, [&] {
    matches.look_at(image, table);
    matches.count_5x5(u.data(), v.data(), n, k.data());
  });
  const std::uint64_t before = matches.tiles_looked_at();
  matches.look_at(image, table);
  matches.look({0, 0, image.width - 1, image.height - 1});
  const auto tiles = static_cast<std::size_t>(matches.tiles_looked_at() - before);
  kernel("classify, whole image, per pixel", 64 * tiles, [&] {
    matches.look_at(image, table);
    matches.look({0, 0, image.width - 1, image.height - 1});
  });
  std::printf("\n%s\n", all_reached ? "every ratio is reached" : "NOT every ratio is reached");
  return all_reached ? 0 : 1;
}
