// Outputs to text files: tracks of the targets (CSV) and poses of the tracked camera (TUM).
#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include "pipeline/output.h"
#include "recordings/recording.h"
#include "tracks/pose_file.h"
#include "tracks/track_csv.h"

namespace huetrack::pipeline {

// What a write error (a full disk) does to the run.
enum class WhenFileFails : std::uint8_t {
  stop,   // the run ends with the error (replay)
  go_on,  // the file ends and problem() says so; tracking continues (live)
};

class FileOutput : public Output {
 public:
  // Why the file ended early, one line; empty: it is being written. Any thread.
  std::string problem() const;

 protected:
  FileOutput(std::string content, const std::filesystem::path& file, WhenFileFails when);
  void log_replaced(const std::filesystem::path& file) const;  // after opening; if the file existed before
  template <typename Write>
  void attempt(Write&& write);  // the output's thread, and flush()

 private:
  const std::string content_;  // "tracks"
  const WhenFileFails when_;
  const bool was_there_;
  bool has_failed_ = false;
  mutable std::mutex mutex_;
  std::string problem_;  // guarded by mutex_
};

// The files that a run writes (empty paths are skipped), and its folder of pictures (empty: none).
struct WrittenFiles {
  std::vector<std::filesystem::path> files;
  std::filesystem::path pictures = {};
};
// All files that a configuration, or a recording, consists of.
std::vector<std::filesystem::path> files_of(const config::ServiceConfig& config);
std::vector<std::filesystem::path> files_of(const recordings::Recording& recording);
// throws std::runtime_error, naming the file, if two outputs are the same file or an output is an input of the run.
void refuse_outputs(const WrittenFiles& outputs, const std::vector<std::filesystem::path>& read);

class TrackFile final : public FileOutput {
 public:
  // throws std::system_error, naming the file
  TrackFile(const std::filesystem::path& file, const config::ServiceConfig& config, WhenFileFails when);
  void on_set(const TrackedSet& set) override;
  void flush() override;

 private:
  std::vector<std::string> targets_;
  tracks::TrackCsvWriter writer_;
};

class PoseFile final : public FileOutput {
 public:
  // throws std::system_error, naming the file; std::runtime_error: the configuration tracks no camera
  PoseFile(const std::filesystem::path& file, const config::ServiceConfig& config, WhenFileFails when);
  void on_camera_pose(const TrackedFrame& frame) override;
  void flush() override;

 private:
  tracks::PoseFileWriter writer_;
};

}  // namespace huetrack::pipeline
