#include "page/calibration_session.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>

#include "calib/files/temporary_folder.h"
#include "calib/model/rig_yaml.h"
#include "page/request_words.h"

namespace huetrack::page {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr const char* calibrator = "huetrack-calibrate";
constexpr const char *rig_name = "calibrated.yaml", *report_name = "calibrated.report.html",
                     *log_name = "calibrated.log", *board_name = "board.yaml";
constexpr double least_wave_s = 5, most_wave_s = 600;
constexpr double least_distance_m = 0.05, most_distance_m = 200;  // between two cameras
constexpr auto coverage_patience = 2s;                            // for the coverage analysis to end
// Printing a board delays the page's pictures: some tenths of a second.
constexpr auto print_patience = 5s;
constexpr std::size_t report_piece_bytes = 256 * 1024;  // half of the limit of a reply

// Keys of requests and the options of `huetrack-calibrate board`. The last is only for printing.
constexpr std::array<std::pair<std::string_view, std::string_view>, 9> board_keys{{{"type", "type"},
                                                                                   {"columns", "columns"},
                                                                                   {"rows", "rows"},
                                                                                   {"square_mm", "square"},
                                                                                   {"marker_mm", "marker"},
                                                                                   {"gap_mm", "gap"},
                                                                                   {"dictionary", "dictionary"},
                                                                                   {"first_marker", "first-marker"},
                                                                                   {"paper", "paper"}}};

std::vector<std::string> board_options(std::span<const std::string> words, bool is_printed) {
  std::vector<std::string> options;
  bool has_type = false;
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    const auto known = std::ranges::find(board_keys, std::string_view(word).substr(0, equals),
                                         &std::pair<std::string_view, std::string_view>::first);
    if (equals == std::string::npos || known == board_keys.end() || (known->first == "paper" && !is_printed))
      throw std::runtime_error(fmt::format(
          "unknown key {}: use type=, columns=, rows=, square_mm=, marker_mm=, gap_mm=, dictionary=, first_marker={}",
          word, is_printed ? ", paper=" : ""));
    has_type |= known->first == "type";
    options.push_back(fmt::format("--{}={}", known->second, word.substr(equals + 1)));
  }
  if (!has_type) options.emplace_back("--type=charuco");
  return options;
}

// The last line of a program's output, without its name.
std::string without_name(std::string line) {
  constexpr std::string_view after_name = ": ";
  const std::size_t name = std::string_view(calibrator).size();
  if (line.starts_with(calibrator) && line.compare(name, after_name.size(), after_name) == 0)
    line.erase(0, name + after_name.size());
  return line;
}

pipeline::RecordingKeeper& needed(pipeline::RecordingKeeper* recording) {
  if (recording == nullptr) throw std::runtime_error("this is a replay: only live cameras can be calibrated");
  return *recording;
}

// Calibration needs whole pictures. throws std::runtime_error
void require_pictures(const config::ServiceConfig& config) {
  const auto without = std::ranges::find(config.cameras, config::Sent::matches, &config::LiveCameraConfig::send);
  if (without != config.cameras.end())
    throw std::runtime_error(
        fmt::format("camera {} sends matches only, but a calibration needs pictures: set send: frames in {} for the "
                    "calibration, and restart",
                    without->name, config.file.string()));
}

// throws std::runtime_error
double number_between(const std::string& text, double least, double most, const char* wanted) {
  const auto value = finite_number(text);
  if (!value || *value < least || *value > most)
    throw std::runtime_error(fmt::format("must be {} to {} {}, not {}", least, most, wanted, text));
  return *value;
}

constexpr std::string_view distance_key = "camera_distance=";

// "camera_distance=left,right,3.42": "left", "right", "3.42".
// throws std::runtime_error
std::vector<std::string> camera_distance_of(std::string_view word, const calib::CameraRig& rig) {
  std::vector<std::string> parts = split(word.substr(distance_key.size()), ',');
  if (parts.size() != 3) throw std::runtime_error("write camera_distance=CAMERA,CAMERA,METRES");
  for (const std::string& camera : {parts[0], parts[1]})
    if (!rig.index_of(camera)) throw std::runtime_error(fmt::format("there is no camera {}", camera));
  if (parts[0] == parts[1]) throw std::runtime_error("camera_distance needs two different cameras");
  number_between(parts[2], least_distance_m, most_distance_m, "metres");
  return parts;
}

