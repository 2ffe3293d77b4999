#include "reports/object_report.h"

#include <gmock/gmock.h>

namespace huetrack::reports {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(ExtraObjectText, NamesPlaceAndRemedy) {
  object_tracking::TargetOptions target;
  target.name = "orange";
  EXPECT_THAT(extra_object_text(target, {0.31, 0.12, 1.1}),
              AllOf(HasSubstr("orange: something else has its colour and its size, at 0.31, 0.12, 1.10 m"),
                    HasSubstr("write count: up to 2")));
  target.count = 3;
  EXPECT_THAT(extra_object_text(target, {0.31, 0.12, 1.1}),
              AllOf(HasSubstr("more objects than the 3 of its count"), HasSubstr("raise count")));
}

}  // namespace
}  // namespace huetrack::reports
