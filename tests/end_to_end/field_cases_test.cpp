// huetrackd on files as other programs and cameras make them (shared/data/field_cases, made from our own rendering):
// the right track, or the reason and what to do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <functional>

#include "end_to_end/process.h"
#include "publish/test_domain.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const fs::path field_cases = fs::path(HUETRACK_SHARED_DATA) / "field_cases";

class FieldCases : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(field_cases)) GTEST_SKIP() << "no " << field_cases;
    folder_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    for (const char* name : {"my.yaml", "rig.yaml", "groundtruth.csv"})
      fs::copy_file(field_cases / "rot180" / name, folder_ / name);
  }
  void TearDown() override { fs::remove_all(folder_); }

  struct Replayed {
    int status = -1;
    double rms_mm = 1e9;  // 1e9: never on the truth
    std::string text;     // all that it says
  };
  Replayed replay(std::vector<std::string> recording, const fs::path& truth = "groundtruth.csv",
                  const std::string& config = "my.yaml") {
    std::vector<std::string> command{HUETRACKD, "replay",        "--no-dds",      "--strict",
                                     "--truth", folder_ / truth, folder_ / config};
    command.insert(command.end(), recording.begin(), recording.end());
    Process process(command, folder_ / "out", folder_ / "err",
                    {{"ROS_DOMAIN_ID", std::to_string(publish::test_domain())}});
    Replayed replayed;
    replayed.status = process.wait();
    replayed.text = process.out() + process.err();
    // Of the summary; a sentence of the same words may stand before it.
    constexpr std::string_view before = "rms error ";
    std::size_t at = 0;
    while ((at = replayed.text.find(before, at)) != std::string::npos) {
      at += before.size();
      if (std::isdigit(static_cast<unsigned char>(replayed.text[at])) == 0) continue;
      replayed.rms_mm = std::stod(replayed.text.substr(at));
      break;
    }
    return replayed;
  }
  // A recording.yaml with these lines for its cameras.
  std::string recording(const std::string& cam0, const std::string& cam1) {
    std::ofstream(folder_ / "recording.yaml")
        << "version: 1\ncameras:\n  cam0: {" << cam0 << "}\n  cam1: {" << cam1 << "}\n";
    return folder_ / "recording.yaml";
  }
  static std::string file(const std::string& name) { return field_cases / name; }
  fs::path folder_;
};

// The ordinary film tracks at 2.1 mm.
TEST_F(FieldCases, FilmsTrackAsTheOrdinaryOne) {
  struct Case {
    std::string first, second;
    double most_mm;
    std::string said;
  };
  for (const Case& c :
       {Case{"xvid_bframes_avi/avi_xvid_b0.avi", "xvid_bframes_avi/avi_xvid_b1.avi", 3.5, "150 frame sets"},
        Case{"rawmux_bframes/rawmux0.mp4", "rawmux_bframes/rawmux1.mp4", 3, "are coded, not shown"},
        Case{"badsei/badsei0.mp4", "badsei/badsei1.mp4", 3, "150 frame sets"},
        Case{"rot180/rot180_0.mp4", "rot180/base1.mp4", 3, "turned by 180 degrees"}}) {
    const Replayed by_file = replay({"cam0=" + file(c.first), "cam1=" + file(c.second)});
    EXPECT_EQ(by_file.status, 0) << by_file.text;
    EXPECT_LT(by_file.rms_mm, c.most_mm) << by_file.text;
    EXPECT_THAT(by_file.text,
                AllOf(HasSubstr(c.said), HasSubstr("150 frame sets"), HasSubstr("0 missing, 0 corrupted")));
    const Replayed by_fps = replay(
        {recording("frames: " + file(c.first) + ", fps: 30000/1000", "frames: " + file(c.second) + ", fps: 30")});
    EXPECT_LT(by_fps.rms_mm, c.most_mm) << by_fps.text;
    EXPECT_THAT(by_fps.text, testing::Not(HasSubstr("fps out")));
  }
}