// A part of so many bytes.
struct Piece {
  std::uint64_t of_bytes = 0;
  std::vector<std::uint8_t> bytes = {};
};

// A missing file counts as empty. throws std::runtime_error
Piece piece_of(const fs::path& path, std::uint64_t from, std::uint64_t most_bytes) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) return {};
  Piece piece{.of_bytes = std::uint64_t(file.tellg())};
  from = std::min(from, piece.of_bytes);
  piece.bytes.resize(std::size_t(std::min(most_bytes, piece.of_bytes - from)));
  file.seekg(std::streamoff(from));
  if (!piece.bytes.empty() &&
      !file.read(reinterpret_cast<char*>(piece.bytes.data()), std::streamsize(piece.bytes.size())))
    throw std::runtime_error(path.filename().string() + " cannot be read");
  return piece;
}

Piece piece_of(std::span<const std::uint8_t> whole, std::uint64_t from, std::size_t most_bytes) {
  const auto rest = whole.subspan(std::size_t(std::min<std::uint64_t>(from, whole.size())));
  const auto piece = rest.first(std::min(rest.size(), most_bytes));
  return {.of_bytes = whole.size(), .bytes = {piece.begin(), piece.end()}};
}

// identity: of the whole.
void add_piece(Piece piece, const std::string& identity, msg::ControlReply& reply) {
  reply.rows().emplace_back().columns({std::to_string(piece.of_bytes), identity});
  reply.bytes(std::move(piece.bytes));
}

}  // namespace

void CalibrationSession::answer(Words words, const config::ServiceConfig& config, pipeline::RecordingKeeper* recording,
                                msg::ControlReply& reply) {
  if (words.empty()) throw unknown_request();
  const std::string& verb = words[0];
  if (verb == "board") {
    begin_board(words.subspan(1), config, recording, reply);
  } else if (verb == "wave" && words.size() >= 2 && words.size() <= 4) {
    begin_wave(words.subspan(1), config, recording, reply);
  } else if (verb == "again" && words.size() == 2) {
    solve_again(words.subspan(1), config, reply);
  } else if (verb == "print" && words.size() >= 2) {
    read_print(words.subspan(1), reply);
  } else if (verb == "state" && words.size() == 1) {
    reply_state(config, reply);
  } else if (verb == "stop" && words.size() == 1) {
    stop(recording, reply);
  } else if (verb == "cancel" && words.size() == 1) {
    cancel(recording, reply);
  } else if (verb == "report" && words.size() == 2) {
    read_report(words.subspan(1), reply);
  } else {
    throw unknown_request();
  }
}

fs::path CalibrationSession::program() const {
  const auto program = options_.program.empty() ? find_program(calibrator) : std::optional(options_.program);
  if (!program)
    throw std::runtime_error(
        fmt::format("{} was not found next to huetrackd or on its PATH: install it (configs/install.sh)", calibrator));
  return *program;
}

void CalibrationSession::begin(Kind kind, const config::ServiceConfig& config) {
  if (is_busy()) throw std::runtime_error("a calibration is in progress: stop or cancel it first");
  program_ = program();
  kind_ = kind;
  config_file_ = config.file;
  rig_before_ = config.rig_file;
  child_.reset();
  has_board_ = false;
  camera_distance_.clear();
  calibrated_by_.reset();
  end_at_.reset();
  for (std::string* text : {&says_, &last_line_, &step_, &done_, &total_, &details_, &verdict_}) text->clear();
  coverage_.clear(), next_coverage_.clear(), needs_.clear(), next_needs_.clear();
  began_at_ = Clock::now();
}

