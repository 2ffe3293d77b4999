#include "drawing/canvas.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <stdexcept>
#include <vector>

namespace huetrack::drawing {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

constexpr Color black{0, 0, 0}, white{255, 255, 255}, red{255, 0, 0};

Color at(const Canvas& canvas, int u, int v) {
  const std::uint8_t* p = canvas.bgrx() + std::size_t(v) * canvas.bgrx_stride() + 4 * std::size_t(u);
  return {p[2], p[1], p[0]};
}

TEST(ColorOfHue, IsTheColourCircle) {
  EXPECT_EQ(color_of_hue(0, 1, 1), (Color{255, 0, 0}));
  EXPECT_EQ(color_of_hue(120, 1, 1), (Color{0, 255, 0}));
  EXPECT_EQ(color_of_hue(240, 1, 1), (Color{0, 0, 255}));
  EXPECT_EQ(color_of_hue(60, 1, 1), (Color{255, 255, 0}));
  EXPECT_EQ(color_of_hue(77, 0, 1), (Color{255, 255, 255}));
}

TEST(Canvas, AreasAreWhereTheyAreSaidToBe) {
  Canvas canvas(20, 10, white);
  canvas.rectangle({2, 3, 4, 5}, red);
  EXPECT_EQ(at(canvas, 2, 3), red);
  EXPECT_EQ(at(canvas, 5, 7), red);
  EXPECT_EQ(at(canvas, 1, 3), white);
  EXPECT_EQ(at(canvas, 6, 8), white);
  const std::array<Point, 2> centres{{{10, 5}, {16, 5}}};
  canvas.discs(centres, 2, black);
  EXPECT_EQ(at(canvas, 10, 5), black);
  EXPECT_EQ(at(canvas, 16, 5), black);
  EXPECT_EQ(at(canvas, 13, 5), white);  // not joined by a line
}

TEST(Canvas, WhatIsFadedLetsTheGroundThrough) {
  Canvas canvas(4, 4, white);
  canvas.rectangle({0, 0, 4, 4}, black.faded(0.25));
  EXPECT_NEAR(at(canvas, 1, 1).r, 191, 1);
}

TEST(Canvas, NothingIsDrawnOutsideAClip) {
  Canvas canvas(10, 10, white);
  {
    const Canvas::Clip clip(canvas, {0, 0, 5, 10});
    canvas.rectangle({0, 0, 10, 10}, red);
  }
  EXPECT_EQ(at(canvas, 4, 4), red);
  EXPECT_EQ(at(canvas, 5, 4), white);
  canvas.rectangle({0, 0, 10, 10}, red);  // the clip is over
  EXPECT_EQ(at(canvas, 5, 4), red);
}

TEST(Canvas, PixelsAndOtherCanvasesArePutOneToOneAndCutAtTheEdge) {
  const std::vector<std::uint8_t> bgr{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};  // 2 x 2
  Canvas small(3, 3, black);
  small.pixels({2, -1}, {bgr.data(), 2, 2, 6});
  EXPECT_EQ(at(small, 2, 0), (Color{9, 8, 7}));
  EXPECT_EQ(at(small, 2, 1), black);
  Canvas large(6, 6, white);
  large.paste({4, 4}, small);
  EXPECT_EQ(at(large, 4, 4), black);
  EXPECT_EQ(at(large, 3, 4), white);
  large.paste({-2, 0}, small);
  EXPECT_EQ(at(large, 0, 0), (Color{9, 8, 7}));
}

TEST(Canvas, TextIsAlignedByItsWidth) {
  const auto columns_with_ink = [](Align align) {
    Canvas canvas(200, 30, white);
    canvas.text({100, 20}, "huetrack", 14, black, align);
    std::pair<int, int> span{200, -1};
    for (int u = 0; u < 200; ++u)
      for (int v = 0; v < 30; ++v)
        if (at(canvas, u, v) != white) span = {std::min(span.first, u), std::max(span.second, u)};
    return span;
  };
  const double width = Canvas(1, 1, white).text_width("huetrack", 14);
  EXPECT_NEAR(columns_with_ink(Align::left).first, 100, 3);
  EXPECT_NEAR(columns_with_ink(Align::left).second, 100 + width, 3);
  EXPECT_NEAR(columns_with_ink(Align::right).second, 100, 3);
  EXPECT_NEAR(columns_with_ink(Align::centre).first, 100 - width / 2, 3);
}

TEST(Canvas, BecomesAFile) {
  Canvas pixels(30, 20, white);
  pixels.line({0, 0}, {30, 20}, red, 2);
  EXPECT_THAT(pixels.png(), StartsWith("\x89PNG"));
  const auto page = [&] {
    Canvas pdf(60, 40, white, Canvas::Kind::pdf);
    {
      const Canvas::Placed placed(pdf, {10, 10}, 0.5);
      pdf.text({2, 10}, "a", 10, red);
    }
    pdf.next_page();
    pdf.line({0, 0}, {10, 10}, red, 1);
    return pdf.pdf();
  };
  EXPECT_THAT(page(), AllOf(testing::StartsWith("%PDF-"), HasSubstr("/Count 2")));
  EXPECT_EQ(page(), page());
  Canvas svg(30, 20, white, Canvas::Kind::svg);
  svg.text({2, 10}, "a", 10, red);
  EXPECT_THAT(svg.svg(), AllOf(HasSubstr("<svg"), HasSubstr("</svg>")));
}

TEST(Canvas, ASizeThatCannotBeIsRefused) {
  EXPECT_THROW(Canvas(100'000, 10, white), std::runtime_error);
}

}  // namespace
}  // namespace huetrack::drawing
