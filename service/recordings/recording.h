// A recording on disk: a folder (or a recording.yaml in it) that names one stream of frames per camera. The same form
// for what we record and for what others did. Documented in service/recordings/README.md.
//   version: 1
//   cameras:
//     left:  {frames: left.mkv, fps: 30, offset_s: 0.0}
//     right: {frames: right/%06d.png, timestamps: right.csv}        # csv: frame,t_s   (header line; frame from 0)
//                                                                   # our own:
//                                                                   frame,t_s,sequence,arrival,stamp_s,clock,clock_sigma_ns
//     fast:  {frames: fast.mkv, fps: 60, first_frame: 1, every: 2}  # frames 1, 3, 5, ... at 1/60, 3/60, 5/60 s
// frames: anything that FFmpeg reads, or a printf pattern / glob of images. Relative paths start at the yaml file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "capture/frames/frame.h"

namespace huetrack::recordings {

struct RecordedCamera {
  std::string name;
  std::filesystem::path frames;  // absolute: a video, a printf pattern or a glob
  double fps = 0;                // > 0 when the times are regular: frame k was captured at k / fps + offset
  capture::Duration offset{0};   // added to every capture time
  // (frame in the stream, capture time before the offset), both strictly ascending. A frame that is not listed is not
  // played. Neither fps nor timestamps: the container's own time stamps.
  std::vector<std::pair<std::int64_t, capture::Timestamp>> timestamps;
  // What our own recordings tell besides (the columns sequence and arrival): one per row of timestamps, or empty.
  struct Received {
    std::uint32_t sequence = 0;  // Frame::sequence
    std::uint64_t arrival = 0;   // Frame::arrival
    // The driver's own time stamp: then the times in `timestamps` are such stamps that the live camera's clock has
    // smoothed (camera_clock.h), and are not smoothed again. Recordings of before 0.3 lack it.
    std::optional<capture::Timestamp> stamped_at;
    capture::StampClock clock = {};  // Frame::clock; this host's own where the recording does not tell
  };
  std::vector<Received> received;
  // Frames that came corrupted (rows without a frame number): a time, but no picture. Ascending in time.
  std::vector<std::pair<capture::Timestamp, Received>> corrupted;
  bool is_listed = false;        // by a time-stamp file; if that lists nothing, the camera delivered nothing
  std::int64_t first_frame = 0;  // >= 0; frames first_frame, first_frame + every, ... are played, each at its
  std::int64_t every = 1;        // >= 1; own time in the stream
};

struct Recording {
  std::filesystem::path file;           // recording.yaml; of videos the words that name them, which are no file
  std::vector<RecordedCamera> cameras;  // in the order of the file
  std::vector<std::string> warnings;    // one line each: what was cut off
  std::optional<capture::Timestamp>
      started_at;  // UNIX time of the recording clock's zero, when known (key started_at, seconds)
};

// By what the file begins with: Matroska and WebM, AVI, MP4 and MOV, JPEG, PNG. No for what cannot be read.
bool is_video_or_picture(const std::filesystem::path& file);

// path: the yaml file, or the folder that holds recording.yaml. throws ConfigError
Recording read_recording(const std::filesystem::path& path);

// As people say it in a command: one word that is such a path; or, where nobody has written a recording.yaml, one
// CAMERA=FILE per camera, whose times are those of the videos. throws ConfigError
Recording read_recording(std::span<const std::string> words);

}  // namespace huetrack::recordings
