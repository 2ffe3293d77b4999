// The outputs that are text files: the tracks of the targets as CSV, the poses of the tracked camera as TUM text.
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

// What a disk that takes no more of a file does to the rest.
enum class WhenFileFails : std::uint8_t {
  stop,   // the run ends with the error: a replay is there for its files
  go_on,  // the file ends, and problem() says so: what happens live happens once
};

class FileOutput : public Output {
 public:
  // Why the file is written no further, one line; empty: it is. Any thread.
  std::string problem() const;

 protected:
  FileOutput(std::string content, const std::filesystem::path& file, WhenFileFails when);
  void tell_replaced(const std::filesystem::path& file) const;  // once it is open; nothing if there was none before
  template <typename Write>
  void attempt(Write&& write);  // the road's thread, and flush()

 private:
  const std::string content_;  // "tracks"
  const WhenFileFails when_;
  const bool was_there_;
  bool has_failed_ = false;
  mutable std::mutex mutex_;
  std::string problem_;  // guarded by mutex_
};

// The files that a run writes, where they are given (not empty), and a folder of pictures (empty: none).
struct WrittenFiles {
  std::vector<std::filesystem::path> files;
  std::filesystem::path pictures = {};
};
// What a configuration and a recording are made of.
std::vector<std::filesystem::path> files_of(const config::ServiceConfig& config);
std::vector<std::filesystem::path> files_of(const recordings::Recording& recording);
// throws std::runtime_error, naming the file: two outputs are one file, or one is what the run reads.
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
