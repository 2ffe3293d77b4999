// `huetrackd demo` as a user without cameras runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "capture/loopback_port.h"
#include "end_to_end/http.h"
#include "end_to_end/process.h"
#include "publish/test_domain.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;

class Demo : public testing::Test {
 protected:
  Demo() : folder(fs::path(testing::TempDir()) / ("demo_" + std::to_string(::getpid()))) {
    fs::create_directories(folder / "tmp");
  }
  ~Demo() override { fs::remove_all(folder); }
  void start(std::vector<std::string> words, const std::string& program = HUETRACKD) {
    words.insert(words.begin(), {program, "demo"});
    service.emplace(words, folder / "out", folder / "err", environment());
  }
  std::map<std::string, std::string> environment() const {
    return {{"ROS_DOMAIN_ID", std::to_string(publish::test_domain())},
            {"TMPDIR", folder / "tmp"},
            {"PATH", fs::path(HUETRACK).parent_path().string() + ":/usr/bin:/bin"}};
  }
  std::string huetrack(std::vector<std::string> words) const {
    words.insert(words.begin(), HUETRACK);
    Process process(words, folder / "client.out", folder / "client.err", environment());
    process.wait();
    return process.out() + process.err();
  }
  // Of the page, from its printed address; 0: not printed within 20 s.
  int port() const {
    const std::string before = "http://127.0.0.1:";
    for (int i = 0; i < 400; ++i, std::this_thread::sleep_for(50ms))
      if (const std::string out = service->out(); out.find(before) != std::string::npos)
        return std::atoi(out.c_str() + out.find(before) + before.size());
    return 0;
  }

  const fs::path folder;
  std::optional<Process> service;
};

TEST_F(Demo, TracksServesThePageAndLeavesNothingBehind) {
  start({"--port", "0"});
  const int page = port();
  ASSERT_NE(page, 0) << service->out() << service->err();
  EXPECT_THAT(http_get(page, "/").value_or(""), AllOf(HasSubstr("200 OK"), HasSubstr("<title>huetrack")));
  EXPECT_FALSE(fs::is_empty(folder / "tmp"));
  EXPECT_THAT(huetrack({"watch", "--count", "30", "--timeout", "20"}), HasSubstr("lime  tracking"));
  service->kill(SIGINT);
  EXPECT_EQ(service->wait(), 0);
  EXPECT_TRUE(fs::is_empty(folder / "tmp"));
}

TEST_F(Demo, EndsWithAnErrorIfItsPortIsInUse) {
  const capture::LoopbackPort other;
  start({"--port", std::to_string(other.number)});
  EXPECT_EQ(service->wait(), 1);
  EXPECT_THAT(service->out(), HasSubstr("cannot listen on 127.0.0.1:" + std::to_string(other.number)));
  EXPECT_THAT(service->err(), HasSubstr("huetrackd: the page has ended, and the demo with it"));
}

TEST_F(Demo, EndsWithAnErrorWithoutThePagesProgram) {
  auto without_huetrack = environment();
  without_huetrack["PATH"] = "/usr/bin:/bin";
  service.emplace(std::vector<std::string>{HUETRACKD, "demo"}, folder / "out", folder / "err", without_huetrack);
  EXPECT_EQ(service->wait(), 1);
  EXPECT_THAT(service->err(), HasSubstr("huetrack, is neither next to huetrackd nor on the PATH"));
}

TEST_F(Demo, RecordsIntoAFolderOfOnesOwn) {
  start({folder / "mine", "--no-page"});
  ASSERT_THAT(huetrack({"watch", "--count", "10", "--timeout", "20"}), HasSubstr("lime"));
  EXPECT_THAT(huetrack({"control", "record", "start"}), HasSubstr("Recording to"));
  std::this_thread::sleep_for(1s);
  EXPECT_THAT(huetrack({"control", "record", "stop"}), HasSubstr("Recorded to"));
  service->kill(SIGINT);
  EXPECT_EQ(service->wait(), 0);
  EXPECT_FALSE(fs::is_empty(folder / "mine/recordings"));
}

