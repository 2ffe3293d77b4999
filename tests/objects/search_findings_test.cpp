#include "object_tracking/objects/search_findings.h"

#include <gtest/gtest.h>

namespace huetrack::objects {
namespace {

TEST(SearchLog, CountsSetsInARoomThatSharesTheColour) {
  SearchLog log(1);
  for (const bool is_room_shared : {true, false, true}) log.add({}, {}, {}, is_room_shared);
  EXPECT_EQ(log.findings().sets, 3u);
  EXPECT_EQ(log.findings().sets_shared, 2u);
  log.clear();
  EXPECT_EQ(log.findings().sets_shared, 0u);
  EXPECT_EQ(log.findings_of_run().sets_shared, 2u);
}

}  // namespace
}  // namespace huetrack::objects
