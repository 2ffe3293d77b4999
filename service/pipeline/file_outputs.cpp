#include "pipeline/file_outputs.h"

#include <set>
#include <stdexcept>
#include <system_error>

namespace huetrack::pipeline {
namespace {

const std::filesystem::path& with_tracked_camera(const std::filesystem::path& file,
                                                 const config::ServiceConfig& config) {
  if (config.camera_tracking.camera.empty())
    throw std::runtime_error("--poses needs a camera to track: give camera_tracking in " + config.file.string());
  return file;
}

}  // namespace

std::string FileOutput::problem() const {
  const std::scoped_lock lock(mutex_);
  return problem_;
}

template <typename Write>
void FileOutput::attempt(Write&& write) {
  if (has_failed_) return;
  try {
    write();
  } catch (const std::system_error& error) {
    if (when_ == WhenFileFails::stop) throw;
    has_failed_ = true;
    const std::scoped_lock lock(mutex_);
    problem_ = std::string(error.what()) + ": the " + content_ + " are written no further";
  }
}

void refuse_one_file_for_two(const std::vector<std::filesystem::path>& files) {
  std::set<std::filesystem::path> known;
  for (const auto& file : files) {
    std::error_code none;
    if (!file.empty() && !known.insert(std::filesystem::weakly_canonical(file, none)).second)
      throw std::runtime_error(file.string() + " is to be written twice: give each output a file of its own");
  }
}

TrackFile::TrackFile(const std::filesystem::path& file, const config::ServiceConfig& config, WhenFileFails when)
    : FileOutput("tracks", when), writer_(file) {
  for (const auto& target : config.targets) targets_.push_back(target.name);
}

void TrackFile::on_set(const TrackedSet& set) {
  attempt([&] {
    for (const auto& estimate : set.estimates)
      writer_.write(object_tracking::object_name(targets_[estimate.target], estimate.object), estimate);
  });
}

void TrackFile::flush() {
  attempt([&] { writer_.flush(); });
}

PoseFile::PoseFile(const std::filesystem::path& file, const config::ServiceConfig& config, WhenFileFails when)
    : FileOutput("poses", when), writer_(with_tracked_camera(file, config)) {}

void PoseFile::on_camera_pose(const TrackedFrame& frame) {
  attempt([&] { writer_.write(frame.estimate); });
}

void PoseFile::flush() {
  attempt([&] { writer_.flush(); });
}

}  // namespace huetrack::pipeline
