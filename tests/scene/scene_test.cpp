#include "scene/scene.h"

#include <gmock/gmock.h>

#include "color/color_model.h"
#include "color/image_color.h"

namespace huetrack::scene {
namespace {

// Every test that stands on the scene trusts it to put the ball where it says: held here to the plain colour formula.
TEST(Scene, ballIsWhereTheCamerasProjectIt) {
  for (const capture::PixelFormat format :
       {capture::PixelFormat::yuyv, capture::PixelFormat::nv12, capture::PixelFormat::i420, capture::PixelFormat::i422,
        capture::PixelFormat::i444, capture::PixelFormat::bgr}) {
    const Scene scene = SceneBuilder{}.cameras_on_ring({.count = 3}).ball({}).build();
    const color::HsiRange lime{65, 115, 0.3, 1, 0.1, 0.95};
    for (const capture::FrameSet& set : render(scene, {.set_count = 3, .format = format, .pixel_noise_stddev = 0})) {
      for (const auto& frame : set.frames) {
        const capture::Image& image = frame->pixels;
        double n = 0, sum_u = 0, sum_v = 0;
        for (int v = 0; v < image.height; ++v) {
          for (int u = 0; u < image.width; ++u) {
            const color::Rgb rgb = color::rgb_at(image, u, v);
            if (!color::contains(lime, color::hsi_of(rgb))) continue;
            n += 1, sum_u += u, sum_v += v;
          }
        }
        const auto expected =
            scene.rig.cameras[static_cast<std::size_t>(frame->camera)].project_world(scene.ball_at(0, set.at));
        ASSERT_TRUE(expected);
        ASSERT_GT(n, 20) << capture::name(format);
        EXPECT_NEAR(sum_u / n, expected->px.x(), 0.6)
            << capture::name(format);  // half-resolution chroma costs the rest
        EXPECT_NEAR(sum_v / n, expected->px.y(), 0.6) << capture::name(format);
      }
    }
  }
}

TEST(Scene, sameSeedSameBytes) {
  const Scene scene = SceneBuilder{}.cameras_on_ring({.count = 2}).ball({}).build();
  const auto a = render(scene, {.set_count = 2, .seed = 5}), b = render(scene, {.set_count = 2, .seed = 5}),
             c = render(scene, {.set_count = 2, .seed = 6});
  const auto bytes = [](const std::vector<capture::FrameSet>& sets) {
    const capture::Image& image = sets[1].frames[1]->pixels;
    return std::vector<std::uint8_t>(image.planes[0].data,
                                     image.planes[0].data + image.planes[0].stride * image.height);
  };
  EXPECT_EQ(bytes(a), bytes(b));
  EXPECT_NE(bytes(a), bytes(c));
}

}  // namespace
}  // namespace huetrack::scene
