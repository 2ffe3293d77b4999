// What is asked of the running service over the bus, as far as it is answered without cameras: nothing may leave the
// handlers but a reply. The first byte chooses: words, a request a line, tabs between them; or a serialized
// TeachRequest after a look at pictures of a green ball.
#include <fastdds/rtps/common/SerializedPayload.h>

#include <array>
#include <memory>
#include <stdexcept>

#include "fuzz/fuzz_target.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/topics.h"
#include "page/control_handler.h"
#include "page/request_words.h"
#include "page/teaching_session.h"

using namespace huetrack;

namespace {

namespace fs = std::filesystem;
constexpr int columns = 64, rows = 48;  // of the pictures

// It reads any control, and sets it.
class Controls final : public capture::CameraControls {
 public:
  std::vector<capture::Control> read() const override {
    return {{.name = "gain", .max = 255, .value = 9, .menu = {}},
            {.name = "power_line_frequency", .max = 1, .value = 1, .menu = {{0, "Disabled"}, {1, "50 Hz"}}}};
  }
  std::vector<capture::ControlResult> set(std::span<const capture::ControlSetting> settings) override {
    std::vector<capture::ControlResult> results;
    for (const auto& setting : settings)
      results.push_back({.name = setting.name, .asked = "", .got = 1, .problem = ""});
    return results;
  }
  void keep(std::vector<capture::ControlSetting>) override {}
};

class Playing final : public page::Playback {
 public:
  page::PlaybackState state() const override { return state_; }
  void pause() override { state_.is_paused = true; }
  void go_on() override { state_.is_paused = false; }
  void step(int sets) override {
    if (sets < 1) throw std::logic_error("a replay that goes backwards");
  }
  void set_speed(double speed) override {
    if (!(speed >= 0)) throw std::logic_error("a replay of no speed");
    state_.speed = speed;
  }
  void seek(double position_s) override {
    if (!(position_s >= 0)) throw std::logic_error("a replay before its beginning");
  }

 private:
  page::PlaybackState state_;
};

// A configuration of two cameras, as it is before anything was taught, in a folder of its own with one recording. It is
// read once: that takes longer than most of what is asked.
const config::ServiceConfig& fresh_config() {
  const fs::path folder = fuzz::folder() / "desk", demo = HUETRACK_SOURCE_DIR "/configs/demo/recording";
  fs::remove_all(folder);
  fs::create_directories(folder / "recordings/one");
  fs::copy_file(demo / "recording.yaml", folder / "recordings/one/recording.yaml");
  fuzz::file_with("desk/rig.yaml", R"(version: 1
cameras:
  a:
    image_size: [64, 48]
    model: pinhole_radtan
    intrinsics: {fx: 48, fy: 48, cx: 31.5, cy: 23.5}
    distortion: [0, 0, 0, 0, 0]
    cam_from_world: {rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], translation: [0, 0, 2]}
  b:
    image_size: [64, 48]
    model: pinhole_radtan
    intrinsics: {fx: 48, fy: 48, cx: 31.5, cy: 23.5}
    distortion: [0, 0, 0, 0, 0]
    cam_from_world: {rotation: [[0, 0, -1], [0, 1, 0], [1, 0, 0]], translation: [0, 0, 2]}
)");
  const fs::path file = fuzz::file_with("desk/c.yaml", R"(version: 1
rig: rig.yaml
targets: {ball: {color: {hue_deg: [65, 115]}}, red: {radius_m: 0.04, color: {hue_deg: [350, 10]}}}
cameras: {a: {device: 0}, b: {device: 1}}
record: {folder: recordings, pre_roll_s: 5}
control: {allow_teach: true, allow_record: true}
)");
  static const config::ServiceConfig config = config::load_service_config(file);
  return config;
}

// What was saved holds, or it ends the program.
void read_what_was_taught(const config::ServiceConfig& config) {
  if (fs::exists(config::taught_file(config.file))) config::load_service_config(config.file);
}

std::string no_problem() {
  return "";
}

void ask_in_words(std::string_view input) {
  const config::ServiceConfig& config = fresh_config();
  Playing playing;
  page::CalibrationSession calibration({.program = fuzz::folder() / "no_such_program"});
  const page::ControlHandler handler({.calibration = &calibration,
                                      .playback = &playing,
                                      .close = [] {},
                                      .open_recording = [](const fs::path&) {},
                                      .cameras = {{"a", std::make_shared<Controls>()}},
                                      .reload = no_problem,
                                      .restart = no_problem});
  std::vector<std::string> lines = page::split(input, '\n');
  constexpr std::size_t most = 8;  // each may write a file
  if (lines.size() > most) lines.resize(most);
  msg::ControlRequest request;
  for (const std::string& line : lines) {
    request.words(page::split(line, '\t'));
    const msg::ControlReply reply = handler.answer(request, config);
    if (!reply.granted() && reply.reason().empty()) throw std::logic_error("refused, and nobody is told why");
    handler.poll();
  }
  read_what_was_taught(config);
}

// A grey picture with a green ball in its middle.
capture::Image ball() {
  auto [image, data] = capture::make_image(capture::PixelFormat::i444, capture::ColorRange::limited, columns, rows);
  for (int v = 0; v < rows; ++v)
    for (int u = 0; u < columns; ++u) {
      const bool is_ball = (u - columns / 2) * (u - columns / 2) + (v - rows / 2) * (v - rows / 2) < 49;
      const std::array<std::uint8_t, 3> yuv =
          is_ball ? std::array<std::uint8_t, 3>{150, 60, 70} : std::array<std::uint8_t, 3>{100, 128, 128};
      for (std::size_t p = 0; p < 3; ++p) data[p][v * image.planes[p].stride + u] = yuv[p];
    }
  return image;
}

void ask_to_teach(std::string_view input) {
  if (input.size() > idl::largest_sample(idl::teach_request_topic).value()) return;
  msg::TeachRequestPubSubType type;
  msg::TeachRequest request;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(input.size()));
  std::copy(input.begin(), input.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(input.size());
  if (!type.deserialize(&payload, &request)) return;
  const config::ServiceConfig& config = fresh_config();
  page::TeachingSession session({.reload = no_problem, .resume = [] {}});
  capture::FrameSet set{.number = 1, .at = {}, .frames = {}};
  for (int c = 0; c < 2; ++c) {
    capture::Frame& frame = set.frames.emplace_back(std::in_place).value();
    frame.camera = c;
    frame.pixels = ball();
  }
  if (!session.freeze(request, config, set).granted()) throw std::logic_error("no pictures to point at");
  const msg::TeachReply reply = session.answer(request, config);
  if (!reply.granted() && reply.reason().empty()) throw std::logic_error("refused, and nobody is told why");
  read_what_was_taught(config);
}

}  // namespace

HUETRACK_FUZZ_TARGET(requests) {
  if (input.empty()) return;
  if (static_cast<unsigned char>(input.front()) % 2 == 0) return ask_in_words(input.substr(1));
  ask_to_teach(input.substr(1));
}
