#include "clients/plot/plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "clients/plot/track_file.h"

namespace huetrack::plot {
namespace {

using namespace testing;
namespace fs = std::filesystem;

const std::string header = "target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence\n";

class Plot : public Test {
 protected:
  Plot() { fs::create_directories(folder); }
  ~Plot() override { fs::remove_all(folder); }
  fs::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder / name) << text;
    return folder / name;
  }
  std::string read(const fs::path& file) {
    std::ostringstream out;
    out << std::ifstream(file, std::ios::binary).rdbuf();
    return out.str();
  }
  // A circle of 1 m, with a gap; 3 mm beside the truth in x.
  fs::path tracks() {
    std::ostringstream text;
    text << header << "ball,0,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,searching,0,0\n";
    for (int i = 1; i < 100; ++i) {
      const double t = i / 30.0;
      if (i > 50 && i < 60) {
        text << "ball," << t << ",nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,lost,0,0\n";
      } else {
        text << "ball," << t << "," << std::cos(t) + 0.003 << "," << std::sin(t) << ",1,0,0,0,1e-5,0,0,1e-5,0,1e-5,"
             << (i > 45 && i <= 50 ? "coasting" : "tracking") << ",2,1\n";
      }
    }
    return write("tracks.csv", text.str());
  }
  fs::path truth(const std::string& name) {
    std::ostringstream text;
    text << "t,ball,x,y,z\n";
    for (int i = 0; i < 100; ++i)
      text << i / 30.0 << "," << name << "," << std::cos(i / 30.0) << "," << std::sin(i / 30.0) << ",1\n";
    return write("truth.csv", text.str());
  }
  const fs::path folder =
      fs::path(TempDir()) / (std::string("plot_") + UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(Plot, WritesEveryKindAndSaysTheFigures) {
  internal::CaptureStdout();
  plot({.tracks = tracks(), .truth = truth("ball"), .out = folder / "a.png"});
  EXPECT_THAT(internal::GetCapturedStdout(),
              AllOf(HasSubstr("ball: 100 samples; tracking 85.0 %, coasting 5.0 %, searching 1.0 %, lost 9.0 %"),
                    HasSubstr("error rms 3.0 mm, max 3.0 mm"), HasSubstr("95 % ellipsoid 100.0 %")));
  EXPECT_THAT(read(folder / "a.png"), StartsWith("\x89PNG"));
  plot({.tracks = tracks(), .truth = {}, .out = folder / "a.html"});
  const std::string html = read(folder / "a.html");
  EXPECT_THAT(html, AllOf(StartsWith("<!doctype html>"), HasSubstr("<svg"), HasSubstr("role=\"img\""),
                          HasSubstr("ball: 100 samples")));
  EXPECT_THAT(html,
              Not(AnyOf(HasSubstr("<script"), HasSubstr("src="), HasSubstr("href=\"http"))));  // needs no other file
}

TEST_F(Plot, OneTargetAndOneTruthBelongTogether) {
  internal::CaptureStdout();
  plot({.tracks = tracks(), .truth = truth("lime"), .out = folder / "a.svg"});
  EXPECT_THAT(internal::GetCapturedStdout(), HasSubstr("error rms 3.0 mm"));
}

TEST_F(Plot, ReadsWhatIsThere) {
  const auto rows = read_tracks(tracks()).at("ball");
  ASSERT_EQ(rows.size(), 100u);
  EXPECT_FALSE(rows[0].has_position());
  EXPECT_EQ(rows[46].state, "coasting");
  EXPECT_EQ(rows[99].covariance[5], 1e-5);
}

TEST_F(Plot, MistakesNameFileAndLine) {
  const auto message = [&](const std::string& text) {
    try {
      plot({.tracks = write("bad.csv", text), .truth = {}, .out = folder / "a.png"});
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string("nothing was said");
  };
  EXPECT_THAT(message(""), HasSubstr("bad.csv: is empty"));
  EXPECT_THAT(message("a,b\n1,2\n"), HasSubstr("bad.csv:1: there is no column target"));
  EXPECT_THAT(message(header), HasSubstr("holds no row"));
  EXPECT_THAT(message(header + "ball,0\n"), HasSubstr("bad.csv:2: has 2 fields, but the header 17"));
  EXPECT_THAT(message(header + "ball,x,1,1,1,0,0,0,1,0,0,1,0,1,tracking,2,1\n"),
              HasSubstr("bad.csv:2: t is no number"));
  EXPECT_THAT([&] { plot({.tracks = tracks(), .truth = {}, .out = "a.gif"}); },
              ThrowsMessage<std::runtime_error>(HasSubstr(".png, .svg or .html")));
  EXPECT_THAT([&] { plot({.tracks = tracks(), .truth = {}, .out = "/no/such/a.png"}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("cannot write /no/such/a.png")));
  EXPECT_THAT([&] { plot({.tracks = "/no/such.csv", .truth = {}, .out = folder / "a.png"}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("cannot be read")));
}

}  // namespace
}  // namespace huetrack::plot
