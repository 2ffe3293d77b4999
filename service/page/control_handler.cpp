#include "page/control_handler.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <utility>

#include "calib/files/joined.h"
#include "calib/model/rig_yaml.h"
#include "config/taught_file.h"
#include "idl/control_words.h"
#include "page/config_text.h"
#include "page/recording_library.h"
#include "page/recording_picture.h"
#include "page/request_words.h"
#include "recordings/recording.h"

namespace huetrack::page {
namespace {

constexpr std::size_t most_listed = 200;         // recordings
constexpr std::size_t piece_bytes = 256 * 1024;  // of a recording: half of the limit of a reply

void add_row(msg::ControlReply& reply, std::vector<std::string> columns) {
  reply.rows().emplace_back().columns(std::move(columns));
}

bool is_played(const config::LiveCameraConfig& camera) {
  return camera.device.string().starts_with(played_device);
}

bool are(std::span<const std::string> words, std::initializer_list<std::string_view> wanted) {
  return std::ranges::equal(words, wanted);
}

std::runtime_error forbidden(const char* key, const config::ServiceConfig& config) {
  return std::runtime_error(
      fmt::format("the configuration does not allow it. Set control: {{{}: true}} in {}, then reload it: kill -HUP {} "
                  "(or systemctl reload huetrackd)",
                  key, config.file.string(), ::getpid()));
}

void require_teaching(const config::ServiceConfig& config) {
  if (!config.control.allow_teach) throw forbidden("allow_teach", config);
}

std::string pair_text(double from, double to) {
  return fmt::format("{},{}", from, to);
}

// "340,20". throws std::runtime_error
std::pair<double, double> pair_of(std::string_view text) {
  const std::size_t comma = text.find(',');
  if (comma == std::string_view::npos) throw std::runtime_error(fmt::format("write FROM,TO, not {}", text));
  return {real_of(text.substr(0, comma)), real_of(text.substr(comma + 1))};
}

// From words KEY=VALUE. throws std::runtime_error
config::TargetEdit edit_of(const std::string& target, std::span<const std::string> words) {
  config::TargetEdit edit{.target = target};
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    const std::string_view key = std::string_view(word).substr(0, equals);
    const std::string_view value = equals == std::string::npos ? "" : std::string_view(word).substr(equals + 1);
    if (key == "radius_m") {
      edit.radius_m = real_of(value);
    } else if (key == "hue_deg") {
      edit.hue_deg = pair_of(value);
    } else if (key == "saturation") {
      edit.saturation = pair_of(value);
    } else if (key == "intensity") {
      edit.intensity = pair_of(value);
    } else if (key == "camera" && !value.empty()) {
      edit.camera = value;
    } else {
      throw std::runtime_error(fmt::format(
          "unknown key {}: use radius_m=, hue_deg=, saturation=, intensity= (FROM,TO each) and camera=", word));
    }
  }
  return edit;
}

// name, value, minimum, maximum, step, default, kind, menu, controlling automatic. A menu: "1=Manual Mode;3=Auto".
std::vector<std::string> columns_of(const capture::Control& control) {
  std::vector<std::string> menu;
  for (const auto& item : control.menu) menu.push_back(fmt::format("{}={}", item.value, item.name));
  return {control.name,
          control.value ? std::to_string(*control.value) : "",
          std::to_string(control.min),
          std::to_string(control.max),
          std::to_string(control.step),
          std::to_string(control.default_value),
          !control.menu.empty() ? "menu"
          : control.is_boolean  ? "boolean"
                                : "number",
          files::joined(menu, ";"),
          control.is_read_only  ? "read only"
          : control.is_inactive ? "ruled by another"
                                : ""};
}

// From words NAME=VALUE. throws std::runtime_error
std::vector<capture::ControlSetting> settings_of(std::span<const std::string> words) {
  std::vector<capture::ControlSetting> settings;
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    if (equals == 0 || equals == std::string::npos || equals + 1 == word.size())
      throw std::runtime_error(fmt::format("write CONTROL=VALUE, not {}", word));
    settings.push_back(capture::control_setting(word.substr(0, equals), word.substr(equals + 1)));
  }
  return settings;
}

// As a sentence of its own.
std::string sentence(std::string text) {
  if (!text.empty() && text.front() >= 'a' && text.front() <= 'z') text.front() = char(text.front() - 'a' + 'A');
  if (!text.ends_with('.')) text += '.';
  return text;
}

