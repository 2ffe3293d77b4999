// A colour taught in a terminal, as a user does it, on the demo's recording.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "calib/model/rig_yaml.h"
#include "config/service_config.h"
#include "end_to_end/process.h"
#include "tracks/truth_comparison.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
using namespace testing;

const fs::path demo_folder = fs::path(HUETRACK_SOURCE_DIR) / "configs/demo";

class Teach : public Test {
 protected:
  Teach() {
    fs::remove_all(folder);
    fs::create_directories(folder);
    std::ofstream(config)
        << "# taught below\nversion: 1\nrig: " << (demo_folder / "recording/rig.yaml").string()
        << "\ntargets:\n  lime:   # the ball\n    radius_m: 0.04\n    color: {hue_deg: [200, 220]}  # not yet\n"
           "dds: {domain: 73, interfaces: [lo]}\n";
  }
  ~Teach() override { fs::remove_all(folder); }
  // A ball that is not taught yet, with the recording's rig.
  void configure_ball(const fs::path& rendered, const std::string& radius_m) {
    std::ofstream(config) << "version: 1\nrig: " << (rendered / "rig.yaml").string()
                          << "\ntargets: {ball: {radius_m: " << radius_m << ", color: {hue_deg: [0, 40]}}}\n"
                          << "object_tracking: {volume: {min: [-1, -1, 0], max: [1, 1, 2.1]}}\n"
                          << "dds: {enabled: false}\n";
  }
  struct Result {
    int status;
    std::string out, err;
  };
  Result run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), HUETRACKD);
    Process process(arguments, folder / "out", folder / "err");
    const int status = process.wait();
    return {status, process.out(), process.err()};
  }
  // Where the ball is in frame 0, as --at wants it.
  std::string at(const std::string& camera) {
    const calib::CameraRig rig = calib::read_rig(demo_folder / "recording/rig.yaml");
    std::ifstream truth(demo_folder / "recording/groundtruth.csv");
    std::string header, row;
    std::getline(truth, header);
    std::getline(truth, row);
    std::map<std::string, std::string> fields;
    std::istringstream names(header), values(row);
    for (std::string name, value; std::getline(names, name, ',') && std::getline(values, value, ',');)
      fields[name] = value;
    const auto pixel = rig.cameras[std::size_t(*rig.index_of(camera))].project_world(
        {std::stod(fields.at("x")), std::stod(fields.at("y")), std::stod(fields.at("z"))});
    return camera + ",0," + std::to_string(pixel->px.x()) + "," + std::to_string(pixel->px.y());
  }
  const fs::path folder =
      fs::path(TempDir()) / (std::string("teach_") + UnitTest::GetInstance()->current_test_info()->name());
  const std::string config = folder / "huetrackd.yaml";
  const std::string taught = folder / "huetrackd.taught.yaml";
  const std::string recording = demo_folder / "recording";
};