void CalibrationSession::begin_board(Words words, const config::ServiceConfig& config,
                                     pipeline::RecordingKeeper* recording, msg::ControlReply& reply) {
  pipeline::RecordingKeeper& keeper = needed(recording);
  const std::vector<std::string> options = board_options(words, false);
  if (config.cameras.size() < 2) throw std::runtime_error("at least two live cameras are needed");
  require_pictures(config);
  begin(Kind::board, config);
  folder_ = keeper.start_anew("board");
  stage_ = Stage::recording;
  says_ = "show the board to the cameras, and hold it still in many places";
  end_at_ = began_at_ + options_.longest_board;
  // The paper size does not matter here: only the board file is used.
  std::vector<std::string> arguments{"board", "--paper=5000x5000", "--out=" + in_folder("board.pdf").string(),
                                     "--board=" + in_folder(board_name).string()};
  arguments.insert(arguments.end(), options.begin(), options.end());
  try {
    start(std::move(arguments));
  } catch (const std::runtime_error& error) {
    end(Stage::failed, error.what());
    keeper.stop_on_request();
    throw;
  }
  reply.reason(fmt::format("Recording to {}: show the board to the cameras; calibrate stop ends it and calibrates.",
                           folder_.string()));
}

void CalibrationSession::begin_wave(Words words, const config::ServiceConfig& config,
                                    pipeline::RecordingKeeper* recording, msg::ControlReply& reply) {
  pipeline::RecordingKeeper& keeper = needed(recording);
  const auto target = std::ranges::find(config.targets, words[0], &object_tracking::TargetOptions::name);
  if (target == config.targets.end()) throw std::runtime_error(fmt::format("there is no target {}", words[0]));
  if (!config::is_taught(*target))
    throw std::runtime_error(fmt::format("{} has no colour yet: teach it first", words[0]));
  require_pictures(config);
  std::vector<std::string> distance;
  if (words.back().starts_with(distance_key)) {
    distance = camera_distance_of(words.back(), config.rig);
    words = words.first(words.size() - 1);
  }
  if (words.size() > 2) throw unknown_request();
  std::optional<double> seconds;
  if (words.size() > 1) seconds = number_between(words[1], least_wave_s, most_wave_s, "seconds");
  if (!seconds && !(config.record.pre_roll_s > 0))
    throw std::runtime_error(
        "there is no pre-roll: set record: {pre_roll_s: 60} and restart, or give the number of seconds to record "
        "from now on");
  begin(Kind::wave, config);
  target_ = words[0];
  camera_distance_ = std::move(distance);
  if (seconds) {
    folder_ = keeper.start_anew("wave");
    end_at_ = began_at_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(*seconds));
    says_ = fmt::format("wave {} through the whole volume{} for {:g} s", target_,
                        config.is_calibrated() ? "" : ", then throw it five times and let it bounce,", *seconds);
    try {
      start({"coverage", folder_.string(), "--config=" + config_file_.string(), "--target=" + target_});
    } catch (const std::runtime_error& error) {  // optional for the calibration
      needs_ = {std::string("the coverage cannot be analysed: ") + error.what()};
    }
  } else {
    folder_ = keeper.save_on_request("wave");
    says_ = fmt::format("saving the last {:g} s", config.record.pre_roll_s);
  }
  stage_ = Stage::recording;
  reply.reason(
      seconds ? fmt::format("Recording {:g} s to {}: wave {} through the whole volume.", *seconds, folder_.string(),
                            target_)
              : fmt::format("Calibrating from the last {:g} s, in {}.", config.record.pre_roll_s, folder_.string()));
}

// From the same recording again, with the measured distance.
void CalibrationSession::solve_again(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) {
  if (!words[0].starts_with(distance_key)) throw unknown_request();
  std::vector<std::string> distance = camera_distance_of(words[0], config.rig);
  if (is_busy()) throw std::runtime_error("a calibration is in progress: stop or cancel it first");
  const bool is_there = stage_ == Stage::usable || stage_ == Stage::doubtful || stage_ == Stage::failed;
  if (kind_ != Kind::wave || !is_there) throw std::runtime_error("there is no wave to calibrate from again");
  const fs::path folder = folder_;
  const std::string target = target_;
  begin(Kind::wave, config);
  folder_ = folder;
  target_ = target;
  camera_distance_ = std::move(distance);
  stage_ = Stage::closing;
  says_ = "calibrating from the same recording";
  reply.reason(fmt::format("Calibrating from {} again, with the measured distance.", folder_.string()));
}

