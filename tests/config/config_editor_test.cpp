#include "config/config_editor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <sstream>

namespace huetrack::config {
namespace {

using namespace testing;
namespace fs = std::filesystem;

YamlValue hue(const std::string& range) {
  return YamlValue::map(
      {{"targets",
        YamlValue::map({{"ball", YamlValue::map({{"color", YamlValue::map({{"hue_deg", YamlValue::of(range)}})}})}})}});
}

TEST(WithValue, ChangesTheValueAndKeepsEverythingElse) {
  const std::string yaml =
      "# mine\n"
      "version: 1\n"
      "\n"
      "targets:\n"
      "  # the green one\n"
      "  ball:          # on the stick\n"
      "    radius_m: 0.04   # measured\n"
      "    color:\n"
      "      saturation: [0.3, 1]\n"
      "      # by hand:\n"
      "      hue_deg: [65, 115]   # was 60\n"
      "  'other ball':\n"
      "    color: {hue_deg: [1, 2]}\n"
      "# the end\n";
  std::string expected = yaml;
  expected.replace(expected.find("[65, 115]"), 9, "[70, 99]");
  EXPECT_EQ(with_value(yaml, hue("[70, 99]")), expected);
}

TEST(WithValue, KnowsFlowStyle) {
  EXPECT_EQ(with_value("targets: {ball: {color: {hue_deg: [65, 115], saturation: [0, 1]}}}  # all\n", hue("[1, 2]")),
            "targets: {ball: {color: {hue_deg: [1, 2], saturation: [0, 1]}}}  # all\n");
  EXPECT_EQ(with_value("targets:\n  ball: {radius_m: 1}\n", hue("[1, 2]")),
            "targets:\n  ball: {radius_m: 1, color: {hue_deg: [1, 2]}}\n");
  EXPECT_EQ(with_value("targets:\n  ball: {}\n", hue("[1, 2]")), "targets:\n  ball: {color: {hue_deg: [1, 2]}}\n");
  EXPECT_EQ(with_value("{targets: {ball: {color: {\"hue_deg\": [3, 4]}}}}", hue("[1, 2]")),
            "{targets: {ball: {color: {\"hue_deg\": [1, 2]}}}}");
  EXPECT_EQ(
      with_value("targets: {ball: {note: \"a, {b} # c\",\n   color: {hue_deg: [3,\n 4]}}}\nx: 1\n", hue("[1, 2]")),
      "targets: {ball: {note: \"a, {b} # c\",\n   color: {hue_deg: [1, 2]}}}\nx: 1\n");
}

TEST(WithValue, AddsWhatIsNotThere) {
  EXPECT_EQ(with_value("targets:\n    ball:\n        radius_m: 1\n\nthreads: 2\n", hue("[1, 2]")),
            "targets:\n    ball:\n        radius_m: 1\n        color: {hue_deg: [1, 2]}\n\nthreads: 2\n");
  EXPECT_EQ(with_value("version: 1", hue("[1, 2]")), "version: 1\ntargets: {ball: {color: {hue_deg: [1, 2]}}}\n");
  EXPECT_EQ(with_value("targets:\n  ball:\n", hue("[1, 2]")), "targets:\n  ball: {color: {hue_deg: [1, 2]}}\n");
}

TEST(WithValue, ReplacesAWholeMappingWhereThatIsMeant) {
  const YamlValue only_right = YamlValue::map({{"cameras", YamlValue::map({{"right", YamlValue::of("2")}}, true)}});
  EXPECT_EQ(with_value("cameras:\n  left: 1  # old\n  # kept\n  right: 1  # mine\nx: 1\n", only_right),
            "cameras:\n  # kept\n  right: 2  # mine\nx: 1\n");
  EXPECT_EQ(with_value("cameras: {left: 1, right: 1}\n", only_right), "cameras: {right: 2}\n");
  EXPECT_EQ(with_value("cameras: {}\n", only_right), "cameras: {right: 2}\n");
}

TEST(WithValue, LeavesFormsThatItDoesNotKnowAlone) {
  for (const std::string yaml : {"targets: &t\n  ball: 1\n", "targets:\n  - ball\n", "targets: {ball: \"open\n",
                                 "targets: {ball: [\n", "just text\n"})
    EXPECT_THROW(with_value(yaml, hue("[1, 2]")), std::runtime_error) << yaml;
}

class Saving : public Test {
 protected:
  Saving() {
    fs::remove_all(folder);
    fs::create_directories(folder);
    fs::copy(fs::path(HUETRACK_SOURCE_DIR) / "configs/demo/recording/rig.yaml", folder / "rig.yaml");
  }
  ~Saving() override { fs::remove_all(folder); }
  ServiceConfig with(const std::string& yaml) {
    std::ofstream(file) << yaml;
    return load_service_config(file);
  }
  std::string text() const {
    std::ostringstream out;
    out << std::ifstream(file).rdbuf();
    return out.str();
  }
  const fs::path folder =
      fs::path(TempDir()) / (std::string("config_editor_") + UnitTest::GetInstance()->current_test_info()->name());
  const fs::path file = folder / "huetrackd.yaml";
};

TEST_F(Saving, WritesColoursAndRectanglesAndReadsThemBack) {
  const ServiceConfig config = with(
      "version: 1\nrig: rig.yaml\ntargets:\n  ball:\n    color: {hue_deg: [1, 2]} # red\n    camera_colors:\n"
      "      cam0: {hue_deg: [3, 4]}\n  other: {color: {hue_deg: [200, 220]}}\nthreads: 2 # two\n");
  ::chmod(file.c_str(), 0640);
  object_tracking::TargetOptions target = config.targets[0];
  target.color = {.hue_min_deg = 350, .hue_max_deg = 10, .saturation_min = 0.25};
  target.camera_colors = {{"cam1", {.hue_min_deg = 340, .hue_max_deg = 5}}};
  const object_tracking::IgnoredRegions ignored = {{"cam1", {{1, 2, 30, 40}, {5, 6, 7, 8}}}};
  save_taught(config, target, ignored);
  const ServiceConfig after = load_service_config(file);
  EXPECT_EQ(after.targets[0].color, target.color);
  EXPECT_EQ(after.targets[0].camera_colors, target.camera_colors);
  EXPECT_EQ(after.targets[1].color, config.targets[1].color);
  EXPECT_EQ(after.ignored, ignored);
  EXPECT_EQ(after.targets[1].ignored, ignored);
  EXPECT_THAT(text(), AllOf(HasSubstr("# red"), HasSubstr("threads: 2 # two"), Not(HasSubstr("cam0"))));
  struct stat rights {};
  ::stat(file.c_str(), &rights);
  EXPECT_EQ(rights.st_mode & 0777, 0640u);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 2);  // nothing is left beside it

