#include "calib/files/nearest_word.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/files/unknown_words.h"

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

TEST(UnknownOption, NamesTheNearestOption) {
  const std::vector<std::string> options{"speed", "strict", "no-dds", "wait-for-subscriber"};
  const auto near = [&](const char* word) { return unknown_option("huetrackd replay", word, options); };
  EXPECT_EQ(near("--sped"),
            "huetrackd replay has no option --sped (did you mean --speed?); huetrackd replay --help lists them\n");
  EXPECT_THAT(near("--sped=2"), testing::HasSubstr("no option --sped (did you mean --speed?)"));
  EXPECT_THAT(near("-speed"), testing::HasSubstr("no option -speed (did you mean --speed?)"));
  EXPECT_THAT(near("--strikt"), testing::HasSubstr("(did you mean --strict?)"));
  EXPECT_THAT(near("--dds"), testing::HasSubstr("(did you mean --no-dds?)"));
  EXPECT_THAT(near("--wait"), testing::HasSubstr("(did you mean --wait-for-subscriber?)"));
  EXPECT_EQ(near("--banana"), "huetrackd replay has no option --banana; huetrackd replay --help lists them\n");
}

}  // namespace
}  // namespace huetrack::files