TEST_F(Teach, OnePointSuggestsTheOtherAndTheColourThenTracks) {
  const std::string by_hand = contents(config);
  const Result one = run({"teach", config, recording, "--at", at("cam0"), "--dry-run"});
  ASSERT_EQ(one.status, 0) << one.err;
  EXPECT_THAT(one.out, AllOf(HasSubstr("camera cam0: "), HasSubstr("of the background matches"),
                             HasSubstr("confirm it with  --at cam1,0,")));
  const Result unconfirmed = run({"teach", config, recording, "--at", at("cam0")});
  EXPECT_EQ(unconfirmed.status, 1);
  EXPECT_THAT(unconfirmed.err, HasSubstr("nothing is saved: the object's place is not confirmed in cam1"));
  EXPECT_EQ(config::load_service_config(config).targets[0].color.hue_min_deg, 200);
  EXPECT_FALSE(fs::exists(taught));  // nothing was written

  const Result all =
      run({"teach", config, recording, "--at", at("cam0"), "--accept", "--pictures", folder / "pictures"});
  ASSERT_EQ(all.status, 0) << all.err;
  EXPECT_THAT(
      all.out,
      ContainsRegex(
          "With the learnt colour, tried on the recording, it is `tracking` in 1[0-9]+ "
          "of 150 sets, with a sigma of [0-9.]+ mm by the pictures, and in every tenth over [0-9.]+, [0-9.]+ px from "
          "the point in cam0(: wider and narrower ranges are tried)?\n"));
  EXPECT_THAT(all.out, AllOf(HasSubstr("written into " + taught + ": the colour of lime"),
                             HasSubstr("no huetrackd runs with this file")));
  EXPECT_TRUE(fs::exists(folder / "pictures/cam1.png"));
  // No picture replaces one of the recording's, nor stands among them.
  const fs::path stills = folder / "stills";
  fs::create_directories(stills);
  for (const char* camera : {"cam0", "cam1"})
    fs::copy_file(folder / "pictures" / (std::string(camera) + ".png"), stills / (std::string(camera) + ".png"));
  std::ofstream(stills / "recording.yaml") << "version: 1\ncameras:\n"
                                              "  cam0: {frames: cam0.png, fps: 30}\n"
                                              "  cam1: {frames: cam1.png, fps: 30}\n";
  const std::string still = contents(stills / "cam0.png");
  const Result over = run({"teach", config, stills, "--at", at("cam0"), "--dry-run", "--pictures", stills});
  EXPECT_EQ(over.status, 1);
  EXPECT_THAT(over.err, HasSubstr("stills/cam0.png is read by this run and is not replaced"));
  EXPECT_EQ(contents(stills / "cam0.png"), still);
  EXPECT_EQ(contents(config), by_hand);
  EXPECT_THAT(contents(taught),
              AllOf(StartsWith("# What huetrackd was taught. It replaces the values of huetrackd.yaml"),
                    HasSubstr("\n    camera_colors:\n      cam0:\n        hue_deg: [")));
  const Result check = run({"check", config});
  ASSERT_EQ(check.status, 0) << check.err;
  EXPECT_THAT(check.out, ContainsRegex("\n      hue_deg: \\[[0-9.]+, [0-9.]+\\] +# from huetrackd.taught.yaml; "));
  EXPECT_THAT(check.out, ContainsRegex("\n    radius_m: 0.04 +# from huetrackd.yaml; of the ball"));
  const Result replay = run({"replay", config, recording, "--no-dds", "--truth", recording + "/groundtruth.csv"});
  ASSERT_EQ(replay.status, 0) << replay.err;
  EXPECT_THAT(replay.out, ContainsRegex("tracking from set [23] on"));

  // A target of another name: said, with what to do.
  std::ofstream(config) << std::string(by_hand).replace(by_hand.find("lime:"), 4, "ball");
  const Result renamed = run({"check", config});
  EXPECT_EQ(renamed.status, 1);
  EXPECT_THAT(renamed.err, ContainsRegex("huetrackd.taught.yaml:8: targets.lime: .*/huetrackd.yaml has no such target: "
                                         "rename it here too, or take it out of this file\n$"));
}

TEST_F(Teach, RectanglesAreSavedAlone) {
  const Result saved = run({"teach", config, "--ignore", "cam1,10,20,30,40"});
  ASSERT_EQ(saved.status, 0) << saved.err;
  EXPECT_THAT(saved.out, HasSubstr("these rectangles are now ignored"));
  const config::ServiceConfig now = config::load_service_config(config);
  ASSERT_EQ(now.ignored.size(), 1U);
  EXPECT_EQ(now.ignored[0].first, "cam1");
  EXPECT_EQ(now.ignored[0].second.at(0).u_max, 30);
  EXPECT_EQ(now.targets[0].color.hue_min_deg, 200) << "the colour is as it was";
  const Result undone = run({"teach", config, "--undo"});
  ASSERT_EQ(undone.status, 0) << undone.err;
  EXPECT_THAT(config::load_service_config(config).ignored, IsEmpty());
}

TEST_F(Teach, MistakesAreOneReadableLine) {
  for (const auto& [arguments, message] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{}, "give the object's place: --at CAMERA,FRAME,U,V"},
           {{"--wider", "-1"}, "only rectangles are saved without one: --ignore, without a recording"},
           {{"--at", "cam0,0,1"}, "is not of the form CAMERA,FRAME,U,V"},
           {{"--at", "cam0,0,x,1"}, "is not of the form CAMERA,FRAME,U,V"},
           {{"--at", "cma0,0,1,1"}, "did you mean cam0?"},
           {{"--at", "cam0,0,1,1", "--at", "cam0,1,1,1"}, "there is another --at for this camera"},
           {{"--at", "cam0,0,5000,1"}, "the pictures of cam0 are 320x240"},
           {{"--at", "cam0,-1,5,1"}, "frames count from 0"},
           {{"--at", "cam0,9999,5,1"}, "camera cam0 has no sound frame 9999 (it has 150)"},
           {{"--at", "cam0,0,5,5", "--target", "pink"}, "there is no target pink"},
           {{"--at", "cam0,0,5,5", "--ignore", "cam0,9,9,1,1"}, "ends before it begins"}}) {
    std::vector<std::string> command{"teach", config, recording};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const Result result = run(command);
    EXPECT_EQ(result.status, 1) << message;
    EXPECT_THAT(result.err, HasSubstr(message));
  }
  EXPECT_EQ(config::load_service_config(config).targets[0].color.hue_min_deg, 200);
}

