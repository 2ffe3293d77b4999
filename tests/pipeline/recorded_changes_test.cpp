#include "pipeline/recorded_changes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "calib/files/config_error.h"

namespace huetrack::pipeline {
namespace {

namespace fs = std::filesystem;

class Changes : public testing::Test {
 protected:
  Changes() : folder(fs::path(testing::TempDir()) / ("changes_" + std::to_string(::getpid()))) {
    fs::create_directories(folder);
  }
  ~Changes() override { fs::remove_all(folder); }
  const fs::path folder;
};

TEST_F(Changes, NoneWithoutAFile) {
  const RecordedChanges none = read_changes(folder);
  EXPECT_TRUE(none.reloads.empty() && none.left_out.empty());
}

TEST_F(Changes, AreReadAsTheyWereWritten) {
  const capture::Timestamp at{capture::Duration(1'795'232'262'000'000'007)};
  ChangesWriter writer(folder);
  writer.left_out(at);
  writer.reloaded(at + capture::Duration(5), "first");
  writer.reloaded(at + capture::Duration(5), "second");
  writer.left_out(at + capture::Duration(9));
  EXPECT_EQ(writer.failure(), "");
  const RecordedChanges read = read_changes(folder);
  EXPECT_THAT(read.left_out, testing::ElementsAre(at, at + capture::Duration(9)));
  ASSERT_EQ(read.reloads.size(), 2u);
  EXPECT_EQ(read.reloads[1].at, at + capture::Duration(5));
  std::string text;
  std::getline(std::ifstream(read.reloads[1].config), text);
  EXPECT_EQ(text, "second");
}

TEST_F(Changes, AWriteErrorIsReported) {
  ChangesWriter writer(folder / "not_there");
  writer.left_out(capture::Timestamp{});
  EXPECT_THAT(writer.failure(), testing::HasSubstr("not_there/changes.csv: No such file or directory"));
}

TEST_F(Changes, AnUnknownOneIsAnErrorWithItsLine) {
  std::ofstream(folder / "changes.csv") << "t_s,change,config\n1.5,danced,\n";
  EXPECT_THAT([&] { read_changes(folder); }, testing::ThrowsMessage<files::ConfigError>(
                                                 testing::HasSubstr("changes.csv:2: unknown change \"danced\"")));
}

}  // namespace
}  // namespace huetrack::pipeline