TEST_F(FieldCases, FieldPicturesAreFrames) {
  const Replayed paff = replay({recording("frames: " + file("paff/paff0.mts") + ", fps: 30",
                                          "frames: " + file("paff/paff1.mts") + ", fps: 30")});
  EXPECT_LT(paff.rms_mm, 10) << paff.text;  // half of the rows
  EXPECT_THAT(paff.text, AllOf(HasSubstr("20 frame sets"), HasSubstr("0 corrupted"), HasSubstr("is interlaced")));
  EXPECT_LT(replay({"cam0=" + file("paff/paff0.mts"), "cam1=" + file("paff/paff1.mts")}).rms_mm, 10);
}

TEST_F(FieldCases, ImagesAreInTheOrderOfTheirNumbers) {
  const auto by_number = replay({file("glob_order/recording.yaml")});
  EXPECT_EQ(by_number.status, 0) << by_number.text;
  EXPECT_LT(by_number.rms_mm, 3.5) << by_number.text;
}

// The ten pictures of a second lead; a ring buffer that begins in its middle; random numbers.
TEST_F(FieldCases, OrdersOfFilesThatThePicturesContradictAreNamed) {
  struct Case {
    std::function<std::string(int)> name;  // of picture k
    std::string said;
    int status;
  };
  for (const Case& c : {Case{[](int k) { return "f_" + std::to_string(k % 10) + "_" + std::to_string(k / 10); },
                             "f_0_0.jpg, f_1_0.jpg, f_2_0.jpg, ... instead of f_0_0.jpg, f_0_1.jpg, f_0_2.jpg", 3},
                        Case{[](int k) { return std::to_string((k + 50) % 120); }, "if the series begins at 50.jpg", 3},
                        Case{[](int k) { return std::to_string(1000 + k * k % 7919 * 11 + k * 37 % 997 * 101); },
                             "hold no order", 1}}) {
    for (const std::string camera : {"cam0", "cam1"}) {
      fs::remove_all(folder_ / camera);
      fs::create_directories(folder_ / camera);
      for (int k = 0; k < 120; ++k)
        fs::copy_file(field_cases / "glob_order" / camera / ("img" + std::to_string(k + 1) + ".jpg"),
                      folder_ / camera / (c.name(k) + ".jpg"));
    }
    const auto played = replay({recording("frames: \"cam0/*.jpg\", fps: 30", "frames: \"cam1/*.jpg\", fps: 30")});
    EXPECT_EQ(played.status, c.status) << played.text;
    EXPECT_THAT(played.text, HasSubstr(c.said));
  }
}

// A picture before the others, and every later one is a frame late: 38 mm.
TEST_F(FieldCases, StrayPicturesInAFolderAreNamed) {
  std::ofstream(folder_ / "t.csv") << "frame,t_s\n"
                                   << [] {
                                        std::string rows;
                                        for (int k = 0; k < 120; ++k)
                                          rows += std::to_string(k) + ',' + std::to_string(k / 30.) + '\n';
                                        return rows;
                                      }();
  for (const std::string camera : {"cam0", "cam1"}) {
    fs::create_directories(folder_ / camera);
    for (int k = 1; k <= 120; ++k)
      fs::copy_file(field_cases / "glob_order" / camera / ("img" + std::to_string(k) + ".jpg"),
                    folder_ / camera / ("frame_" + std::to_string(k) + ".jpg"));
    fs::copy_file(folder_ / camera / "frame_1.jpg", folder_ / camera / "background.jpg");
  }
  const auto played = [&](const std::string& what) {
    return replay({recording("frames: \"cam0/" + what, "frames: \"cam1/" + what)});
  };
  for (const std::string times : {"fps: 30", "timestamps: t.csv"}) {
    const Replayed stray = played("*.jpg\", " + times);
    EXPECT_EQ(stray.status, 3) << stray.text;
    EXPECT_THAT(stray.text, HasSubstr("background.jpg is not named like the other files"));
  }
  for (const std::string camera : {"cam0", "cam1"})
    fs::copy_file(folder_ / camera / "frame_1.jpg", folder_ / camera / "test_old.jpg");
  const Replayed two = played("*.jpg\", fps: 30");
  EXPECT_EQ(two.status, 3) << two.text;
  EXPECT_THAT(two.text, HasSubstr("background.jpg, test_old.jpg are not named like the other files"));
  const Replayed right = played("frame_*.jpg\", fps: 30");
  EXPECT_EQ(right.status, 0) << right.text;
  EXPECT_LT(right.rms_mm, 3.5) << right.text;
}