// A cupboard that somebody pointed at by mistake: nothing of its colour moves, and what is tracked by it is nothing.
TEST_F(Teach, AcceptTriesTheColourBeforeItIsWritten) {
  const Result result = run({"teach", config, recording, "--at", "cam0,60,100,100", "--accept"});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, AllOf(StartsWith("huetrackd: nothing is saved: with the learnt colour, "),
                                HasSubstr("nothing is tracked in any of 150 sets"), HasSubstr("(--at)"),
                                HasSubstr("or radius_m, 40 mm, is wrong"), Not(HasSubstr("--radius"))));
  EXPECT_FALSE(fs::exists(taught));
}

TEST_F(Teach, OtherWidthsAreTriedAndOnlyForceSavesWhatIsNotTracked) {
  const std::vector<std::string> teach{"teach", config, recording, "--at", "cam0,60,100,100", "--only"};
  const Result refused = run(teach);
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.out, AllOf(HasSubstr("ranges are tried"), Not(HasSubstr("  --wider ")))) << "none is better";
  EXPECT_THAT(refused.err, AllOf(StartsWith("huetrackd: nothing is saved: "), HasSubstr(", nor with other ranges: "),
                                 HasSubstr("; --force saves it anyway\n")));
  EXPECT_FALSE(fs::exists(taught));
  std::vector<std::string> forced = teach;
  forced.push_back("--force");
  const Result saved = run(forced);
  EXPECT_EQ(saved.status, 0) << saved.err;
  EXPECT_THAT(saved.out, HasSubstr("Warning: with the learnt colour, tried on the recording, nothing is tracked"));
  EXPECT_TRUE(fs::exists(taught));
}

TEST_F(Teach, WhereAnotherObjectOfTheColourIsTrackedItNamesCount) {
  const fs::path three = fs::path(HUETRACK_SHARED_DATA) / "rendered/juggling";
  if (!fs::exists(three)) GTEST_SKIP() << three << " is not there";
  std::ofstream(config) << "version: 1\nrig: " << (three / "rig.yaml").string()
                        << "\ntargets: {ball: {radius_m: 0.036}}\ndds: {enabled: false}\n";
  const Result result = run({"teach", config, three.string(), "--at", "cam0,0,367,287", "--accept"});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err,
              HasSubstr("px away from the point in cam0: if that is another such object, raise the target's count"));
  EXPECT_THAT(result.out, HasSubstr("or, if it is another object to track, raise the target's count"));
  // One camera, so that all views are clicked.
  const std::string one = folder / "film.yaml", film = three / "cam0.mkv";
  ASSERT_EQ(run({"setup", "--film", film, one}).status, 0);
  const Result of_one = run({"teach", one, "cam0=" + film, "--at", "cam0,0,367,287"});
  EXPECT_EQ(of_one.status, 1) << of_one.out;
  EXPECT_THAT(of_one.err, AllOf(HasSubstr("raise the target's count"), Not(HasSubstr("in every camera"))));
}

// The world of the only camera begins at the camera, and half of its picture shows what is below that.
TEST_F(Teach, OneCameraFindsWhatItSeesAndAVolumeWithoutTheObjectIsNamed) {
  const fs::path film = fs::path(HUETRACK_SHARED_DATA) / "red_pendulum/ball.mp4";
  if (!fs::exists(film)) GTEST_SKIP() << film << " is not there";
  std::ofstream(folder / "rig.yaml") << R"(version: 1
cameras:
  cam:
    image_size: [360, 640]
    model: pinhole_radtan
    intrinsics: {fx: 554, fy: 554, cx: 180, cy: 320}
    distortion: [0, 0, 0, 0]
    cam_from_world: {rotation: [[0,-1,0],[0,0,-1],[1,0,0]], translation: [0,0,0]}
)";
  const std::string head = "version: 1\nrig: rig.yaml\ntargets: {ball: {radius_m: 0.035}}\ndds: {enabled: false}\n";
  const std::vector<std::string> teach{"teach", config, "cam=" + film.string(), "--at", "cam,100,231,541", "--accept"};
  std::ofstream(config) << head << "object_tracking: {volume: {min: [-1, -1, 0], max: [1, 1, 2]}}\n";
  const Result refused = run(teach);
  EXPECT_EQ(refused.status, 1) << refused.out;
  EXPECT_THAT(refused.err, AllOf(HasSubstr("the point in cam is outside of object_tracking.volume, min: [-1, -1, 0], "),
                                 Not(HasSubstr("radius"))));
  std::ofstream(config) << head;
  const Result saved = run(teach);
  EXPECT_EQ(saved.status, 0) << saved.err;
  EXPECT_TRUE(fs::exists(taught));
}

