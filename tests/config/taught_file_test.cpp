#include "config/taught_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/fsuid.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <sstream>

#include "calib/files/config_error.h"
#include "config/service_config.h"

namespace huetrack::config {
namespace {

using namespace testing;
namespace fs = std::filesystem;
using color::HsiRange;
using object_tracking::IgnoredRegions;
using object_tracking::TargetOptions;

class TaughtFile : public Test {
 protected:
  TaughtFile() {
    fs::remove_all(folder);
    fs::create_directories(folder);
    fs::copy(fs::path(HUETRACK_SOURCE_DIR) / "configs/demo/recording/rig.yaml", folder / "rig.yaml");
  }
  ~TaughtFile() override { fs::remove_all(folder); }
  ServiceConfig with(const std::string& yaml) {
    std::ofstream(file) << yaml;
    return load_service_config(file);
  }
  static std::string text(const fs::path& of) {
    std::ostringstream out;
    out << std::ifstream(of).rdbuf();
    return out.str();
  }
  // The taught file from `version` on.
  std::string said() const { return text(taught).substr(text(taught).find("version:")); }
  // The message without the folder's name.
  std::string error(const std::string& yaml, const std::string& taught_yaml) {
    std::ofstream(taught) << taught_yaml;
    try {
      with(yaml);
    } catch (const files::ConfigError& e) {
      std::string message = e.what();
      for (std::size_t at; (at = message.find(folder.string() + "/")) != std::string::npos;)
        message.erase(at, folder.string().size() + 1);
      return message;
    }
    return "no error";
  }
  std::ptrdiff_t files() const { return std::distance(fs::directory_iterator(folder), {}); }

