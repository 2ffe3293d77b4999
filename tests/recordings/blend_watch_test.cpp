// A film in which a program put the mean of two pictures between them is named; as a camera took it, it is not.
#include "recordings/blend_watch.h"

#include <gmock/gmock.h>

#include "capture/comb_film.h"

namespace huetrack::recordings {
namespace {

using testing::HasSubstr;
using testing::Optional;

capture::Image mean_of(const capture::Image& a, const capture::Image& b) {
  capture::WritableImage out = capture::make_image(a.format, a.range, a.width, a.height);
  for (int v = 0; v < a.height; ++v)
    for (int u = 0; u < a.width; ++u)
      out.data[0][v * out.image.planes[0].stride + u] = static_cast<std::uint8_t>(
          (a.planes[0].data[v * a.planes[0].stride + u] + b.planes[0].data[v * b.planes[0].stride + u] + 1) / 2);
  return out.image;
}

// mean_at: 0, 1: even or odd pictures are means; 2: none
std::optional<std::string> problem_of(double noise, double step_px, int mean_at, int lost_every = 1000) {
  const capture::CombFilm film{.format = capture::PixelFormat::grey, .noise = noise, .step_px = step_px};
  std::mt19937_64 random(1);
  BlendWatch watch;
  const int period = std::max(2, int(50 / step_px));
  for (int k = 0; k < 120; ++k) {
    const auto taken = [&](int n) { return capture::comb_picture(film, n % period, random); };
    if (k % lost_every == 0 && k > 0) continue;
    if (mean_at == 2)
      watch.see(k, taken(k));
    else
      watch.see(k, k % 2 == mean_at ? mean_of(taken(k / 2), taken(k / 2 + 1)) : taken((k + 1) / 2));
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

TEST(BlendWatch, NamesNoFilmOfACamera) {
  for (const double noise : {0., 2., 5.})
    for (const double step_px : {0., 0.3, 1., 3., 6.}) EXPECT_FALSE(problem_of(noise, step_px, 2)) << noise << step_px;
}

}  // namespace
}  // namespace huetrack::recordings