// throws std::runtime_error
void seek(Playback& playback, double position_s) {
  const PlaybackState state = playback.state();
  if (!state.why_no_seek.empty()) throw std::runtime_error(state.why_no_seek);
  if (position_s < 0 || (state.length_s && position_s > *state.length_s))
    throw std::runtime_error(fmt::format("write a position of 0 to {} s, from the recording's first frame",
                                         state.length_s ? fmt::format("{:.3f}", *state.length_s) : "its length"));
  playback.seek(position_s);
}

void refuse(msg::ControlReply& reply, std::string why) {
  reply.granted(false);
  reply.rows().clear();
  reply.bytes().clear();
  reply.reason(std::move(why));
}

}  // namespace

bool ControlHandler::is_read(const msg::ControlRequest& request) {
  const auto& words = request.words();
  return words.size() > 1 && ((words[0] == "record" && (words[1] == "read" || words[1] == "picture")) ||
                              (words[0] == "calibrate" && (words[1] == "report" || words[1] == "print")));
}

msg::ControlReply ControlHandler::answer(const msg::ControlRequest& request,
                                         const config::ServiceConfig& config) const {
  msg::ControlReply reply;
  reply.client(request.client());
  reply.number(request.number());
  const Words words = request.words();
  try {
    if (words.empty() || words.size() > idl::most_control_words ||
        std::ranges::any_of(words, [](const std::string& word) { return word.size() > idl::longest_control_word; }))
      throw unknown_request();
    if (words[0] == "record") {
      record(words.subspan(1), config, reply);
    } else if (words[0] == "calibrate") {
      calibrate(words.subspan(1), config, reply);
    } else if (words[0] == "target") {
      target(words.subspan(1), config, reply);
    } else if (words[0] == "replay") {
      replay(words.subspan(1), config, reply);
    } else if (words[0] == "camera") {
      camera(words.subspan(1), config, reply);
    } else if (are(words, {"config", "show"})) {
      show_config(config, reply);
    } else if (words.size() == 1 && (words[0] == "undo" || words[0] == "redo" || words[0] == "history")) {
      history(words[0], config, reply);
    } else {
      throw unknown_request();
    }
    reply.granted(true);
  } catch (const UnknownRequest& error) {
    refuse(reply, sentence(fmt::format("{}: {}", error.what(), known_requests(words))));
  } catch (const std::exception& error) {  // invalid, not allowed, or a disk error
    refuse(reply, sentence(error.what()));
  }
  return reply;
}

pipeline::RecordingKeeper& ControlHandler::recording() const {
  if (actions_.recording == nullptr) throw std::runtime_error("this is a replay: it cannot record");
  return *actions_.recording;
}

std::string ControlHandler::unfinished() const {
  if (actions_.recording == nullptr || !actions_.recording->is_unfinished()) return "";
  return actions_.recording->folder().filename().string();
}

void ControlHandler::require_finished(const std::string& name) const {
  if (idl::is_recording_name(name) && name == unfinished())
    throw std::runtime_error(name + " is still being recorded: stop it first");
}

std::string ControlHandler::take_over(const config::ServiceConfig& config) const {
  const config::ServiceConfig fresh = config::load_service_config(config.file);
  const auto kind = [](const object_tracking::TargetOptions& target) { return std::pair(target.name, target.count); };
  const bool is_same_set = std::ranges::equal(fresh.targets, config.targets, {}, kind, kind) &&
                           fresh.is_calibrated() == config.is_calibrated() &&
                           calib::rig_identity(fresh.rig) == calib::rig_identity(config.rig);
  const auto& act = is_same_set ? actions_.reload : actions_.restart;
  if (!act) return " It takes effect at the next start.";
  if (const std::string why_not = act(); !why_not.empty())
    return fmt::format(" It takes effect at the next start: {}.", why_not);
  return is_same_set ? "" : " The service restarts with it.";
}

