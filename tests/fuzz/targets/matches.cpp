// Which pixels match, as bytes. The first byte chooses: those of one frame, or a file of a recording, without the line
// with which it begins.
#include "capture/frames/matches.h"

#include <stdexcept>

#include "calib/files/config_error.h"
#include "fuzz/fuzz_target.h"
#include "recordings/matches_reader.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

using namespace huetrack;

namespace {

void read_frame(std::string_view input) {
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
  capture::JpegDecoder decoder;
  capture::Image latest;
  const auto decoded = capture::decode_matches(bytes, decoder, latest);
  constexpr int longest = 512;  // of what a few bytes say of the largest image the fuzzer learns nothing more
  if (!decoded || decoded->source.width > longest || decoded->source.height > longest) return;
  std::vector<std::uint8_t> again;
  capture::encode_matches(decoded->source, decoded->matches->colors, {}, again);
  const auto back = capture::decode_matches(again, decoder, latest);
  if (!back || back->matches->colors.size() != decoded->matches->colors.size())
    throw std::logic_error("the matches do not read back");
  for (std::size_t i = 0; i < back->matches->colors.size(); ++i)
    if (back->matches->colors[i].tiles != decoded->matches->colors[i].tiles)
      throw std::logic_error("other pixels match when it is read back");
}

void read_file(std::string_view input) {
  recordings::Recording recording;
  recording.file = fuzz::folder() / "recording.yaml";
  recordings::RecordedCamera camera;
  camera.name = "cam0";
  camera.frames = fuzz::file_with("cam0.matches", std::string(recordings::matches_file_begins).append(input));
  camera.fps = 30;
  recording.cameras.push_back(camera);
  const std::string names[] = {"cam0"};
  recordings::ReplaySource source(recording, names,
                                  {.decoder_threads = 1, .keeps_encoded = true, .takes_matches = true});
  for (int i = 0; i < 5 && source.next({}); ++i) {
  }
}

}  // namespace

HUETRACK_FUZZ_TARGET(matches) {
  if (input.empty() || fuzz::is_long_to_decode(input)) return;
  try {
    if (static_cast<unsigned char>(input.front()) % 2 == 0) return read_frame(input.substr(1));
    read_file(input.substr(1));
  } catch (const files::ConfigError&) {
  }
}