// As a program that sorts by letters numbers them anew.
TEST_F(FieldCases, PicturesInTheOrderOfLettersAreNamed) {
  for (const std::string camera : {"cam0", "cam1"}) {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(field_cases / "glob_order" / camera)) files.push_back(entry.path());
    std::ranges::sort(files);
    fs::create_directories(folder_ / camera);
    for (std::size_t k = 0; k < files.size(); ++k)
      fs::copy_file(files[k], folder_ / camera / (std::to_string(k) + ".jpg"));
  }
  const auto by_letters = replay({recording("frames: \"cam0/*.jpg\", fps: 30", "frames: \"cam1/*.jpg\", fps: 30")});
  EXPECT_EQ(by_letters.status, 3) << by_letters.text;
  EXPECT_THAT(by_letters.text, HasSubstr("not in the order in which they were taken"));
}

TEST_F(FieldCases, TablesOfTimesAreReadOrRefusedForTheRightReason) {
  struct Case {
    std::string table, refused;  // "": read
  };
  for (const Case& c :
       {Case{"savetxt_t.csv", ""}, Case{"savetxt.csv", ""}, Case{"semicolon.csv", ""}, Case{"crlf_bom.csv", ""},
        Case{"ms_named.csv", ""}, Case{"ms.csv", "they look like milliseconds: name the column t_ms"},
        Case{"iso.csv", "must be a time in seconds"}, Case{"caliscope_history.csv", "it has sync_index, port"}}) {
    const std::string times = ", timestamps: " + file("tables/" + c.table);
    const Replayed result = replay(
        {recording("frames: " + file("badsei/badsei0.mp4") + times, "frames: " + file("badsei/badsei1.mp4") + times)});
    EXPECT_EQ(result.status, c.refused.empty() ? 0 : 1) << result.text;
    EXPECT_THAT(result.text, HasSubstr(c.refused)) << c.table;
    if (c.refused.empty()) {
      EXPECT_LT(result.rms_mm, 3) << c.table << result.text;
    }
  }
}

// A table with a row for every frame of the films, k-th at k / 30 s.
TEST_F(FieldCases, TimesThatTheFilesContradictAreNamed) {
  const auto table = [&](int first, double unit_s, bool has_commas, int rows = 150) {
    std::ofstream out(folder_ / "t.csv");
    out << "frame,t_s\n";
    for (int k = 0; k < rows; ++k) {
      std::string time = std::to_string(k / 30.0 / unit_s);
      if (has_commas) time[time.find('.')] = ',';
      out << k + first << ',' << time << '\n';
    }
  };
  const auto played = [&](const std::string& times) {
    return replay({recording("frames: " + file("badsei/badsei0.mp4") + ", " + times,
                             "frames: " + file("badsei/badsei1.mp4") + ", " + times)});
  };
  table(1, 1, false);  // spreadsheets count from 1
  const Replayed from_1 = played("timestamps: t.csv");
  EXPECT_LT(from_1.rms_mm, 3) << from_1.text;
  EXPECT_THAT(from_1.text, HasSubstr("t.csv counts its frames from 1"));
  table(1, 1, false, 140);
  const Replayed rows_missing = played("timestamps: t.csv");
  EXPECT_EQ(rows_missing.status, 3) << rows_missing.text;
  EXPECT_THAT(rows_missing.text, AllOf(HasSubstr("  mistake "), HasSubstr("no row for frame 0")));
  EXPECT_EQ(played("timestamps: t.csv, trust_times: true").status, 0);
  table(0, 2, false);
  const Replayed half_the_rate = played("timestamps: t.csv");
  EXPECT_EQ(half_the_rate.status, 3) << half_the_rate.text;
  EXPECT_THAT(half_the_rate.text, HasSubstr("t.csv says 60, but the file itself 30"));
  table(0, 60, false);
  const Replayed minutes = played("timestamps: t.csv");
  EXPECT_EQ(minutes.status, 1) << minutes.text;
  EXPECT_THAT(minutes.text, HasSubstr("they look like minutes: convert them to seconds"));
  table(0, 1, true);
  EXPECT_THAT(played("timestamps: t.csv").text, AllOf(HasSubstr("t.csv:2"), HasSubstr("decimal commas")));
  const Replayed rate = played("fps: 25");
  EXPECT_EQ(rate.status, 3) << rate.text;
  EXPECT_THAT(rate.text, AllOf(HasSubstr("  mistake "), HasSubstr("fps says 25, but the file itself 30"),
                               HasSubstr("add trust_times: true"), Not(HasSubstr("calibrate again"))));
  EXPECT_EQ(played("fps: 30").status, 0);
  EXPECT_THAT(played("fps: 25, trust_times: true").text, Not(HasSubstr("fps says")));
}

