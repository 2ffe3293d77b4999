#include "outline/picture.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace huetrack::outline {
namespace {

constexpr int width = 52, height = 38;

struct Layout {
  const char* name;
  int columns, rows;                        // that share chroma
  int light_step, chroma_step;              // bytes from a sample to the next
  bool is_interleaved, is_bgr, is_limited;  // interleaved: chroma lies between light
};

class RowsOfPicture : public testing::TestWithParam<Layout> {};

// Of exactly as many bytes as there are, so that a sanitizer sees what is read beyond them.
struct Bytes {
  std::vector<std::uint8_t> light, chroma;
};

Picture picture_of(const Layout& of, Bytes& bytes) {
  Picture out;
  out.width = width, out.height = height;
  out.columns = of.columns, out.rows = of.rows;
  out.is_bgr = of.is_bgr, out.is_limited = of.is_limited;
  std::mt19937 random(1);
  const auto fill = [&](std::vector<std::uint8_t>& to, int count) {
    to.resize(static_cast<std::size_t>(count));
    for (std::uint8_t& byte : to) byte = static_cast<std::uint8_t>(random());
  };
  fill(bytes.light, width * height * of.light_step);
  out.light = {bytes.light.data(), width * of.light_step, of.light_step};
  if (of.is_interleaved) {
    out.blue = {bytes.light.data() + 1, width * of.light_step, of.chroma_step};
    out.red = {bytes.light.data() + 3, width * of.light_step, of.chroma_step};
  } else if (!of.is_bgr) {
    const int across = width / of.columns * of.chroma_step, down = height / of.rows;
    fill(bytes.chroma, of.chroma_step == 2 ? across * down : 2 * across * down);
    out.blue = {bytes.chroma.data(), across, of.chroma_step};
    out.red = {bytes.chroma.data() + (of.chroma_step == 2 ? 1 : across * down), across, of.chroma_step};
  }
  return out;
}

// Rows of whole numbers, of any size and at any place, are what is read here and there as grey values.
TEST_P(RowsOfPicture, areWhatIsReadHereAndThere) {
  Bytes bytes;
  const Picture picture = picture_of(GetParam(), bytes);
  const auto compare = [&](int all_across, int all_down, auto&& read_rows, auto&& read_places) {
    for (const int across : {1, 5, 8, 16, 19}) {
      for (const int down : {1, 7, 8, 16}) {
        const Rows rows{all_across - across, all_down - down, across, down, 20};
        std::vector<std::int16_t> whole(static_cast<std::size_t>(20 * down));
        read_rows(rows, whole.data());
        for (int j = 0; j < down; ++j) {
          for (int i = 0; i < across; ++i) {
            const int u = rows.u + i, v = rows.v + j;
            const double value = static_cast<double>(read_places(Places{&u, &v, 1}));
            ASSERT_NEAR(whole[static_cast<std::size_t>(20 * j + i)], units * value, 1) << u << " " << v;
          }
        }
      }
    }
  };
  compare(
      width, height, [&](const Rows& rows, std::int16_t* to) { read_light(picture, rows, to); },
      [&](const Places& at) {
        float light = 0;
        read_light(picture, at, &light);
        return light;
      });
  for (const bool is_blue : {true, false}) {
    compare(
        width / picture.columns, height / picture.rows,
        [&](const Rows& rows, std::int16_t* to) {
          std::vector<std::int16_t> other(static_cast<std::size_t>(rows.stride * rows.down));
          read_chroma(picture, rows, is_blue ? to : other.data(), is_blue ? other.data() : to);
        },
        [&](const Places& at) {
          float blue = 0, red = 0;
          read_chroma(picture, at, &blue, &red);
          return is_blue ? blue : red;
        });
  }
}

INSTANTIATE_TEST_SUITE_P(
    Picture, RowsOfPicture,
    testing::Values(Layout{"yuyv", 2, 1, 2, 4, true, false, true}, Layout{"nv12", 2, 2, 1, 2, false, false, true},
                    Layout{"i420", 2, 2, 1, 1, false, false, false}, Layout{"i422", 2, 1, 1, 1, false, false, true},
                    Layout{"i444", 1, 1, 1, 1, false, false, false}, Layout{"bgr", 1, 1, 3, 3, false, true, false}),
    [](const auto& param) { return std::string(param.param.name); });

}  // namespace
}  // namespace huetrack::outline
