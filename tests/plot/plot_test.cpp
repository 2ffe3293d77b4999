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
  // A circle of 1 m, with a gap; with an error of 3 mm in x.
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

TEST_F(Plot, WritesEveryFormatAndPrintsTheFigures) {
  internal::CaptureStdout();
  plot({.tracks = tracks(), .truth = truth("ball"), .out = folder / "a.png"});
  EXPECT_THAT(
      internal::GetCapturedStdout(),
      AllOf(HasSubstr("ball: 100 samples; tracking 85.0 %, coasting 5.0 %, searching 1.0 %, lost 9.0 %"),
            HasSubstr("error rms 3.0 mm (3.0 mm while tracking), max 3.0 mm"), HasSubstr("95 % ellipsoid 100.0 %")));
  EXPECT_THAT(read(folder / "a.png"), StartsWith("\x89PNG"));
  plot({.tracks = tracks(), .truth = {}, .out = folder / "a.html"});
  const std::string html = read(folder / "a.html");
  EXPECT_THAT(html, AllOf(StartsWith("<!doctype html>"), HasSubstr("<svg"), HasSubstr("role=\"img\""),
                          HasSubstr("ball: 100 samples")));
  EXPECT_THAT(html,
              Not(AnyOf(HasSubstr("<script"), HasSubstr("src="), HasSubstr("href=\"http"))));  // needs no other file
}

TEST_F(Plot, MatchesASingleTargetAndTruth) {
  internal::CaptureStdout();
  plot({.tracks = tracks(), .truth = truth("lime"), .out = folder / "a.svg"});
  EXPECT_THAT(internal::GetCapturedStdout(), HasSubstr("error rms 3.0 mm"));
}

TEST_F(Plot, InterpolatesTheTruth) {
  std::ostringstream text;  // at 100 Hz, of the first half, on a clock 1000 s behind
  text << "t,ball,x,y,z\n";
  for (int i = 0; i < 160; ++i)
    text << i / 100.0 << ",ball," << std::cos(i / 100.0) << "," << std::sin(i / 100.0) << ",1\n";
  const fs::path truth = write("truth.csv", text.str());
  std::string live = read(tracks());
  std::string shifted = header;
  std::istringstream lines(live);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("target")) continue;
    const auto from = line.find(',') + 1, to = line.find(',', from);
    shifted +=
        line.substr(0, from) + std::to_string(1e9 + std::stod(line.substr(from, to - from))) + line.substr(to) + "\n";
  }
  const fs::path file = write("live.csv", shifted);
  EXPECT_THAT([&] { plot({.tracks = file, .truth = truth, .out = folder / "a.svg"}); },
              ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("the tracks are at 1000000000.000 to 1000000003.300 s"),
                                                      HasSubstr("the truth at 0.000 to 1.590 s"),
                                                      HasSubstr("--clock-offset"))));
  EXPECT_FALSE(fs::exists(folder / "a.svg"));
  internal::CaptureStdout();
  plot({.tracks = file, .truth = truth, .out = folder / "a.html", .clock_offset_s = 1e9});
  EXPECT_THAT(internal::GetCapturedStdout(), AllOf(HasSubstr("error rms 3.0 mm (3.0 mm while tracking), max 3.0 mm"),
                                                   HasSubstr("compared where there is a truth, 47 of 90")));
  const std::string html = read(folder / "a.html");
  EXPECT_THAT(html, AllOf(HasSubstr("live.csv, from 2001-09-09 01:46:40.000 UTC"),
                          HasSubstr("prefers-color-scheme:dark"), HasSubstr("svg class=\"narrow\"")));
}

