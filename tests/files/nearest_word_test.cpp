#include "calib/files/nearest_word.h"

#include <gtest/gtest.h>

namespace huetrack::files {
namespace {

TEST(NearestWord, FindsMisspellingsOnly) {
  const std::vector<std::string> words{"particle_count", "fx", "fy", "seed", "yuyv"};
  EXPECT_EQ(nearest_word("particle_cuont", words), "particle_count");
  EXPECT_EQ(nearest_word("particlecount", words), "particle_count");
  EXPECT_EQ(nearest_word("sead", words), "seed");
  EXPECT_EQ(nearest_word("yuvy", words), "yuyv");
  EXPECT_EQ(nearest_word("cx", words), std::nullopt);  // too short for a suggestion
  EXPECT_EQ(nearest_word("banana", words), std::nullopt);
  EXPECT_EQ(nearest_word("", words), std::nullopt);
  EXPECT_EQ(nearest_word("seed", {}), std::nullopt);
}

}  // namespace
}  // namespace huetrack::files