// The commands that setup prints; the lens is assumed, 25 %.
TEST_F(Teach, OneCameraOfAnAssumedLensIsTaught) {
  const fs::path film = fs::path(HUETRACK_SHARED_DATA) / "red_pendulum/ball.mp4";
  if (!fs::exists(film)) GTEST_SKIP() << film << " is not there";
  const std::string file = folder / "film.yaml";
  ASSERT_EQ(run({"setup", "--film", film, file}).status, 0);
  const Result wrong = run({"teach", file, "cam0=" + film.string(), "--at", "cam0,116,60,60"});
  EXPECT_EQ(wrong.status, 1) << wrong.out;
  const Result saved = run({"teach", file, "cam0=" + film.string(), "--at", "cam0,116,206,529"});
  EXPECT_EQ(saved.status, 0) << saved.out << saved.err;
  EXPECT_THAT(saved.out, HasSubstr("written into "));
}

// A wrong radius is why nothing is tracked by a colour that is right: the line that ends with says so, and what to do.
TEST_F(Teach, AWrongRadiusIsNamedWhereNothingIsTrackedByIt) {
  std::string wrong = contents(config);
  std::ofstream(config) << wrong.replace(wrong.find("0.04"), 4, "0.08");
  const std::vector<std::string> teach{"teach", config, recording, "--at", at("cam0"), "--accept"};
  const Result refused = run(teach);
  EXPECT_EQ(refused.status, 1) << refused.out;
  EXPECT_THAT(refused.err,
              ContainsRegex("configured radius, 80 mm, but the pictures show (3[6-9]|4[0-3]) mm: use that with "
                            "--radius, or correct radius_m\n$"));
  std::vector<std::string> with_radius = teach;
  with_radius.push_back("--radius");
  EXPECT_EQ(run(with_radius).status, 0);
}

// What is taken in one view suggests the object in a third, which is taken, too.
TEST_F(Teach, AcceptTakesWhatIsOnlySuggestedThen) {
  const fs::path webcams = fs::path(HUETRACK_SHARED_DATA) / "rendered/webcams";
  if (!fs::exists(webcams)) GTEST_SKIP() << webcams << " is not there";
  configure_ball(webcams, "0.04");
  const Result result = run({"teach", config, webcams, "--at", "cam1,90,196.2,262.3", "--accept"});
  EXPECT_EQ(result.status, 0) << result.out << result.err;
  EXPECT_THAT(result.out, Not(HasSubstr("with --accept")));
  EXPECT_TRUE(fs::exists(taught));
}

// An orange ball in a hand, before wood of its hue: ranges that leave the wood out do not hold the ball, and the
// tracker distinguishes the two. The trial shows it.
TEST_F(Teach, AcceptInAHandUsesRangesThatTheRoomShares) {
  const fs::path hand = fs::path(HUETRACK_SHARED_DATA) / "rendered/hand";
  if (!fs::exists(hand)) GTEST_SKIP() << hand << " is not there";
  configure_ball(hand, "0.0469");
  const Result result = run({"teach", config, hand, "--at", "cam1,40,334.2,244.1", "--accept"});
  EXPECT_EQ(result.status, 0) << result.out << result.err;
  EXPECT_TRUE(fs::exists(taught));
}

// A picture on the wall was clicked, and the ball is found at other moments: what is tracked is not what was clicked.
TEST_F(Teach, AcceptSavesNothingThatIsTrackedElsewhere) {
  const fs::path hand = fs::path(HUETRACK_SHARED_DATA) / "rendered/hand";
  if (!fs::exists(hand)) GTEST_SKIP() << hand << " is not there";
  configure_ball(hand, "0.0469");
  const Result result = run({"teach", config, hand, "--at", "cam2,0,505,18", "--accept"});
  EXPECT_EQ(result.status, 1) << result.out << result.err;
  EXPECT_FALSE(fs::exists(taught));
}

}  // namespace
}  // namespace huetrack::end_to_end