void ControlHandler::target(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) const {
  require_teaching(config);
  if (are(words, {"list"})) {
    for (const auto& one : config.targets) {
      const bool is_taught = config::is_taught(one);
      add_row(reply, {one.name, fmt::format("{}", one.radius_m), std::to_string(one.count),
                      is_taught ? pair_text(one.color.hue_min_deg, one.color.hue_max_deg) : "",
                      is_taught ? pair_text(one.color.saturation_min, one.color.saturation_max) : "",
                      is_taught ? pair_text(one.color.intensity_min, one.color.intensity_max) : ""});
    }
    reply.reason(fmt::format("Targets: {}.", config.targets.size()));
    return;
  }
  if (words.size() < 2) throw unknown_request();
  const std::string &verb = words[0], &name = words[1];
  std::filesystem::path file;
  std::string done;
  if (verb == "set" && words.size() > 2) {
    file = config::save_target(config.file, edit_of(name, words.subspan(2)));
    done = fmt::format("Saved: {} is now tracked like this", name);
  } else if (verb == "add") {
    file = config::add_target(config.file, edit_of(name, words.subspan(2)));
    done = fmt::format("Added: {}", name);
  } else if (verb == "rename" && words.size() == 3) {
    file = config::rename_target(config.file, name, words[2]);
    done = fmt::format("Renamed: {} is {} now", name, words[2]);
  } else if (verb == "remove" && words.size() == 2) {
    file = config::remove_target(config.file, name);
    done = fmt::format("Removed: {}", name);
  } else {
    throw unknown_request();
  }
  reply.reason(fmt::format("{}; written into {}.{}", done, file.filename().string(), take_over(config)));
}

void ControlHandler::camera(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) const {
  require_teaching(config);
  if (are(words, {"list"})) {
    for (const auto& one : config.cameras)
      add_row(reply, {one.name, actions_.cameras.contains(one.name) ? "reached"
                                : is_played(one)                    ? "played"
                                                                    : "not reached"});
    reply.reason(fmt::format("The controls of {} of {} cameras are reachable from here.", actions_.cameras.size(),
                             config.cameras.size()));
    return;
  }
  if (words.size() < 2) throw unknown_request();
  const auto found = actions_.cameras.find(words[1]);
  if (found == actions_.cameras.end())
    throw std::runtime_error(
        fmt::format("no controls of a camera {} are reachable from here: camera list shows which are; set controls of "
                    "remote cameras in their host's configuration",
                    words[1]));
  capture::CameraControls& controls = *found->second;
  if (words[0] == "controls" && words.size() == 2) {
    for (const capture::Control& control : controls.read())
      if (!control.is_button && !control.is_write_only) add_row(reply, columns_of(control));
    reply.reason(fmt::format("Of camera {}.", words[1]));
    return;
  }
  const bool saves = words[0] == "save";
  if (!saves && words[0] != "set") throw unknown_request();
  if (words.size() < 3)
    throw std::runtime_error(
        fmt::format("give controls and values: camera {} {} CONTROL=VALUE ...; camera controls {} lists them", words[0],
                    words[1], words[1]));
  const std::vector<capture::ControlSetting> settings = settings_of(words.subspan(2));
  const std::vector<capture::ControlResult> results = controls.set(settings);
  for (const auto& result : results)
    add_row(reply, {result.name, result.asked, result.got ? std::to_string(*result.got) : "", result.problem});
  const auto refused =
      std::ranges::find_if(results, [](const auto& result) { return !result.problem.empty() && !result.is_implied; });
  if (refused != results.end()) throw std::runtime_error(to_string(*refused));
  if (!saves) {
    reply.reason(
        fmt::format("Set, but not saved: camera save {} {} keeps it.", words[1], fmt::join(words.subspan(2), " ")));
    return;
  }
  const auto file = config::save_controls(config.file, words[1], settings);
  reply.reason(
      fmt::format("Saved for camera {}; written into {}.{}", words[1], file.filename().string(), take_over(config)));
}

void ControlHandler::open(const std::string& name, const config::ServiceConfig& config,
                          msg::ControlReply& reply) const {
  if (!config.control.allow_record) throw forbidden("allow_record", config);
  if (!actions_.open_recording)
    throw std::runtime_error("only huetrackd run on live cameras without output files can open a recording");
  if (!config.is_calibrated()) throw std::runtime_error("the cameras are not calibrated yet");
  require_finished(name);
  RecordingLibrary(config.record.folder).read(name, 0, 0);  // checks that it exists
  recordings::read_recording(config.record.folder / name);  // checks that it is readable
  actions_.open_recording(config.record.folder / name);
  reply.reason(fmt::format("Replaying {} instead of the cameras, until it ends or is closed.", name));
}

