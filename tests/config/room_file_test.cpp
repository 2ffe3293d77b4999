#include "config/room_file.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "calib/files/config_error.h"

namespace huetrack::config {
namespace {

class RoomFile : public testing::Test {
 protected:
  // A file for each test: they run beside one another.
  RoomFile()
      : file_(std::filesystem::path(testing::TempDir()) /
              ("room_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".yaml")) {
    std::filesystem::remove(file_);
    KeptRoom kept{.camera = "cam-0.left", .patches = {}};
    for (int k = 0; k < 3; ++k) {
      room_watch::KeptPatch patch{.px = {10.25 + k, 1.0 / 3}, .cell = k, .seen = {}};
      for (std::size_t i = 0; i < patch.seen.size(); ++i)
        patch.seen[i] = static_cast<std::uint8_t>(7 * i + std::size_t(k));
      kept.patches.push_back(patch);
    }
    room_ = {kept, {.camera = "cam1", .patches = kept.patches}, {.camera = "of_one_colour", .patches = {}}};
  }
  const std::filesystem::path file_;
  std::vector<KeptRoom> room_;
};

TEST_F(RoomFile, ReadsBackWhatWasWritten) {
  write_room(file_, room_, "abc");
  const auto read = read_room(file_, "abc");
  ASSERT_EQ(read.size(), room_.size());
  for (std::size_t c = 0; c < read.size(); ++c) {
    EXPECT_EQ(read[c].camera, room_[c].camera);
    ASSERT_EQ(read[c].patches.size(), room_[c].patches.size());
    for (std::size_t k = 0; k < read[c].patches.size(); ++k) {
      EXPECT_EQ(read[c].patches[k].px, room_[c].patches[k].px);
      EXPECT_EQ(read[c].patches[k].cell, room_[c].patches[k].cell);
      EXPECT_EQ(read[c].patches[k].seen, room_[c].patches[k].seen);
    }
  }
}

TEST_F(RoomFile, OfAnotherRigOrAbsentItIsEmpty) {
  EXPECT_TRUE(read_room(file_, "abc").empty());
  write_room(file_, room_, "abc");
  EXPECT_TRUE(read_room(file_, "another").empty());
}

TEST_F(RoomFile, WhatIsNoPatchIsAnError) {
  std::ofstream(file_) << "version: 1\nrig: \"abc\"\ncameras:\n  cam0:\n    patches:\n"
                          "      - {px: [1, 2], cell: 0, seen: \"00zz\"}\n";
  EXPECT_THROW(read_room(file_, "abc"), files::ConfigError);
}

// Found by fuzzing: a longer one is written, and does not read back.
TEST_F(RoomFile, WhatIsNoCamerasNameIsAnError) {
  for (const std::string& name : {std::string("two words"), std::string(65, 'c'), std::string("\xDC")}) {
    std::ofstream(file_) << "version: 1\nrig: \"abc\"\ncameras:\n  \"" << name << "\":\n    patches: []\n";
    EXPECT_THROW(read_room(file_, "abc"), files::ConfigError) << name;
  }
}

}  // namespace
}  // namespace huetrack::config
