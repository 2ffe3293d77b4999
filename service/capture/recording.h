// A recording on disk: a folder (or a recording.yaml in it) that names one stream of frames per camera. The same form
// for what we record and for what others did. Documented in service/capture/README.md.
//   version: 1
//   cameras:
//     left:  {frames: left.mkv, fps: 30, offset_s: 0.0}
//     right: {frames: right/%06d.png, timestamps: right.csv}        # csv: frame,t_s   (header line; frame from 0)
// frames: anything that FFmpeg reads, or a printf pattern / glob of images. Relative paths start at the yaml file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "capture/frame.h"

namespace huetrack {

struct RecordedCamera {
  std::string name;
  std::filesystem::path frames;          // absolute: a video, a printf pattern or a glob
  double fps = 0;                        // > 0 when the times are regular, else 0 and timestamps is set
  Duration offset{0};                    // added to every capture time
  std::vector<std::pair<std::int64_t, Timestamp>> timestamps;   // (frame in the stream, capture time), ascending
};

struct Recording {
  std::filesystem::path file;            // recording.yaml
  std::vector<RecordedCamera> cameras;   // in the order of the file
  std::optional<Timestamp> started_at;   // UNIX time of the recording clock's zero, when known (key started_at, seconds)
};

// path: the yaml file, or the folder that holds recording.yaml. throws ConfigError
Recording read_recording(const std::filesystem::path& path);

}  // namespace huetrack