// words: the board, and the offset in its PDF, which is created once for all parts.
void CalibrationSession::read_print(Words words, msg::ControlReply& reply) {
  const Words board = words.first(words.size() - 1);
  if (!std::ranges::equal(board, printed_for_) || print_.empty()) {
    std::vector<std::string> arguments = board_options(board, true);
    const files::TemporaryFolder folder("huetrack-board");
    const fs::path pdf = folder.path() / "board.pdf";
    arguments.insert(arguments.begin(), {"board", "--out=" + pdf.string()});
    std::string last_line;
    std::optional<ChildProcess::Ended> ended;
    {
      ChildProcess child(program(), arguments);
      for (const auto until = Clock::now() + print_patience; !ended && Clock::now() < until;) {
        std::this_thread::sleep_for(5ms);
        ended = child.ended();
        for (const std::string& line : child.take_lines())
          if (!line.empty()) last_line = without_name(line);
      }
    }
    const bool is_made = ended && ended->status == 0 && ended->signal == 0;
    print_ = is_made ? piece_of(pdf, 0, std::numeric_limits<std::uint64_t>::max()).bytes : std::vector<std::uint8_t>();
    printed_for_.assign(board.begin(), board.end());
    if (print_.empty()) throw std::runtime_error(last_line.empty() ? "the board cannot be printed" : last_line);
  }
  add_piece(piece_of(print_, whole_number_of(words.back()), report_piece_bytes), fmt::to_string(fmt::join(board, " ")),
            reply);
  reply.reason("The board, to be printed at 100 %.");
}

bool CalibrationSession::is_recorded_by(const pipeline::RecordingKeeper* recording) const {
  return recording != nullptr && recording->folder() == folder_ && recording->is_recording();
}

void CalibrationSession::stop(pipeline::RecordingKeeper* recording, msg::ControlReply& reply) {
  if (stage_ != Stage::recording)
    throw std::runtime_error(is_busy() ? "the recording has ended: calibrate cancel ends the rest"
                                       : "no calibration is in progress");
  if (is_recorded_by(recording)) recording->stop_on_request();
  check_recording(recording);
  reply.reason(fmt::format("Recorded to {}: calibrating from it.", folder_.string()));
}

void CalibrationSession::cancel(pipeline::RecordingKeeper* recording, msg::ControlReply& reply) {
  if (!is_busy()) throw std::runtime_error("no calibration is in progress");
  if (is_recorded_by(recording)) recording->stop_on_request();
  end(Stage::cancelled, "it was cancelled");
  reply.reason(fmt::format("Cancelled. The recording stays in {}.", folder_.string()));
}

void CalibrationSession::end(Stage stage, const std::string& says) {
  child_.reset();
  stage_ = stage;
  says_ = says;
  step_.clear();
  if (options_.log) options_.log(stage == Stage::failed, fmt::format("calibration {}: {}", folder_.string(), says));
}

void CalibrationSession::start(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "--tell-program");
  last_line_.clear();
  child_.emplace(program_, arguments);
}

void CalibrationSession::poll(pipeline::RecordingKeeper* recording) {
  if (!is_busy()) return;
  try {
    read_output();
    const bool was_solving = stage_ == Stage::solving;  // the ended child may be an earlier one
    const auto ended = child_ ? child_->ended() : std::nullopt;
    if (ended) read_output();  // the rest
    if (stage_ == Stage::recording && ended && kind_ == Kind::board && !has_board_) {
      if (ended->status != 0 || ended->signal != 0) {
        const std::string why = last_line_;
        if (is_recorded_by(recording)) recording->stop_on_request();
        end(Stage::failed, why.empty() ? "the board file cannot be written" : why);
        return;
      }
      has_board_ = true;
      start({"coverage", folder_.string(), "--board=" + in_folder(board_name).string()});
    } else if (stage_ == Stage::recording && ended) {  // not needed for the calibration
      if (!last_line_.empty()) needs_ = {"the coverage cannot be analysed: " + last_line_};
      child_.reset();
    }
    if (stage_ == Stage::recording) check_recording(recording);
    if (stage_ == Stage::closing) solve_when_closed(recording);
    if (was_solving && ended) take_result(*ended);
  } catch (const std::exception& error) {  // for example a full disk
    end(Stage::failed, error.what());
  }
}

