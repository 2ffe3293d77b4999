// huetrack-calibrate certify as a user runs it, on tracks that huetrackd wrote.
#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "calib/model/rig_yaml.h"
#include "certify/carried_bar.h"
#include "end_to_end/process.h"
#include "gather/pictured_rig.h"
#include "object_tracking/object_estimate.h"
#include "tracks/track_csv.h"

namespace huetrack::program {
namespace {

namespace fs = std::filesystem;
using certify::BallFix;
using certify::BallTrack;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class Certify : public testing::Test {
 protected:
  struct Ended {
    int status = -1;
    std::string out, err;
  };

  Certify() : folder_(fs::temp_directory_path() / ("huetrack_certify_" + std::to_string(getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    calib::write_rig(gather::pictured_rig(), path("rig.yaml"));
  }
  ~Certify() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  // targets: "lime: 2", ...: names and counts
  void configure(const std::vector<std::pair<std::string, int>>& targets) const {
    std::ofstream out(path("my.yaml"));
    out << "version: 1\nrig: rig.yaml\nobject_tracking:\n  volume: {min: [-2, -2, 0], max: [2, 2, 2]}\ntargets:\n";
    int hue_deg = 60;
    for (const auto& [name, count] : targets) {
      out << "  " << name << ":\n    radius_m: 0.04\n    count: " << count << "\n    color: {hue_deg: [" << hue_deg
          << ", " << hue_deg + 40 << "], saturation: [0.3, 1], intensity: [0.1, 0.9]}\n";
      hue_deg += 100;
    }
  }

  // In the order of time, as huetrackd writes it.
  void write_tracks(const std::map<std::string, BallTrack>& tracks) const {
    std::vector<std::tuple<double, std::string, BallFix>> rows;
    for (const auto& [name, track] : tracks)
      for (const BallFix& fix : track) rows.emplace_back(fix.t_s, name, fix);
    std::ranges::stable_sort(rows, {}, [](const auto& row) { return std::get<0>(row); });
    tracks::TrackCsvWriter writer(path("tracks.csv"));
    for (const auto& [t_s, name, fix] : rows) {
      object_tracking::ObjectEstimate e;
      e.at = capture::Timestamp(std::chrono::nanoseconds(std::llround(1e9 * t_s)));
      e.state = object_tracking::TrackState::tracking;
      e.position = fix.position, e.velocity = fix.velocity, e.covariance = fix.covariance;
      writer.write(name, e);
    }
    writer.flush();
  }

  Ended certify(std::vector<std::string> more) const {
    std::vector<std::string> arguments{HUETRACK_CALIBRATE, "certify",          "--config",   path("my.yaml"),
                                       "--tracks",         path("tracks.csv"), "--limit-mm", "10"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    end_to_end::Process process(arguments, folder_ / "out", folder_ / "err");
    Ended ended;
    ended.status = process.wait();
    ended.out = process.out(), ended.err = process.err();
    return ended;
  }

  fs::path folder_;
  const std::array<BallTrack, 2> bar_ = certify::CarriedBar{}.tracks();
  static BallTrack part_of(const BallTrack& track, double from_s, double to_s) {
    BallTrack out;
    for (const BallFix& fix : track)
      if (fix.t_s >= from_s && fix.t_s < to_s) out.push_back(fix);
    return out;
  }
};

TEST_F(Certify, ABarOfTwoColorsAndOneOfOneColorHaveTheSameCertificate) {
  configure({{"lime", 1}, {"pink", 1}});
  write_tracks({{"lime", bar_[0]}, {"pink", bar_[1]}});
  const Ended two = certify({"--length-mm", "400", "--report", path("two.html")});
  EXPECT_EQ(two.status, 0) << two.out << two.err;
  EXPECT_THAT(two.out, AllOf(HasSubstr("PASS"), HasSubstr("between lime and pink")));

  configure({{"lime", 2}});
  write_tracks({{"lime_1", bar_[0]}, {"lime_2", bar_[1]}});
  const Ended one = certify({"--length-mm", "400", "--report", path("one.html")});
  EXPECT_EQ(one.status, 0) << one.out << one.err;
  EXPECT_THAT(one.out,
              AllOf(HasSubstr("two balls, both lime"), HasSubstr("lime, both"), HasSubstr("2700 gave a length")));
  EXPECT_THAT(end_to_end::contents(path("one.pdf")), testing::StartsWith("%PDF-"));
  const auto uncertainty = [](const std::string& text) {
    return text.substr(text.find("The expanded uncertainty"), 60);
  };
  EXPECT_EQ(uncertainty(one.out), uncertainty(two.out));

  // The second ball was out of sight for a while, and has another number since.
  write_tracks({{"lime_1", bar_[0]}, {"lime_2", part_of(bar_[1], 0, 30)}, {"lime_3", part_of(bar_[1], 31, 90)}});
  const Ended hidden = certify({"--length-mm", "400"});
  EXPECT_EQ(hidden.status, 0) << hidden.out << hidden.err;
  EXPECT_THAT(hidden.out, AllOf(HasSubstr("Of 2700 frame sets 2670 gave a length"), HasSubstr("in 30 only one ball")));
}

TEST_F(Certify, ReportsWhatIsNotTheBar) {
  configure({{"lime", 2}});
  BallTrack furniture = part_of(bar_[1], 30, 40);
  for (BallFix& fix : furniture) fix.position = {1.5, 1.5, 0.4}, fix.velocity.setZero();
  write_tracks({{"lime_1", bar_[0]},
                {"lime_2", part_of(bar_[1], 0, 30)},
                {"lime_3", furniture},
                {"lime_4", part_of(bar_[1], 40, 90)}});
  const Ended with_third = certify({"--length-mm", "400"});
  EXPECT_EQ(with_third.status, 2) << with_third.out << with_third.err;
  EXPECT_THAT(with_third.out, AllOf(HasSubstr("DOUBTFUL"), HasSubstr("the first 30.0 s after the beginning"),
                                    HasSubstr("2400 gave a length"), Not(HasSubstr("FAIL"))));

  const Ended other_length = certify({"--length-mm", "700"});
  EXPECT_NE(other_length.status, 0);
  EXPECT_THAT(other_length.err, AllOf(HasSubstr("but the bar has 700 mm"), HasSubstr("is --length-mm right")));

  write_tracks({{"lime_1", bar_[0]}});
  EXPECT_THAT(certify({"--length-mm", "400"}).err, HasSubstr("two objects of lime are never tracked at the same time"));
}

TEST_F(Certify, RejectsTargetsThatDoNotFitABar) {
  write_tracks({{"lime_1", bar_[0]}, {"lime_2", bar_[1]}});
  const auto refusal = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--length-mm", "400"});
    const Ended ended = certify(more);
    EXPECT_NE(ended.status, 0) << ended.out;
    return ended.err;
  };
  configure({{"lime", 1}});
  EXPECT_THAT(refusal({}), AllOf(HasSubstr("lime has count: 1"), HasSubstr("count: 2")));
  EXPECT_THAT(refusal({"--target", "lime", "--target", "lime"}),
              AllOf(HasSubstr("given twice"), HasSubstr("--target lime, once, with count: 2")));
  configure({{"lime", 3}});
  EXPECT_THAT(refusal({}), AllOf(HasSubstr("lime has count: 3"), HasSubstr("count: 2")));
  configure({{"lime", 2}, {"pink", 1}});
  EXPECT_THAT(refusal({}), AllOf(HasSubstr("lime has count: 2"), HasSubstr("--target lime")));
  EXPECT_THAT(refusal({"--target", "pink"}), HasSubstr("pink has count: 1"));
  EXPECT_THAT(refusal({"--target", "lemon"}), HasSubstr("has no target lemon: it has lime, pink"));
  configure({{"lime", 1}, {"pink", 1}, {"blue", 1}});
  EXPECT_THAT(refusal({}), HasSubstr("choose with --target"));

  std::ofstream(path("places.yaml")) << "places:\n  a: [0, 0, 0]\n  b: [1, 0, 0]\n  c: [0, 1, 0]\n";
  configure({{"lime", 2}});
  EXPECT_THAT(certify({"--places", path("places.yaml")}).err, HasSubstr("one ball is put on marked places"));
}

}  // namespace
}  // namespace huetrack::program
