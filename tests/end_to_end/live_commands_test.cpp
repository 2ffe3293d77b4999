// huetrackd run, record and doctor as a user types them, on a host without cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "end_to_end/http.h"
#include "end_to_end/process.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

class Commands : public testing::Test {
 protected:
  Commands() : folder(fs::path(testing::TempDir()) / ("commands_" + std::to_string(::getpid()))) {
    fs::create_directories(folder);
  }
  ~Commands() override { fs::remove_all(folder); }
  std::string configure(const std::string& cameras, const std::string& more = "") const {
    std::ofstream(folder / "c.yaml") << "version: 1\nrig: " HUETRACK_SOURCE_DIR "/configs/demo/recording/rig.yaml\n"
                                     << "targets: {lime: {color: {hue_deg: [65, 115]}}}\ndds: {enabled: false}\n"
                                     << cameras << more;
    return folder / "c.yaml";
  }
  std::unique_ptr<Process> start(std::vector<std::string> command) const {
    command.insert(command.begin(), HUETRACKD);
    return std::make_unique<Process>(command, folder / "out", folder / "err");
  }
  struct Result {
    int status;
    std::string out, err;
  };
  Result run(const std::vector<std::string>& command) const {
    const auto process = start(command);
    const int status = process->wait();
    return {status, process->out(), process->err()};
  }
  const std::string absent = "cameras: {cam0: {device: /dev/v4l/by-path/none-video-index0}}\n";
  const fs::path folder;
};

TEST_F(Commands, RunNeedsCamerasAndSaysHowToNameThem) {
  const Result result = run({"run", configure("")});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr("c.yaml: cameras: there are none"), HasSubstr("huetrackd doctor")));
}

TEST_F(Commands, RunRefusesAWrongConfigurationWithItsLine) {
  const Result result = run({"run", configure("cameras: {cam7: {device: 0}}\n")});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr("c.yaml:5"), HasSubstr("cam7")));
  EXPECT_EQ(run({"run", folder / "not_there.yaml"}).status, 1);
  EXPECT_GT(run({"run"}).status, 100);
  EXPECT_GT(run({"record", configure(absent)}).status, 100);
  EXPECT_GT(run({"record", configure(absent), folder / "out", "--seconds", "-1"}).status, 100);
}

TEST_F(Commands, ADeviceThatIsNoCameraIsRefused) {
  const Result result = run({"run", configure("cameras: {cam0: {device: /dev/null}}\n")});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("/dev/null: is not a video device"));
}

TEST_F(Commands, RecordDoesNotWriteIntoAFolderThatIsNotEmpty) {
  const Result result = run({"record", configure(absent), folder});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("is not an empty folder"));
}

TEST_F(Commands, RunWaitsForAbsentCamerasAndEndsWithinASecondWhateverHappens) {
  const int port = 20000 + ::getpid() % 10000;
  const auto service = start({"run", configure(absent, "metrics: {port: " + std::to_string(port) + "}\n")});
  const auto end = std::chrono::steady_clock::now() + 20s;
  while (!http_get(port, "/metrics") && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(20ms);
  const Connection silent(port);
  ASSERT_TRUE(silent.is_open());
  std::this_thread::sleep_for(300ms);
  EXPECT_THAT(service->err(),
              HasSubstr("camera cam0: not available: /dev/v4l/by-path/none-video-index0: No such file"));
  const auto asked = std::chrono::steady_clock::now();
  service->kill(SIGTERM);
  EXPECT_EQ(service->wait(), 0);
  EXPECT_LT(std::chrono::steady_clock::now() - asked, 1s);
}

TEST_F(Commands, DoctorNamesWhatIsMissing) {
  const Result result = run({"doctor", configure(absent)});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("  ok    it is valid"), HasSubstr("camera cam0\n  FAIL  /dev/v4l/by-path/none"),
                    HasSubstr("        -> plug it in"), HasSubstr("USB\n"), HasSubstr("1 problem")));
  const Result wrong = run({"doctor", configure(absent, "no_such_key: 1\n")});
  EXPECT_EQ(wrong.status, 1);
  EXPECT_THAT(wrong.out, HasSubstr("  FAIL  " + (folder / "c.yaml").string() + ":6: no_such_key is not a known key"));
}

}  // namespace
}  // namespace huetrack::end_to_end
