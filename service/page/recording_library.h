// The recordings that lie in one folder, for who is on the other side of the network: which there are, and each as one
// tar file, piece by piece. Whatever is asked for, nothing outside that folder is opened: a recording is a folder right
// in it, of a plain name, and its files are regular ones right in that; links are not followed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace huetrack::page {

struct ShelvedRecording {
  std::string name;                       // of its folder
  std::optional<double> begun_at_s = {};  // UNIX time of the first frame; nullopt: there is none, or it is not known
  double length_s = 0;                    // from its first frame to its last, of all cameras
  std::uint64_t bytes = 0;                // of all its files
  std::size_t cameras = 0;
};

// A part of the tar file of a recording.
struct RecordingPiece {
  std::uint64_t tar_bytes = 0;  // of the whole
  std::string identity;         // changes when any file of the recording does: then earlier pieces are of another whole
  std::vector<std::uint8_t> bytes = {};
};

// Reads the disk with each call. thread-compatible.
class RecordingLibrary {
 public:
  explicit RecordingLibrary(std::filesystem::path folder) : folder_(std::move(folder)) {}

  // Newest first, by name, which begins with the time; at most so many. What is no recording is not there.
  std::vector<ShelvedRecording> list(std::size_t most) const;

  // Takes it and all its files away. throws std::runtime_error of one readable line: there is no such recording; it
  // holds something that is no file of a recording, and then nothing has happened; or the disk refuses.
  void remove(const std::string& name) const;

  // At most so many bytes from there on; none at the end and beyond. throws std::runtime_error of one readable line:
  // there is no such recording, or it cannot be read.
  RecordingPiece read(const std::string& name, std::uint64_t from, std::size_t most_bytes) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace huetrack::page