// Ends the recording when due, and notices if it has ended otherwise: by a request, a full disk, another session.
void CalibrationSession::check_recording(pipeline::RecordingKeeper* recording) {
  if (is_recorded_by(recording)) {
    if (!end_at_ || Clock::now() < *end_at_) return;
    recording->stop_on_request();
  }
  if (kind_ == Kind::board && !has_board_) {
    if (child_) return;  // wait for the child
    return end(Stage::failed, "the board file is missing");
  }
  stage_ = Stage::closing;
  says_ = "writing the recording";
  if (child_) child_->ask_to_end();
  end_requested_at_ = Clock::now();
}

void CalibrationSession::solve_when_closed(const pipeline::RecordingKeeper* recording) {
  if (recording != nullptr && recording->folder() == folder_ && recording->is_unfinished()) return;
  if (child_ && !child_->ended()) {
    if (Clock::now() > end_requested_at_ + coverage_patience) child_->kill();
    return;
  }
  std::vector<std::string> arguments;
  if (kind_ == Kind::board) {
    arguments = {"extrinsics", folder_.string(), "--board=" + in_folder(board_name).string()};
    if (!rig_before_.empty()) {
      arguments.push_back("--intrinsics=" + rig_before_.string());
      arguments.push_back("--world-of=" + rig_before_.string());
    }
  } else {
    arguments = {"wave", folder_.string(), "--config=" + config_file_.string(), "--target=" + target_, "--overwrite"};
    if (!camera_distance_.empty()) {
      arguments.emplace_back("--camera-distance");
      arguments.insert(arguments.end(), camera_distance_.begin(), camera_distance_.end());
    }
  }
  arguments.push_back("--rig=" + in_folder(rig_name).string());
  arguments.push_back("--report=" + in_folder(report_name).string());
  stage_ = Stage::solving;
  says_ = "calibrating from the recording";
  start(std::move(arguments));
}

void CalibrationSession::take_result(const ChildProcess::Ended& ended) {
  constexpr int usable_status = 0, doubtful_status = 2;  // huetrack-calibrate's
  if (ended.signal != 0)
    return end(Stage::failed, fmt::format("{} was ended by signal {}{}", calibrator, ended.signal,
                                          last_line_.empty() ? "" : "; its last line: " + last_line_));
  if (ended.status != usable_status && ended.status != doubtful_status)
    return end(Stage::failed, !verdict_.empty() ? verdict_ : last_line_.empty() ? "nothing came of it" : last_line_);
  if (!fs::exists(in_folder(rig_name))) return end(Stage::failed, "it wrote no rig");
  const bool is_usable = ended.status == usable_status;
  end(is_usable ? Stage::usable : Stage::doubtful,
      verdict_.empty() ? (is_usable ? "usable" : "doubtful: see the report") : verdict_);
}

void CalibrationSession::read_output() {
  if (!child_) return;
  for (const std::string& line : child_->take_lines()) parse(line);
}

// Tagged lines are for this program; others are for people and are logged next to the recording.
void CalibrationSession::parse(const std::string& line) {
  if (!line.starts_with('@')) {
    if (line.empty()) return;
    last_line_ = without_name(line);
    std::ofstream(in_folder(log_name), std::ios::app) << line << '\n';
    return;
  }
  std::vector<std::string> fields = split(std::string_view(line).substr(1), '\t');
  if (fields[0] == "progress" && fields.size() >= 5) {
    step_ = fields[1], done_ = fields[2], total_ = fields[3], details_ = fields[4];
    if (stage_ == Stage::recording) {  // end of a round of coverage
      coverage_ = std::exchange(next_coverage_, {});
      needs_ = std::exchange(next_needs_, {});
    }
  } else if (fields[0] == "coverage" && fields.size() >= 9) {
    CameraCoverage camera{.camera = fields[1], .fields = {}};
    camera.fields.assign(fields.begin() + 2, fields.end());
    next_coverage_.push_back(std::move(camera));
  } else if (fields[0] == "need" && fields.size() >= 2) {
    next_needs_.push_back(fields[1]);
  } else if (fields[0] == "verdict" && fields.size() >= 3) {
    verdict_ = fields[2];
  } else if (fields[0] == "ball" && fields.size() >= 5) {
    calibrated_by_ = {.target = target_,
                      .middle = {real_of(fields[1]), real_of(fields[2]), real_of(fields[3])},
                      .radius_m = finite_number(fields[4])};
  }
}

