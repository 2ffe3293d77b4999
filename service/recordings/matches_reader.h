// Reads one camera's matches from a file of ours (recording_writer.h), numbered by position. Private to this module.
//   The line "huetrack matches 1", then the frames: four bytes with the length, lowest first, and the bytes of
//   matches.h.
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

bool is_matches_file(const std::filesystem::path& file);  // by its first line; false if it cannot be read

// thread-compatible.
class MatchesReader final : public PictureStream {
 public:
  // camera and warnings must outlive it; the file must be is_matches_file(). keeps_encoded: see ReplayOptions
  MatchesReader(const RecordedCamera& camera, std::vector<std::string>& warnings, bool keeps_encoded);

  std::optional<Shown> next() override;
  std::int64_t position() const override { return index_; }

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