  const fs::path folder = fs::weakly_canonical(TempDir()) /
                          (std::string("taught_file_") + UnitTest::GetInstance()->current_test_info()->name());
  const fs::path file = folder / "lab.yaml", taught = folder / "lab.taught.yaml";
};

const std::string taught_head = "version: 1\nrig: rig.yaml\n";
// Every form that a person may write it in: block and flow, comments, quotes, an anchor, Windows' line ends.
const std::string by_hand =
    taught_head +
    "# mine\n\ntargets:\n  # the green one\n  ball: &b          # on the stick\n    radius_m: 0.03   "
    "# measured\n    color:\n      saturation: [0.3, 1]\n      # by hand:\n      hue_deg: [65, "
    "115]   # was 60\n    camera_colors:\n      cam0: {hue_deg: [3, 4]}\r\n  'other': {\"color\": "
    "{hue_deg: [200,\n 220]}}\nthreads: 2 # two\nignore: {cam0: [1, 2, 3, 4]}\n# the end";

TEST_F(TaughtFile, LiesBesideTheConfiguration) {
  EXPECT_EQ(taught_file("/etc/huetrack/huetrackd.yaml"), "/etc/huetrack/huetrackd.taught.yaml");
  EXPECT_EQ(taught_file("/nowhere/a.b.yml"), "/nowhere/a.b.taught.yml");
  EXPECT_EQ(taught_file("/nowhere/plain"), "/nowhere/plain.taught");
  EXPECT_EQ(taught_file(file), taught);
}

TEST_F(TaughtFile, TheUsersOwnTextIsNotTouched) {
  const ServiceConfig config = with(by_hand);
  TargetOptions target = config.targets[0];
  target.color = {.hue_min_deg = 350, .hue_max_deg = 10, .saturation_min = 0.25};
  target.camera_colors = {{"cam1", {.hue_min_deg = 340, .hue_max_deg = 5}}};
  EXPECT_EQ(save_taught(file, target, IgnoredRegions{{"cam1", {{1, 2, 30, 40}}}}), taught);
  EXPECT_EQ(text(file), by_hand);
  EXPECT_EQ(load_service_config(file).targets[0].color, target.color);
}

TEST_F(TaughtFile, ASaveCanBeUndoneAndThatAgain) {
  const ServiceConfig config = with(by_hand);
  EXPECT_THROW(undo_taught(file), std::runtime_error);
  TargetOptions target = config.targets[0];
  target.color = {.hue_min_deg = 350, .hue_max_deg = 10, .saturation_min = 0.25};
  save_taught(file, target, {});
  const std::string first = text(taught);
  target.color.hue_max_deg = 20;
  save_taught(file, target, {});
  const std::string second = text(taught);
  ASSERT_NE(first, second);
  EXPECT_EQ(undo_taught(file), taught);
  EXPECT_EQ(text(taught), first);
  redo_taught(file);
  EXPECT_EQ(text(taught), second);
}

TEST_F(TaughtFile, ManySavesAreUndoneStepByStepAndDoneAgain) {
  const ServiceConfig config = with(by_hand);
  TargetOptions target = config.targets[0];
  const auto save = [&](double hue) {
    target.color = {.hue_min_deg = hue, .hue_max_deg = hue + 10};
    save_taught(file, target, {});
  };
  const auto hue = [&] { return load_service_config(file).targets[0].color.hue_min_deg; };
  const auto history = [&] { return std::pair(taught_history(file).undoable, taught_history(file).redoable); };
  EXPECT_EQ(history(), std::pair(0, 0));
  EXPECT_THROW(redo_taught(file), std::runtime_error);
  for (const double h : {10, 20, 30, 40}) save(h);
  EXPECT_EQ(history(), std::pair(4, 0));
  for (const double h : {30, 20, 10}) {
    undo_taught(file);
    EXPECT_EQ(hue(), h);
  }
  EXPECT_EQ(history(), std::pair(1, 3));
  undo_taught(file);
  EXPECT_FALSE(fs::exists(taught));
  EXPECT_THROW(undo_taught(file), std::runtime_error);
  for (const double h : {10, 20, 30}) {
    redo_taught(file);
    EXPECT_EQ(hue(), h);
  }
  // What was undone is gone with the next save; what is before it is not.
  save(50);
  EXPECT_EQ(history(), std::pair(4, 0));
  undo_taught(file);
  EXPECT_EQ(hue(), 30);
  redo_taught(file);
  EXPECT_EQ(hue(), 50);
  for (int i = 0; i < 40; ++i) save(100 + i);  // no more than twenty are kept
  EXPECT_EQ(history(), std::pair(21, 0));
  for (int i = 0; i < 20; ++i) undo_taught(file);
  EXPECT_EQ(hue(), 119);
}

TEST_F(TaughtFile, TheHistoryNamesTheNextChange) {
  const ServiceConfig config = with(by_hand);
  EXPECT_EQ(taught_history(file).undoes, "");
  save_taught(file, config.targets[0], {});
  save_target(file, {.target = "ball", .radius_m = 0.05});
  EXPECT_EQ(taught_history(file).undoes, "radius of ball");
  save_ignored(file, {});
  EXPECT_EQ(taught_history(file).undoes, "ignored rectangles");
  undo_taught(file);
  undo_taught(file);
  EXPECT_EQ(taught_history(file).undoes, "colour of ball");
  EXPECT_EQ(taught_history(file).redoes, "radius of ball");
  std::ofstream(taught) << "version: 1\n";  // by hand
  EXPECT_EQ(taught_history(file).undoes, "");
}

TEST_F(TaughtFile, TargetsAreChangedByHand) {
  with(by_hand);
  save_target(file, {.target = "ball", .radius_m = 0.05, .hue_deg = std::pair(340.0, 20.0)});
  ServiceConfig after = load_service_config(file);
  EXPECT_EQ(after.targets[0].radius_m, 0.05);
  EXPECT_EQ(after.targets[0].color, (HsiRange{.hue_min_deg = 340, .hue_max_deg = 20, .saturation_min = 0.3}));
  EXPECT_THAT(after.targets[0].camera_colors, IsEmpty());  // of all cameras
  save_target(file, {.target = "ball", .intensity = std::pair(0.2, 0.8), .camera = "cam1"});
  after = load_service_config(file);
  EXPECT_EQ(after.targets[0].color.intensity_min, 0.1);
  EXPECT_EQ(after.targets[0].color_in("cam1"),
            (HsiRange{.hue_min_deg = 340, .hue_max_deg = 20, .intensity_min = 0.2, .intensity_max = 0.8}));
  EXPECT_EQ(after.targets[0].color_in("cam0"), after.targets[0].color);
  // Each value says where it comes from.
  EXPECT_THAT(to_yaml_with_origins(after), ContainsRegex("radius_m: 0.05 +# from lab.taught.yaml"));
  const std::string before = text(taught);
  const auto refused = [&](const TargetEdit& edit) {
    try {
      save_target(file, edit);
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string("saved");
  };
  EXPECT_THAT(refused({.target = "none", .radius_m = 0.1}), HasSubstr("there is no target none"));
  EXPECT_THAT(refused({.target = "ball", .hue_deg = std::pair(1.0, 2.0), .camera = "none"}),
              HasSubstr("no camera none"));
  EXPECT_THAT(refused({.target = "ball", .radius_m = -1}), HasSubstr("radius_m"));
  EXPECT_THAT(refused({.target = "ball", .hue_deg = std::pair(1.0, 400.0)}), HasSubstr("from 0 to 360"));
  EXPECT_THAT(refused({.target = "ball", .saturation = std::pair(0.9, 0.1)}), HasSubstr("saturation must be"));
  EXPECT_EQ(text(taught), before);
}

std::vector<std::string> assumed_in(const ServiceConfig& config) {
  std::vector<std::string> names;
  for (const auto& target : config.targets)
    if (target.is_radius_assumed) names.push_back(target.name);
  return names;
}

TEST_F(TaughtFile, ARadiusThatNobodySaidIsTaughtWithTheColour) {
  with(by_hand);
  add_target(file, {.target = "wand"});
  ServiceConfig config = load_service_config(file);
  EXPECT_THAT(assumed_in(config), ElementsAre("other", "wand"));
  EXPECT_THAT(text(taught), Not(HasSubstr("radius_m")));
  rename_target(file, "wand", "stick");
  EXPECT_THAT(assumed_in(load_service_config(file)), ElementsAre("other", "stick"));

  TargetOptions stick = load_service_config(file).targets.back();
  stick.color = {.hue_min_deg = 20, .hue_max_deg = 40};
  EXPECT_FALSE(stick.is_hue_taught);
  save_taught(file, stick, {});
  EXPECT_TRUE(load_service_config(file).targets.back().is_hue_taught);
  EXPECT_THAT(assumed_in(load_service_config(file)), ElementsAre("other", "stick"));
  save_taught(file, stick, {}, 0.037249);
  config = load_service_config(file);
  EXPECT_THAT(assumed_in(config), ElementsAre("other"));
  EXPECT_EQ(config.targets.back().radius_m, 0.0372);
  EXPECT_THAT(to_yaml_with_origins(config), ContainsRegex("radius_m: 0.0372 *#.*taught"));
  undo_taught(file);
  EXPECT_THAT(assumed_in(load_service_config(file)), ElementsAre("other", "stick"));
}

TEST_F(TaughtFile, TargetsAreAddedRenamedAndRemoved) {
  with(by_hand);
  add_target(file, {.target = "wand", .radius_m = 0.02});
  const auto names = [&] {
    std::vector<std::string> all;
    for (const auto& target : load_service_config(file).targets) all.push_back(target.name);
    return all;
  };
  EXPECT_THAT(names(), ElementsAre("ball", "other", "wand"));
  EXPECT_FALSE(is_taught(load_service_config(file).targets[2]));
  EXPECT_EQ(load_service_config(file).targets[2].radius_m, 0.02);
  save_target(file, {.target = "wand", .hue_deg = std::pair(200.0, 210.0)});
  EXPECT_TRUE(is_taught(load_service_config(file).targets[2]));

  // With all that was said of it, whoever said it.
  const TargetOptions ball = load_service_config(file).targets[0];
  rename_target(file, "ball", "disc");
  EXPECT_THAT(names(), ElementsAre("other", "wand", "disc"));
  const TargetOptions disc = load_service_config(file).targets[2];
  EXPECT_EQ(disc.color, ball.color);
  EXPECT_EQ(disc.camera_colors, ball.camera_colors);
  EXPECT_EQ(disc.radius_m, ball.radius_m);
  rename_target(file, "wand", "stick");
  EXPECT_THAT(names(), ElementsAre("other", "disc", "stick"));
  rename_target(file, "disc", "ball");  // and back again
  EXPECT_THAT(names(), UnorderedElementsAre("other", "stick", "ball"));
  remove_target(file, "other");
  remove_target(file, "stick");
  EXPECT_THAT(names(), ElementsAre("ball"));
  const std::string before = text(taught);
  EXPECT_THROW(remove_target(file, "ball"), std::runtime_error);  // there must be one
  for (const std::string name : {"", "a b", "ball", "a__b", "1a", "../x", "a\nb", "\xff"})
    EXPECT_THROW(add_target(file, {.target = name}), std::runtime_error) << name;
  EXPECT_THROW(rename_target(file, "none", "x"), std::runtime_error);
  EXPECT_EQ(text(taught), before);
  for (int i = 0; i < 4; ++i) undo_taught(file);
  EXPECT_THAT(names(), ElementsAre("other", "wand", "disc"));
}

TEST_F(TaughtFile, TheFirstSaveIsUndoneToNothing) {
  const ServiceConfig config = with(by_hand);
  save_taught(file, config.targets[0], {});
  undo_taught(file);
  EXPECT_FALSE(fs::exists(taught));
  EXPECT_EQ(load_service_config(file).targets[0].color, config.targets[0].color);
  redo_taught(file);
  EXPECT_TRUE(fs::exists(taught));
}

// What was undone, or deleted by hand, is not what was there before the save that follows.
TEST_F(TaughtFile, ASaveAfterNothingIsUndoneToNothing) {
  const ServiceConfig config = with(by_hand);
  TargetOptions target = config.targets[0];
  target.color = {.hue_min_deg = 350, .hue_max_deg = 10};
  save_taught(file, target, {});
  undo_taught(file);
  target.color.hue_max_deg = 20;
  save_taught(file, target, {});
  undo_taught(file);
  EXPECT_FALSE(fs::exists(taught));
  redo_taught(file);
  EXPECT_EQ(load_service_config(file).targets[0].color.hue_max_deg, 20);
}

TEST_F(TaughtFile, HoldsColoursAndRectanglesAndIsReadOverTheConfiguration) {
  const ServiceConfig config = with(by_hand);
  ::chmod(file.c_str(), 0640);
  TargetOptions target = config.targets[0];
  target.color = {.hue_min_deg = 350, .hue_max_deg = 10, .saturation_min = 0.25};
  target.camera_colors = {{"cam1", {.hue_min_deg = 340, .hue_max_deg = 5}}};
  const IgnoredRegions ignored = {{"cam1", {{1, 2, 30, 40}, {5, 6, 7, 8}}}};
  save_taught(file, target, ignored);
  EXPECT_THAT(text(taught), StartsWith("# What huetrackd was taught. It replaces the values of lab.yaml "));
  EXPECT_EQ(said(),
            "version: 1\ntargets:\n  ball:\n    color:\n      hue_deg: [350, 10]\n      saturation: [0.25, 1]\n"
            "      intensity: [0.1, 0.95]\n    camera_colors:\n      cam1:\n        hue_deg: [340, 5]\n"
            "        saturation: [0.3, 1]\n        intensity: [0.1, 0.95]\n      cam0: null\n"
            "ignore:\n  cam1: [1, 2, 30, 40, 5, 6, 7, 8]\n  cam0: null\n");
  const ServiceConfig after = load_service_config(file);
  EXPECT_EQ(after.targets[0].color, target.color);
  EXPECT_EQ(after.targets[0].camera_colors, target.camera_colors);
  EXPECT_EQ(after.targets[0].radius_m, 0.03);  // the configuration's
  EXPECT_EQ(after.targets[1].color, config.targets[1].color);
  EXPECT_EQ(after.ignored, ignored);
  EXPECT_EQ(after.targets[1].ignored, ignored);
  EXPECT_EQ(after.threads, 2);
  EXPECT_NE(config_identity(after), config_identity(config));
  EXPECT_THAT(differing_keys(config, after), ElementsAre("targets", "ignore"));
  struct stat rights {};
  ::stat(taught.c_str(), &rights);
  EXPECT_EQ(rights.st_mode & 0777, 0640u);  // the configuration's
  EXPECT_EQ(files(), 3);                    // nothing is left beside them

  // Its own rights from then on.
  ::chmod(taught.c_str(), 0604);
  save_ignored(file, {});
  EXPECT_THAT(load_service_config(file).ignored, IsEmpty());
  EXPECT_EQ(load_service_config(file).targets[0].color, target.color);
  ::stat(taught.c_str(), &rights);
  EXPECT_EQ(rights.st_mode & 0777, 0604u);

  // Whoever deletes it has the configuration alone again.
  fs::remove(taught);
  EXPECT_EQ(config_identity(load_service_config(file)), config_identity(config));
}

TEST_F(TaughtFile, ASecondTeachOfATargetReplacesTheFirst) {
  const std::string yaml =
      taught_head + "targets:\n  a: {color: {hue_deg: [1, 2]}}\n  b: {color: {hue_deg: [200, 220]}}\n";
  TargetOptions a = with(yaml).targets[0], b = with(yaml).targets[1];
  a.color.hue_min_deg = 350;
  a.camera_colors = {{"cam0", {.hue_min_deg = 340, .hue_max_deg = 5}},
                     {"cam1", {.hue_min_deg = 350, .hue_max_deg = 2}}};
  save_taught(file, a, {});
  b.color.hue_max_deg = 230;
  save_taught(file, b, {});  // what the other target was taught stays
  EXPECT_EQ(load_service_config(file).targets[0].camera_colors, a.camera_colors);

  a.color = {.hue_min_deg = 10, .hue_max_deg = 20};
  a.camera_colors.clear();
  save_taught(file, a, {});
  const ServiceConfig after = load_service_config(file);
  EXPECT_EQ(after.targets[0].color, a.color);
  EXPECT_THAT(after.targets[0].camera_colors, IsEmpty());
  EXPECT_EQ(after.targets[1].color, b.color);
  EXPECT_THAT(said(),
              Not(HasSubstr("camera_colors")));  // nothing has to be taken away that the configuration never said

  save_ignored(file, {{"cam0", {{1, 2, 3, 4}}}});
  save_ignored(file, {{"cam1", {{5, 6, 7, 8}}}});
  EXPECT_EQ(load_service_config(file).ignored, (IgnoredRegions{{"cam1", {{5, 6, 7, 8}}}}));
  EXPECT_EQ(load_service_config(file).targets[0].color, a.color);
}

TEST_F(TaughtFile, CamerasThatWereNotTaughtStayTheConfigurations) {
  const ServiceConfig config = with(taught_head +
                                    "targets:\n  ball:\n    color: {hue_deg: [1, 2], saturation: [0.4, 1]}\n"
                                    "    camera_colors:\n      cam1: {hue_deg: [3, 4]}  # by hand\n");
  TargetOptions target = config.targets[0];
  const HsiRange by_hand_in_cam1 = target.color_in("cam1");
  target.color = {.hue_min_deg = 7, .hue_max_deg = 8, .saturation_min = 0.5};
  save_taught(file, target, {});
  // Its hue is said there, and may be changed there. The rest was the target's, which is another one now.
  EXPECT_EQ(load_service_config(file).targets[0].color_in("cam1"), by_hand_in_cam1);
  EXPECT_THAT(said(), HasSubstr("    camera_colors:\n      cam1:\n        saturation: [0.4, 1]\n"));
  EXPECT_THAT(said(), Not(HasSubstr("hue_deg: [3, 4]")));
  with(taught_head + "targets: {ball: {color: {hue_deg: [1, 2]}, camera_colors: {cam1: {hue_deg: [5, 6]}}}}\n");
  EXPECT_EQ(load_service_config(file).targets[0].color_in("cam1").hue_min_deg, 5);
  EXPECT_EQ(load_service_config(file).targets[0].color_in("cam1").saturation_min, 0.4);

  // Of a camera whose colour was taken away, and is taught again, nothing old comes back.
  target.camera_colors.clear();
  save_taught(file, target, {});
  EXPECT_THAT(load_service_config(file).targets[0].camera_colors, IsEmpty());
  target.camera_colors = {{"cam1", HsiRange{.hue_min_deg = 5, .hue_max_deg = 6}}};
  save_taught(file, target, {});
  EXPECT_EQ(load_service_config(file).targets[0].camera_colors, target.camera_colors);

  // Cameras that say nothing but their names.
  with(taught_head + "targets: {ball: {color: {hue_deg: [1, 2]}, camera_colors: {cam0: {}, cam1: {}}}}\n");
  target.camera_colors.clear();
  save_taught(file, target, {});
  EXPECT_THAT(load_service_config(file).targets[0].camera_colors, IsEmpty());
}

TEST_F(TaughtFile, CheckSaysWhatComesFromIt) {
  const ServiceConfig config =
      with(taught_head + "targets:\n  ball: {color: {hue_deg: [1, 2]}, camera_colors: {cam0: {hue_deg: [3, 4]}}}\n");
  // What the user wrote, what was taught, and what is the default can be told from one another.
  EXPECT_THAT(to_yaml_with_origins(config),
              AllOf(ContainsRegex("      hue_deg: .1, 2. +# from lab.yaml; .from, to.; "),
                    ContainsRegex("rig: .* # from lab.yaml; the calibrated cameras"),
                    HasSubstr("    radius_m: auto                          # of the ball")));
  TargetOptions target = config.targets[0];
  target.color.hue_min_deg = 0.5;
  target.camera_colors.clear();
  save_taught(file, target, {});
  const ServiceConfig after = load_service_config(file);
  const std::string printed = to_yaml_with_origins(after);
  EXPECT_THAT(printed, HasSubstr("      hue_deg: [0.5, 2]                     # from lab.taught.yaml; [from, to]; "));
  EXPECT_THAT(printed, HasSubstr("    camera_colors: {} "));
  EXPECT_THAT(printed, HasSubstr("\n      # without cam0: from lab.taught.yaml\n"));
  EXPECT_THAT(printed, HasSubstr("    radius_m: auto                          # of the ball"));  // the default
  // The values are the same, and load back by themselves; where they come from is no part of them.
  EXPECT_EQ(to_yaml(after).find("lab.taught"), std::string::npos);
  fs::create_directory(folder / "elsewhere");
  std::ofstream(folder / "elsewhere/lab.yaml") << printed;
  EXPECT_EQ(config_identity(load_service_config(folder / "elsewhere/lab.yaml")), config_identity(after));
  // A recording holds the values in force.
  fs::copy(folder / "rig.yaml", folder / "elsewhere/rig.yaml");
  std::ofstream(folder / "elsewhere/lab.yaml") << to_portable_yaml(after);
  EXPECT_EQ(config_identity(load_service_config(folder / "elsewhere/lab.yaml")), config_identity(after));
  EXPECT_THAT(load_service_config(folder / "elsewhere/lab.yaml").taught.given, IsEmpty());
}

// Any key may stand in it, as in the configuration: a later program may write others, and a person may.
TEST_F(TaughtFile, AnyKeyMayStandInIt) {
  std::ofstream(taught)
      << "version: 1\ntargets: {ball: {radius_m: 0.05}}\ncameras: {cam0: {controls: {gain: 9, hue: null}}}\n"
         "threads: 3\nrecord: {folder: out}\nlog_level: null\ndds: {}\nmetrics: null\n";
  const ServiceConfig config = with(taught_head +
                                    "targets: {ball: {radius_m: 0.04, color: {hue_deg: [1, 2]}}}\nlog_level: debug\n"
                                    "cameras: {cam0: {device: 0, controls: {exposure: 5, gain: 1, hue: 2}}}\n");
  EXPECT_EQ(config.targets[0].radius_m, 0.05);
  EXPECT_EQ(config.targets[0].color.hue_max_deg, 2);
  ASSERT_EQ(config.cameras[0].controls.size(), 2u);
  EXPECT_EQ(config.cameras[0].controls[0].name, "exposure");
  EXPECT_EQ(config.cameras[0].controls[1].value, capture::ControlValue(std::int64_t{9}));
  EXPECT_EQ(config.threads, 3);
  EXPECT_EQ(config.record.folder, folder / "out");
  EXPECT_EQ(config.log_level, LogLevel::info);
  // All of it stays when something is taught.
  TargetOptions target = config.targets[0];
  target.color.hue_max_deg = 20;
  save_taught(file, target, {});
  const ServiceConfig after = load_service_config(file);
  EXPECT_EQ(after.targets[0].color.hue_max_deg, 20);
  EXPECT_THAT(differing_keys(config, after), ElementsAre("targets"));
  EXPECT_THAT(said(), AllOf(HasSubstr("threads: 3\n"), HasSubstr("log_level: null\n"), HasSubstr("hue: null\n"),
                            HasSubstr("dds: {}\n"), HasSubstr("metrics: null\n")));
}

TEST_F(TaughtFile, MistakesInItAreNamedWithFileAndLine) {
  const std::string yaml = taught_head + "targets:\n  ball: {color: {hue_deg: [1, 2]}}\n";
  const std::string v = "version: 1\n";
  EXPECT_EQ(error(yaml, v), "no error");
  EXPECT_EQ(error(yaml, v + "thraeds: 2\n"), "lab.taught.yaml:2: thraeds is not a known key (did you mean threads?)");
  EXPECT_EQ(error(yaml, v + "thraeds: null\n"),
            "lab.taught.yaml:2: thraeds is not a known key (did you mean threads?)");
  EXPECT_EQ(error(yaml, v + "targets:\n  ball:\n    colour: {hue_deg: [1, 2]}\n"),
            "lab.taught.yaml:4: targets.ball.colour is not a known key (did you mean color?)");
  EXPECT_EQ(error(yaml, v + "targets:\n  ball:\n    color:\n      hue_deg: [1,\n        370]\n"),
            "lab.taught.yaml:5: targets.ball.color.hue_deg: must be from 0 to 360, got [1, 370]: write [1, 10], the "
            "same on the circle");
  EXPECT_EQ(error(yaml, v + "targets: {ball: {color: {saturation: [0.9, 0.3]}}}\n"),
            "lab.yaml:4: targets.ball.color: saturation must be a range min <= max within 0..1 (lab.taught.yaml:2 is "
            "read over it)");
  EXPECT_EQ(error(yaml, v + "ignore: {cma0: [1, 2, 3, 4]}\n"),
            "lab.taught.yaml:2: ignore.cma0: is not a camera of the rig, which has cam0, cam1 (did you mean cam0?)");
  EXPECT_THAT(error(yaml, "threads: 2\n"), testing::StartsWith("lab.taught.yaml:1: version is missing"));
  EXPECT_THAT(error(yaml, "version: 2\n"), testing::StartsWith("lab.taught.yaml:1: version must be 1, got \"2\""));
  EXPECT_EQ(error(yaml, ""), "lab.taught.yaml: is empty");
  // A target that is gone or renamed.
  EXPECT_EQ(error(yaml, v + "targets:\n  bal:\n    color: {hue_deg: [3, 4]}\n"),
            "lab.taught.yaml:3: targets.bal: lab.yaml has no such target (did you mean ball?): rename it here too, or "
            "take it out of this file");
  // A mistake in the configuration is not hidden by what is read over it.
  EXPECT_EQ(error(yaml + "threads: many\n", v + "threads: 2\n"),
            "lab.yaml:5: threads must be a whole number, got \"many\"");
}

TEST_F(TaughtFile, AnotherRigTakesThePlaceOfThatOneOrOfNone) {
  fs::copy(folder / "rig.yaml", folder / "new.yaml");
  with("version: 1\nrig: rig.yaml\ntargets: {ball: {color: {hue_deg: [65, 115]}}}\n");
  save_rig(file, folder / "new.yaml");
  EXPECT_EQ(load_service_config(file).rig_file, folder / "new.yaml");
  undo_taught(file);
  EXPECT_EQ(load_service_config(file).rig_file, folder / "rig.yaml");
  with("version: 1\nrig: none\ncameras: {cam0: {device: 0}, cam1: {device: 1}}\ntargets: {ball: {}}\n");
  save_rig(file, folder / "new.yaml");
  const ServiceConfig begun = load_service_config(file);
  EXPECT_TRUE(begun.is_calibrated());
  // Targets are looked for where two cameras see: the demo's look at (0, 0, 1).
  EXPECT_GT(volume_coverage(begun.rig, begun.object_tracking.volume).by_two, 0.15);
  EXPECT_LT(begun.object_tracking.volume.min.z(), 0.7);
  EXPECT_GT(begun.object_tracking.volume.max.z(), 1.3);
  EXPECT_GT(begun.object_tracking.volume.max.x(), 0.3);
  fs::remove(taught);
  with(
      "version: 1\nrig: none\ncameras: {cam0: {device: 0}, cam1: {device: 1}}\ntargets: {ball: {}}\n"
      "object_tracking: {volume: {min: [-2, -2, 0], max: [1, 1, 2]}}\n");
  save_rig(file, folder / "new.yaml");
  EXPECT_EQ(load_service_config(file).object_tracking.volume.min.x(), -2) << "somebody has thought of it";
  fs::remove(taught);
  // One that does not hold with the cameras is refused, and nothing has changed.
  with("version: 1\nrig: none\ncameras: {cam0: {device: 0}, other: {device: 1}}\ntargets: {ball: {}}\n");
  fs::remove(taught);
  EXPECT_THROW(save_rig(file, folder / "new.yaml"), std::runtime_error);
  EXPECT_FALSE(fs::exists(taught));
}

TEST_F(TaughtFile, FollowsALinkToTheConfiguration) {
  const ServiceConfig config = with(taught_head + "targets:\n  ball:\n    color: {hue_deg: [1, 2]}\n");
  fs::create_directory(folder / "links");
  fs::copy(folder / "rig.yaml", folder / "links/rig.yaml");
  const fs::path link = folder / "links/link.yaml";
  fs::create_symlink(file, link);
  TargetOptions target = config.targets[0];
  target.color.hue_max_deg = 77;
  EXPECT_EQ(save_taught(link, target, {}), taught);
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(load_service_config(file).targets[0].color.hue_max_deg, 77);
  EXPECT_EQ(load_service_config(link).targets[0].color.hue_max_deg, 77);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "links"), {}), 2);
}

