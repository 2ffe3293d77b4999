#include "tracks/track_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <clocale>
#include <filesystem>
#include <fstream>
#include <locale>
#include <sstream>

#include "calib/files/config_error.h"

namespace huetrack::tracks {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::HasSubstr;

object_tracking::ObjectEstimate tracked() {
  object_tracking::ObjectEstimate e;
  e.at = capture::Timestamp(1'033'333'333ns);
  e.state = object_tracking::TrackState::tracking;
  e.position = {0.1, -2.5, 1e-7};
  e.velocity = {1.0 / 3, 0, -0.0};
  e.covariance << 1, 0.2, 0.3, 0.2, 4, 0.5, 0.3, 0.5, 6;
  e.views = 3;
  e.confidence = 0.75;
  return e;
}

class TrackCsv : public testing::Test {
 protected:
  TrackCsv()
      : file_(fs::path(testing::TempDir()) /
              ("track_csv_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".csv")) {}
  ~TrackCsv() override { fs::remove(file_); }
  std::string error_of(const std::string& text) const {
    std::ofstream(file_) << text;
    try {
      read_track_csv(file_);
    } catch (const files::ConfigError& e) {
      return e.what();
    }
    return "no error";
  }
  fs::path file_;
};

TEST_F(TrackCsv, ARowHasTheColumnsOfTheHeader) {
  EXPECT_EQ(track_csv_header, "target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence");
  EXPECT_EQ(to_csv_row("ball", tracked()),
            "ball,1.033333333,0.1,-2.5,1e-07,0.3333333333333333,0,-0,1,0.2,0.3,4,0.5,6,tracking,3,0.75");
}

TEST_F(TrackCsv, WithoutAPositionThereAreNans) {
  object_tracking::ObjectEstimate e;
  e.at = capture::Timestamp(5ms);
  EXPECT_EQ(to_csv_row("b", e), "b,0.005000000,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,searching,0,0");
}

TEST_F(TrackCsv, TimesKeepEveryNanosecond) {
  object_tracking::ObjectEstimate e;
  e.at = capture::Timestamp(1'795'230'029'716'078'946ns);
  EXPECT_THAT(to_csv_row("b", e), testing::StartsWith("b,1795230029.716078946,"));
  e.at = capture::Timestamp(-1ns);
  EXPECT_THAT(to_csv_row("b", e), testing::StartsWith("b,-0.000000001,"));
}

TEST_F(TrackCsv, NumbersDoNotDependOnTheLocale) {
  struct CommaDecimals : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  const std::string expected = to_csv_row("ball", tracked());
  const std::locale before = std::locale::global(std::locale(std::locale(), new CommaDecimals));
  {
    TrackCsvWriter writer(file_);
    writer.write("ball", tracked());
    writer.flush();
  }
  EXPECT_EQ(to_csv_row("ball", tracked()), expected);
  const auto tracks = read_track_csv(file_);
  std::locale::global(before);
  EXPECT_EQ(tracks.at("ball").at(0).position, tracked().position);
}

TEST_F(TrackCsv, ARepeatedTargetStartsTheNextFrameSet) {
  {
    TrackCsvWriter writer(file_);
    for (const char* name : {"lime_1", "lime_2", "lime_1", "lime_1", "lime_2", "lime_3"}) writer.write(name, tracked());
    writer.flush();
  }
  const auto tracks = read_track_csv(file_);
  ASSERT_EQ(tracks.at("lime_1").size(), 3u);
  for (std::uint64_t set = 0; set < 3; ++set) EXPECT_EQ(tracks.at("lime_1")[set].set_number, set);
  EXPECT_EQ(tracks.at("lime_2")[1].set_number, 2u);  // set 1 has no row of it
  EXPECT_EQ(tracks.at("lime_3")[0].set_number, 2u);
}

TEST_F(TrackCsv, ReadsBackToTheSameBits) {
  {
    TrackCsvWriter writer(file_);
    writer.write("a", tracked());
    writer.write("b", object_tracking::ObjectEstimate{});
    writer.write("a", tracked());
    writer.flush();
  }
  const auto tracks = read_track_csv(file_);
  ASSERT_EQ(tracks.size(), 2u);
  ASSERT_EQ(tracks.at("a").size(), 2u);
  const object_tracking::ObjectEstimate& e = tracks.at("a")[1];
  EXPECT_EQ(e.at, tracked().at);
  EXPECT_EQ(e.position, tracked().position);
  EXPECT_EQ(e.velocity, tracked().velocity);
  EXPECT_EQ(e.covariance, tracked().covariance);
  EXPECT_EQ(e.state, object_tracking::TrackState::tracking);
  EXPECT_EQ(e.views, 3);
  EXPECT_EQ(e.confidence, 0.75);
  EXPECT_EQ(tracks.at("b").at(0).state, object_tracking::TrackState::searching);
  EXPECT_TRUE(tracks.at("b")[0].position.array().isNaN().all());
}

TEST_F(TrackCsv, AFullDiskIsAnErrorThatNamesTheFile) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  try {
    TrackCsvWriter writer("/dev/full");
    writer.write("ball", tracked());
    writer.flush();
    FAIL() << "a failed write was not reported";
  } catch (const std::system_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("cannot write /dev/full"));
    EXPECT_EQ(e.code().value(), ENOSPC);
  }
}

TEST_F(TrackCsv, AMissingFolderIsAnErrorThatNamesTheFile) {
  try {
    TrackCsvWriter writer("/no/such/folder/t.csv");
    FAIL();
  } catch (const std::system_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("cannot write /no/such/folder/t.csv"));
  }
}

TEST_F(TrackCsv, ErrorsNameTheLine) {
  const std::string header = std::string(track_csv_header) + "\n";
  const std::string row = to_csv_row("b", tracked());
  EXPECT_EQ(error_of(header + row + "\n" + row + "\r\n\n"), "no error");
  EXPECT_EQ(error_of("target,x\n"), file_.string() + ":1: the header has no column t: it has target, x");
  EXPECT_EQ(error_of(header + row + "\nb,1,2\n"), file_.string() + ":3: has 3 columns, at least 17 are needed");
  EXPECT_EQ(error_of(header + "b,1,0x7,0,0,0,0,0,0,0,0,0,0,0,tracking,2,1\n"),
            file_.string() + ":2: x must be a number, got \"0x7\"");
  EXPECT_EQ(error_of(header + "b,soon,0,0,0,0,0,0,0,0,0,0,0,0,tracking,2,1\n"),
            file_.string() + ":2: t must be a time in seconds, got \"soon\"");
  EXPECT_EQ(error_of(header + "b,1,0,0,0,0,0,0,0,0,0,0,0,0,sleeping,2,1\n"),
            file_.string() + ":2: state must be searching, tracking, coasting or lost, got \"sleeping\"");
  EXPECT_EQ(error_of(""), file_.string() + ": is empty: a header line is needed");
  EXPECT_THROW(read_track_csv("/no/such/file.csv"), files::ConfigError);
}

}  // namespace
}  // namespace huetrack::tracks
