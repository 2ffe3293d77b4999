#include "calib/files/file_order.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <fstream>
#include <random>

#include "calib/files/config_error.h"

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

std::vector<std::filesystem::path> sorted(std::vector<std::filesystem::path> files) {
  std::mt19937_64 random(1);
  std::ranges::shuffle(files, random);
  sort_by_numbers(files);
  return files;
}

TEST(FileOrder, AMinusIsASignWhereOtherNamesHaveNone) {
  for (const std::vector<std::filesystem::path>& ordered :
       {std::vector<std::filesystem::path>{"frame-10.png", "frame-9.png", "frame-1.png", "frame0.png", "frame9.png"},
        {"f-010.png", "f-009.png", "f0000.png", "f0010.png"},
        {"t-0.5s.png", "t-0.25s.png", "t0.0s.png", "t0.25s.png"},
        {"t-2.png", "t-1.png", "t+0.png", "t+1.png", "t+10.png"},
        {"run1_f-2.png", "run1_f-1.png", "run2_f-1.png", "run2_f0.png"},
        {"-2.png", "-1.png", "0.png", "1.png"},
        {"t-0.05.png", "t-0.017.png", "t0.017.png", "t0.05.png", "t0.083.png"},
        // separators
        {"frame-0.png", "frame-1.png", "frame-2.png", "frame-10.png"},
        {"img-1.png", "img-2.png", "img-10.png"},
        {"2026-11-28.png", "2026-11-29.png", "2026-12-01.png"},
        {"a1.png", "a1-1.png", "a1-2.png", "a2.png"}})
    EXPECT_EQ(sorted(ordered), ordered);
}

TEST(FileOrder, OtherNumbersMayLead) {
  const std::vector<std::filesystem::path> files{"f_0_0.png", "f_0_1.png", "f_1_0.png", "f_1_1.png"};
  EXPECT_THAT(other_orders(files), testing::ElementsAre(testing::ElementsAre(0, 2, 1, 3)));
  EXPECT_THAT(other_orders({"f_1.png", "f_2.png"}), testing::IsEmpty());
  EXPECT_THAT(other_orders({"7_f_1.png", "7_f_2.png"}), testing::IsEmpty()) << "one does not vary";
  EXPECT_THAT(other_orders({"1_10.png", "2_20.png", "3_30.png"}), testing::IsEmpty()) << "the same order";
  EXPECT_THAT(other_orders({"1_1.png", "1_b2.png"}), testing::IsEmpty()) << "of two kinds";
}

// As programs print times, and other numbers with a point.
TEST(FileOrder, EvenDecimalsAreFractions) {
  for (const std::vector<std::filesystem::path>& ordered :
       {std::vector<std::filesystem::path>{"0.jpg", "0.0333333.jpg", "0.0666667.jpg", "0.1.jpg", "0.133333.jpg",
                                           "0.166667.jpg"},
        {"f0.92.jpg", "f0.96.jpg", "f1.jpg", "f1.04.jpg", "f1.08.jpg"},
        {"1.8.jpg", "1.9.jpg", "1.10.jpg", "1.11.jpg"},                      // counters
        {"12.58.jpg", "12.59.jpg", "13.00.jpg", "13.01.jpg", "13.02.jpg"}})  // hours and minutes
    EXPECT_EQ(sorted(ordered), ordered);
}

// Seconds as names: where the zeros at the end are dropped, only the reading as fractions has even steps.
TEST(FileOrder, ThePointMayBeAnotherCharacter) {
  for (const std::string point : {".", ",", "_", "p", "-"}) {
    std::vector<std::filesystem::path> ordered;
    for (int k = 0; k < 150; ++k) {
      char text[32];
      std::snprintf(text, sizeof(text), "%.4f", k / 30.0);
      std::string name = text;
      while (name.back() == '0' && name[name.size() - 2] != '.') name.pop_back();
      name.replace(name.find('.'), 1, point);
      ordered.push_back("cam0/frame_" + name + ".jpg");
    }
    EXPECT_EQ(sorted(ordered), ordered) << point;
    EXPECT_TRUE(hold_an_order(ordered)) << point;
  }
  const std::vector<std::filesystem::path> takes{"a_1_8.png", "a_1_9.png", "a_1_10.png", "a_1_11.png", "a_2_1.png"};
  EXPECT_EQ(sorted(takes), takes) << "two counters";
}

