// Replays of JPEGs that are decoded where they are looked at, against replays that decode every picture whole. What is
// not decoded has random bytes here, so a reader that forgot require() changes the results.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>

#include "calib/model/rig_yaml.h"
#include "capture/frames/crop.h"
#include "capture/jpeg/jpeg_reader.h"
#include "daemon/replay.h"

namespace huetrack::daemon {
namespace {

namespace fs = std::filesystem;

struct Recorded {
  std::string name;        // for the test's name
  fs::path recording;      // folder
  std::string config;      // file in it, or the text of a configuration without `rig`
  bool is_camera = false;  // poses instead of tracks
  // A recording of cam0.mkv and cam1.mkv, of which only this part is used.
  std::optional<capture::Crop> crop = {};
};

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

class OnDemandReplay : public testing::TestWithParam<Recorded> {
 protected:
  OnDemandReplay() : folder_(fs::path(testing::TempDir()) / ("on_demand_" + GetParam().name)) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~OnDemandReplay() override {
    capture::JpegReader::set_reading(capture::JpegReading::on_demand);
    fs::remove_all(folder_);
  }

  // Tracks or poses, and the sentences about light and cameras.
  std::string replayed(capture::JpegReading reading) {
    const Recorded& recorded = GetParam();
    ReplayCommand command;
    command.config = recorded.recording / recorded.config;
    if (!recorded.config.ends_with(".yaml")) {
      command.config = folder_ / "c.yaml";
      std::ofstream(command.config) << "version: 1\nrig: " << (recorded.recording / "rig.yaml").string() << "\n"
                                    << recorded.config;
    }
    command.recording = {recorded.recording.string()};
    if (recorded.crop) {
      write_cropped(*recorded.crop);
      command.recording = {(folder_ / "recording.yaml").string()};
      std::ofstream(command.config) << "version: 1\nrig: " << (folder_ / "rig.yaml").string() << "\n"
                                    << recorded.config;
    }
    command.no_dds = true;
    command.progress = false;
    const fs::path out = folder_ / "out";
    (recorded.is_camera ? command.poses : command.tracks) = out;
    capture::JpegReader::set_reading(reading);
    const ReplaySummary summary = replay(command, {});
    std::string all = content(out);
    EXPECT_FALSE(all.empty());
    for (const auto* sentences : {&summary.mistakes, &summary.clutter, &summary.calibration})
      for (const std::string& sentence : *sentences) all += sentence + "\n";
    return all;
  }

  void write_cropped(const capture::Crop& crop) const {
    calib::CameraRig rig = calib::read_rig(GetParam().recording / "rig.yaml");
    std::ofstream recording(folder_ / "recording.yaml");
    recording << "version: 1\ncameras:\n";
    for (calib::Camera& camera : rig.cameras) {
      auto pinhole = std::get<calib::PinholeRadtan>(camera.model.lens());
      pinhole.cx -= crop.u;
      pinhole.cy -= crop.v;
      camera.model = calib::CameraModel(pinhole);
      camera.image_size = {.width = crop.width, .height = crop.height};
      recording << "  " << camera.name << ": {frames: " << (GetParam().recording / (camera.name + ".mkv")).string()
                << ", fps: 30, crop: " << capture::text_of(crop) << "}\n";
    }
    calib::write_rig(rig, folder_ / "rig.yaml");
  }

  const fs::path folder_;
};

TEST_P(OnDemandReplay, GivesWhatWholePicturesGive) {
  if (!fs::exists(GetParam().recording / "rig.yaml")) GTEST_SKIP() << GetParam().recording << " is not there";
  EXPECT_EQ(replayed(capture::JpegReading::poisoned), replayed(capture::JpegReading::whole));
}

const fs::path rendered = fs::path(HUETRACK_SHARED_DATA) / "rendered";
const std::string two_balls =
    "targets: {pink: {radius_m: 0.04, color: {hue_deg: [310, 355]}}, lime: {radius_m: 0.04, color: {hue_deg: [65, "
    "115]}}}\n"
    "object_tracking: {";
const std::string room = "volume: {min: [-1, -1, 0.1], max: [1, 1, 2.1]}}\n";

INSTANTIATE_TEST_SUITE_P(
    Recordings, OnDemandReplay,
    testing::Values(
        Recorded{"demo", fs::path(HUETRACK_SOURCE_DIR) / "configs/demo/recording",
                 "targets: {ball: {radius_m: 0.04, color: {hue_deg: [65, 115]}}}\nobject_tracking: {" + room},
        Recorded{"demo_cropped", fs::path(HUETRACK_SOURCE_DIR) / "configs/demo/recording",
                 "targets: {ball: {radius_m: 0.04, color: {hue_deg: [65, 115]}}}\nobject_tracking: {" + room, false,
                 capture::Crop{6, 10, 300, 222}},
        Recorded{"webcams", rendered / "webcams", "huetrackd.yaml"},
        Recorded{"occlusion_paper", rendered / "occlusion", two_balls + "observation: paper, " + room},
        Recorded{"occlusion", rendered / "occlusion", two_balls + room},
        Recorded{"juggling", rendered / "juggling", "huetrackd.yaml"},
        Recorded{"images", fs::path(HUETRACK_SHARED_DATA) / "field_cases/glob_order", "my.yaml"},
        Recorded{"bumped", rendered / "bumped", "huetrackd.yaml"},
        Recorded{"leds", rendered / "leds",
                 "camera_tracking: {camera: cam0, method: huetrack, start: {leds: " +
                     (rendered / "leds/led_positions.csv").string() +
                     ", led_schedule: " + (rendered / "leds/led_frames.csv").string() + "}}\n",
                 true}),
    [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace huetrack::daemon