TEST_F(Plot, ReportsAClockOffsetWithoutApplyingIt) {
  std::ostringstream text;
  text << "t,ball,x,y,z\n";
  for (int i = 0; i < 400; ++i)
    text << i / 100.0 - 0.03 << ",ball," << std::cos(i / 100.0) << "," << std::sin(i / 100.0) << ",1\n";
  const fs::path early = write("truth.csv", text.str());
  internal::CaptureStdout();
  plot({.tracks = tracks(), .truth = early, .out = folder / "a.svg"});
  EXPECT_THAT(internal::GetCapturedStdout(),
              AllOf(ContainsRegex("error rms [23][0-9].* mm"), HasSubstr("explains most of the error"),
                    ContainsRegex("with --clock-offset 0.0(29|30|31)")));
  internal::CaptureStdout();
  plot({.tracks = tracks(), .truth = early, .out = folder / "a.svg", .clock_offset_s = 0.03});
  EXPECT_THAT(internal::GetCapturedStdout(), AllOf(HasSubstr("error rms 3.0 mm"), Not(HasSubstr("clock offset"))));
  internal::CaptureStdout();
  plot({.tracks = tracks(),
        .truth = early,
        .out = folder / "a.svg",
        .align = truth::Freedom::rigid,
        .align_time = true});
  EXPECT_THAT(internal::GetCapturedStdout(),
              AllOf(StartsWith("aligned: a clock offset of "), HasSubstr("error rms 0.0 mm")));
}

TEST_F(Plot, ReportsATruthOfAnotherTarget) {
  std::ostringstream text;
  text << "t,ball,x,y,z\n";
  for (int i = 0; i < 100; ++i) text << i / 30.0 << ",pink,3,3,3\n";
  internal::CaptureStdout();
  internal::CaptureStderr();
  plot({.tracks = tracks(), .truth = write("truth.csv", text.str()), .out = folder / "a.svg"});
  internal::GetCapturedStdout();
  EXPECT_THAT(internal::GetCapturedStderr(),
              AllOf(HasSubstr("a single ball named pink"), HasSubstr("never within 50 mm")));
}

// Objects of one colour have numbers that mean nothing: each is compared with the ball that it follows.
TEST_F(Plot, AssignsObjectsToBalls) {
  std::ostringstream text, truth;
  text << header << "swarm,0,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,searching,0,0\n";
  truth << "t,ball,x,y,z\n";
  for (int i = 0; i < 60; ++i) {
    const double t = i / 30.0;
    const std::string rest = ",0,0,0,1e-5,0,0,1e-5,0,1e-5,tracking,2,1\n";
    text << "swarm_1," << t << ",0.503," << t << ",1" << rest << "swarm_2," << t << ",-0.496," << t << ",1" << rest;
    truth << t << ",blue,-0.5," << t << ",1\n" << t << ",red,0.5," << t << ",1\n";
  }
  internal::CaptureStdout();
  internal::CaptureStderr();
  plot({.tracks = write("tracks.csv", text.str()), .truth = write("truth.csv", truth.str()), .out = folder / "a.svg"});
  EXPECT_THAT(internal::GetCapturedStdout(), AllOf(ContainsRegex("swarm_1: [^\n]*error rms 3.0 mm"),
                                                   ContainsRegex("swarm_2: [^\n]*error rms 4.0 mm")));
  EXPECT_THAT(internal::GetCapturedStderr(),
              AllOf(HasSubstr("swarm_1 is next to red"), HasSubstr("swarm_2 is next to blue"),
                    Not(HasSubstr("no ball named"))));
}

TEST_F(Plot, NamesATruthInMilliseconds) {
  std::ostringstream text;
  text << "t,ball,x,y,z\n";
  for (int i = 0; i < 100; ++i) text << 5e5 + i / 0.03 << ",ball,1,1,1\n";
  EXPECT_THAT(
      [&] { plot({.tracks = tracks(), .truth = write("truth.csv", text.str()), .out = folder / "a.svg"}); },
      ThrowsMessage<std::runtime_error>(HasSubstr("if the truth's times are milliseconds, name their column t_ms")));
}

TEST_F(Plot, ASingleSampleIsAMomentOfItsState) {
  const std::string header = "target,t,x,y,z,c11,c12,c13,c22,c23,c33,state,confidence\n",
                    rest = ",1,2,3,1e-6,0,0,1e-6,0,1e-6,";
  internal::CaptureStdout();
  plot({.tracks = write("one.csv", header + "ball,1" + rest + "tracking,1\n" + "orb,0" + rest + "lost,1\norb,2" + rest +
                                       "lost,1\n"),
        .truth = {},
        .out = folder / "a.svg"});
  EXPECT_THAT(internal::GetCapturedStdout(), AllOf(HasSubstr("ball: 1 sample;"), HasSubstr("orb: 2 samples;")));
  // The bars of the states: rectangles of that height.
  const std::string svg = read(folder / "a.svg");
  std::vector<double> widths;
  for (auto at = svg.find("fill:rgb(20%,60%"); at != svg.npos; at = svg.find("fill:rgb(20%,60%", at + 1)) {
    std::istringstream path(svg.substr(svg.find(" d=\"M ", at) + 6));
    double left = 0, top = 0, right = 0, same = 0, bottom = 0;
    char line = 0;
    path >> left >> top >> line >> right >> same >> line >> same >> bottom;
    if (bottom - top == 20) widths.push_back(right - left);
  }
  EXPECT_THAT(widths, ElementsAre(1));
}