// The demo's own configuration permits --hold; times rise over the end of the recording, and over jumps.
TEST_F(Demo, ItsRecordingIsHeldSoughtAndLooped) {
  const fs::path demo = HUETRACK_SOURCE_DIR "/configs/demo";
  service.emplace(std::vector<std::string>{HUETRACKD, "replay", demo / "huetrackd.yaml", demo / "recording", "--loop",
                                           "--speed", "10", "--hold"},
                  folder / "out", folder / "err", environment());
  std::string state;
  for (int i = 0; i < 100 && state.find("paused") == std::string::npos; ++i) {
    state = huetrack({"control", "replay", "state"});
    std::this_thread::sleep_for(50ms);
  }
  EXPECT_THAT(state, AllOf(HasSubstr("paused"), HasSubstr("length_s\t4.967"), HasSubstr("loops\ttrue")));
  huetrack({"control", "replay", "seek", "4"});
  for (int i = 0; i < 100 && state.find("position_s\t4.0") == std::string::npos; ++i)
    state = huetrack({"control", "replay", "state"});
  EXPECT_THAT(state, AllOf(HasSubstr("paused"), HasSubstr("position_s\t4.0")));
  Process log({HUETRACK, "log", folder / "log.csv", "--count", "400", "--timeout", "20"}, folder / "log.out",
              folder / "log.err", environment());
  std::this_thread::sleep_for(500ms);
  huetrack({"control", "replay", "go"});
  EXPECT_EQ(log.wait(), 0) << log.err();
  service->kill(SIGINT);
  EXPECT_EQ(service->wait(), 0);
  std::istringstream rows(contents(folder / "log.csv"));
  double before = 0;
  int tracking = 0;
  for (std::string row; std::getline(rows, row);) {
    if (row.starts_with("target")) continue;
    tracking += row.find(",tracking,") != std::string::npos ? 1 : 0;
    const double at = std::atof(row.c_str() + row.find(',') + 1);
    if (!std::isfinite(at)) continue;
    EXPECT_GT(at, before);
    before = at;
  }
  EXPECT_GT(tracking, 360) << "a loop costs some frames of coasting";
}

// With the demo's files and the documents that messages name; the source tree is not above it.
TEST_F(Demo, RunsAsInstalled) {
  const fs::path prefix = folder / "installed";
  Process install({HUETRACK_CMAKE, "--install", HUETRACK_BUILD_DIR, "--prefix", prefix}, folder / "install.out",
                  folder / "install.err");
  ASSERT_EQ(install.wait(), 0) << install.err();
  const fs::path documents = prefix / "share/doc/huetrack";
  for (const char* const document : {"README.md", "calib/tutorial.md", "calib/reference.md", "calib/formats.md",
                                     "service/daemon/live.md", "configs/huetrackd.yaml"})
    EXPECT_TRUE(fs::is_regular_file(documents / document)) << document;
  Process links({"/usr/bin/python3", HUETRACK_SOURCE_DIR "/tests/floors/check_documents.py", "--links", documents},
                folder / "links.out", folder / "links.err");
  EXPECT_EQ(links.wait(), 0) << links.err();
  Process help({prefix / "bin/huetrack", "control", "--help"}, folder / "help.out", folder / "help.err");
  EXPECT_EQ(help.wait(), 0);
  EXPECT_THAT(help.out(), HasSubstr((documents / "idl/README.md").string())) << "messages name the installed documents";
  start({folder / "mine", "--no-page"}, prefix / "bin/huetrackd");
  EXPECT_THAT(huetrack({"watch", "--count", "10", "--timeout", "20"}), HasSubstr("lime  tracking"));
  service->kill(SIGINT);
  EXPECT_EQ(service->wait(), 0) << service->err();
}

}  // namespace
}  // namespace huetrack::end_to_end