TEST_F(TaughtFile, WhatCannotBeSaidIsNotWritten) {
  const ServiceConfig config = with(taught_head + "targets:\n  ball:\n    color: {hue_deg: [1, 2]}\n");
  save_ignored(file, {{"cam0", {{1, 2, 3, 4}}}});
  const std::string before = text(taught);
  const std::vector<color::PixelBox> too_many(101, {1, 2, 3, 4});
  EXPECT_THAT(
      [&] {
        save_ignored(file, {{"cam0", too_many}});
      },
      ThrowsMessage<std::runtime_error>(
          AllOf(StartsWith(taught.string() + " was not changed: "), HasSubstr("must be a list of 4 to 400 numbers"))));
  TargetOptions gone = config.targets[0];
  gone.name = "gone";
  EXPECT_THAT([&] { save_taught(file, gone, {}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("lab.yaml no longer has a target gone")));
  std::ofstream(file) << "version: 1\nrig: rig.yaml\ntargets: &t\n";  // somebody is writing it just now
  EXPECT_THAT([&] { save_ignored(file, {}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("lab.yaml:3: targets: is a group of names")));
  EXPECT_EQ(text(taught), before);
}

TEST_F(TaughtFile, AFullDiskLeavesTheOldFile) {
  const ServiceConfig config = with(taught_head + "targets:\n  ball:\n    color: {hue_deg: [1, 2]}\n");
  save_ignored(file, {{"cam0", {{1, 2, 3, 4}}}});
  const std::string before = text(taught);
  // A limit of file sizes stands for the full disk: some is written, then nothing.
  rlimit old{};
  ::getrlimit(RLIMIT_FSIZE, &old);
  const auto old_signal = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{.rlim_cur = 50, .rlim_max = old.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &small);
  std::string message;
  try {
    save_ignored(file, {});
  } catch (const std::runtime_error& error) {
    message = error.what();
  }
  ::setrlimit(RLIMIT_FSIZE, &old);
  std::signal(SIGXFSZ, old_signal);
  EXPECT_EQ(message, "cannot write " + taught.string() + ": File too large");
  EXPECT_EQ(text(taught), before);
  EXPECT_EQ(files(), 3);  // and nothing half written beside it
}

TEST_F(TaughtFile, AReadOnlyFolderIsOneReadableLine) {
  with(taught_head + "targets:\n  ball:\n    color: {hue_deg: [1, 2]}\n");
  ::chmod(folder.c_str(), 0555);
  const int root = ::setfsuid(::geteuid() == 0 ? 65534 : ::geteuid());  // to root every folder can be written
  std::string message;
  try {
    save_ignored(file, {{"cam0", {{1, 2, 3, 4}}}});
  } catch (const std::runtime_error& error) {
    message = error.what();
  }
  ::setfsuid(uid_t(root));
  ::chmod(folder.c_str(), 0755);
  EXPECT_EQ(message, "cannot write " + taught.string() + ": Permission denied");
  EXPECT_EQ(files(), 2);
}

}  // namespace
}  // namespace huetrack::config