void ControlHandler::replay(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) const {
  require_teaching(config);
  if (words.size() == 2 && words[0] == "open") {
    open(words[1], config, reply);
    return;
  }
  if (actions_.playback == nullptr) throw std::runtime_error("this is not a replay");
  Playback& playback = *actions_.playback;
  constexpr double slowest = 0.01, fastest = 100;
  if (are(words, {"close"})) {
    if (!actions_.close) throw std::runtime_error("this replay has no live cameras to return to");
    actions_.close();
    reply.reason("The cameras again.");
    return;
  }
  if (are(words, {"pause"})) {
    playback.pause();
  } else if (are(words, {"go"})) {
    playback.go_on();
  } else if (are(words, {"step"})) {
    playback.step(1);
  } else if (words.size() == 2 && words[0] == "step") {
    constexpr std::uint64_t most_sets = 100'000;
    const std::uint64_t sets = whole_number_of(words[1]);
    if (sets < 1 || sets > most_sets) throw std::runtime_error(fmt::format("write 1 to {} frame sets", most_sets));
    playback.step(int(sets));
  } else if (words.size() == 2 && words[0] == "speed") {
    const double speed = words[1] == "max" ? 0 : real_of(words[1]);
    if (words[1] != "max" && !(speed >= slowest && speed <= fastest))
      throw std::runtime_error(fmt::format("write a speed of {} to {}, or max", slowest, fastest));
    playback.set_speed(speed);
  } else if (words.size() == 2 && words[0] == "seek") {
    seek(playback, real_of(words[1]));
  } else if (!are(words, {"state"})) {
    throw unknown_request();
  }
  const PlaybackState state = playback.state();
  add_row(reply, {"state", state.is_paused ? "paused" : "playing"});
  add_row(reply, {"speed", state.speed > 0 ? fmt::format("{:g}", state.speed) : "max"});
  add_row(reply, {"closes", actions_.close ? "true" : "false"});
  add_row(reply, {"position_s", fmt::format("{:.3f}", state.position_s)});
  add_row(reply, {"length_s", state.length_s ? fmt::format("{:.3f}", *state.length_s) : ""});
  add_row(reply, {"loops", state.loops ? "true" : "false"});
  add_row(reply, {"seeks", state.why_no_seek.empty() ? "true" : "false"});
  reply.reason(fmt::format("{} at {:.3f} s.", state.is_paused ? "Paused" : "Playing", state.position_s));
}

void ControlHandler::history(const std::string& word, const config::ServiceConfig& config,
                             msg::ControlReply& reply) const {
  require_teaching(config);
  if (word != "history") {
    const bool is_undo = word == "undo";
    const config::TaughtHistory before = config::taught_history(config.file);
    const std::string& change = is_undo ? before.undoes : before.redoes;
    const std::string file = (is_undo ? config::undo_taught(config.file) : config::redo_taught(config.file)).filename();
    reply.reason(fmt::format("{}: {}{}{} is as it was {}.{}", is_undo ? "Undone" : "Redone", change,
                             change.empty() ? "" : "; ", file, is_undo ? "before the save" : "after it",
                             take_over(config)));
  }
  const config::TaughtHistory left = config::taught_history(config.file);
  add_row(reply, {"undoable", std::to_string(left.undoable), left.undoes});
  add_row(reply, {"redoable", std::to_string(left.redoable), left.redoes});
}

void ControlHandler::record(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) const {
  if (!config.control.allow_record) throw forbidden("allow_record", config);
  if (config.record.folder.empty())
    throw std::runtime_error("there is no folder for recordings: set record: {folder: ...} in " + config.file.string() +
                             ", and restart");
  if (are(words, {"state"})) {
    reply_state(config.record, reply);
  } else if (are(words, {"start"})) {
    reply.reason(fmt::format("Recording to {}.", recording().start_on_request().string()));
  } else if (are(words, {"stop"})) {
    reply.reason(fmt::format("Recorded to {}.", recording().stop_on_request().string()));
  } else if (are(words, {"save"})) {
    const double held_s = pre_roll_held_s();  // before it is taken
    const std::string folder = recording().save_on_request().string();
    reply.reason(fmt::format("Saving the last {:.1f} s, and {:g} more, to {}.", held_s, config.record.after_s, folder));
  } else if (are(words, {"list"})) {
    list(config.record, reply);
  } else if (words.size() == 2 && words[0] == "delete") {
    remove(words[1], config.record, reply);
  } else if (words.size() == 3 && words[0] == "read") {
    read(words, config.record, reply);
  } else if (words.size() == 3 && words[0] == "picture") {
    picture(words, config.record, reply);
  } else {
    throw unknown_request();
  }
}