// 30 frames a second saved as 60: half as long, and the ball twice as fast.
TEST_F(FieldCases, OneFilmAtAWrongRateIsNamed) {
  const auto played = [&](const std::string& times_0, const std::string& times_1) {
    return replay({recording("frames: " + file("badsei/badsei0.mp4") + times_0,
                             "frames: " + file("badsei/badsei1.mp4") + times_1)});
  };
  const std::string wrong = ", fps: 60, trust_times: true";
  const Replayed first = played(wrong, ", fps: 30"), second = played(", fps: 30", wrong), none = played("", "");
  EXPECT_EQ(first.status, 3) << first.text;
  EXPECT_THAT(first.text,
              HasSubstr("mistake cam0 and cam1 have as many frames, 150, but at 60 and 30 frames a second"));
  EXPECT_THAT(second.text, HasSubstr("mistake cam1 and cam0 have as many frames, 150, but at 60 and 30"));
  EXPECT_THAT(none.text, Not(HasSubstr("as many frames")));
}

TEST_F(FieldCases, GreyPicturesAreTheReasonThatNothingIsTracked) {
  for (int k = 0; k < 30; ++k)
    std::ofstream(folder_ / (std::to_string(k) + ".pgm")) << "P5\n320 240\n255\n" << std::string(320 * 240, char(90));
  const Replayed grey = replay({recording("frames: '%d.pgm', fps: 30", "frames: '%d.pgm', fps: 30")});
  EXPECT_THAT(grey.text, AllOf(HasSubstr("never tracking"), HasSubstr("  mistake the pictures of all cameras are grey"),
                               Not(HasSubstr("widen its colour"))));
  EXPECT_EQ(grey.status, 3);
}

TEST_F(FieldCases, TruthsAreReadOrNamed) {
  const auto with = [&](const std::string& table, const std::string& offset) {
    return replay({recording("frames: " + file("badsei/badsei0.mp4") + ", fps: 30, offset_s: " + offset,
                             "frames: " + file("badsei/badsei1.mp4") + ", fps: 30, offset_s: " + offset)},
                  field_cases / "tables" / table);
  };
  for (const std::string table : {"truth_savetxt.csv", "truth_excel_de.csv"})
    EXPECT_LT(with(table, "0").rms_mm, 3) << table;
  for (const std::string table : {"truth_savetxt_10s.csv", "truth_plain_10s.csv"})
    EXPECT_LT(with(table, "20").rms_mm, 3) << table;
  EXPECT_THAT(with("truth_mm.csv", "0").text, HasSubstr("millimetres"));
  EXPECT_THAT(with("truth_plain_10s.csv", "0").text, HasSubstr("nothing can be compared"));
  EXPECT_LT(with("truth_motive.csv", "0").rms_mm, 3);
}

}  // namespace
}  // namespace huetrack::end_to_end
