#include "page/request_words.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace huetrack::page {
namespace {

using namespace testing;

TEST(RequestWords, AreSplitCompletely) {
  EXPECT_THAT(split("left,right,3.42", ','), ElementsAre("left", "right", "3.42"));
  EXPECT_THAT(split(",a,,", ','), ElementsAre("", "a", "", ""));
  EXPECT_THAT(split("a,b", '\t'), ElementsAre("a,b"));
  EXPECT_THAT(split("", ','), ElementsAre(""));
}

TEST(RequestWords, NumbersAreStrict) {
  EXPECT_EQ(finite_number("-2.5e3"), -2500);
  for (const char* text : {"", " 1", "1 ", "1,2", "3m", "+1", "nan", "inf", "1e999", "zero"}) {
    EXPECT_EQ(finite_number(text), std::nullopt) << text;
    EXPECT_THAT([&] { real_of(text); }, ThrowsMessage<std::runtime_error>(std::string("write a number, not ") + text));
  }
  EXPECT_EQ(real_of("0.5"), 0.5);
  EXPECT_EQ(whole_number_of("18446744073709551615"), 18446744073709551615u);
  for (const char* text : {"", "-1", "1.5", "1x", " 1", "18446744073709551616"})
    EXPECT_THAT([&] { whole_number_of(text); },
                ThrowsMessage<std::runtime_error>(std::string("write a whole number, not ") + text));
}

}  // namespace
}  // namespace huetrack::page