// The result is saved next to the configuration like taught values; the recording is in record.folder.
void ControlHandler::calibrate(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) const {
  require_teaching(config);
  if (!config.control.allow_record) throw forbidden("allow_record", config);
  if (actions_.calibration == nullptr)
    throw std::runtime_error("only huetrackd run on live cameras without output files can calibrate");
  if (!words.empty() && words[0] == "accept") {
    const auto rig = actions_.calibration->accept(words.subspan(1), config);
    reply.reason(fmt::format("Accepted: {} is now the rig.{}", rig.filename().string(), take_over(config)));
  } else {
    actions_.calibration->answer(words, config, actions_.recording, reply);
  }
}

void ControlHandler::poll() const {
  if (actions_.calibration != nullptr) actions_.calibration->poll(actions_.recording);
}

void ControlHandler::remove(const std::string& name, const config::RecordConfig& record,
                            msg::ControlReply& reply) const {
  recording();  // refuses in a replay
  require_finished(name);
  if (idl::is_recording_name(name) && actions_.calibration != nullptr && name == actions_.calibration->busy_with())
    throw std::runtime_error(name + " is being used for a calibration: cancel that first");
  RecordingLibrary(record.folder).remove(name);
  reply.reason(fmt::format("Deleted: {}.", name));
}

double ControlHandler::pre_roll_held_s() const {
  const auto held = actions_.recording != nullptr ? actions_.recording->figures().pre_roll_held : std::nullopt;
  return held ? capture::seconds(*held) : 0;
}

void ControlHandler::reply_state(const config::RecordConfig& record, msg::ControlReply& reply) const {
  const bool is_recording = actions_.recording != nullptr && actions_.recording->is_recording();
  const std::string folder = is_recording ? actions_.recording->folder().string() : "";
  add_row(reply, {"state", actions_.recording == nullptr ? "replay" : is_recording ? "recording" : "idle"});
  add_row(reply, {"name", std::filesystem::path(folder).filename().string()});
  add_row(reply, {"folder", record.folder.string()});
  add_row(reply, {"pre_roll_s", fmt::format("{}", record.always ? 0 : record.pre_roll_s)});
  add_row(reply, {"pre_roll_held_s", fmt::format("{:.1f}", pre_roll_held_s())});
  add_row(reply, {"always", record.always ? "true" : "false"});
  reply.reason(is_recording ? fmt::format("Recording to {}.", folder) : "Nothing is being recorded.");
}

void ControlHandler::list(const config::RecordConfig& record, msg::ControlReply& reply) const {
  const std::string going_on = unfinished();
  const auto recordings = RecordingLibrary(record.folder).list(most_listed);
  for (const ListedRecording& one : recordings)
    add_row(reply, {one.name, one.begun_at_s ? fmt::format("{:.3f}", *one.begun_at_s) : "",
                    fmt::format("{:.3f}", one.length_s), std::to_string(one.bytes), std::to_string(one.cameras),
                    one.name == going_on ? "recording" : "done"});
  reply.reason(fmt::format("In {}: {}.", record.folder.string(), recordings.size()));
}

void ControlHandler::read(Words words, const config::RecordConfig& record, msg::ControlReply& reply) const {
  const std::string& name = words[1];
  require_finished(name);
  RecordingPiece piece = RecordingLibrary(record.folder).read(name, whole_number_of(words[2]), piece_bytes);
  add_row(reply, {std::to_string(piece.tar_bytes), piece.identity});
  reply.bytes(std::move(piece.bytes));
}

// In one piece.
void ControlHandler::picture(Words words, const config::RecordConfig& record, msg::ControlReply& reply) const {
  const std::string& name = words[1];
  require_finished(name);
  const std::uint64_t from = whole_number_of(words[2]);
  const std::string identity = RecordingLibrary(record.folder).read(name, 0, 0).identity;  // checks that it exists
  std::vector<std::uint8_t> jpeg = recording_picture(record.folder / name);
  add_row(reply, {std::to_string(jpeg.size()), identity});
  if (from == 0) reply.bytes(std::move(jpeg));
}

void ControlHandler::show_config(const config::ServiceConfig& config, msg::ControlReply& reply) const {
  require_teaching(config);
  for (const ConfigText& one : config_texts(config.file)) add_row(reply, {one.file.filename().string(), one.text});
  reply.reason(fmt::format("The configuration {}, without passwords.", config.file.string()));
}

}  // namespace huetrack::page
