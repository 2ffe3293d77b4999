#include "printable_sample.h"

#include <algorithm>

#include "calib/files/text_file.h"

namespace huetrack::client {
namespace {

constexpr std::size_t longest_name = 64, longest_sentence = 500;  // characters

// No comma, either: it would be another field of a CSV.
std::string word(const std::string& text) {
  std::string out = files::printable(text, longest_name);
  std::ranges::replace(out, ',', '_');
  return out;
}

std::string sentence(const std::string& text) {
  return files::printable(text, longest_sentence);
}

}  // namespace

void make_printable(msg::ObjectPosition& sample) {
  sample.target(word(sample.target()));
  for (msg::ViewSupport& view : sample.per_view()) view.camera(word(view.camera()));
}

void make_printable(msg::CameraPose& sample) {
  sample.camera(word(sample.camera()));
}

void make_printable(msg::ServiceStatus& sample) {
  sample.host(word(sample.host()));
  sample.program_version(word(sample.program_version()));
  sample.mode(word(sample.mode()));
  sample.frame_id(word(sample.frame_id()));
  sample.config_file(sentence(sample.config_file()));
  sample.config_identity(word(sample.config_identity()));
  sample.rig_identity(word(sample.rig_identity()));
  sample.rig_history(sentence(sample.rig_history()));
  for (msg::CameraStatus& camera : sample.cameras()) {
    camera.name(word(camera.name()));
    camera.message(sentence(camera.message()));
  }
  for (std::string& target : sample.targets()) target = word(target);
  for (std::string& warning : sample.warnings()) warning = sentence(warning);
}

void make_printable(msg::CameraTimes& sample) {
  sample.host(word(sample.host()));
  for (msg::CameraTime& camera : sample.cameras()) camera.camera(word(camera.camera()));
}

void make_printable(msg::HostClocks& sample) {
  sample.host(word(sample.host()));
  for (msg::HostClock& clock : sample.clocks()) {
    clock.host(word(clock.host()));
    for (std::string& camera : clock.cameras()) camera = word(camera);
    clock.advice(sentence(clock.advice()));
  }
}

void make_printable(msg::CameraHost& sample) {
  sample.host(word(sample.host()));
  sample.program_version(word(sample.program_version()));
  for (msg::HostedCamera& camera : sample.cameras()) {
    camera.name(word(camera.name()));
    camera.message(sentence(camera.message()));
  }
}

void make_printable(msg::ObjectSet& sample) {
  sample.target(word(sample.target()));
  for (msg::ObjectInSet& object : sample.objects()) object.name(word(object.name()));
}

const std::string& name_of(const msg::ObjectPosition& sample) {
  return sample.target();
}

const std::string& name_of(const msg::CameraPose& sample) {
  return sample.camera();
}

}  // namespace huetrack::client
