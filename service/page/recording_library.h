// The recordings in one folder, for remote clients: list, deletion, and download as a tar file in parts. Never opens
// anything outside that folder: a recording is a direct subfolder with a plain name and regular files; links are not
// followed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace huetrack::page {

struct ListedRecording {
  std::string name;                       // of its folder
  std::optional<double> begun_at_s = {};  // UNIX time of the first frame; nullopt: unknown
  double length_s = 0;                    // from its first frame to its last, of all cameras
  std::uint64_t bytes = 0;                // of all its files
  std::size_t cameras = 0;
};

// A part of the tar file of a recording.
struct RecordingPiece {
  std::uint64_t tar_bytes = 0;  // of the whole
  std::string identity;         // changes if any file changes: earlier parts are then invalid
  std::vector<std::uint8_t> bytes = {};
};

// Each call reads the disk. thread-compatible.
class RecordingLibrary {
 public:
  explicit RecordingLibrary(std::filesystem::path folder) : folder_(std::move(folder)) {}

  // Newest first by name, which begins with the time; at most so many. Skips other folders.
  std::vector<ListedRecording> list(std::size_t most) const;

  // Deletes it with all its files. throws std::runtime_error with one readable line if there is no such recording, it
  // contains anything else (then nothing is deleted), or on a disk error.
  void remove(const std::string& name) const;

  // At most most_bytes from that offset; none at the end. throws std::runtime_error with one readable line.
  RecordingPiece read(const std::string& name, std::uint64_t from, std::size_t most_bytes) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace huetrack::page