  save_ignored(after, {});
  EXPECT_THAT(load_service_config(file).ignored, IsEmpty());
}

TEST_F(Saving, FollowsALinkAndTellsWhatToWriteWhereItCannot) {
  const ServiceConfig config = with("version: 1\nrig: rig.yaml\ntargets:\n  ball: &b\n    color: {hue_deg: [1, 2]}\n");
  const std::string before = text();
  object_tracking::TargetOptions target = config.targets[0];
  target.color.hue_max_deg = 77;
  EXPECT_THAT([&] { save_taught(config, target, {}); },
              ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("was left as it is"), HasSubstr("hue_deg: [1, 77]"))));
  EXPECT_EQ(text(), before);

  const ServiceConfig simple = with("version: 1\nrig: rig.yaml\ntargets:\n  ball:\n    color: {hue_deg: [1, 2]}\n");
  fs::create_directory(folder / "links");
  fs::create_symlink(file, folder / "links/link.yaml");
  ServiceConfig linked = simple;
  linked.file = folder / "links/link.yaml";
  save_taught(linked, target, {});
  EXPECT_TRUE(fs::is_symlink(folder / "links/link.yaml"));
  EXPECT_THAT(text(), HasSubstr("[1, 77]"));
}

}  // namespace
}  // namespace huetrack::config