TEST(FileOrder, OneSeriesTwiceByItsEnding) {
  for (const std::string other : {"png", "JPG", "jpeg"}) {
    std::vector<std::filesystem::path> files;
    for (int k = 0; k < 20; ++k)
      for (const std::string& ending : {std::string("jpg"), other})
        files.push_back("cam0/img" + std::to_string(k) + "." + ending);
    EXPECT_EQ(several_series(files).size(), 2u) << other;
  }
  std::vector<std::filesystem::path> goes_on;
  for (int k = 0; k < 20; ++k) goes_on.push_back("img" + std::to_string(k) + (k < 12 ? ".jpg" : ".JPG"));
  EXPECT_THAT(several_series(goes_on), testing::IsEmpty());
}

TEST(FileOrder, CaseDoesNotCount) {
  const std::vector<std::filesystem::path> ordered{"IMG1.JPG", "img2.jpg", "Img3.jpg", "IMG10.JPG"};
  EXPECT_EQ(sorted(ordered), ordered);
}

TEST(FileOrder, AMinusThatMayBeBothIsRefused) {
  for (const std::vector<std::filesystem::path>& files :
       {std::vector<std::filesystem::path>{"f-1.png", "f-2.png", "f-3.png", "f1.png", "f2.png",
                                           "f3.png"},            // two series
        {"f-1.png", "f-2.png", "f-3.png", "f4.png", "f5.png"}})  // one series, whose writer changed
    try {
      sorted(files);
      ADD_FAILURE() << "is not refused";
    } catch (const ConfigError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("may be a sign or a separator"));
    }
}

// The first two look like a number with and without a sign.
TEST(FileOrder, AMinusInRandomNamesIsNone) {
  const std::vector<std::filesystem::path> files{"00670dba-5898.png", "0067dba8-5898.png", "025b413f-8a9a.png",
                                                 "b2c30ab1-9d0c.png"};
  EXPECT_FALSE(hold_an_order(sorted(files)));
}

std::string hexadecimal(int number, int width = 0) {
  char text[16];
  std::snprintf(text, sizeof(text), "%0*x", width, unsigned(number));
  return text;
}

// Of the pictures 0 to 119, without those that are missing.
std::vector<std::filesystem::path> counted_by_16(int width, int one_of) {
  std::vector<std::filesystem::path> files;
  for (int k = 0; k < 120; ++k)
    if (k % 7 % one_of == 0) files.push_back("cam0/frame_" + hexadecimal(k, width) + ".jpg");
  return files;
}

TEST(FileOrder, HexadecimalNumbersAreNumbers) {
  for (const int width : {1, 2, 4})
    for (const int one_of : {1, 2, 3}) {
      const auto ordered = counted_by_16(width, one_of);
      EXPECT_EQ(sorted(ordered), ordered) << width << one_of;
      EXPECT_TRUE(hold_an_order(ordered)) << width << one_of;
      EXPECT_THAT(several_series(ordered), testing::IsEmpty()) << width << one_of;
      EXPECT_THAT(letters_in_numbers(ordered), testing::IsEmpty()) << width << one_of;
    }
  EXPECT_EQ(last_numbers(counted_by_16(1, 1)).back(), 119);
  std::vector<std::filesystem::path> hashes;
  std::mt19937_64 random(1);
  for (int k = 0; k < 100; ++k) hashes.emplace_back(hexadecimal(int(random() >> 36), 8));
  EXPECT_FALSE(hold_an_order(hashes));
}

TEST(FileOrder, FilesThatAreNotOfTheSeriesAreKnown) {
  for (const std::vector<std::string>& names : {std::vector<std::string>{"background.jpg"},
                                                {"thumb.jpg"},
                                                {"cal2.jpg"},
                                                {"bg100.jpg"},
                                                {"img101 (1).jpg"},
                                                {"img_0101_copy.jpg"},
                                                {"background.jpg", "test_old.jpg"},
                                                {"background.jpg", "test_1.jpg", "test_2.jpg"},
                                                {"img101 (1).jpg", "img102 (1).jpg"},
                                                {"img101_old.jpg", "img102_old.jpg"}}) {
    std::vector<std::filesystem::path> strays(names.begin(), names.end()), series;
    for (int k = 101; k <= 112; ++k) series.push_back("img" + std::to_string(k) + ".jpg");
    EXPECT_THAT(stray_files(series), testing::IsEmpty());
    series.insert(series.end(), strays.begin(), strays.end());
    EXPECT_THAT(stray_files(sorted(series)), testing::UnorderedElementsAreArray(strays));
  }
  // A series that goes on under another name, one with remarks, and one across zero.
  EXPECT_THAT(stray_files({"a_1.jpg", "a_2.jpg", "a_3.jpg", "b_4.jpg", "b_5.jpg"}), testing::IsEmpty());
  for (const std::string other : {"_b", "_bad"})
    EXPECT_THAT(stray_files(sorted({"a_1.jpg", "a_2.jpg", "a_3_bad.jpg", "a_4.jpg", "a_5" + other + ".jpg", "a_6.jpg",
                                    "a_7.jpg", "a_8.jpg"})),
                testing::IsEmpty());
  EXPECT_THAT(stray_files({"f-1.jpg", "f0.jpg", "f1.jpg", "f2.jpg"}), testing::IsEmpty());
  EXPECT_THAT(stray_files({"left.jpg", "right.jpg", "top.jpg"}), testing::IsEmpty());
}

