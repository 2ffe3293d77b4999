// A film in which a program put the mean of two pictures between them is named; as a camera took it, it is not.
#include "recordings/blend_watch.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "capture/comb_film.h"

namespace huetrack::recordings {
namespace {

using testing::HasSubstr;
using testing::Optional;

capture::Image mixture(const capture::Image& a, const capture::Image& b, double of_b = 0.5) {
  capture::WritableImage out = capture::make_image(a.format, a.range, a.width, a.height);
  for (int v = 0; v < a.height; ++v)
    for (int u = 0; u < a.width; ++u)
      out.data[0][v * out.image.planes[0].stride + u] =
          static_cast<std::uint8_t>(std::lround((1 - of_b) * a.planes[0].data[v * a.planes[0].stride + u] +
                                                of_b * b.planes[0].data[v * b.planes[0].stride + u]));
  return out.image;
}

// As a lens blurs it: no edge of a picture is as sharp as its pixels.
capture::Image through_a_lens(const capture::Image& a) {
  capture::WritableImage out = capture::make_image(a.format, a.range, a.width, a.height);
  for (int v = 0; v < a.height; ++v)
    for (int u = 0; u < a.width; ++u) {
      int sum = 0;
      for (const int dv : {-1, 0, 1})
        for (const int du : {-1, 0, 1})
          sum +=
              (2 - std::abs(dv)) * (2 - std::abs(du)) *
              a.planes[0]
                  .data[std::clamp(v + dv, 0, a.height - 1) * a.planes[0].stride + std::clamp(u + du, 0, a.width - 1)];
      out.data[0][v * out.image.planes[0].stride + u] = static_cast<std::uint8_t>((sum + 8) / 16);
    }
  return out.image;
}

capture::Image taken(double step_px, double noise, int k, std::mt19937_64& random) {
  const capture::CombFilm film{.format = capture::PixelFormat::grey, .noise = noise, .step_px = step_px};
  return through_a_lens(capture::comb_picture(film, k % std::max(2, int(50 / step_px)), random));
}

// mean_at: 0, 1: even or odd pictures are means; 2: none
std::optional<std::string> problem_of(double noise, double step_px, int mean_at, int lost_every = 1000) {
  std::mt19937_64 random(1);
  BlendWatch watch;
  for (int k = 0; k < 120; ++k) {
    const auto at = [&](int n) { return taken(step_px, noise, n, random); };
    if (k % lost_every == 0 && k > 0) continue;
    if (mean_at == 2)
      watch.see(k, at(k));
    else
      watch.see(k, k % 2 == mean_at ? mixture(at(k / 2), at(k / 2 + 1)) : at((k + 1) / 2));
  }
  return watch.problem();
}

TEST(BlendWatch, NamesADoubledRate) {
  for (const double step_px : {2., 3., 6.}) {
    EXPECT_THAT(problem_of(0, step_px, 1), Optional(HasSubstr("first_frame: 0, every: 2"))) << step_px;
    EXPECT_THAT(problem_of(0, step_px, 0), Optional(HasSubstr("first_frame: 1, every: 2"))) << step_px;
  }
  EXPECT_THAT(problem_of(0, 3, 1, 10), Optional(HasSubstr("every: 2"))) << "some do not decode";
}

// Picture k is blended of the source's two about k times this ratio.
std::optional<std::string> problem_of_converted(double ratio, double noise, double step_px) {
  BlendWatch watch;
  const auto of_source = [&](int n) {
    std::mt19937_64 random(static_cast<std::uint64_t>(n));
    return taken(step_px, noise, n, random);
  };
  for (int k = 0; k < 120; ++k) {
    const int n = static_cast<int>(k * ratio);
    watch.see(k, mixture(of_source(n), of_source(n + 1), k * ratio - n));
  }
  return watch.problem();
}

TEST(BlendWatch, NamesAConvertedRate) {
  for (const double noise : {0., 5.})
    for (const double step_px : {2., 3.}) {  // beyond the width of an edge
      EXPECT_THAT(problem_of_converted(30. / 25, noise, step_px), Optional(HasSubstr("a period of 5.0 pictures")));
      EXPECT_THAT(problem_of_converted(30. / 24, noise, step_px), Optional(HasSubstr("a period of 4.0 pictures")));
      EXPECT_THAT(problem_of_converted(25. / 30, noise, step_px), Optional(HasSubstr("a period of 6.0 pictures")));
      EXPECT_THAT(problem_of_converted(30. / 50, noise, step_px), Optional(HasSubstr("a period of 2.5 pictures")));
      EXPECT_FALSE(problem_of_converted(2, noise, step_px)) << "pictures of a camera, every second one";
    }
}

TEST(BlendWatch, NamesNoFilmOfACamera) {
  for (const double noise : {0., 2., 5.})
    for (const double step_px : {0., 0.3, 0.55, 0.85, 1., 1.3, 1.9, 2.125, 3., 6.})
      EXPECT_FALSE(problem_of(noise, step_px, 2)) << noise << step_px;
}

// All pixels change at once, as where a camera is knocked or a lamp is switched on: of one picture, not of a period.
TEST(BlendWatch, NamesNoFilmInWhichAllChangesOnce) {
  std::mt19937_64 random(1);
  BlendWatch watch;
  for (int k = 0; k < 120; ++k) {
    capture::Image image = taken(3, 2, k, random);
    capture::WritableImage lit = capture::make_image(image.format, image.range, image.width, image.height);
    for (int v = 0; v < image.height; ++v)
      for (int u = 0; u < image.width; ++u)
        lit.data[0][v * lit.image.planes[0].stride + u] =
            static_cast<std::uint8_t>(image.planes[0].data[v * image.planes[0].stride + u] + (k < 60    ? 0
                                                                                              : k == 60 ? 18
                                                                                                        : 60));
    watch.see(k, lit.image);
  }
  EXPECT_FALSE(watch.problem());
}

}  // namespace
}  // namespace huetrack::recordings
