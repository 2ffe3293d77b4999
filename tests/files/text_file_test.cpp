#include "calib/files/text_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "calib/files/config_error.h"
#include "calib/files/csv_table.h"
#include "calib/files/files_beside.h"

namespace huetrack::files {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;
namespace fs = std::filesystem;

std::string repeated(const std::string& text, int times) {
  std::string out;
  for (int i = 0; i < times; ++i) out += text;
  return out;
}

auto refuses(const std::string& what) {
  return ThrowsMessage<ConfigError>(HasSubstr(what));
}

TEST(TextFile, RejectsDevicesPipesAndFolders) {
  const fs::path pipe = fs::path(testing::TempDir()) / ("pipe_" + std::to_string(::getpid()));
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  static constexpr std::string_view columns[] = {"a"};
  for (const auto& [file, why] : {std::pair<fs::path, std::string>{"/dev/zero", "device"},
                                  {pipe, "pipe"},
                                  {"/tmp", "directory"},
                                  {"/nowhere/x", "No such file"},
                                  {fs::path(std::string(5000, 'a')), "too long"}}) {
    EXPECT_THAT([&] { read_text_file(file); }, refuses(why));
    EXPECT_THAT([&] { CsvTable(file, columns); }, refuses(why));
  }
  fs::remove(pipe);
}

TEST(TextFile, NamesFilesThatMayBeMeant) {
  const fs::path folder = fs::path(testing::TempDir()) / "files";
  fs::create_directories(folder / "sub");
  EXPECT_EQ(files_beside(folder / "recording.yaml"), "");  // only a folder
  EXPECT_EQ(files_beside(folder / "subs"), "; in that folder is sub/");
  std::ofstream(folder / "cam0.mp4") << "x";
  EXPECT_EQ(files_beside(folder / "recording.yaml"), "; in that folder is cam0.mp4");
  for (const char* name : {"img10.png", "img2.png", "img1.png", "img3.png", "img4.png", ".hidden.png"})
    std::ofstream(folder / name) << "x";
  EXPECT_EQ(files_beside(folder / "img%06d.png"), "; in that folder are img1.png, img2.png, img3.png, img4.png, ...");
  EXPECT_EQ(files_beside(folder / "none" / "a.png"), "; there is no folder " + (folder / "none").string());
  EXPECT_THAT([&] { read_text_file(folder / "a.mp4"); },
              refuses("No such file or directory; in that folder is cam0.mp4"));
  fs::remove_all(folder);
}

TEST(TextFile, StopsReadingAtTheSizeLimit) {
  const fs::path file = fs::path(testing::TempDir()) / ("sparse_" + std::to_string(::getpid()));
  std::ofstream(file) << "a\n";
  fs::resize_file(file, std::uintmax_t{1} << 36U);  // a hole of 64 GB
  EXPECT_THAT([&] { read_text_file(file); }, refuses("larger than 4 MiB"));
  static constexpr std::string_view columns[] = {"a"};
  CsvTable table(file, columns);
  EXPECT_THAT([&] { table.next(); }, refuses("longer than 64 KiB"));
  std::ofstream(file, std::ios::trunc) << std::string(largest_text_file, 'x');
  EXPECT_EQ(read_text_file(file).size(), largest_text_file);
  fs::remove(file);
}

TEST(TextFile, ReadsProcFilesOfSizeZero) {
  EXPECT_THAT(read_text_file("/proc/self/status"), HasSubstr("VmRSS"));
}

TEST(TextFile, RejectsDeepNestingAtItsLine) {
  const auto check = [](const std::string& text, Keys keys = Keys::plain) { refuse_deep_nesting(text, "f", keys); };
  const int deep = deepest_nesting + 1;
  for (const std::string& text :
       {"a: 1\nb: " + repeated("[", deep), "{\n" + repeated("{\"a\":", deep), "a: 1\n" + repeated("- ", deep) + "1",
        "<?xml?>\n" + repeated("<a>", deep), "a:\n" + std::string(5000, ' ') + "b: 1"})
    EXPECT_THAT([&] { check(text); }, refuses("f:2: is nested deeper than 64 levels")) << text.substr(0, 40);
  for (const std::string& text :
       {"a = 1\n" + repeated("a.", deep) + "a = 1", "a = 1\n[" + repeated("a . ", deep) + "a]",
        "a = 1\nb = {" + repeated("\"#\".", deep) + "a = 1}"})
    EXPECT_THAT([&] { check(text, Keys::dotted); }, refuses("f:2")) << text.substr(0, 40);
  for (const std::string& text : {repeated("[", deep - 1) + repeated("]", deep - 1), repeated("[1.5, 2.5],\n", 1000),
                                  repeated("a: {b: [1]}\n", 999), "<a>" + repeated("<b>1.0 2.0</b><c/>", 1000) + "</a>",
                                  "# " + repeated("- ", 1000), std::string(1'000'000, ' '), std::string(40'000, '\n')})
    EXPECT_NO_THROW(check(text)) << text.substr(0, 40);
  EXPECT_NO_THROW(
      check("# .............................................................................\nx = 1.5\n"
            "matrix = [" +
                repeated("[1.0, 2.0, 3.0], ", 100) + "]\n",
            Keys::dotted));
}

TEST(Printable, IsOneShortLineWithoutControlCharacters) {
  EXPECT_EQ(printable("plain, \u00e9\u4e2d"), "plain, \u00e9\u4e2d");
  EXPECT_EQ(printable("\x1b]0;owned\x07\nnext\x7f"), " ]0;owned  next ");
  EXPECT_EQ(printable("\u009b31m \u202egpj.exe\u2066"), " 31m  gpj.exe ");
  EXPECT_EQ(printable("\xff\xc3"), "??");
  EXPECT_EQ(printable("\xc0\x9b \xed\xa0\x80"), "?? ???");  // overlong, and half of a pair
  EXPECT_EQ(printable(std::string(41, 'x')), std::string(40, 'x') + "...");
  EXPECT_EQ(printable(std::string(40, 'x')), std::string(40, 'x'));
  EXPECT_EQ(printable(repeated("\u4e2d", 50), 2), "\u4e2d\u4e2d...");
  EXPECT_TRUE(has_control_characters("a\x1b"));
  EXPECT_TRUE(has_control_characters("\u009b"));
  EXPECT_FALSE(has_control_characters("a\tb \u00e9 \xff"));
}

TEST(Printable, MessagesHaveBoundedLength) {
  const std::string message = ConfigError(std::string(5000, 'p'), 1, "is \x1b[31m" + std::string(50'000, 'x')).what();
  EXPECT_LT(message.size(), 1300u);
  EXPECT_EQ(message.find('\x1b'), std::string::npos);
}

TEST(TextFile, RejectsATableWithControlCharacters) {
  const fs::path file = fs::path(testing::TempDir()) / ("escapes_" + std::to_string(::getpid()) + ".csv");
  std::ofstream(file) << "a\nok\n\x1b]0;owned\x07\n";
  static constexpr std::string_view columns[] = {"a"};
  CsvTable table(file, columns);
  EXPECT_TRUE(table.next());
  EXPECT_THAT([&] { table.next(); }, refuses(":3: has control characters"));
  fs::remove(file);
}

}  // namespace
}  // namespace huetrack::files
