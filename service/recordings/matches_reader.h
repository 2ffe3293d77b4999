// One camera's matches out of a file of ours (recording_writer.h), numbered as they lie in it. Private to this module.
//   The line "huetrack matches 1", then one frame after the other: four bytes, the lowest first, say how many follow,
//   and these are as matches.h has them.
#pragma once

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "capture/frames/jpeg_decoder.h"
#include "recordings/recording.h"
#include "recordings/video_reader.h"

namespace huetrack::recordings {

inline constexpr std::string_view matches_file_begins = "huetrack matches 1\n";
inline constexpr const char* matches_file_ending = ".matches";

bool is_matches_file(const std::filesystem::path& file);  // by what it begins with; no for what cannot be read

// thread-compatible.
class MatchesReader {
 public:
  // camera and warnings must outlive it, and its file must be one. keeps_encoded: ReplayOptions
  MatchesReader(const RecordedCamera& camera, std::vector<std::string>& warnings, bool keeps_encoded);

  std::optional<VideoReader::Shown> next();  // the next selected one; nullopt at the end. Never throws.

 private:
  bool read(std::vector<std::uint8_t>& bytes);

  const RecordedCamera& camera_;
  FrameSelection selection_;
  std::vector<std::string>& warnings_;
  bool keeps_encoded_;
  std::ifstream in_;
  std::int64_t index_ = 0;
  capture::JpegDecoder decoder_;
  capture::Image picture_;
  bool has_warned_ = false;
};

}  // namespace huetrack::recordings
