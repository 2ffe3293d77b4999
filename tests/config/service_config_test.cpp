#include "config/service_config.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "calib/files/config_error.h"
#include "calib/model/placement.h"
#include "calib/model/rig_yaml.h"
#include "config/view_volume.h"

namespace huetrack::config {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const fs::path configs = fs::path(HUETRACK_SOURCE_DIR) / "configs";

class ServiceConfigFile : public testing::Test {
 protected:
  ServiceConfigFile()
      : folder_(fs::path(testing::TempDir()) /
                ("service_config_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()))) {
    fs::create_directories(folder_);
    fs::copy_file(configs / "demo/recording/rig.yaml", folder_ / "rig.yaml", fs::copy_options::overwrite_existing);
  }
  ~ServiceConfigFile() override { fs::remove_all(folder_); }

  fs::path write(const std::string& yaml, const std::string& name = "c.yaml") const {
    std::ofstream(folder_ / name) << yaml;
    return folder_ / name;
  }
  ServiceConfig load(const std::string& yaml) const { return load_service_config(write(yaml)); }
  // The message without the folder's name.
  std::string error(const std::string& yaml) const {
    try {
      load(yaml);
    } catch (const files::ConfigError& e) {
      std::string message = e.what();
      for (std::size_t at; (at = message.find(folder_.string() + "/")) != std::string::npos;) {
        message.erase(at, folder_.string().size() + 1);
      }
      return message;
    }
    return "no error";
  }

  fs::path folder_;
};

const std::string head = "version: 1\nrig: rig.yaml\n";
const std::string ball = head + "targets: {ball: {color: {hue_deg: [65, 115]}}}\n";

TEST_F(ServiceConfigFile, ATargetMayBeSeveralObjects) {
  const auto with = [](const std::string& count) {
    return head + "targets: {ball: {count: " + count + ", color: {hue_deg: [65, 115]}}}\n";
  };
  EXPECT_EQ(load(ball).targets[0].count, 1);
  EXPECT_EQ(load(with("3")).targets[0].count, 3);
  EXPECT_FALSE(load(with("3")).targets[0].is_up_to);
  const ServiceConfig config = load(with("up to 8"));
  EXPECT_EQ(config.targets[0].count, 8);
  EXPECT_TRUE(config.targets[0].is_up_to);
  EXPECT_EQ(load(to_yaml(config)).targets[0].count, 8);
  EXPECT_TRUE(load(to_yaml(config)).targets[0].is_up_to);
  EXPECT_THAT(config.dds.publisher.counts, ElementsAre(8));
  EXPECT_THAT(targets_that_differ(load(ball), config), ElementsAre(0u));
  // An object of theirs would have another target's name.
  const std::string two =
      head + "targets: {ball: {count: 3, color: {hue_deg: [65, 115]}}, ball_1: {color: {hue_deg: [5, 15]}}}\n";
  EXPECT_THAT(error(two), HasSubstr("targets.ball_1: is the name of an object of ball"));
  for (const std::string wrong : {"0", "-1", "17", "up to 1000", "up to", "many", "2.5", "3 balls"}) {
    const std::string message = error(with(wrong));
    EXPECT_THAT(message, HasSubstr("c.yaml:3: targets.ball.count: must be a number from 1 to 16, or \"up to\""));
    EXPECT_THAT(message, HasSubstr("\"" + wrong + "\""));
    const bool is_too_many = wrong == "17" || wrong == "up to 1000";
    EXPECT_EQ(message.find("more than 16 have not been measured") != std::string::npos, is_too_many) << message;
  }
  EXPECT_THAT(error(with("2") + "object_tracking: {observation: paper}\n"),
              HasSubstr("c.yaml:3: targets.ball.count: is not for object_tracking.observation: paper"));
}

TEST_F(ServiceConfigFile, AColourMayAdapt) {
  EXPECT_FALSE(load(ball).targets[0].adapts_color);
  const std::string adapting = head + "targets: {ball: {color: {hue_deg: [65, 115], adapt: true}}}\n";
  const ServiceConfig config = load(adapting);
  EXPECT_TRUE(config.targets[0].adapts_color);
  EXPECT_TRUE(load(to_yaml(config)).targets[0].adapts_color);
  EXPECT_THAT(targets_that_differ(load(ball), config), ElementsAre(0u));
  EXPECT_EQ(error(head + "targets: {ball: {color: {hue_deg: [65, 115], adapt: slowly}}}\n").find("c.yaml:3: "), 0u);
  EXPECT_THAT(error(adapting + "object_tracking: {observation: paper}\n"),
              HasSubstr("c.yaml:3: targets.ball.color.adapt: is not for object_tracking.observation: paper"));
  // What is taught says nothing of it, and changes nothing of it.
  write(adapting);
  const ServiceConfig taught = load_service_config(
      folder_ / "c.yaml", "version: 1\ntargets: {ball: {color: {hue_deg: [70, 120], saturation: [0.4, 1]}}}\n");
  EXPECT_EQ(taught.targets[0].color.hue_max_deg, 120);
  EXPECT_TRUE(taught.targets[0].adapts_color);
}

TEST_F(ServiceConfigFile, WhatIsNotGivenHasItsDefault) {
  const ServiceConfig config = load(ball);
  ASSERT_EQ(config.targets.size(), 1u);
  EXPECT_EQ(config.targets[0].name, "ball");
  EXPECT_EQ(config.targets[0].radius_m, object_tracking::TargetOptions{}.radius_m);
  EXPECT_EQ(config.targets[0].color, (color::HsiRange{.hue_min_deg = 65, .hue_max_deg = 115}));
  EXPECT_EQ(config.object_tracking.particle_count, object_tracking::ObjectTrackerOptions{}.particle_count);
  EXPECT_EQ(config.set_tolerance_s, std::nullopt);
  EXPECT_EQ(config.threads, 1);
  EXPECT_TRUE(config.dds.enabled);
  EXPECT_EQ(config.dds.publisher.domain, std::nullopt);
  EXPECT_THAT(config.dds.publisher.targets, ElementsAre("ball"));
  EXPECT_THAT(config.dds.publisher.cameras, ElementsAre("cam0", "cam1"));
  EXPECT_EQ(config.rig.cameras.size(), 2u);
}

const std::string everything = head + R"(
targets:
  red_cap:
    radius_m: 0.12
    color: {hue_deg: [340, 20], saturation: [0.8, 0.95], intensity: [0.2, 0.7]}
    camera_colors:
      cam1: {saturation: [0.5, 0.7]}
  lime: {color: {hue_deg: [65, 115]}}
cameras:
  cam1:
    device: /dev/v4l/by-id/usb-cam
    format: mjpeg
    size: [320, 240]
    fps: 29.97
    controls: {exposure_time_absolute: 100, white_balance_automatic: false, power_line_frequency: 50 Hz}
    latency_offset_s: 0.0125
    restore_controls: true
  cam0: {device: 3}
quorum: 1
object_tracking:
  observation: paper
  volume: {min: [-0.5, -0.25, 0.125], max: [0.5, 0.75, 1.5]}
  particle_count: 321
  max_particle_count: 4321
  seed: 77
  position_noise_m: 0.031
  acceleration_m_s2: 12.5
  start_speed_m_s: 4.5
  pixel_noise_px: 0.75
  max_tracking_sigma_m: 0.0625
  max_tracking_share_along: 0.25
  coast_s: 0.7
  max_coast_sigma_m: 0.21
frame_sets: {tolerance_s: 0.0123}
threads: 3
dds: {enabled: false, domain: 42, profile: dds.xml, interfaces: [lo, 10.0.0.1], ros2: false, frame_id: "the \"map\""}
record:
  folder: recordings
  always: true
  raw_storage: huffyuv
  queue_frames: 7
  pre_roll_s: 1.5
  pre_roll_mb: 64
  after_s: 0.5
  on_lost: false
metrics: {port: 9464, address: 0.0.0.0}
log_level: debug
)";

TEST_F(ServiceConfigFile, EveryKeyIsRead) {
  write("<dds/>", "dds.xml");
  const ServiceConfig c = load(everything);
  ASSERT_EQ(c.targets.size(), 2u);
  EXPECT_EQ(c.targets[0].name, "red_cap");
  EXPECT_EQ(c.targets[0].radius_m, 0.12);
  EXPECT_EQ(c.targets[0].color, (color::HsiRange{340, 20, 0.8, 0.95, 0.2, 0.7}));
  // What a camera's colour leaves out is the target's.
  ASSERT_EQ(c.targets[0].camera_colors.size(), 1u);
  EXPECT_EQ(c.targets[0].camera_colors[0].first, "cam1");
  EXPECT_EQ(c.targets[0].camera_colors[0].second, (color::HsiRange{340, 20, 0.5, 0.7, 0.2, 0.7}));
  EXPECT_EQ(c.targets[1].name, "lime");
  ASSERT_EQ(c.cameras.size(), 2u);
  EXPECT_EQ(c.cameras[0].name, "cam1");
  EXPECT_EQ(c.cameras[0].device, "/dev/v4l/by-id/usb-cam");
  EXPECT_EQ(c.cameras[0].format, capture::CaptureFormat::mjpeg);
  EXPECT_EQ(c.cameras[0].size, (calib::ImageSize{320, 240}));
  EXPECT_EQ(c.cameras[0].fps, 29.97);
  ASSERT_EQ(c.cameras[0].controls.size(), 3u);
  EXPECT_EQ(c.cameras[0].controls[0].name, "exposure_time_absolute");
  EXPECT_EQ(c.cameras[0].controls[0].value, capture::ControlValue(std::int64_t{100}));
  EXPECT_EQ(c.cameras[0].controls[1].value, capture::ControlValue(std::int64_t{0}));
  EXPECT_EQ(c.cameras[0].controls[2].value, capture::ControlValue("50 Hz"));
  EXPECT_EQ(c.cameras[0].latency_offset_s, 0.0125);
  EXPECT_TRUE(c.cameras[0].restore_controls);
  EXPECT_EQ(c.cameras[1].device, "/dev/video3");
  EXPECT_EQ(c.quorum, 1);
  const object_tracking::ObjectTrackerOptions& o = c.object_tracking;
  EXPECT_EQ(o.observation, object_tracking::Observation::paper);
  EXPECT_EQ(o.volume.min, Eigen::Vector3d(-0.5, -0.25, 0.125));
  EXPECT_EQ(o.volume.max, Eigen::Vector3d(0.5, 0.75, 1.5));
  EXPECT_EQ(o.particle_count, 321);
  EXPECT_EQ(o.max_particle_count, 4321);
  EXPECT_EQ(o.seed, 77u);
  EXPECT_EQ(o.position_noise_m, 0.031);
  EXPECT_EQ(o.acceleration_m_s2, 12.5);
  EXPECT_EQ(o.start_speed_m_s, 4.5);
  EXPECT_EQ(o.pixel_noise_px, 0.75);
  EXPECT_EQ(o.max_tracking_sigma_m, 0.0625);
  EXPECT_EQ(o.max_tracking_share_along, 0.25);
  EXPECT_EQ(o.coast_s, 0.7);
  EXPECT_EQ(o.max_coast_sigma_m, 0.21);
  EXPECT_EQ(c.set_tolerance_s, 0.0123);
  EXPECT_EQ(c.threads, 3);
  EXPECT_FALSE(c.dds.enabled);
  EXPECT_EQ(c.dds.publisher.domain, 42);
  EXPECT_EQ(c.dds.publisher.profiles, folder_ / "dds.xml");
  EXPECT_THAT(c.dds.publisher.interfaces, ElementsAre("lo", "10.0.0.1"));
  EXPECT_FALSE(c.dds.publisher.ros2);
  EXPECT_EQ(c.dds.publisher.frame_id, "the \"map\"");
  EXPECT_EQ(c.record.folder, folder_ / "recordings");
  EXPECT_TRUE(c.record.always);
  EXPECT_EQ(c.record.raw_storage, recordings::RawStorage::huffyuv);
  EXPECT_EQ(c.record.queue_frames, 7);
  EXPECT_EQ(c.record.pre_roll_s, 1.5);
  EXPECT_EQ(c.record.pre_roll_mb, 64);
  EXPECT_EQ(c.record.after_s, 0.5);
  EXPECT_FALSE(c.record.on_lost);
  EXPECT_EQ(c.metrics.port, 9464);
  EXPECT_EQ(c.metrics.address, "0.0.0.0");
  EXPECT_EQ(c.log_level, LogLevel::debug);
}

TEST_F(ServiceConfigFile, WhatCheckPrintsLoadsBackToTheSame) {
  write("<dds/>", "dds.xml");
  for (const auto& yaml : {ball, everything}) {
    const ServiceConfig config = load(yaml);
    const std::string printed = to_yaml(config);
    fs::create_directories(folder_ / "elsewhere");  // paths in it hold from any folder
    const ServiceConfig again = load_service_config(write(printed, "elsewhere/printed.yaml"));
    EXPECT_EQ(to_yaml(again), printed);
    EXPECT_EQ(config_identity(again), config_identity(config));
  }
}

TEST_F(ServiceConfigFile, TheIdentityChangesWithAnyValueAndNotWithTheFolder) {
  EXPECT_EQ(config_identity(load(ball)), config_identity(load(ball + "threads: 1\n")));
  EXPECT_NE(config_identity(load(ball)), config_identity(load(ball + "threads: 2\n")));
  const std::string here = config_identity(load(ball));
  fs::copy_file(folder_ / "rig.yaml", folder_ / "rig2.yaml", fs::copy_options::overwrite_existing);
  EXPECT_EQ(here, config_identity(load("version: 1\nrig: rig2.yaml\n" + ball.substr(head.size()))));
}

TEST_F(ServiceConfigFile, DifferingKeysAreThoseOfTheFirstLevel) {
  const ServiceConfig config = load(ball);
  EXPECT_THAT(differing_keys(config, config), IsEmpty());
  EXPECT_THAT(differing_keys(config, load(ball + "threads: 2\ndds: {domain: 3}\n")), ElementsAre("threads", "dds"));
  EXPECT_THAT(differing_keys(config, load(head + "targets: {ball: {color: {hue_deg: [66, 115]}}}\n")),
              ElementsAre("targets"));
  ServiceConfig moved = config;
  moved.rig.cameras[0].cam_from_world.translation.x() += 0.01;
  EXPECT_THAT(differing_keys(config, moved), ElementsAre("rig"));
}

TEST_F(ServiceConfigFile, IgnoredRectanglesAreThoseOfEveryTarget) {
  const ServiceConfig config = load(head +
                                    "targets: {a: {color: {hue_deg: [1, 9]}}, b: {color: {hue_deg: [65, "
                                    "115]}}}\nignore: {cam1: [1, 2, 3, 4, 5, 6, 7, 8]}\n");
  const object_tracking::IgnoredRegions expected = {{"cam1", {{1, 2, 3, 4}, {5, 6, 7, 8}}}};
  EXPECT_EQ(config.ignored, expected);
  for (const auto& target : config.targets) EXPECT_EQ(target.ignored, expected);
  EXPECT_EQ(load_service_config(write(to_yaml(config), "printed.yaml")).ignored, expected);
}

struct Mistake {
  const char* name;
  std::string yaml, message;
};

class Mistakes : public ServiceConfigFile, public testing::WithParamInterface<Mistake> {};

TEST_P(Mistakes, AreNamedWithFileAndLine) {
  EXPECT_EQ(error(GetParam().yaml), GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    All, Mistakes,
    testing::Values(
        Mistake{"UnknownKey", ball + "object_tracking:\n  particle_cuont: 300\n",
                "c.yaml:5: object_tracking.particle_cuont is not a known key (did you mean particle_count?)"},
        Mistake{"KeyOfAnotherPlace", ball + "volume: {min: [-1, -1, 0], max: [1, 1, 2]}\n",
                "c.yaml:4: volume is not a known key here (did you mean object_tracking.volume?)"},
        Mistake{"GroupWithoutKeys", ball + "calibration: mend\n",
                "c.yaml:4: calibration: is a group of keys: its keys belong below it, indented, with a colon each: "
                "watch, room"},
        Mistake{"HueBelowZero", head + "targets:\n  ball: {color: {hue_deg: [-20, 20]}}\n",
                "c.yaml:4: targets.ball.color.hue_deg: must be from 0 to 360, got [-20, 20]: write [340, 20], the same "
                "on the circle"},
        Mistake{"SaturationOfAByte", head + "targets:\n  ball: {color: {hue_deg: [1, 2], saturation: [76, 255]}}\n",
                "c.yaml:4: targets.ball.color.saturation: must be from 0 to 1, got [76, 255]: write [0.3, 1] if these "
                "are of 255"},
        Mistake{"HueThatIsOneNumber", head + "targets:\n  ball: {color: {hue_deg: green}}\n",
                "c.yaml:4: targets.ball.color.hue_deg: must be two numbers, [from, to], got \"green\""},
        Mistake{"SizeWithAnX", ball + "cameras: {cam0: {device: 0, size: 640*480}}\n",
                "c.yaml:4: cameras.cam0.size: must be two numbers, as [640, 480], or the word rig, got \"640*480\": "
                "write [640, 480]"},
        Mistake{"TargetsAsAList", head + "targets:\n  - ball\n",
                "c.yaml:3: targets: is a group of names, each on a line of its own below it, indented, with a colon "
                "and without a dash: \"NAME:\"; and of each name its keys belong below it, indented, with a colon "
                "each: radius_m, shape, count, color, camera_colors"},
        Mistake{"UnknownKeyAtTheRoot", ball + "target: 3\n",
                "c.yaml:4: target is not a known key (did you mean targets?)"},
        Mistake{"UnknownKeyInATarget", head + "targets:\n  ball:\n    radius: 0.04\n    color: {hue_deg: [65, 115]}\n",
                "c.yaml:5: targets.ball.radius is not a known key (did you mean radius_m?)"},
        Mistake{"WrongType", ball + "threads: many\n", "c.yaml:4: threads must be a whole number, got \"many\""},
        Mistake{"OutOfRange", ball + "dds: {domain: 233}\n", "c.yaml:4: dds.domain must be from 0 to 232 (is 233)"},
        Mistake{"NeitherNumberNorWord", ball + "dds: {domain: atuo}\n",
                "c.yaml:4: dds.domain: must be a number or the word auto, got \"atuo\""},
        Mistake{"WrongWord", ball + "object_tracking: {observation: papper}\n",
                "c.yaml:4: object_tracking.observation must be one of huetrack, paper, got \"papper\" (did you mean "
                "paper?)"},
        Mistake{"IgnoredCameraUnknown", ball + "ignore: {cma0: [1, 2, 3, 4]}\n",
                "c.yaml:4: ignore.cma0: is not a camera of the rig, which has cam0, cam1 (did you mean cam0?)"},
        Mistake{"IgnoredNotFourNumbers", ball + "ignore: {cam0: [1, 2, 3, 4, 5]}\n",
                "c.yaml:4: ignore.cam0: must be four numbers per rectangle: u_min, v_min, u_max, v_max"},
        Mistake{"IgnoredEmpty", ball + "ignore: {cam0: [1, 2, 3, 4, 9, 9, 8, 9]}\n",
                "c.yaml:4: ignore.cam0: rectangle 2 ends before it begins"},
        Mistake{"NoVersion", "rig: rig.yaml\n",
                "c.yaml:1: version is missing: write version: 1, the version of the file format"},
        Mistake{"NoRig", "version: 1\n",
                "c.yaml:1: rig is missing: write rig: FILE (from huetrack-calibrate), or rig: none before the "
                "calibration"},
        Mistake{"RigMisspelt", "version: 1\nrgi: rig.yaml\n",
                "c.yaml:1: rig is missing (is rgi in line 2 a misspelling of it?)"},
        Mistake{"VersionMisspelt", "verson: 1\nrig: rig.yaml\n",
                "c.yaml:1: version is missing (is verson in line 1 a misspelling of it?)"},
        Mistake{"RigFileMissing", "version: 1\nrig: no.yaml\n",
                "c.yaml:2: rig: there is no file no.yaml; rig: none shows cameras that are not calibrated yet"},
        Mistake{"NoRigAndNoCameras", "version: 1\nrig: none\ntargets: {ball: {}}\n",
                "c.yaml:2: rig: is none: then the configuration names the cameras, under cameras"},
        Mistake{
            "NetworkCameraOfNoScheme", ball + "cameras: {cam0: {device: \"file:///a.mp4\"}}\n",
            "c.yaml:4: cameras.cam0.device: the address must begin with rtsp://, rtsps://, http://, https://, tcp://, "
            "udp:// or rtp://"},
        Mistake{"NetworkCameraWithControls", ball + "cameras: {cam0: {device: \"rtsp://c/1\", controls: {gain: 1}}}\n",
                "c.yaml:4: cameras.cam0.device: is a camera of the network, which has its own settings: format and "
                "controls are not for it"},
        Mistake{"TracksACameraWithoutARig",
                "version: 1\nrig: none\ncameras: {cam0: {device: 0}}\ncamera_tracking: {camera: cam0}\n",
                "c.yaml:4: camera_tracking.camera: cannot be tracked yet: rig is none"},
        Mistake{"NoTargets", head,
                "c.yaml:1: targets: at least one target is needed: targets: {ball: {color: {hue_deg: [65, 115]}}}, or "
                "{ball: {}} to be taught; or a camera to track, under camera_tracking"},
        Mistake{"NoHue", head + "targets:\n  ball:\n    color: {saturation: [0.3, 1]}\n",
                "c.yaml:5: targets.ball.color.hue_deg is missing (other keys here: saturation)"},
        Mistake{"TargetNameThatIsNoTopic", head + "targets:\n  ball__x: {color: {hue_deg: [65, 115]}}\n",
                "c.yaml:4: targets.ball__x: target \"ball__x\" must be a letter, then letters, digits and single '_', "
                "64 characters at most: it is part of a ROS 2 topic's name"},
        Mistake{"TooManyParticles", ball + "object_tracking: {particle_count: 2000000}\n",
                "c.yaml:4: object_tracking.particle_count must be from 1 to 1000000 (is 2000000)"},
        Mistake{"TargetTwice",
                head + "targets:\n  ball: {color: {hue_deg: [1, 2]}}\n  ball: {color: {hue_deg: [3, 4]}}\n",
                "c.yaml:5: targets.ball is given twice, first in line 4: take one of them out, or write both as one"},
        Mistake{"UnknownCamera",
                head + "targets:\n  ball:\n    color: {hue_deg: [65, 115]}\n    camera_colors:\n      cma1: {}\n",
                "c.yaml:7: targets.ball.camera_colors.cma1: is not a camera of the rig, which has cam0, cam1 (did you "
                "mean cam1?)"},
        Mistake{"VolumeUpsideDown", ball + "object_tracking:\n  volume: {min: [-1, -1, 2], max: [1, 1, 2]}\n",
                "c.yaml:5: object_tracking.volume: min must be less than max on every axis, and on z it is not"},
        Mistake{
            "VolumeOutOfSight", ball + "object_tracking:\n  volume: {min: [50, 50, 50], max: [51, 51, 51]}\n",
            "c.yaml:5: object_tracking.volume: no camera of the rig sees any of it: is the volume in the rig's world "
            "frame, in metres?"},
        Mistake{
            "RadiusInMillimetres", head + "targets:\n  ball:\n    radius_m: 40\n    color: {hue_deg: [65, 115]}\n",
            "c.yaml:5: targets.ball.radius_m: a ball of this radius does not fit into object_tracking.volume; the unit "
            "is metres: did you mean 0.04?"},
        Mistake{"UnknownLiveCamera", ball + "cameras:\n  cma1: {device: 0}\n",
                "c.yaml:5: cameras.cma1: is not a camera of the rig, which has cam0, cam1 (did you mean cam1?)"},
        Mistake{"RateThatNoneHas", ball + "cameras:\n  cam1: {device: 0, fps: 1e9}\n",
                "c.yaml:5: cameras.cam1.fps must be > 0 and <= 10000 (is 1000000000)"},
        Mistake{"CameraWithoutDevice", ball + "cameras:\n  cam1: {fps: 30}\n",
                "c.yaml:5: cameras.cam1.device is missing (other keys here: fps)"},
        Mistake{"DeviceUnderAnotherName", ball + "cameras:\n  cam1: {source: /dev/video0}\n",
                "c.yaml:5: cameras.cam1.source: is not a known key: write device: /dev/v4l/by-path/..., an index, "
                "or rtsp://..."},
        Mistake{"DeviceNotBelowDev", ball + "cameras:\n  cam1: {device: webcam}\n",
                "c.yaml:5: cameras.cam1.device: must be a path below /dev, an index, or an address like rtsp://..., "
                "got \"webcam\": "
                "ls -l /dev/v4l/by-path/ lists the cameras"},
        Mistake{"DeviceTwice", ball + "cameras:\n  cam0: {device: 0}\n  cam1: {device: /dev/video0}\n",
                "c.yaml:6: cameras.cam1.device: is the device of cam0 already: cameras that share one need a crop "
                "each, their part of "
                "its picture"},
        Mistake{"FieldsOfMatches", ball + "cameras:\n  cam0: {host: pi, send: matches, fields: top}\n",
                "c.yaml:5: cameras.cam0.fields: needs the camera's pictures: give send: frames"},
        Mistake{"FieldsOfAnotherName", ball + "cameras:\n  cam0: {device: 0, fields: even}\n",
                "c.yaml:5: cameras.cam0.fields must be one of none, top, bottom, got \"even\""},
        Mistake{"CropWithoutSize", ball + "cameras:\n  cam0: {device: 0, crop: [0, 0, 320, 240]}\n",
                "c.yaml:5: cameras.cam0.crop: needs size: that of the device's whole picture, as [1280, 480]"},
        Mistake{
            "CropNotTheRigs", ball + "cameras:\n  cam0: {device: 0, size: [1280, 480], crop: [0, 0, 640, 480]}\n",
            "c.yaml:5: cameras.cam0.crop: is 640x480, and the rig was calibrated at 320x240: calibrate with this crop"},
        Mistake{"CropOutside", ball + "cameras:\n  cam0: {device: 0, size: [640, 240], crop: [480, 0, 320, 240]}\n",
                "c.yaml:5: cameras.cam0.crop: camera cam0: crop [480, 0, 320, 240] (u, v, width, height) is no part of "
                "the picture, "
                "which is 640x240"},
        Mistake{"CropOfOddPixels", ball + "cameras:\n  cam0: {device: 0, size: [640, 240], crop: [1, 0, 320, 240]}\n",
                "c.yaml:5: cameras.cam0.crop: camera cam0: crop [1, 0, 320, 240] must be even numbers, because "
                "neighbouring "
                "pixels of a camera share their colour"},
        Mistake{"CropsOfTwoRates",
                ball + "cameras:\n  cam0: {device: 0, size: [640, 240], fps: 30, crop: [0, 0, 320, 240]}\n"
                       "  cam1: {device: 0, size: [640, 240], fps: 60, crop: [320, 0, 320, 240]}\n",
                "c.yaml:6: cameras.cam1.crop: cameras cam0 and cam1 share a device, which has one format, size, fps, "
                "controls "
                "and restore_controls: give both the same"},
        Mistake{
            "CropOfOneOfTwo",
            ball + "cameras:\n  cam0: {device: 0}\n  cam1: {device: 0, size: [640, 240], crop: [320, 0, 320, 240]}\n",
            "c.yaml:6: cameras.cam1.device: is the device of cam0 already: cameras that share one need a crop each, "
            "their part of "
            "its picture"},
        Mistake{"CropOfANetworkCamera",
                ball + "cameras:\n  cam0: {device: \"rtsp://c/1\", size: [640, 240], crop: [0, 0, 320, 240]}\n",
                "c.yaml:5: cameras.cam0.crop: is for a camera that is connected to this host: connect it here, or have "
                "its pictures cropped where they "
                "come from"},
        Mistake{"SizeNotTheRigs", ball + "cameras:\n  cam0: {device: 0, size: [640, 480]}\n",
                "c.yaml:5: cameras.cam0.size: the rig was calibrated at 320x240: use that size (or the word rig), or "
                "calibrate anew"},
        Mistake{"QuorumTooLarge", ball + "cameras:\n  cam0: {device: 0}\nquorum: 2\n",
                "c.yaml:6: quorum: is more than there are in cameras (1)"},
        Mistake{"RecordWithoutFolder", ball + "record: {always: true}\n",
                "c.yaml:4: record: a folder is needed to record to, or to save the pre-roll to"},
        Mistake{"ColorInBritish", head + "targets:\n  ball: {colour: {hue_deg: [65, 115]}}\n",
                "c.yaml:4: targets.ball.colour is not a known key (did you mean color?)"},
        Mistake{"HalfAKey", head + "targets:\n  ball: {color: {hue: [65, 115]}}\n",
                "c.yaml:4: targets.ball.color.hue_deg is missing (is hue in line 4 a misspelling of it?)"},
        Mistake{"HueTheWrongWayRound", head + "targets:\n  ball: {color: {hue_deg: [115, 65]}}\n",
                "c.yaml:4: targets.ball.color: hue must be a range of at most 300 degrees, or 0..360 for any hue; from "
                "115 on to 65 are 310 (were [65, 115] meant?)"},
        Mistake{"SizeAsTheDriverPrintsIt", ball + "cameras:\n  cam0: {device: 0, size: 320x240}\n",
                "c.yaml:5: cameras.cam0.size: must be two numbers, as [640, 480], or the word rig, got \"320x240\": "
                "write [320, 240]"},
        Mistake{"ExposureBesideTheControls", ball + "cameras:\n  cam0: {device: 0, exposure: 100}\n",
                "c.yaml:5: cameras.cam0.exposure: is a control of the camera: write controls: "
                "{exposure_time_absolute: ...} (`huetrackd doctor` lists those that it has)"},
        Mistake{
            "FormatInCapitals", ball + "cameras:\n  cam0: {device: 0, format: MJPG}\n",
            "c.yaml:5: cameras.cam0.format must be one of auto, yuyv, nv12, mjpeg, grey, got \"MJPG\" (did you mean "
            "mjpeg?)"},
        Mistake{"ARecording", "version: 1\ncameras:\n  cam0: {frames: a.mkv, fps: 30}\n",
                "c.yaml:1: this is a recording, not a configuration: huetrackd replay CONFIGURATION RECORDING"},
        Mistake{"ToleranceOfCenturies", ball + "frame_sets: {tolerance_s: 1e10}\n",
                "c.yaml:4: frame_sets.tolerance_s must be from 1e-06 to 10 (is 10000000000)"},
        Mistake{"NoSuchProfile", ball + "dds: {profile: none.xml}\n",
                "c.yaml:4: dds.profile: there is no file none.xml"}),
    [](const auto& instance) { return std::string(instance.param.name); });

TEST_F(ServiceConfigFile, NamesThatCannotBePartOfATopicAreRefused) {
  EXPECT_THAT(error(head + "targets:\n  2balls: {color: {hue_deg: [65, 115]}}\n"),
              HasSubstr("c.yaml:4: targets.2balls: "));
}

TEST_F(ServiceConfigFile, ADefaultVolumeOutOfSightIsNamedByItsWholeKey) {
  calib::CameraRig far = calib::read_rig(folder_ / "rig.yaml");
  for (auto& camera : far.cameras) camera.cam_from_world.translation += Eigen::Vector3d(0, 0, -100);  // all behind it
  calib::write_rig(far, folder_ / "rig.yaml");
  EXPECT_THAT(error(ball), HasSubstr("c.yaml:1: object_tracking.volume: no camera of the rig sees any of it"));
}

TEST_F(ServiceConfigFile, ARigInMillimetresIsNamedAsTheReasonForAVolumeOutOfSight) {
  calib::CameraRig rig = calib::read_rig(folder_ / "rig.yaml");
  for (auto& camera : rig.cameras)  // the volume is behind all of them
    camera.cam_from_world.translation = 1000 * camera.cam_from_world.translation - Eigen::Vector3d(0, 0, 1e5);
  calib::write_rig(rig, folder_ / "rig.yaml");
  EXPECT_THAT(error(ball), AllOf(HasSubstr("no camera of the rig sees any of it: the cameras stand up to "),
                                 HasSubstr(" m apart: is the rig in millimetres? Write it in metres")));
}

// What one camera sees is not at 0 to 2 m of any axis: its world may begin at the camera.
TEST_F(ServiceConfigFile, OneCameraSearchesWhatItSees) {
  calib::CameraRig rig = calib::read_rig(folder_ / "rig.yaml");
  const calib::Camera camera = rig.cameras.front();
  rig.cameras.resize(1);
  rig.uncertainty.reset();
  calib::write_rig(rig, folder_ / "one.yaml");
  const std::string one = "version: 1\nrig: one.yaml\ntargets: {ball: {radius_m: 0.04, color: {hue_deg: [65, 115]}}}\n";
  const object_tracking::Volume volume = load(one).object_tracking.volume;
  // A ball at every corner of the picture is inside, up to where its radius is 2 pixels.
  const double far_m = 0.04 * camera.model.fx() / 2;
  ASSERT_LT(far_m, 10);
  const double right = camera.image_size.width - 1, bottom = camera.image_size.height - 1;
  for (const Eigen::Vector2d& corner : {Eigen::Vector2d(0, 0), {right, 0}, {0, bottom}, {right, bottom}}) {
    const Eigen::Vector3d direction =
        camera.cam_from_world.rotation.conjugate() * camera.model.ray({corner})->normalized();
    for (const double depth_m : {0.21, 0.99 * far_m}) {
      const Eigen::Vector3d p = camera.centre() + depth_m * direction;
      EXPECT_TRUE((p.array() >= volume.min.array()).all() && (p.array() <= volume.max.array()).all()) << p.transpose();
    }
    EXPECT_TRUE(meets_volume(camera, corner, volume));
  }
  EXPECT_LT((volume.max - volume.min).norm(), 3 * far_m);
  EXPECT_LE(load("version: 1\nrig: one.yaml\ntargets: {ball: {radius_m: 2}}\n").object_tracking.volume.max.norm(),
            camera.centre().norm() + std::sqrt(3) * 10.1);
  const ServiceConfig said = load(one + "object_tracking: {volume: {min: [-1, -1, 0], max: [1, 1, 1.5]}}\n");
  EXPECT_EQ(said.object_tracking.volume.max, Eigen::Vector3d(1, 1, 1.5));
  EXPECT_EQ(load(ball).object_tracking.volume.max, object_tracking::Volume().max) << "several cameras";
}

TEST(MeetsVolume, OnlyBeforeTheCameraAndInItsDirection) {
  calib::Camera camera;  // at the origin, along z
  camera.image_size = {640, 480};
  camera.model = calib::CameraModel(calib::PinholeRadtan{.fx = 500, .fy = 500, .cx = 320, .cy = 240});
  const object_tracking::Volume ahead{.min = {-0.5, -0.5, 1}, .max = {0.5, 0.5, 2}},
      behind{.min = {-0.5, -0.5, -2}, .max = {0.5, 0.5, -1}}, around{.min = {-1, -1, -1}, .max = {1, 1, 1}};
  EXPECT_TRUE(meets_volume(camera, {320, 240}, ahead));
  EXPECT_FALSE(meets_volume(camera, {320, 240}, behind));
  EXPECT_TRUE(meets_volume(camera, {0, 0}, around));
  const object_tracking::Volume above{.min = {-1, -2, 0}, .max = {1, 0.01, 2}};  // y is down
  EXPECT_TRUE(meets_volume(camera, {320, 40}, above));
  EXPECT_FALSE(meets_volume(camera, {320, 440}, above)) << "only the camera itself is inside";
  EXPECT_TRUE(meets_volume(camera, {320 + 240, 240}, ahead));   // 0.48 m aside where it begins
  EXPECT_FALSE(meets_volume(camera, {320 + 260, 240}, ahead));  // 0.52 m
}

TEST_F(ServiceConfigFile, EmptyRangesAreRefused) {
  EXPECT_THAT(error(head + "targets:\n  b:\n    color: {hue_deg: [1, 9], saturation: [0.9, 0.3]}\n"),
              HasSubstr("c.yaml:5: targets.b.color: "));
}

TEST_F(ServiceConfigFile, MoreParticlesThanTheMostAreRefused) {
  EXPECT_THAT(error(head + "targets: {ball: {count: 8, color: {hue_deg: [65, 115]}}}\n" +
                    "object_tracking: {max_particle_count: 1000000}\n"),
              HasSubstr("makes 8000000 particles of all objects together"));
  EXPECT_THAT(error(ball + "object_tracking: {particle_count: 500, max_particle_count: 400}\n"),
              HasSubstr("c.yaml:4: object_tracking: "));
}

TEST_F(ServiceConfigFile, AMistakeInTheRigIsNamedInTheRig) {
  write("version: 1\ncameras: {}\n", "bad_rig.yaml");
  EXPECT_THAT(error("version: 1\nrig: bad_rig.yaml\ntargets: {b: {color: {hue_deg: [1, 9]}}}\n"),
              HasSubstr("bad_rig.yaml"));
}

std::string targets_of_one_color(int count) {
  std::string text = "targets:\n";
  for (int i = 0; i < count; ++i) text += fmt::format("  t{}: {{radius_m: 0.04, color: {{hue_deg: [65, 115]}}}}\n", i);
  return text;
}

TEST_F(ServiceConfigFile, MoreTargetsThanCanBeTrackedAreRefused) {
  EXPECT_EQ(load(head + targets_of_one_color(100)).targets.size(), 100u);
  EXPECT_THAT(error(head + targets_of_one_color(101)), HasSubstr("targets: are 101, and 100 at most can be tracked"));
}

TEST_F(ServiceConfigFile, WarnsOfWhatIsProbablyNotMeant) {
  const std::string sized = head + "targets: {ball: {radius_m: 0.04, color: {hue_deg: [65, 115]}}}\n";
  EXPECT_THAT(warnings_of(load(sized)), IsEmpty());
  EXPECT_THAT(warnings_of(load(sized + "record: {folder: recordings}\n")),
              ElementsAre(HasSubstr("nothing will be recorded")));
  EXPECT_THAT(warnings_of(load(sized + "record: {folder: recordings, always: true}\n")), IsEmpty());
  EXPECT_THAT(warnings_of(load(head + "targets: {a: {radius_m: 0.04, color: {hue_deg: [350, 20]}}, b: {radius_m: 0.04, "
                                      "color: {hue_deg: [10, 40]}}}\n")),
              ElementsAre("targets a and b have overlapping colours in camera cam0 and may be taken for each other"));
  EXPECT_THAT(warnings_of(load(head + "targets: {a: {radius_m: 0.04, color: {hue_deg: [160, 80]}}}\n")),
              ElementsAre(HasSubstr("were [80, 160] meant?")));
  EXPECT_THAT(warnings_of(load(head + "targets: {a: {radius_m: 0.04, color: {hue_deg: [0.18, 0.32]}}}\n")),
              ElementsAre(AllOf(HasSubstr("target a: its hue_deg [0.18, 0.32] is one degree wide"),
                                HasSubstr("shares of the circle, 0 to 1, write [65, 115]"))));
  // Red, as OpenCV has it.
  EXPECT_THAT(warnings_of(load(head + "targets: {a: {radius_m: 0.04, color: {hue_deg: [170, 10]}}}\n")),
              ElementsAre(HasSubstr("were [340, 20] meant, which are [170, 10] in OpenCV's units (0 to 180)?")));
  // Many targets of one colour are one line, not one for each pair.
  EXPECT_THAT(warnings_of(load(head + targets_of_one_color(40))),
              ElementsAre(testing::StartsWith("780 pairs of targets have overlapping colours")));
  // Far to the side: cam1 alone sees a part of it.
  const auto far = load(sized + "object_tracking: {volume: {min: [-4, -4, 0], max: [4, 4, 2]}}\n");
  const auto coverage = volume_coverage(far.rig, far.object_tracking.volume);
  ASSERT_LT(coverage.by_two, 0.5);
  EXPECT_THAT(warnings_of(far), ElementsAre(HasSubstr("of the volume is seen by two or more cameras")));
}

TEST_F(ServiceConfigFile, WarnsOfARigThatWasDoubtfulWhenItWasMade) {
  const auto warnings_with = [&](std::vector<std::pair<std::string, std::string>> made_by,
                                 std::vector<calib::RigCheckNote> checks) {
    calib::CameraRig rig = calib::read_rig(folder_ / "rig.yaml");
    rig.made_by = std::move(made_by);
    rig.made.checks = std::move(checks);
    calib::write_rig(rig, folder_ / "made.yaml");
    return warnings_of(
        load("version: 1\nrig: made.yaml\ntargets: {b: {radius_m: 0.04, color: {hue_deg: [65, 115]}}}\n"));
  };
  EXPECT_THAT(warnings_with({{"verdict", "usable"}, {"expected_error_mm", "3.1"}}, {}), IsEmpty());
  EXPECT_THAT(warnings_with({{"verdict", "doubtful"}, {"expected_error_mm", "85.3"}, {"doubt", "throw the ball"}}, {}),
              ElementsAre("the rig was doubtful when it was calibrated, with an expected error of positions of 85.3 "
                          "mm: throw the ball"));
  EXPECT_THAT(warnings_with({{"verdict", "doubtful"}}, {}),
              ElementsAre(HasSubstr("when it was calibrated: calibrate again")));
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  EXPECT_THAT(warnings_with({{"verdict", "doubtful"}}, {{now, "usable", ""}}), IsEmpty());
}

// It is an assumption, until it is taught.
TEST_F(ServiceConfigFile, WarnsOfARadiusThatNobodyGave) {
  const ServiceConfig unset = load(head + "targets: {a: {color: {hue_deg: [80, 160]}}}\n");
  EXPECT_TRUE(unset.targets[0].is_radius_assumed);
  EXPECT_THAT(warnings_of(unset), ElementsAre("no radius of target a is set: 0.04 m is assumed until its outlines have "
                                              "shown another: measure it, and set radius_m"));
  EXPECT_THAT(warnings_of(load(head + "targets: {a: {count: 2, color: {hue_deg: [80, 160]}}}\n")),
              ElementsAre(HasSubstr("is assumed, and positions are as wrong as that")));
  EXPECT_THAT(warnings_of(load(head + "targets: {a: {}}\n")), ElementsAre(HasSubstr("no colour yet")));
  // A recording's configuration must not turn the assumption into a given radius.
  EXPECT_THAT(to_portable_yaml(unset), HasSubstr("radius_m: auto"));
  const ServiceConfig said = load(head + "targets: {a: {radius_m: auto, color: {hue_deg: [80, 160]}}}\n");
  EXPECT_TRUE(said.targets[0].is_radius_assumed);
  EXPECT_EQ(said.targets[0].radius_m, 0.04);
  const ServiceConfig given = load(head + "targets: {a: {radius_m: 0.04, color: {hue_deg: [80, 160]}}}\n");
  EXPECT_FALSE(given.targets[0].is_radius_assumed);
  EXPECT_THAT(targets_that_differ(unset, given), ElementsAre(0u)) << "the tracker learns it, or does not";
  EXPECT_THAT(error(head + "targets: {a: {radius_m: small}}\n"), HasSubstr("a number or the word auto"));
}

TEST_F(ServiceConfigFile, PosesThatAreProbablyInvertedAreAMistake) {
  ServiceConfig config = load(ball);
  EXPECT_THAT(pose_mistake(config), IsEmpty());
  config.rig.cameras.assign(3, config.rig.cameras[0]);
  for (int c = 0; c < 3; ++c) {  // around the room, and look at its middle
    const Eigen::AngleAxisd about_z(2.1 * c, Eigen::Vector3d::UnitZ()), down(2.0, Eigen::Vector3d::UnitX());
    config.rig.cameras[std::size_t(c)].cam_from_world = {Eigen::Quaterniond(down * about_z),
                                                         Eigen::Vector3d(0, 0, 2.5)};
  }
  EXPECT_THAT(pose_mistake(config), IsEmpty());
  calib::invert_poses(config.rig.cameras);
  EXPECT_THAT(pose_mistake(config), HasSubstr("its poses are probably world_from_cam"));
  EXPECT_THAT(warnings_of(config), testing::Contains(pose_mistake(config)));
}

// Read the wrong way round, cameras around a place seem to stand together, and may see a place there.
TEST_F(ServiceConfigFile, AVolumeThatNoTwoCamerasSeeIsAMistake) {
  ServiceConfig config = load(ball);
  EXPECT_THAT(coverage_mistake(config), IsEmpty());
  config.rig.cameras.assign(3, config.rig.cameras[0]);
  for (int c = 0; c < 3; ++c) {
    const Eigen::AngleAxisd about_z(0.8 * c, Eigen::Vector3d::UnitZ()), down(2 + 0.1 * c, Eigen::Vector3d::UnitX());
    config.rig.cameras[std::size_t(c)].cam_from_world = {Eigen::Quaterniond(down * about_z),
                                                         Eigen::Vector3d(0, 0, 4 + 0.1 * c)};
  }
  config.object_tracking.volume = {{-1, -1, 0}, {1, 1, 2}};
  EXPECT_THAT(coverage_mistake(config), IsEmpty());
  EXPECT_THAT(pose_mistake(config), IsEmpty());
  calib::CameraRig right = config.rig;
  calib::invert_poses(config.rig.cameras);
  ASSERT_TRUE(calib::middle_of(config.rig.cameras).is_in_all_pictures);
  EXPECT_THAT(coverage_mistake(config), HasSubstr("its poses are probably world_from_cam"));
  EXPECT_THAT(warnings_of(config), testing::Contains(coverage_mistake(config)));
  config.rig = std::move(right);
  config.object_tracking.volume = {{100, 100, 0}, {102, 102, 2}};
  EXPECT_THAT(coverage_mistake(config), HasSubstr("or in another unit (--unit)?"));
}

TEST_F(ServiceConfigFile, LengthsThatCannotBeMetresAreAMistake) {
  const ServiceConfig right = load(ball);
  ASSERT_THAT(unit_mistake(right), IsEmpty());
  const auto with_volume = [&](const std::string& volume) {
    return load(ball + "object_tracking: {volume: " + volume + "}\n");
  };
  const ServiceConfig long_volume = with_volume("{min: [-1000, -1000, 0], max: [1000, 1000, 2000]}");
  EXPECT_THAT(unit_mistake(long_volume), HasSubstr("volume is 2000 m long: is it in millimetres?"));
  EXPECT_THAT(warnings_of(long_volume), testing::Contains(unit_mistake(long_volume)));
  // In one and the same wrong unit everything is seen.
  ServiceConfig both = with_volume("{min: [-1500, -1500, 0], max: [1500, 1500, 2000]}");
  ServiceConfig in_millimetres = right;
  for (ServiceConfig* const config : {&both, &in_millimetres})
    for (auto& camera : config->rig.cameras) camera.cam_from_world.translation *= 1000;
  EXPECT_THAT(unit_mistake(both), HasSubstr("in millimetres? Write"));
  EXPECT_THAT(unit_mistake(in_millimetres), testing::ContainsRegex("cameras stand up to [0-9]+ m apart"));
  EXPECT_THAT(warnings_of(in_millimetres), testing::Contains(unit_mistake(in_millimetres)));
  in_millimetres.rig.cameras.resize(1);
  EXPECT_THAT(unit_mistake(in_millimetres), HasSubstr("the nearest camera stands "));
}

// A unit that is not so far off may be meant.
TEST_F(ServiceConfigFile, WarnsOfABallThatIsTooSmallToBeSeen) {
  ServiceConfig far = load(ball);
  for (auto& camera : far.rig.cameras) camera.cam_from_world.translation *= 50;
  EXPECT_THAT(unit_mistake(far), IsEmpty());
  EXPECT_THAT(warnings_of(far), testing::Contains(HasSubstr("not in metres?")));
}

TEST(VolumeCoverage, IsWholeWhereTheWholeVolumeIsSeen) {
  // A box of 20 cm, 2 m before a camera that looks along z, and behind the other.
  calib::CameraRig rig;
  for (const double sign : {1.0, -1.0}) {
    calib::Camera camera;
    camera.name = sign > 0 ? "sees" : "turned_away";
    camera.image_size = {640, 480};
    camera.model = calib::CameraModel(calib::PinholeRadtan{.fx = 500, .fy = 500, .cx = 320, .cy = 240});
    if (sign < 0) camera.cam_from_world.rotation = Eigen::Quaterniond(0, 1, 0, 0);
    rig.cameras.push_back(camera);
  }
  const auto coverage = volume_coverage(rig, object_tracking::Volume{.min = {-0.1, -0.1, 1.9}, .max = {0.1, 0.1, 2.1}});
  ASSERT_EQ(coverage.per_camera.size(), 2u);
  EXPECT_NEAR(coverage.per_camera[0], 1, 1e-9);
  EXPECT_EQ(coverage.per_camera[1], 0);
  EXPECT_NEAR(coverage.by_one, 1, 1e-9);
  EXPECT_EQ(coverage.by_two, 0);
}

// ---------------------------------------------------------------------------------------------------------------------

// The keys with their values, in order: "dds.domain: auto". Of YAML in block style, without its comments.
std::vector<std::string> keys_and_values(std::istream& yaml) {
  std::vector<std::string> out, path;
  for (std::string line; std::getline(yaml, line);) {
    if (const auto comment = line.find('#'); comment != std::string::npos) line.erase(comment);
    line.erase(line.find_last_not_of(' ') + 1);
    const auto indent = line.find_first_not_of(' ');
    if (indent == std::string::npos) continue;
    const auto colon = line.find(':');
    path.resize(indent / 2);
    path.push_back(line.substr(indent, colon - indent));
    std::string joined;
    for (const auto& part : path) joined += (joined.empty() ? "" : ".") + part;
    out.push_back(joined + line.substr(colon));
  }
  return out;
}

// ---- camera_tracking

class CameraTrackingConfigTest : public testing::Test {
 protected:
  CameraTrackingConfigTest() : folder_(fs::path(testing::TempDir()) / ("camera_config_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
    write("rig.yaml",
          "version: 1\ncameras:\n  cam0:\n    image_size: [320, 240]\n    model: pinhole_radtan\n"
          "    intrinsics: {fx: 250, fy: 250, cx: 160, cy: 120}\n    distortion: [0, 0, 0, 0, 0]\n");
  }
  ~CameraTrackingConfigTest() override { fs::remove_all(folder_); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  ServiceConfig load(const std::string& tracking) const {
    write("c.yaml", "version: 1\nrig: rig.yaml\ncamera_tracking:\n" + tracking);
    return load_service_config(folder_ / "c.yaml");
  }
  std::string mistake(const std::string& tracking) const {
    try {
      load(tracking);
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "no mistake";
  }
  fs::path folder_;
};

TEST_F(CameraTrackingConfigTest, StartsAreReadFromFilesAndInline) {
  write("rectangle.csv",
        "corner,name,X,Y,Z,u_frame0,v_frame0\n0,TL,-0.1,0.075,0,11,12\n1,TR,0.1,0.075,0,21,22\n"
        "2,BR,0.1,-0.075,0,31,32\n3,BL,-0.1,-0.075,0,41,42\n");
  const ServiceConfig config = load("  camera: cam0\n  seed: 7\n  start: {rectangle: rectangle.csv}\n");
  EXPECT_TRUE(config.targets.empty());
  EXPECT_EQ(config.dds.publisher.tracked_camera, "cam0");
  const auto options = tracker_options(config.camera_tracking);
  EXPECT_EQ(options.seed, 7u);
  const auto& rectangle = std::get<camera_tracking::RectangleStart>(options.start);
  EXPECT_EQ(rectangle.corners[1], Eigen::Vector3d(0.1, 0.075, 0));
  EXPECT_EQ(rectangle.pixels[3], Eigen::Vector2d(41, 42));
  // What is printed loads back to the same, and needs no file.
  write("again.yaml", to_yaml(config));
  fs::remove(folder_ / "rectangle.csv");
  EXPECT_EQ(to_yaml(load_service_config(folder_ / "again.yaml")), to_yaml(config));

  write("leds.csv", "led,X,Y,Z\n0,0,0,0\n1,1,0,0\n2,0,1,0\n3,0,0,1\n");
  write("frames.csv", "frame,t,led,u,v\n0,0,2,1,1\n1,0.1,0,1,1\n2,0.2,1,1,1\n3,0.3,3,1,1\n4,0.4,-1,0,0\n");
  const auto leds = std::get<camera_tracking::LedStart>(
      tracker_options(
          load("  camera: cam0\n  start: {leds: leds.csv, led_schedule: frames.csv, led_room_max: [2, 2, 2]}\n")
              .camera_tracking)
          .start);
  EXPECT_EQ(leds.leds.size(), 4u);
  EXPECT_EQ(leds.schedule, (std::vector<int>{2, 0, 1, 3, -1}));
  EXPECT_EQ(leds.room_max, Eigen::Vector3d(2, 2, 2));

  const auto points = std::get<camera_tracking::PointsStart>(
      tracker_options(load("  camera: cam0\n  start: {points: [[0, 0, 0, 1, 2], [1, 0, 0, 3, 4], "
                           "[0, 1, 0, 5, 6], [1, 1, 0, 7, 8]]}\n")
                          .camera_tracking)
          .start);
  EXPECT_EQ(points.pixels[2], Eigen::Vector2d(5, 6));
}

TEST_F(CameraTrackingConfigTest, MistakesAreNamed) {
  using testing::HasSubstr;
  const std::string leds = "  start: {leds: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]}\n";
  EXPECT_THAT(
      mistake("  camera: cam1\n" + leds),
      HasSubstr(
          "c.yaml:4: camera_tracking.camera: cam1 is not a camera of the rig, which has cam0 (did you mean cam0?)"));
  EXPECT_THAT(mistake(leds), HasSubstr("camera_tracking.camera: is not given"));
  EXPECT_THAT(mistake("  camera: cam0\n"), HasSubstr("exactly one of rectangle, points, board and leds must be given "
                                                     "(with load_map none is needed), and there are 0"));
  EXPECT_THAT(mistake("  camera: cam0\n  methd: lee\n" + leds),
              HasSubstr("c.yaml:5: camera_tracking.methd is not a known key (did you mean method?)"));
  EXPECT_THAT(mistake("  camera: cam0\n  start: {leds: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}\n"),
              HasSubstr("at least 4 LEDs are needed, not 3"));
  EXPECT_THAT(mistake("  camera: cam0\n  method: lee\n" + leds),
              HasSubstr("LEDs are for the methods huetrack and herranz"));
  EXPECT_THAT(mistake("  camera: cam0\n  start: {leds: no.csv}\n"), HasSubstr("there is no file"));
  EXPECT_THAT(mistake("  camera: cam0\n  start: {points: [[0, 0, 0]]}\n"),
              HasSubstr("c.yaml:5: camera_tracking.start.points"));
  write("bad.csv", "X,Y,Z\n0,0,0\n1,zero,0\n");
  EXPECT_THAT(mistake("  camera: cam0\n  start: {leds: bad.csv}\n"),
              HasSubstr("bad.csv:3: Y must be a number, got \"zero\""));
  write("bad.csv", "X,Y\n0,0\n");
  EXPECT_THAT(mistake("  camera: cam0\n  start: {leds: bad.csv}\n"),
              HasSubstr("bad.csv:1: the header has no column Z"));
}

TEST_F(CameraTrackingConfigTest, PixelsOutsideTheImageAndPointsThatAreThereTwiceAreNamed) {
  using testing::HasSubstr;
  write("outside.csv", "X,Y,Z,u,v\n0,0,0,1,2\n\n1,0,0,3,4\n0,1,0,319.6,6\n1,1,0,7,8\n");
  EXPECT_THAT(mistake("  camera: cam0\n  start: {points: outside.csv}\n"),
              HasSubstr("outside.csv:5: row 3: the pixel (319.6, 6) is outside the image of cam0, which is 320x240"));
  write("twice.csv", "X,Y,Z,u,v\n0,0,0,1,2\n1,0,0,3,4\n0,1,0,319,6\n1,0,0,7,8\n");
  EXPECT_THAT(mistake("  camera: cam0\n  start: {points: twice.csv}\n"),
              HasSubstr("twice.csv:5: row 4: the point (1, 0, 0) is repeated, it is in row 2 too"));
  EXPECT_THAT(mistake("  camera: cam0\n  start:\n    rectangle: [[0, 0, 0, 1, 2], [1, 0, 0, 3, 4], "
                      "[1, 1, 0, 5, -6], [0, 1, 0, 7, 8]]\n"),
              HasSubstr("c.yaml:6: camera_tracking.start.rectangle: row 3: the pixel (5, -6) is outside the image"));
}

TEST_F(CameraTrackingConfigTest, WithAMapNoStartIsNeeded) {
  write("m.map", "");
  const ServiceConfig config = load("  camera: cam0\n  load_map: m.map\n");
  write("again.yaml", to_yaml(config));
  EXPECT_EQ(to_yaml(load_service_config(folder_ / "again.yaml")), to_yaml(config));
  const auto options = tracker_options(config.camera_tracking);
  EXPECT_EQ(std::get<camera_tracking::FoundStart>(options.start).find(capture::Image{}),
            std::nullopt);  // there is nothing to be found
  EXPECT_THAT(mistake("  camera: cam0\n  load_map: m.map\n  method: herranz\n"), testing::HasSubstr("needs LEDs"));
}

TEST(ReferenceConfig, HasEveryKeyWithItsDefaultInTheOrderOfCheck) {
  const fs::path file = configs / "huetrackd.yaml";
  const ServiceConfig reference = load_service_config(file);

  // All as by default but for what has no default.
  ServiceConfig defaults;
  defaults.file = reference.file;
  defaults.rig_file = reference.rig_file;
  object_tracking::TargetOptions target;
  target.name = reference.targets.at(0).name;
  target.color.hue_min_deg = reference.targets[0].color.hue_min_deg;
  target.color.hue_max_deg = reference.targets[0].color.hue_max_deg;
  defaults.targets = {target};
  for (const auto& camera : reference.cameras) {
    LiveCameraConfig live;
    live.name = camera.name;
    live.device = camera.device;
    defaults.cameras.push_back(live);
  }
  EXPECT_FALSE(defaults.cameras.empty());
  EXPECT_EQ(to_yaml(reference), to_yaml(defaults));

  std::ifstream written(file);
  std::istringstream printed(to_yaml(reference));
  auto in_file = keys_and_values(written), in_print = keys_and_values(printed);
  ASSERT_GE(in_file.size(), 2u);
  EXPECT_EQ(in_file[1], "rig: demo/recording/rig.yaml");  // relative in the file, absolute in the print
  in_file[1] = in_print.at(1);
  EXPECT_EQ(in_file, in_print);
}

TEST_F(ServiceConfigFile, AVideoIsNoConfiguration) {
  try {
    load_service_config(configs / "demo/recording/cam0.mkv");
    FAIL();
  } catch (const files::ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr("cam0.mkv: is a video, a picture or a bag, not a configuration"));
  }
}

// Where somebody begins: the cameras alone.
TEST_F(ServiceConfigFile, CamerasMayNotBeCalibratedYet) {
  const std::string begun =
      "version: 1\nrig: none\ncameras: {left: {device: 0}, right: {device: 1, size: [320, 240]}}\ntargets: {ball: "
      "{}}\n";
  const ServiceConfig config = load(begun);
  EXPECT_FALSE(config.is_calibrated());
  ASSERT_EQ(config.rig.cameras.size(), 2u);
  EXPECT_EQ(config.rig.cameras[0].name, "left");
  EXPECT_EQ(config.rig.cameras[0].image_size, (calib::ImageSize{640, 480}));
  EXPECT_EQ(config.rig.cameras[1].image_size, (calib::ImageSize{320, 240}));
  EXPECT_THAT(warnings_of(config), testing::ElementsAre(HasSubstr("not calibrated")));
  EXPECT_THROW(require_rig(config), files::ConfigError);
  EXPECT_NO_THROW(require_rig(load(ball)));
  EXPECT_EQ(to_yaml(load(to_yaml(config))), to_yaml(config));
  // What they see is recorded all the same, to be calibrated from.
  EXPECT_EQ(load(begun + "record: {folder: r, pre_roll_s: 60}\n").record.pre_roll_s, 60);
}

// Who may teach may add the first one.
TEST_F(ServiceConfigFile, TargetsMayBeAddedLater) {
  const ServiceConfig config = load(head + "control: {allow_teach: true}\n");
  EXPECT_TRUE(config.targets.empty());
  EXPECT_EQ(to_yaml(load(to_yaml(config))), to_yaml(config));
}

TEST_F(ServiceConfigFile, ATargetMayHaveNoColorYet) {
  const std::string begun = head + "targets: {ball: {radius_m: 0.04}}\n";
  const ServiceConfig config = load(begun);
  EXPECT_FALSE(is_taught(config.targets[0]));
  EXPECT_TRUE(is_taught(load(ball).targets[0]));
  EXPECT_THAT(warnings_of(config), testing::Contains(HasSubstr("target ball has no colour yet")));
  EXPECT_THAT(warnings_of(load(ball)), testing::Not(testing::Contains(HasSubstr("no colour yet"))));
  EXPECT_EQ(to_yaml(load(to_yaml(config))), to_yaml(config));
  // What one camera says is taught, and does not begin with what matches nothing.
  const ServiceConfig one = load(head + "targets: {ball: {camera_colors: {cam0: {hue_deg: [65, 115]}}}}\n");
  EXPECT_TRUE(is_taught(one.targets[0]));
  EXPECT_EQ(one.targets[0].color_in("cam0").saturation_max, 1);
  EXPECT_LT(one.targets[0].color_in("cam0").saturation_min, 0.5);
}

TEST(UntaughtColor, MatchesNoPixel) {
  EXPECT_TRUE(untaught_color.problems().empty());
  for (int r = 0; r < 256; r += 3)
    for (int g = 0; g < 256; g += 3)
      for (int b = 0; b < 256; b += 3)
        ASSERT_FALSE(color::contains(untaught_color, color::hsi_of({r / 255.0, g / 255.0, b / 255.0})))
            << r << " " << g << " " << b;
}

std::vector<fs::path> yaml_files_in(const fs::path& folder, const std::string& part_of_name) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    const bool is_taught = name.ends_with(".taught.yaml");  // somebody has tried it here: no configuration by itself
    if (entry.path().extension() == ".yaml" && !is_taught && name.find(part_of_name) != std::string::npos)
      files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

class ShippedConfig : public testing::TestWithParam<fs::path> {};

TEST_P(ShippedConfig, LoadsWithoutErrorsAndWarnings) {
  ServiceConfig config;
  ASSERT_NO_THROW(config = load_service_config(GetParam()));
  EXPECT_THAT(warnings_of(config), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(All, ShippedConfig, testing::ValuesIn(yaml_files_in(configs, "huetrackd")));

}  // namespace
}  // namespace huetrack::config
