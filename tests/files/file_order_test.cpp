#include "calib/files/file_order.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <random>

namespace huetrack::files {
namespace {

TEST(FileOrder, NumbersInNamesCompareAsNumbers) {
  for (const std::vector<std::string>& ordered :
       {std::vector<std::string>{"img1.jpg", "img2.jpg", "img10.jpg", "img100.jpg"},
        {"a/9/x.png", "a/10/x.png", "b/1/x.png"},
        {"f_001.png", "f_2.png", "f_0010.png"},
        {"t1_f2.png", "t1_f10.png", "t2_f1.png"},
        {"pic.jpg", "pic (1).jpg", "pic (2).jpg", "pic (10).jpg"},  // copies of Windows
        {"t0.1s.png", "t0.133s.png", "t0.2s.png", "t1.0s.png"},     // seconds
        {"cam.1/x.png", "cam.2/x.jpg"},
        {"v1.9.png", "v1.10.png"},                                                        // a version, a counter
        {"1700000000.5.png", "1700000000.51.png", "1700000000.6.png", "1700000001.png"},  // seconds of 1970
        {"18446744073709551617.png", "99999999999999999999999.png"},
        {"a", "a1", "b"}}) {
    auto shuffled = ordered;
    std::mt19937_64 random(1);
    std::ranges::shuffle(shuffled, random);
    std::ranges::sort(shuffled, numbers_ascend);
    EXPECT_EQ(shuffled, ordered);
    for (const auto& name : ordered) EXPECT_FALSE(numbers_ascend(name, name)) << name;
  }
}

TEST(FileOrder, OrdersNamesThatDifferOnlyInLeadingZeros) {
  EXPECT_NE(numbers_ascend("a1", "a01"), numbers_ascend("a01", "a1"));
}

TEST(FileOrder, FindsTheFilesOfAGlob) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "file_order";
  std::filesystem::create_directories(folder);
  for (const char* name : {"a10.txt", "a9.txt", "a11.png"}) std::ofstream(folder / name) << "x";
  EXPECT_THAT(files_of_glob((folder / "*.txt").string()), testing::ElementsAre(folder / "a9.txt", folder / "a10.txt"));
  EXPECT_THAT(files_of_glob((folder / "b*").string()), testing::IsEmpty());
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace huetrack::files
