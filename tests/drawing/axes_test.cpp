#include "drawing/axes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace huetrack::drawing {
namespace {

TEST(TickStep, IsOneTwoOrFiveTimesAPowerOfTen) {
  EXPECT_DOUBLE_EQ(tick_step(10, 10), 1);
  EXPECT_DOUBLE_EQ(tick_step(10, 9), 2);
  EXPECT_DOUBLE_EQ(tick_step(0.3, 10), 0.05);
  EXPECT_DOUBLE_EQ(tick_step(700, 10), 100);
}

TEST(TickLabel, HasAsManyDecimalsAsTheStep) {
  EXPECT_EQ(tick_label(3, 1), "3");
  EXPECT_EQ(tick_label(0.15, 0.05), "0.15");
  EXPECT_EQ(tick_label(-1e-17, 0.5), "0.0");
  EXPECT_EQ(tick_label(200, 100), "200");
}

TEST(Ticks, AreAtTheMultiplesAndAtEndsThatAreOnes) {
  std::vector<std::string> labels;
  for_each_tick({-0.1, 0.3}, 0.1, [&](double value) { labels.push_back(tick_label(value, 0.1)); });
  EXPECT_THAT(labels, testing::ElementsAre("-0.1", "0.0", "0.1", "0.2", "0.3"));
}

TEST(Span, IsPaddedOnBothSides) {
  Span span;
  span.add(1);
  span.add(std::nan(""));
  span.add(3);
  span.pad(0.1, 0);
  EXPECT_DOUBLE_EQ(span.low, 0.8);
  EXPECT_DOUBLE_EQ(span.high, 3.2);
  span.pad(0, 10);
  EXPECT_DOUBLE_EQ(span.size(), 10);
  Span empty;
  empty.pad(0, 0);
  EXPECT_DOUBLE_EQ(empty.size(), 1);
}

TEST(Axes, SayWhereValuesLie) {
  const Axes axes{{10, 20, 100, 50}, {0, 2}, {0, 1}};
  EXPECT_EQ(axes(0, 0), Point(10, 70));
  EXPECT_EQ(axes(1, 1), Point(60, 20));
}

}  // namespace
}  // namespace huetrack::drawing
