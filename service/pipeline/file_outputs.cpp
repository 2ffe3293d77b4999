#include "pipeline/file_outputs.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <system_error>

#include "calib/files/output_file.h"

namespace huetrack::pipeline {
namespace {

namespace fs = std::filesystem;

const std::filesystem::path& with_tracked_camera(const std::filesystem::path& file,
                                                 const config::ServiceConfig& config) {
  if (config.camera_tracking.camera.empty())
    throw std::runtime_error("--poses needs a tracked camera: set camera_tracking in " + config.file.string());
  return file;
}

}  // namespace

FileOutput::FileOutput(std::string content, const fs::path& file, WhenFileFails when)
    : content_(std::move(content)), when_(when), was_there_([&] {
        std::error_code none;
        return fs::is_regular_file(file, none) && fs::file_size(file, none) > 0;
      }()) {}

void FileOutput::log_replaced(const fs::path& file) const {
  if (was_there_) spdlog::info("{}: replaced the earlier {}", file.string(), content_);
}

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
    problem_ = std::string(error.what()) + ": no more " + content_ + " are written: free some space and restart";
  }
}

std::vector<fs::path> files_of(const config::ServiceConfig& config) {
  std::vector<fs::path> out{config.file,
                            config::taught_file(config.file),
                            config.rig_file,
                            config.calibration.room_file,
                            config.camera_tracking.load_map,
                            config.camera_tracking.board};
  std::erase(out, fs::path());
  return out;
}

std::vector<fs::path> files_of(const recordings::Recording& recording) {
  std::vector<fs::path> out{recording.file};
  for (const recordings::RecordedCamera& camera : recording.cameras) out.push_back(camera.frames);
  return out;
}

void refuse_outputs(const WrittenFiles& outputs, const std::vector<fs::path>& read) {
  const auto real = [](const fs::path& file) {
    std::error_code none;
    return fs::weakly_canonical(files::resolved_link(file), none);
  };
  const fs::path pictures = outputs.pictures.empty() ? fs::path() : real(outputs.pictures);
  std::set<fs::path> known;
  for (const fs::path& file : outputs.files) {
    if (file.empty()) continue;
    const fs::path at = real(file);
    if (!known.insert(at).second)
      throw std::runtime_error(file.string() + " would be written twice: give each output its own file");
    if (!pictures.empty() && at.parent_path() == pictures && at.extension() == ".png")
      throw std::runtime_error(file.string() + " could be overwritten by a picture of --pictures: give each output " +
                               "its own file");
    std::error_code none;
    const bool is_read = std::ranges::any_of(
        read, [&](const fs::path& input) { return real(input) == at || fs::equivalent(input, file, none); });
    if (is_read)
      throw std::runtime_error(file.string() + " is read by this run and is not replaced: give another name");
  }
  for (const fs::path& input : read) {
    std::error_code none;
    const bool is_pictures = !fs::is_regular_file(input, none) && input.has_extension();  // cam0/%06d.png
    if (!pictures.empty() && is_pictures && real(input.parent_path()) == pictures)
      throw std::runtime_error(outputs.pictures.string() + " holds the recording's own pictures: give another folder");
  }
}

TrackFile::TrackFile(const std::filesystem::path& file, const config::ServiceConfig& config, WhenFileFails when)
    : FileOutput("tracks", file, when), writer_(file) {
  log_replaced(file);
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
    : FileOutput("poses", file, when), writer_(with_tracked_camera(file, config)) {
  log_replaced(file);
}

void PoseFile::on_camera_pose(const TrackedFrame& frame) {
  attempt([&] { writer_.write(frame.estimate); });
}

void PoseFile::flush() {
  attempt([&] { writer_.flush(); });
}

}  // namespace huetrack::pipeline
