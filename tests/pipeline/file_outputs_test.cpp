#include "pipeline/file_outputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <stdexcept>

namespace huetrack::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

class RefuseOutputs : public testing::Test {
 protected:
  RefuseOutputs() { fs::create_directories(folder_ / "pictures"); }
  ~RefuseOutputs() override { fs::remove_all(folder_); }
  fs::path made(const std::string& name) const {
    std::ofstream(folder_ / name) << "something";
    return folder_ / name;
  }
  static auto refuses(const WrittenFiles& outputs, const std::vector<fs::path>& read, const std::string& why) {
    EXPECT_THAT([&] { refuse_outputs(outputs, read); }, ThrowsMessage<std::runtime_error>(HasSubstr(why)));
  }
  const fs::path folder_ = fs::path(testing::TempDir()) / ("outputs_" + std::to_string(::getpid()));
};

TEST_F(RefuseOutputs, AcceptsDistinctFiles) {
  EXPECT_NO_THROW(
      refuse_outputs({.files = {folder_ / "tracks.csv", folder_ / "poses.tum", {}}, .pictures = folder_ / "pictures"},
                     {made("truth.csv"), folder_ / "film" / "%06d.png", made("cam0.mkv")}));
}

TEST_F(RefuseOutputs, RefusesOneFileTwiceByAnyName) {
  refuses({.files = {folder_ / "a.csv", folder_ / "pictures" / ".." / "a.csv"}}, {}, "written twice");
  fs::create_symlink("a.csv", folder_ / "later.csv");  // a link to what is not there yet
  refuses({.files = {folder_ / "a.csv", folder_ / "later.csv"}}, {}, "written twice");
  refuses({.files = {folder_ / "pictures" / "track_3d.png"}, .pictures = folder_ / "pictures"}, {}, "by a picture");
}

TEST_F(RefuseOutputs, RefusesInputs) {
  const fs::path truth = made("truth.csv");
  refuses({.files = {truth}}, {truth}, "is read by this run");
  fs::create_hard_link(truth, folder_ / "same.csv");
  refuses({.files = {folder_ / "same.csv"}}, {truth}, "is read by this run");
  refuses({.files = {}, .pictures = folder_ / "pictures"}, {folder_ / "pictures" / "set_%06d.png"},
          "the recording's own pictures");
}

}  // namespace
}  // namespace huetrack::pipeline