TEST_F(Plot, DrawsALogOfACamera) {
  const fs::path log = write("cam.csv",
                             "camera,t,x,y,z,qx,qy,qz,qw,c11,c12,c13,c22,c23,c33,state,confidence\n"
                             "cam0,1,0.1,0.2,0.3,0,0,0,1,1e-6,0,0,2e-6,0,3e-6,tracking,1\n"
                             "cam0,1.1,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,lost,0\n");
  const auto rows = read_tracks(log).at("cam0");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].covariance(1, 1), 2e-6);
  internal::CaptureStdout();
  plot({.tracks = log, .truth = {}, .out = folder / "a.svg"});
  EXPECT_THAT(internal::GetCapturedStdout(), HasSubstr("cam0: 2 samples; tracking 50.0 %"));
}

TEST_F(Plot, ReadsTracks) {
  const auto rows = read_tracks(tracks()).at("ball");
  ASSERT_EQ(rows.size(), 100u);
  EXPECT_FALSE(rows[0].has_position());
  EXPECT_EQ(rows[46].state, "coasting");
  EXPECT_EQ(rows[99].covariance(2, 2), 1e-5);
}

TEST_F(Plot, ErrorsNameFileAndLine) {
  const auto message = [&](const std::string& text) {
    try {
      plot({.tracks = write("bad.csv", text), .truth = {}, .out = folder / "a.png"});
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string("nothing was said");
  };
  EXPECT_THAT(message(""), HasSubstr("bad.csv: is empty"));
  EXPECT_THAT(message("a,b\n1,2\n"), HasSubstr("bad.csv:1: the header has no column target"));
  EXPECT_THAT(message(header), HasSubstr("holds no row"));
  EXPECT_THAT(message(header + "ball,0\n"), HasSubstr("bad.csv:2: has 2 fields, but the header has 17"));
  EXPECT_THAT(message(header + "ball,x,1,1,1,0,0,0,1,0,0,1,0,1,tracking,2,1\n"),
              HasSubstr("bad.csv:2: t must be a time in seconds, got \"x\""));
  EXPECT_THAT(message(header + "ball,1,1,1,1,0,0,0,1,0,0,1,0,1,trakcing,2,1\n"),
              HasSubstr("bad.csv:2: state must be searching, tracking, coasting or lost, got \"trakcing\""));
  EXPECT_THAT(message(header + "ball,1,1e300,1,1,0,0,0,1,0,0,1,0,1,tracking,2,1\n"),
              HasSubstr("bad.csv:2: x is absurd: \"1e300\""));
  EXPECT_THAT(message(header + "ball,1,1,nan,1,0,0,0,1,0,0,1,0,1,tracking,2,1\n"),
              HasSubstr("bad.csv:2: a part of the position is missing"));
  EXPECT_THAT([&] { plot({.tracks = tracks(), .truth = {}, .out = "a.gif"}); },
              ThrowsMessage<std::runtime_error>(HasSubstr(".png, .svg or .html")));
  std::string many = header;
  for (int i = 0; i < 1100; ++i)
    many += "ball_" + std::to_string(i) + ",0,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,searching,0,0\n";
  EXPECT_THAT([&] { read_tracks(write("many.csv", many)); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no more than 1000 can be drawn")));
  EXPECT_THAT([&] { plot({.tracks = tracks(), .truth = {}, .out = "/no/such/a.png"}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("cannot write /no/such/a.png")));
  EXPECT_THAT([&] { plot({.tracks = "/no/such.csv", .truth = {}, .out = folder / "a.png"}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("cannot be read")));
}

}  // namespace
}  // namespace huetrack::plot
