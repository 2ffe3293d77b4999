// Requests in words are executed if allowed, and always answered with a sentence.
#include "page/control_handler.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <map>
#include <optional>
#include <thread>

#include "capture/frames/pixel_format.h"
#include "recordings/recording.h"

namespace huetrack::page {
namespace {

using namespace testing;
using namespace std::chrono_literals;
namespace fs = std::filesystem;

msg::ControlRequest asked(std::vector<std::string> words) {
  msg::ControlRequest request;
  request.client("a page");
  request.number(7);
  request.words(std::move(words));
  return request;
}

class Control : public Test {
 protected:
  Control() {
    fs::create_directories(folder);
    config = config::load_service_config(fs::path(HUETRACK_SOURCE_DIR) / "configs/demo/huetrackd.yaml");
    config.control = {};
    config.control.allow_record = true;
    config.record = {};
    config.record.folder = folder;
  }
  ~Control() override { fs::remove_all(folder); }

  msg::ControlReply ask(std::vector<std::string> words) {
    const msg::ControlReply reply =
        ControlHandler({.recording = keeper ? &*keeper : nullptr}).answer(asked(std::move(words)), config);
    EXPECT_EQ(reply.client(), "a page");
    EXPECT_EQ(reply.number(), 7u);
    return reply;
  }
  std::map<std::string, std::string> state() {
    std::map<std::string, std::string> values;
    const msg::ControlReply told = ask({"record", "state"});
    for (const auto& row : told.rows()) values[row.columns().at(0)] = row.columns().at(1);
    return values;
  }
  void keep() {
    keeper.emplace(config,
                   pipeline::RecordingKeeperOptions{.record_to = {}, .cameras_in_use = config.rig.cameras.size()});
  }
  // A frame of every camera, every 50 ms of capture time.
  void frames(int count) {
    for (int i = 0; i < count; ++i, ++number) {
      for (std::size_t c = 0; c < config.rig.cameras.size(); ++c) {
        capture::Frame frame;
        frame.camera = int(c);
        frame.sequence = std::uint32_t(number);
        frame.captured_at = capture::Timestamp(100s + number * 50ms);
        frame.pixels = capture::make_image(capture::PixelFormat::yuyv, capture::ColorRange::limited, 32, 24).image;
        keeper->on_frame(frame, frame.captured_at);
      }
      std::this_thread::sleep_for(2ms);  // the writers have room for 32
    }
  }
  const fs::path folder = fs::path(TempDir()) / ("control_" + std::to_string(::getpid()));
  config::ServiceConfig config;
  std::optional<pipeline::RecordingKeeper> keeper;
  int number = 0;
};

const std::vector<std::vector<std::string>> requests{
    {"record", "state"}, {"record", "start"},          {"record", "stop"},       {"record", "save"},
    {"record", "list"},  {"record", "read", "a", "0"}, {"record", "delete", "a"}};

TEST_F(Control, RefusesWithoutPermission) {
  config.control.allow_record = false;
  keep();
  for (const auto& words : requests) {
    const msg::ControlReply reply = ask(words);
    EXPECT_FALSE(reply.granted()) << words[1];
    EXPECT_THAT(reply.reason(), AllOf(StartsWith("The configuration does not allow it. Set control: {allow_record: "
                                                 "true} in"),
                                      HasSubstr("kill -HUP")))
        << words[1];
    EXPECT_THAT(reply.rows(), IsEmpty());
  }
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST_F(Control, WithoutAFolderNothingIsRecorded) {
  config.record.folder.clear();
  keep();
  for (const auto& words : requests) EXPECT_THAT(ask(words).reason(), HasSubstr("set record: {folder: ...}"));
}

TEST_F(Control, AnswersNonsenseWithASentence) {
  keep();
  for (const std::vector<std::string>& words : {std::vector<std::string>{},
                                                {""},
                                                {"dance"},
                                                {"record"},
                                                {"record", "dance"},
                                                {"record", "start", "/etc"},
                                                {"record", "read"},
                                                {"record", "read", "a"},
                                                {"record", "read", "a", "0", "1"},
                                                {"record", std::string(1000, 'x')},
                                                std::vector<std::string>(1000, "record")}) {
    const msg::ControlReply reply = ask(words);
    EXPECT_FALSE(reply.granted());
    EXPECT_EQ(reply.reason(),
              words.empty() || words[0] != "record"
                  ? "This service does not know that request: known requests begin with record, target, camera, "
                    "calibrate, replay, undo, redo, history."
                  : "This service does not know that request: after record it knows state, start, stop, save, list, "
                    "delete NAME.");
  }
  EXPECT_EQ(ask({"record", "read", "../secret", "0"}).reason(), "That is not a valid name of a recording.");
  EXPECT_EQ(ask({"record", "read", "none", "0"}).reason(), "There is no recording none.");
  for (const char* text : {"", "-1", "1e3", "0x10", "99999999999999999999999"})
    EXPECT_THAT(ask({"record", "read", "none", text}).reason(), StartsWith("Write a whole number")) << text;
  EXPECT_EQ(ask({"record", "delete", "../secret"}).reason(), "That is not a valid name of a recording.");
  EXPECT_EQ(ask({"record", "delete", "none"}).reason(), "There is no recording none.");
  EXPECT_EQ(ask({"record", "stop"}).reason(), "Nothing is being recorded.");
  EXPECT_THAT(ask({"record", "save"}).reason(), StartsWith("There is no pre-roll to save: set record: {pre_roll_s"));
}

TEST_F(Control, ARecordingIsBegunEndedListedAndRead) {
  keep();
  EXPECT_EQ(state()["state"], "idle");
  frames(3);  // that nobody wants
  const msg::ControlReply started = ask({"record", "start"});
  ASSERT_TRUE(started.granted()) << started.reason();
  EXPECT_THAT(started.reason(), StartsWith("Recording to " + folder.string()));
  EXPECT_EQ(state()["state"], "recording");
  const std::string name = state()["name"];
  frames(11);
  EXPECT_THAT(ask({"record", "start"}).reason(), HasSubstr("lready recording"));
  EXPECT_EQ(ask({"record", "read", name, "0"}).reason(), name + " is still being recorded: stop it first.");
  EXPECT_EQ(ask({"record", "delete", name}).reason(), name + " is still being recorded: stop it first.");
  ASSERT_EQ(ask({"record", "list"}).rows().at(0).columns().at(5), "recording");
  std::this_thread::sleep_for(100ms);  // the queues are empty
  ASSERT_TRUE(ask({"record", "stop"}).granted());
  EXPECT_EQ(state()["state"], "idle");
  std::vector<std::string> row;
  for (int i = 0; i < 500; ++i) {  // its files are being closed
    row = ask({"record", "list"}).rows().at(0).columns();
    if (row.at(5) == "done") break;
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_THAT(row, ElementsAre(name, "100.150", "0.500", Not("0"), std::to_string(config.rig.cameras.size()), "done"));
  std::uint64_t got = 0;
  for (;;) {
    const msg::ControlReply piece = ask({"record", "read", name, std::to_string(got)});
    ASSERT_TRUE(piece.granted()) << piece.reason();
    if (piece.bytes().empty()) {
      EXPECT_EQ(std::to_string(got), piece.rows().at(0).columns().at(0));
      break;
    }
    got += piece.bytes().size();
  }
  const msg::ControlReply picture = ask({"record", "picture", name, "0"});
  ASSERT_TRUE(picture.granted()) << picture.reason();
  ASSERT_GT(picture.bytes().size(), 100u);
  EXPECT_EQ(picture.bytes()[0], 0xFF);
  EXPECT_EQ(picture.bytes()[1], 0xD8);  // a JPEG
  EXPECT_EQ(picture.rows().at(0).columns().at(0), std::to_string(picture.bytes().size()));
  EXPECT_EQ(ask({"record", "picture", "../secret", "0"}).reason(), "That is not a valid name of a recording.");
  const recordings::Recording recording = recordings::read_recording(folder / name);
  EXPECT_EQ(recording.cameras.size(), config.rig.cameras.size());
  EXPECT_EQ(recording.cameras[0].timestamps.size(), 11u);
  // A second one beside it.
  ASSERT_TRUE(ask({"record", "start"}).granted());
  EXPECT_NE(state()["name"], name);
  EXPECT_EQ(ask({"record", "list"}).rows().size(), 2u);
}

TEST_F(Control, ThePreRollIsSavedAndContinuedOnRequest) {
  config.record.pre_roll_s = 1;
  config.record.after_s = 0.05;
  keep();
  EXPECT_EQ(state()["pre_roll_s"], "1");
  EXPECT_EQ(state()["pre_roll_held_s"], "0.0") << "nothing came yet";
  frames(40);  // two seconds
  std::this_thread::sleep_for(100ms);
  EXPECT_THAT(state()["pre_roll_held_s"], testing::AnyOf("0.9", "1.0"));
  const msg::ControlReply saved = ask({"record", "save"});
  ASSERT_TRUE(saved.granted()) << saved.reason();
  EXPECT_THAT(saved.reason(),
              testing::ContainsRegex("^Saving the last (0.9|1.0) s, and 0.05 more, to " + folder.string()));
  const std::string name = state()["name"];
  EXPECT_THAT(name, EndsWith("-asked"));
  ASSERT_TRUE(ask({"record", "start"}).granted());  // it goes on
  EXPECT_EQ(state()["name"], name);
  std::this_thread::sleep_for(150ms);
  keeper->supervise();
  EXPECT_EQ(state()["state"], "recording");
  frames(2);
  std::this_thread::sleep_for(100ms);
  ASSERT_TRUE(ask({"record", "stop"}).granted());
  keeper->finish(1s);
  const auto times = recordings::read_recording(folder / name).cameras.at(0).timestamps;
  EXPECT_THAT(times.size(), AllOf(Ge(20u), Le(23u)));  // a second of the two, and what came after
  EXPECT_EQ(times.back().second, capture::Timestamp(100s + 41 * 50ms));
}

TEST_F(Control, AlwaysCannotBeStopped) {
  config.record.always = true;
  keep();
  keeper->begin();
  EXPECT_EQ(state()["state"], "recording");
  EXPECT_THAT(ask({"record", "stop"}).reason(), HasSubstr("record: {always: true}"));
  EXPECT_EQ(state()["state"], "recording");
}

TEST_F(Control, AReplayListsAndRecordsNothing) {
  EXPECT_EQ(state()["state"], "replay");
  EXPECT_EQ(ask({"record", "start"}).reason(), "This is a replay: it cannot record.");
  EXPECT_TRUE(ask({"record", "list"}).granted());
  EXPECT_EQ(ask({"record", "delete", "any"}).reason(), "This is a replay: it cannot record.");
}

// ---- Targets

class Targets : public Control {
 protected:
  Targets() {
    config.control.allow_teach = true;
    config.file = folder / "c.yaml";
    std::ofstream(config.file) << "version: 1\nrig: " << config.rig_file.string()
                               << "\ncontrol: {allow_teach: true}\ntargets: {ball: {radius_m: 0.04, color: {hue_deg: "
                                  "[10, 30]}}}\n";
    config = config::load_service_config(config.file);
  }
  msg::ControlReply ask(std::vector<std::string> words) {
    return ControlHandler({.reload =
                            [this] {
                              ++reloads;
                              config = config::load_service_config(config.file);
                              return std::string();
                            },
                        .restart = can_restart ? [this] {
                              ++begun_anew;
                              config = config::load_service_config(config.file);
                              return std::string();
                            } : std::function<std::string()>()})
        .answer(asked(std::move(words)), config);
  }
  bool can_restart = true;
  int reloads = 0, begun_anew = 0;
};

TEST_F(Targets, TheConfigurationIsShownWithoutPasswords) {
  std::ofstream(config.file, std::ios::app) << "cameras: {cam0: {device: \"rtsp://me:hidden@10.0.0.7/live\"}}\n";
  ASSERT_TRUE(ask({"target", "set", "ball", "hue_deg=340,20"}).granted());
  const msg::ControlReply reply = ask({"config", "show"});
  ASSERT_TRUE(reply.granted()) << reply.reason();
  ASSERT_EQ(reply.rows().size(), 2u);
  EXPECT_THAT(reply.rows().at(0).columns(),
              ElementsAre("c.yaml", AllOf(HasSubstr("hue_deg: [10, 30]"), HasSubstr("rtsp://***@10.0.0.7/live"),
                                          Not(HasSubstr("hidden")))));
  EXPECT_THAT(reply.rows().at(1).columns(), ElementsAre("c.taught.yaml", HasSubstr("hue_deg: [340, 20]")));
  config.control.allow_teach = false;
  EXPECT_FALSE(ask({"config", "show"}).granted());
}

TEST_F(Targets, AreChangedAddedRenamedAndUndone) {
  EXPECT_THAT(ask({"target", "list"}).rows().at(0).columns(),
              ElementsAre("ball", "0.04", "1", "10,30", "0.3,1", "0.1,0.95"));
  msg::ControlReply reply = ask({"target", "set", "ball", "hue_deg=340,20", "radius_m=0.05"});
  EXPECT_EQ(reply.reason(), "Saved: ball is now tracked like this; written into c.taught.yaml.");
  EXPECT_EQ(reloads, 1);
  EXPECT_EQ(config.targets[0].radius_m, 0.05);
  reply = ask({"target", "add", "wand", "radius_m=0.02"});
  EXPECT_EQ(reply.reason(), "Added: wand; written into c.taught.yaml. The service restarts with it.");
  EXPECT_EQ(begun_anew, 1);
  EXPECT_EQ(ask({"target", "list"}).rows().at(1).columns().at(3), "");  // to be taught
  EXPECT_TRUE(ask({"target", "rename", "wand", "stick"}).granted());
  EXPECT_EQ(begun_anew, 2);
  can_restart = false;
  EXPECT_EQ(ask({"target", "remove", "stick"}).reason(),
            "Removed: stick; written into c.taught.yaml. It takes effect at the next start.");
  can_restart = true;
  reply = ask({"undo"});
  EXPECT_EQ(reply.reason(), "Undone: removal of stick; c.taught.yaml is as it was before the save.");
  EXPECT_THAT(reply.rows().at(0).columns(), ElementsAre("undoable", "3", "renaming of wand to stick"));
  EXPECT_THAT(reply.rows().at(1).columns(), ElementsAre("redoable", "1", "removal of stick"));
  EXPECT_EQ(
      ask({"undo"}).reason(),
      "Undone: renaming of wand to stick; c.taught.yaml is as it was before the save. The service restarts with it.");
  EXPECT_TRUE(ask({"redo"}).granted());
  EXPECT_EQ(config.targets.at(1).name, "stick");
  EXPECT_THAT(ask({"history"}).rows().at(1).columns(), ElementsAre("redoable", "1", "removal of stick"));
}

TEST_F(Targets, NonsenseChangesNothing) {
  for (const std::vector<std::string>& words : {std::vector<std::string>{"target"},
                                                {"target", "set"},
                                                {"target", "set", "ball"},
                                                {"target", "dance", "ball"},
                                                {"target", "rename", "ball"},
                                                {"target", "set", "ball", "radius_m"},
                                                {"target", "set", "ball", "radius_m="},
                                                {"target", "set", "ball", "radius_m=nan"},
                                                {"target", "set", "ball", "radius_m=1e999"},
                                                {"target", "set", "ball", "radius_m=0"},
                                                {"target", "set", "ball", "hue_deg=1"},
                                                {"target", "set", "ball", "hue_deg=1,2,3"},
                                                {"target", "set", "ball", "hue_deg=inf,2"},
                                                {"target", "set", "ball", "color=red"},
                                                {"target", "set", "ball", "hue_deg=1,2", "camera=none"},
                                                {"target", "set", "none", "radius_m=1"},
                                                {"target", "add", "ball"},
                                                {"target", "add", "a b"},
                                                {"target", "remove", "none"},
                                                {"undo", "now"},
                                                {"undo"},
                                                {"redo"}}) {
    const msg::ControlReply reply = ask(words);
    EXPECT_FALSE(reply.granted()) << words.back();
    EXPECT_THAT(reply.reason(), EndsWith(".")) << words.back();
  }
  EXPECT_FALSE(fs::exists(folder / "c.taught.yaml"));
  config.control.allow_teach = false;
  for (const std::vector<std::string>& words : {std::vector<std::string>{"target", "list"},
                                                {"undo"},
                                                {"redo"},
                                                {"history"},
                                                {"target", "set", "ball", "radius_m=1"}})
    EXPECT_THAT(ask(words).reason(), HasSubstr("Set control: {allow_teach: true} in"));
  EXPECT_EQ(reloads + begun_anew, 0);
}

// ---- The cameras' controls

// A camera with one control, of which only what is below a hundred is taken.
class FakeControls final : public capture::CameraControls {
 public:
  std::vector<capture::Control> read() const override {
    if (!is_there)
      throw capture::CaptureError(std::make_error_code(std::errc::no_such_device), "the camera is not there");
    return {{.name = "gain", .min = 0, .max = 255, .default_value = 7, .value = value, .menu = {}},
            {.name = "power_line_frequency", .max = 1, .value = 1, .menu = {{0, "Disabled"}, {1, "50 Hz"}}},
            {.name = "reset", .value = {}, .menu = {}, .is_button = true}};
  }
  std::vector<capture::ControlResult> set(std::span<const capture::ControlSetting> settings) override {
    std::vector<capture::ControlResult> results;
    for (const auto& setting : settings) {
      const auto* const number = std::get_if<std::int64_t>(&setting.value);
      const bool is_taken = setting.name == "gain" && number != nullptr && *number < 100;
      if (is_taken) value = *number;
      results.push_back({.name = setting.name,
                         .asked = number != nullptr ? std::to_string(*number) : "a word",
                         .got = {},
                         .problem = is_taken ? "" : "is refused"});
      if (is_taken) results.back().got = value;
    }
    return results;
  }
  void keep(std::vector<capture::ControlSetting>) override {}
  bool is_there = true;
  std::int64_t value = 7;
};

class Cameras : public Control {
 protected:
  Cameras() {
    config.file = folder / "c.yaml";
    std::ofstream(config.file) << "version: 1\nrig: " << config.rig_file.string()
                               << "\ncontrol: {allow_teach: true}\ntargets: {ball: {}}\ncameras: {cam0: {device: 0, "
                                  "controls: {gain: 3, sharpness: 1}}, cam1: {device: 1}}\n";
    config = config::load_service_config(config.file);
  }
  msg::ControlReply ask(std::vector<std::string> words) {
    return ControlHandler({.cameras = {{"cam0", fake}},
                           .reload =
                               [this] {
                                 ++reloads;
                                 config = config::load_service_config(config.file);
                                 return std::string();
                               }})
        .answer(asked(std::move(words)), config);
  }
  const std::shared_ptr<FakeControls> fake = std::make_shared<FakeControls>();
  int reloads = 0;
};

TEST_F(Cameras, ControlsAreReadSetAndSaved) {
  EXPECT_THAT(ask({"camera", "list"}).rows().at(0).columns(), ElementsAre("cam0", "reached"));
  EXPECT_THAT(ask({"camera", "list"}).rows().at(1).columns(), ElementsAre("cam1", "not reached"));
  config.cameras[1].device = "/dev/v4l/by-id/huetrackd-demo-cam1";
  EXPECT_THAT(ask({"camera", "list"}).rows().at(1).columns(), ElementsAre("cam1", "played"));
  const msg::ControlReply read = ask({"camera", "controls", "cam0"});
  ASSERT_EQ(read.rows().size(), 2u) << read.reason();  // no button
  EXPECT_THAT(read.rows()[0].columns(), ElementsAre("gain", "7", "0", "255", "1", "7", "number", "", ""));
  EXPECT_THAT(read.rows()[1].columns(),
              ElementsAre("power_line_frequency", "1", "0", "1", "1", "0", "menu", "0=Disabled;1=50 Hz", ""));
  EXPECT_EQ(ask({"camera", "set", "cam0", "gain=50"}).reason(),
            "Set, but not saved: camera save cam0 gain=50 keeps it.");
  EXPECT_THAT(ask({"camera", "save", "cam0"}).reason(), HasSubstr("camera controls cam0 lists them"));
  EXPECT_EQ(fake->value, 50);
  EXPECT_EQ(config::load_service_config(config.file).cameras[0].controls[0].value, capture::ControlValue(3));
  const msg::ControlReply saved = ask({"camera", "save", "cam0", "gain=60"});
  EXPECT_EQ(saved.reason(), "Saved for camera cam0; written into c.taught.yaml.");
  EXPECT_THAT(saved.rows().at(0).columns(), ElementsAre("gain", "60", "60", ""));
  EXPECT_EQ(reloads, 1);
  ASSERT_EQ(config.cameras[0].controls.size(), 2u);
  EXPECT_EQ(config.cameras[0].controls[0].value, capture::ControlValue(60));
  EXPECT_THAT(config::to_yaml_with_origins(config), ContainsRegex("gain: 60 +# from c.taught.yaml"));
  EXPECT_TRUE(ask({"undo"}).granted());
  EXPECT_EQ(config.cameras[0].controls[0].value, capture::ControlValue(3));
}

TEST_F(Cameras, RejectedControlsAreNotSaved) {
  for (const std::vector<std::string>& words : {std::vector<std::string>{"camera"},
                                                {"camera", "controls"},
                                                {"camera", "controls", "cam1"},
                                                {"camera", "controls", "none"},
                                                {"camera", "set", "cam0"},
                                                {"camera", "set", "cam0", "gain"},
                                                {"camera", "set", "cam0", "=1"},
                                                {"camera", "save", "cam0", "gain="},
                                                {"camera", "save", "cam0", "gain=200"},
                                                {"camera", "save", "cam0", "gain=1", "nonsense=2"},
                                                {"camera", "save", "cam0", "gain=manual"},
                                                {"camera", "dance", "cam0", "gain=1"}})
    EXPECT_FALSE(ask(words).granted()) << words.back();
  EXPECT_EQ(ask({"camera", "save", "cam0", "gain=200"}).reason(), "Gain: asked 200: is refused.");
  fake->is_there = false;
  EXPECT_EQ(ask({"camera", "controls", "cam0"}).reason(), "The camera is not there.");
  EXPECT_FALSE(fs::exists(folder / "c.taught.yaml"));
  EXPECT_EQ(reloads, 0);
  config.control.allow_teach = false;
  EXPECT_THAT(ask({"camera", "set", "cam0", "gain=1"}).reason(), HasSubstr("Set control: {allow_teach: true} in"));
}

// ---- A replay

class FakePlayback final : public Playback {
 public:
  PlaybackState state() const override { return now; }
  void pause() override { now.is_paused = true; }
  void go_on() override { now.is_paused = false; }
  void step(int sets) override { now.position_s += sets; }
  void set_speed(double speed) override { now.speed = speed; }
  void seek(double position_s) override { now.position_s = position_s; }
  PlaybackState now{.speed = 1};
};

TEST_F(Control, ARecordingIsOpenedInsteadOfTheCameras) {
  config.control.allow_teach = true;
  keep();
  ASSERT_TRUE(ask({"record", "start"}).granted());
  frames(3);
  const std::string name = state()["name"];
  fs::path opened;
  const auto told = [&](std::vector<std::string> words) {
    return ControlHandler({.recording = &*keeper, .open_recording = [&](const fs::path& path) { opened = path; }})
        .answer(asked(std::move(words)), config);
  };
  EXPECT_THAT(told({"replay", "open", name}).reason(), HasSubstr("still being recorded"));
  ASSERT_TRUE(ask({"record", "stop"}).granted());
  keeper->finish(1s);
  for (const std::string hostile : {"..", "../x", "", "none", "/etc"})
    EXPECT_FALSE(told({"replay", "open", hostile}).granted()) << hostile;
  fs::create_directories(folder / "broken");
  std::ofstream(folder / "broken/recording.yaml") << "no recording";
  EXPECT_THAT(told({"replay", "open", "broken"}).reason(), HasSubstr("recording.yaml"));
  EXPECT_TRUE(opened.empty());
  EXPECT_THAT(ask({"replay", "open", name}).reason(), StartsWith("Only huetrackd run on live cameras"));
  const msg::ControlReply reply = told({"replay", "open", name});
  EXPECT_TRUE(reply.granted()) << reply.reason();
  EXPECT_EQ(opened, folder / name);
  config.control.allow_record = false;
  EXPECT_THAT(told({"replay", "open", name}).reason(), HasSubstr("allow_record"));
}

TEST_F(Control, AReplayJumpsWithinItsLengthUnlessItWritesTimes) {
  config.control.allow_teach = true;
  FakePlayback playback;
  playback.now.length_s = 5;
  const auto told = [&](const std::string& to) {
    return ControlHandler({.playback = &playback}).answer(asked({"replay", "seek", to}), config);
  };
  EXPECT_EQ(told("2.5").rows().at(3).columns().at(1), "2.500");
  EXPECT_EQ(told("5").rows().at(4).columns().at(1), "5.000");
  EXPECT_EQ(told("0").rows().at(6).columns().at(1), "true");
  for (const std::string bad : {"-1", "5.1", "nan", "x", ""}) EXPECT_FALSE(told(bad).granted()) << bad;
  EXPECT_THAT(told("77").reason(), HasSubstr("0 to 5.000 s"));
  playback.now.why_no_seek = "it writes a file";
  EXPECT_EQ(told("1").reason(), "It writes a file.");
  EXPECT_EQ(playback.now.position_s, 0);
}

TEST_F(Control, AReplayIsPausedSteppedAndSpedUp) {
  config.control.allow_teach = true;
  FakePlayback playback;
  const auto told = [&](std::vector<std::string> words) {
    return ControlHandler({.playback = &playback}).answer(asked(std::move(words)), config);
  };
  EXPECT_EQ(told({"replay", "state"}).reason(), "Playing at 0.000 s.");
  EXPECT_EQ(told({"replay", "pause"}).rows().at(0).columns().at(1), "paused");
  EXPECT_EQ(told({"replay", "step"}).rows().at(3).columns().at(1), "1.000");
  EXPECT_EQ(told({"replay", "step", "10"}).rows().at(3).columns().at(1), "11.000");
  EXPECT_EQ(told({"replay", "go"}).rows().at(0).columns().at(1), "playing");
  EXPECT_EQ(told({"replay", "speed", "0.25"}).rows().at(1).columns().at(1), "0.25");
  EXPECT_EQ(told({"replay", "speed", "max"}).rows().at(1).columns().at(1), "max");
  for (const std::vector<std::string>& words : {std::vector<std::string>{"replay"},
                                                {"replay", "dance"},
                                                {"replay", "step", "0"},
                                                {"replay", "step", "-1"},
                                                {"replay", "step", "1e9"},
                                                {"replay", "speed"},
                                                {"replay", "speed", "0"},
                                                {"replay", "speed", "-1"},
                                                {"replay", "speed", "nan"},
                                                {"replay", "speed", "1000"}})
    EXPECT_FALSE(told(words).granted()) << words.back();
  EXPECT_THAT(told({"replay", "close"}).reason(), HasSubstr("no live cameras"));
  EXPECT_EQ(playback.now.position_s, 11);
  EXPECT_EQ(playback.now.speed, 0);
  EXPECT_EQ(ask({"replay", "pause"}).reason(), "This is not a replay.");
  config.control.allow_teach = false;
  EXPECT_THAT(told({"replay", "pause"}).reason(), HasSubstr("allow_teach"));
}

}  // namespace
}  // namespace huetrack::page
