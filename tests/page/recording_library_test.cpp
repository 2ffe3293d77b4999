// Recordings, and nothing else, are listed and read as tar files in parts.
#include "page/recording_library.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

namespace huetrack::page {
namespace {

using namespace testing;
namespace fs = std::filesystem;

class Recordings : public Test {
 protected:
  Recordings() {
    fs::create_directories(folder);
    recording("20261123T070000Z");
  }
  ~Recordings() override { fs::remove_all(top); }

  void recording(const std::string& name) const {
    write(name, "recording.yaml", "version: 1\n");
    write(name, "left.csv", "frame,t_s,sequence\n0,100.25,0\n1,100.5,1\n2,103.75,2\n");
    write(name, "right.csv", "frame,t_s,sequence\n0,100.125,0\n");
    write(name, "left.mkv", std::string(5000, 'l'));
    write(name, "right.mkv", std::string(512, 'r'));  // a whole block
    write(name, "empty.txt", "");
  }
  void write(const std::string& name, const std::string& file, const std::string& text) const {
    fs::create_directories(folder / name);
    std::ofstream(folder / name / file, std::ios::binary) << text;
  }
  std::string whole(const std::string& name, std::size_t piece_bytes) const {
    std::string tar;
    for (;;) {
      const RecordingPiece piece = recordings.read(name, tar.size(), piece_bytes);
      if (piece.bytes.empty()) {
        EXPECT_EQ(tar.size(), piece.tar_bytes);
        return tar;
      }
      EXPECT_LE(piece.bytes.size(), piece_bytes);
      tar.append(piece.bytes.begin(), piece.bytes.end());
    }
  }
  const fs::path top = fs::path(TempDir()) / ("recording_library_" + std::to_string(::getpid()));
  const fs::path folder = top / "recordings";
  const RecordingLibrary recordings{folder};
};

TEST_F(Recordings, ARecordingIsDeletedAndNothingElse) {
  recording("20261123T080000Z-lost");
  write("20261123T080000Z-lost", ".hidden", "x");
  fs::create_symlink(folder / "20261123T070000Z" / "left.mkv", folder / "20261123T080000Z-lost" / "link");
  fs::create_directories(folder / "no_recording");
  fs::create_directory_symlink(folder / "20261123T070000Z", folder / "linked");
  for (const std::string hostile : {"no_recording", "linked", "..", ".", "", "a/b", "/etc", "none"})
    EXPECT_THROW(recordings.remove(hostile), std::runtime_error) << hostile;
  recordings.remove("20261123T080000Z-lost");
  EXPECT_FALSE(fs::exists(folder / "20261123T080000Z-lost"));
  EXPECT_EQ(fs::file_size(folder / "20261123T070000Z" / "left.mkv"), 5000u);  // the link went, not what it led to
  fs::create_directories(folder / "20261123T070000Z" / "mine");
  EXPECT_THROW(recordings.remove("20261123T070000Z"), std::runtime_error);
  EXPECT_EQ(recordings.list(10).size(), 1u);
  EXPECT_EQ(fs::file_size(folder / "20261123T070000Z" / "left.mkv"), 5000u);
}

TEST_F(Recordings, ListsTheNewestFirst) {
  recording("20261123T080000Z-lost");
  fs::create_directories(folder / "no_recording");
  write("20261123T090000Z", "recording.yaml", "");  // begun a moment ago: no frame yet
  const auto list = recordings.list(10);
  ASSERT_EQ(list.size(), 3u);
  EXPECT_EQ(list[0].name, "20261123T090000Z");
  EXPECT_FALSE(list[0].begun_at_s);
  EXPECT_EQ(list[0].cameras, 0u);
  EXPECT_EQ(list[1].name, "20261123T080000Z-lost");
  EXPECT_EQ(list[2].begun_at_s, 100.125);
  EXPECT_DOUBLE_EQ(list[2].length_s, 3.625);
  EXPECT_EQ(list[2].cameras, 2u);
  EXPECT_GT(list[2].bytes, 5512u);
  EXPECT_EQ(recordings.list(1).size(), 1u);
  EXPECT_THAT(RecordingLibrary(top / "none").list(10), IsEmpty());
}

TEST_F(Recordings, PartsMakeATarFileThatTarUnpacks) {
  const std::string tar = whole("20261123T070000Z", 256 * 1024);
  EXPECT_EQ(tar.size() % 512, 0u);
  for (const std::size_t piece : {1000, 512, 77}) EXPECT_EQ(whole("20261123T070000Z", piece), tar) << piece;
  std::ofstream(top / "a.tar", std::ios::binary) << tar;
  fs::create_directories(top / "out");
  ASSERT_EQ(std::system(("tar -xf " + (top / "a.tar").string() + " -C " + (top / "out").string()).c_str()), 0);
  ASSERT_EQ(
      std::system(("diff -r " + (folder / "20261123T070000Z").string() + " " + (top / "out/20261123T070000Z").string())
                      .c_str()),
      0);
}

TEST_F(Recordings, AFileOfMoreThanEightGigabytesHasItsSize) {
  const std::string name = "20261123T070000Z";
  ::truncate((folder / name / "left.mkv").c_str(), off_t(9) << 30);  // of zeros that no disk holds
  const RecordingPiece begin = recordings.read(name, 0, 4096);
  EXPECT_GT(begin.tar_bytes, std::uint64_t(9) << 30);
  std::string tar(begin.bytes.begin(), begin.bytes.end());
  const std::size_t header = tar.find("left.mkv");
  ASSERT_NE(header, std::string::npos);
  std::uint64_t size = 0;
  for (std::size_t i = 125; i < 136; ++i) size = size << 8 | static_cast<unsigned char>(tar[header + i]);
  EXPECT_EQ(static_cast<unsigned char>(tar[header + 124]), 0x80);
  EXPECT_EQ(size, std::uint64_t(9) << 30);
  // What stands behind it is where it belongs.
  EXPECT_TRUE(recordings.read(name, begin.tar_bytes - 10, 100).bytes.size() == 10);
}

TEST_F(Recordings, ARecordingThatChangesIsAnotherOne) {
  const std::string before = recordings.read("20261123T070000Z", 0, 10).identity;
  EXPECT_EQ(recordings.read("20261123T070000Z", 700, 10).identity, before);
  write("20261123T070000Z", "left.csv", "frame,t_s\n");
  EXPECT_NE(recordings.read("20261123T070000Z", 0, 10).identity, before);
}

TEST_F(Recordings, NothingOutsideIsOpened) {
  std::ofstream(top / "secret") << "secret";
  std::ofstream(top / "recording.yaml") << "version: 1\n";
  fs::create_directories(folder / ".hidden");
  std::ofstream(folder / ".hidden" / "recording.yaml") << "version: 1\n";
  fs::create_directory_symlink(top, folder / "link");
  const std::string name = "20261123T070000Z";
  for (const std::string& hostile :
       {std::string(), std::string("."), std::string(".."), std::string("../recordings"), std::string("link"),
        std::string(".hidden"), top.string(), name + "/", name + "/../../", name + std::string(1, '\0'),
        std::string("a b"), std::string("%2e%2e"), std::string(200, 'a')})
    EXPECT_THROW(recordings.read(hostile, 0, 100), std::runtime_error) << hostile;
  EXPECT_EQ(recordings.list(10).size(), 1u);

  fs::create_symlink(top / "secret", folder / name / "secret.txt");
  fs::create_directory_symlink(top, folder / name / "folder");
  ASSERT_EQ(::mkfifo((folder / name / "pipe").c_str(), 0600), 0);  // who opened it would wait for ever
  EXPECT_THAT(whole(name, 4096), Not(AnyOf(HasSubstr("secret"), HasSubstr("pipe"), HasSubstr("folder"))));
}

}  // namespace
}  // namespace huetrack::page