// Of which a pattern leaves out those that end with a letter.
TEST(FileOrder, APartOfHexadecimalNumbersIsNamed) {
  for (const int width : {1, 3}) {
    const auto all = counted_by_16(width, 1);
    std::vector<std::filesystem::path> chosen;
    std::ranges::copy_if(all, std::back_inserter(chosen), [](const std::filesystem::path& file) {
      return std::isdigit(static_cast<unsigned char>(file.stem().string().back())) != 0;
    });
    EXPECT_EQ(hexadecimal_left_out(chosen, all), all[10]) << width;
    EXPECT_EQ(hexadecimal_left_out(all, all), std::nullopt) << width;
    EXPECT_EQ(hexadecimal_left_out(chosen, chosen), std::nullopt) << width;
    // copies and other series beside decimal numbers
    EXPECT_EQ(hexadecimal_left_out({"1.jpg", "2.jpg", "3.jpg"}, {"1.jpg", "1b.jpg", "2.jpg", "3.jpg", "b_1.jpg"}),
              std::nullopt);
  }
  std::vector<std::filesystem::path> larger;  // to 0xff
  for (int k = 0; k < 256; ++k)
    if (k % 16 < 10) larger.push_back("f" + hexadecimal(k, 2) + ".jpg");
  EXPECT_THAT(letters_in_numbers(larger), testing::SizeIs(2));
  EXPECT_THAT(letters_in_numbers({"1.jpg", "1b.jpg", "2.jpg"}), testing::IsEmpty());
  EXPECT_THAT(letters_in_numbers({"a1.jpg", "a2.jpg", "b1.jpg", "b2.jpg"}), testing::IsEmpty());
}

TEST(FileOrder, HexadecimalCountersAreOrderedByLetters) {
  std::vector<std::filesystem::path> ordered;
  for (const char* hex : {"08", "09", "0a", "0b", "0f", "10", "11", "12"})
    ordered.emplace_back("f" + std::string(hex) + "_x.png");
  EXPECT_EQ(sorted(ordered), ordered);
  EXPECT_TRUE(hold_an_order(ordered));
}

TEST(FileOrder, NamesOfLettersAndHashesHoldNone) {
  EXPECT_FALSE(hold_an_order({"red.png", "green.png", "blue.png"}));
  std::mt19937_64 random(1);
  std::vector<std::filesystem::path> hashes, after_number;
  for (int k = 0; k < 100; ++k) {
    std::string hash;
    for (int digit = 0; digit < 32; ++digit) hash += "0123456789abcdef"[random() % 16];
    hashes.emplace_back("cam0/" + hash + ".png");
    after_number.emplace_back("cam0/frame_" + std::to_string(k) + "_jpg.rf." + hash + ".png");
  }
  EXPECT_FALSE(hold_an_order(hashes));
  EXPECT_TRUE(hold_an_order(after_number));
  EXPECT_TRUE(hold_an_order({"a_1.png", "a_2.png", "b_1.png", "b_2.png"}));
  EXPECT_TRUE(hold_an_order({"run_a/1.png", "run_a/2.png", "run_b/1.png", "run_b/2.png"}));
  EXPECT_TRUE(hold_an_order({"left.png", "right.png"})) << "too few to know";
  std::vector<std::filesystem::path> ids, times;
  for (int k = 0; k < 60; ++k) {
    ids.emplace_back("img" + std::to_string(std::uniform_int_distribution(100'000, 999'999)(random)) + ".jpg");
    times.emplace_back(std::to_string(1'700'000'000'000 + 33 * k + std::uniform_int_distribution(-5, 5)(random)));
  }
  EXPECT_FALSE(hold_an_order(ids));
  EXPECT_TRUE(hold_an_order(times));
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
