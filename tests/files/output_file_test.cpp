#include "calib/files/output_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <system_error>

namespace huetrack::files {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;
namespace fs = std::filesystem;

std::string contents(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

class OutputFile : public testing::Test {
 protected:
  OutputFile() { fs::create_directories(folder_); }
  ~OutputFile() override { fs::remove_all(folder_); }
  // A disk that is full, as far as a process can tell: its files may have so many bytes.
  template <typename F>
  void with_room_for(rlim_t bytes, F&& what) {
    rlimit before{};
    ::getrlimit(RLIMIT_FSIZE, &before);
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{bytes, before.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
    what();
    ::setrlimit(RLIMIT_FSIZE, &before);
  }
  static constexpr FileKind kind_{"tracks", [](std::string_view text) { return text.starts_with("target,"); }};
  const fs::path folder_ = fs::path(testing::TempDir()) / ("output_" + std::to_string(::getpid()));
  const fs::path file_ = folder_ / "f.csv";
};

TEST_F(OutputFile, ReplacesOnlyFilesOfItsKind) {
  EXPECT_NO_THROW(refuse_other_kind(file_, kind_));  // nothing there
  std::ofstream(file_) << "";
  EXPECT_NO_THROW(refuse_other_kind(file_, kind_));
  std::ofstream(file_) << "target,t\n1,2\n";
  EXPECT_NO_THROW(refuse_other_kind(file_, kind_));
  EXPECT_NO_THROW(refuse_other_kind("/dev/null", kind_));
  for (const char* other : {"ball,t,x,y,z\n", "cameras:\n", "\x1a\x45\xdf\xa3"}) {
    std::ofstream(file_) << other;
    EXPECT_THAT([&] { LineFile(file_, kind_, "target,t"); },
                ThrowsMessage<std::runtime_error>(HasSubstr("f.csv exists and holds no tracks")));
    EXPECT_EQ(contents(file_), other);
  }
}

TEST_F(OutputFile, AFailedWriteKeepsTheOldFile) {
  write_whole_file(file_, "first");
  EXPECT_EQ(contents(file_), "first");
  with_room_for(100, [&] {
    EXPECT_THAT([&] { write_whole_file(file_, std::string(5000, 'x')); },
                ThrowsMessage<std::system_error>(HasSubstr("cannot write " + file_.string())));
  });
  EXPECT_EQ(contents(file_), "first");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1) << "nothing is left behind";
}

TEST_F(OutputFile, FollowsLinksAndKeepsPermissions) {
  const fs::path real = folder_ / "real.csv";
  std::ofstream(real) << "first";
  fs::permissions(real, fs::perms::owner_read | fs::perms::owner_write);
  fs::create_symlink("real.csv", file_);
  write_whole_file(file_, "second");
  EXPECT_TRUE(fs::is_symlink(file_));
  EXPECT_EQ(contents(real), "second");
  EXPECT_EQ(fs::status(real).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  const fs::path dangling = folder_ / "dangling.csv";
  fs::create_symlink(folder_ / "not_yet.csv", dangling);
  EXPECT_EQ(resolved_link(dangling), folder_ / "not_yet.csv");
  write_whole_file(dangling, "third");
  EXPECT_EQ(contents(folder_ / "not_yet.csv"), "third");
}

TEST_F(OutputFile, WritesIntoAPipeWithoutReplacingIt) {
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  const int reader = ::open(file_.c_str(), O_RDONLY | O_NONBLOCK);
  ASSERT_GE(reader, 0);
  write_whole_file(file_, "all of it");
  char got[32] = {};
  EXPECT_EQ(::read(reader, got, sizeof got), 9);
  EXPECT_STREQ(got, "all of it");
  ::close(reader);
  EXPECT_TRUE(fs::is_fifo(file_));
}

TEST_F(OutputFile, AFullDiskLeavesCompleteLinesOrNoFile) {
  with_room_for(10'000, [&] {
    LineFile lines(file_, kind_, "target,t");
    EXPECT_THAT(
        [&] {
          for (int i = 0; i < 1000; ++i) lines.write("ball,0123456789");
        },
        ThrowsMessage<std::system_error>(HasSubstr("cannot write")));
  });
  const std::string text = contents(file_);
  EXPECT_GT(text.size(), 9'000u);
  EXPECT_TRUE(text.ends_with("ball,0123456789\n"));
  fs::remove(file_);
  with_room_for(0, [&] {
    LineFile lines(file_, kind_, "target,t");
    EXPECT_THROW(lines.flush(), std::system_error);
  });
  EXPECT_FALSE(fs::exists(file_)) << "an empty one";
}

TEST_F(OutputFile, AKilledWriterLeavesACompleteLastLine) {
  for (int round = 0; round < 10; ++round) {
    const pid_t child = ::fork();
    if (child == 0) {
      LineFile lines(file_, kind_, "target,t");
      for (int i = 0;; ++i) {
        lines.write("ball," + std::to_string(i));
        ::usleep(20);  // between writes, that is: the kernel itself may end one at a page's end
      }
    }
    // However busy the machine is, it is killed while it writes.
    std::error_code not_there;
    for (int i = 0; i < 30'000 && !(fs::exists(file_, not_there) && fs::file_size(file_, not_there) > 1000); ++i)
      ::usleep(1000);
    ::usleep(static_cast<useconds_t>(3'000 * round));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    const std::string text = contents(file_);
    ASSERT_FALSE(text.empty());
    EXPECT_EQ(text.back(), '\n');
    fs::remove(file_);
  }
}

}  // namespace
}  // namespace huetrack::files
