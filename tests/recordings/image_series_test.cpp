#include "recordings/image_series.h"

#include <gmock/gmock.h>

#include <fstream>

#include "calib/files/config_error.h"
#include "capture/temporary_folder.h"

namespace huetrack::recordings {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

class ImageSeries : public testing::Test {
 protected:
  // Number in the stream and name of every file.
  std::vector<std::pair<std::int64_t, std::string>> series(const std::vector<std::string>& names,
                                                           const std::string& frames) {
    std::filesystem::remove_all(folder_ / "cam");
    std::filesystem::create_directories(folder_ / "cam");
    for (const auto& name : names) std::ofstream(folder_ / "cam" / name) << "x";
    RecordedCamera camera;
    camera.name = "cam";
    camera.frames = folder_ / "cam" / frames;
    std::vector<std::pair<std::int64_t, std::string>> found;
    named_.clear();
    for (const auto& file : image_files_of(camera)) named_.push_back(file.named);
    for (const auto& file : image_files_of(camera)) found.emplace_back(file.number, file.path.filename().string());
    return found;
  }
  std::string refusal(const std::vector<std::string>& names, const std::string& frames) {
    try {
      series(names, frames);
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return {};
  }
  capture::TemporaryFolder folder_;
  std::vector<std::int64_t> named_;
};

// Of a camera that counts from its trigger.
TEST_F(ImageSeries, NegativeNumbersComeFirst) {
  const std::vector<std::string> names{"f0.png", "f1.png", "f-1.png", "f-2.png", "f-10.png"};
  EXPECT_THAT(series(names, "f%d.png"), ElementsAre(Pair(0, "f-10.png"), Pair(8, "f-2.png"), Pair(9, "f-1.png"),
                                                    Pair(10, "f0.png"), Pair(11, "f1.png")));
  EXPECT_THAT(series(names, "*.png"), ElementsAre(Pair(0, "f-10.png"), Pair(1, "f-2.png"), Pair(2, "f-1.png"),
                                                  Pair(3, "f0.png"), Pair(4, "f1.png")));
  EXPECT_THAT(series({"f-02.png", "f000.png", "f010.png", "f-1.png"}, "f%03d.png"),
              ElementsAre(Pair(0, "f-02.png"), Pair(2, "f000.png"), Pair(12, "f010.png")));
}

// Each digit pair of which the first ones go on to f.
TEST_F(ImageSeries, HexadecimalNumbersArePlayedWholeOrRefused) {
  std::vector<std::string> names;
  for (const char* high : {"", "1", "2", "3", "4", "5"})
    for (const char low : std::string("0123456789abcdef")) names.push_back("f_" + std::string(high) + low + ".jpg");
  const auto all = series(names, "f_*.jpg");
  ASSERT_EQ(all.size(), names.size());
  for (std::size_t k = 0; k < names.size(); ++k) EXPECT_EQ(all[k], std::pair(std::int64_t(k), names[k]));
  for (const std::string part : {"f_*[0-9].jpg", "f_%d.jpg"})
    EXPECT_THAT(refusal(names, part), testing::AllOf(HasSubstr("leaves out f_a.jpg"), HasSubstr("give \"f_*.jpg\"")));
  EXPECT_THAT(refusal(names, "f_%x.jpg"), HasSubstr("for other numbers (%x) give a glob"));
  EXPECT_THAT(refusal({"f_08.jpg", "f_09.jpg", "f_0a0.jpg", "f_0a1.jpg", "f_10.jpg"}, "f_*.jpg"),
              HasSubstr("f_0a1.jpg has a letter where f_10.jpg has a digit"));
}

TEST_F(ImageSeries, NumbersInNamesAreReadAcrossZero) {
  std::vector<std::string> names;
  for (int k = -10; k < 20; ++k)
    if (k != 5) names.push_back("f" + std::to_string(k) + ".png");
  series(names, "*.png");
  ASSERT_EQ(named_.size(), 29u);
  EXPECT_EQ(named_[14], 4);
  EXPECT_EQ(named_[15], 6);
  series({"1700000000.1.png", "1700000000.2.png", "1700000000.35.png"}, "*.png");
  EXPECT_THAT(named_, ElementsAre(0, 1, 2)) << "times";
}

TEST_F(ImageSeries, SeparatorsAreNoSigns) {
  EXPECT_THAT(series({"f-1.png", "f-2.png", "f-10.png"}, "*.png"),
              ElementsAre(Pair(0, "f-1.png"), Pair(1, "f-2.png"), Pair(2, "f-10.png")));
  EXPECT_THAT(refusal({"f-1.png", "f-2.png", "f-10.png"}, "f%d.png"), HasSubstr("if the - is a separator"));
  EXPECT_THAT(refusal({"f-1.png", "f-2.png", "f1.png", "f2.png"}, "*.png"), HasSubstr("a sign or a separator"));
}

// The pictures of two cameras in one folder.
TEST_F(ImageSeries, SeveralSeriesInOneGlobAreRefused) {
  const std::vector<std::string> sides{"left_1.png", "right_1.png", "left_2.png", "right_2.png", "left_10.png"};
  EXPECT_THAT(refusal(sides, "*.png"), HasSubstr("name one, as \"left_*[0-9].png\""));
  EXPECT_THAT(series(sides, "left_*[0-9].png"),
              ElementsAre(Pair(0, "left_1.png"), Pair(1, "left_2.png"), Pair(2, "left_10.png")));
  EXPECT_THAT(refusal({"01_cam0a.png", "02_cam0a.png", "01_cam0b.png", "02_cam0b.png"}, "*.png"),
              HasSubstr("several series"));
  EXPECT_THAT(refusal({"1.png", "2.png", "3.png", "1_copy.png", "2_copy.png"}, "*.png"),
              HasSubstr("as \"*[0-9].png\""));
  // One that goes on under another name, and single files.
  EXPECT_THAT(series({"a_1.png", "a_2.png", "b_3.png", "b_4.png"}, "*.png"), testing::SizeIs(4));
  EXPECT_THAT(series({"IMG1.png", "img1.png", "img2.png", "IMG3.png"}, "*.png"), testing::SizeIs(4));
}

TEST_F(ImageSeries, NamesWithoutAnOrderAreRefusedUnlessTheirTimesAreListed) {
  const std::vector<std::string> names{"3f2504e0-4f89.png", "b2c30ab1-9d0c.png", "0305e82c-3301.png"};
  EXPECT_THAT(refusal(names, "*.png"), HasSubstr("hold no order"));
  RecordedCamera camera;
  camera.name = "cam";
  camera.frames = folder_ / "cam/*.png";
  camera.timestamps = {{0, capture::Timestamp{}}};
  EXPECT_EQ(image_files_of(camera).size(), 3u);
}

}  // namespace
}  // namespace huetrack::recordings