void CalibrationSession::reply_state(const config::ServiceConfig& config, msg::ControlReply& reply) const {
  constexpr std::array words{"idle",     "recording", "closing",   "solving", "usable",
                             "doubtful", "failed",    "cancelled", "accepted"};
  const auto add = [&](std::vector<std::string> columns) { reply.rows().emplace_back().columns(std::move(columns)); };
  const std::string state = words[std::size_t(stage_)];
  add({"state", state});
  add({"pre_roll_s", fmt::format("{}", config.record.always ? 0 : config.record.pre_roll_s)});
  if (stage_ == Stage::idle) {
    reply.reason("No calibration since the start.");
    return;
  }
  std::error_code none;
  add({"kind", kind_ == Kind::board ? "board" : "wave"});
  if (!camera_distance_.empty()) add({"camera_distance", fmt::to_string(fmt::join(camera_distance_, ","))});
  add({"name", folder_.filename().string()});
  add({"says", says_});
  add({"report", fs::exists(in_folder(report_name), none) ? "true" : "false"});
  if (is_busy()) {
    add({"seconds", fmt::format("{:.1f}", std::chrono::duration<double>(Clock::now() - began_at_).count())});
    if (!step_.empty()) add({"progress", step_, done_, total_, details_});
  }
  for (const CameraCoverage& camera : coverage_) {
    std::vector<std::string> columns{"coverage", camera.camera};
    columns.insert(columns.end(), camera.fields.begin(), camera.fields.end());
    add(std::move(columns));
  }
  for (const std::string& need : needs_) add({"need", need});
  reply.reason(fmt::format("{}: {}.", state, says_));
}

void CalibrationSession::read_report(Words words, msg::ControlReply& reply) const {
  Piece piece;
  if (stage_ != Stage::idle) piece = piece_of(in_folder(report_name), whole_number_of(words[0]), report_piece_bytes);
  if (piece.of_bytes == 0) throw std::runtime_error("there is no report");
  add_piece(std::move(piece), folder_.filename().string(), reply);
}

fs::path CalibrationSession::accept(Words words, const config::ServiceConfig& config) {
  const bool takes_doubtful = words.size() == 1 && words[0] == "doubtful";
  if (!words.empty() && !takes_doubtful) throw unknown_request();
  if (is_busy()) throw std::runtime_error("the calibration is not finished yet");
  if (stage_ == Stage::accepted) throw std::runtime_error("it was already accepted");
  if (stage_ != Stage::usable && stage_ != Stage::doubtful)
    throw std::runtime_error("there is no calibration to accept");
  if (stage_ == Stage::doubtful && !takes_doubtful)
    throw std::runtime_error(
        fmt::format("it is doubtful ({}): calibrate again, or use it with accept doubtful", says_));
  const calib::CameraRig rig = calib::read_rig(in_folder(rig_name));
  const fs::path taught = config::taught_file(config.file);
  const fs::path place =
      taught.parent_path() /
      fmt::format("{}.rig-{}.yaml", fs::weakly_canonical(config.file).stem().string(), folder_.filename().string());
  std::error_code none;
  if (fs::exists(place, none)) throw std::runtime_error(place.string() + " is there already");
  calib::write_rig(rig, place);
  try {
    config::save_rig(config.file, place, calibrated_by_);
  } catch (const std::exception&) {  // it lacks a camera of the configuration
    fs::remove(place, none);
    throw;
  }
  stage_ = Stage::accepted;
  says_ = fmt::format("{} is now the rig", place.filename().string());
  if (options_.log) options_.log(false, "calibration accepted: " + place.string());
  return place;
}

}  // namespace huetrack::page
