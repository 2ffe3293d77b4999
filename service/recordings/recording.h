// A recording on disk: a folder (or its recording.yaml) that names one stream of frames per camera; written by us or by
// others. Documented in service/recordings/README.md.
//   version: 1
//   cameras:
//     left:  {frames: left.mkv, fps: 30, offset_s: 0.0}
//     right: {frames: right/%06d.png, timestamps: right.csv}        # csv: frame,t_s   (header line; frame from 0)
//                                                                   # our own:
//                                                                   frame,t_s,sequence,arrival,stamp_s,clock,clock_sigma_ns
//     fast:  {frames: fast.mkv, fps: 60, first_frame: 1, every: 2}  # frames 1, 3, 5, ... at 1/60, 3/60, 5/60 s
//     robot: {frames: run.mcap, topic: /robot/image_raw}            # a ROS bag; topic may be omitted where it is clear
//     slow:  {frames: slow.mp4, fps: 240, trust_times: true}        # though the file says 30
//     half:  {frames: stereo.mkv, crop: [640, 0, 640, 480]}         # u, v, width, height
//     tv:    {frames: tape.avi, fields: top}                        # interlaced; which field was taken first
//     deep:  {frames: deep/%d.png, fps: 30, bits: 12}               # 0 to 4095 in samples of 16 bits
// frames: anything that FFmpeg reads, a printf pattern or glob of images, or a bag. Relative paths start at the yaml
// file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "calib/yaml/yaml_reader.h"
#include "capture/frames/crop.h"
#include "capture/frames/frame.h"
#include "capture/frames/picture_layout.h"

namespace huetrack::recordings {

struct RecordedCamera {
  std::string name;
  std::filesystem::path frames;            // absolute: a video, a printf pattern, a glob, a split film, or a ROS bag
  std::string topic = {};                  // of a bag; never empty then
  std::optional<capture::Crop> crop = {};  // the camera's image is this part of every picture
  std::optional<capture::FirstField> first_field = {};  // its pictures are interlaced, whatever the file says
  int bits = 0;                 // that a camera fills of samples of 16, the lower ones; 0: as the file says
  bool trusts_times = false;    // fps or timestamps are right, even if the file contradicts them
  double fps = 0;               // > 0: regular times, frame k was captured at k / fps + offset
  capture::Duration offset{0};  // added to every capture time
  // (frame in the stream, capture time before the offset), both strictly ascending. Frames that are not listed are not
  // played. Neither fps nor timestamps: the container's own time stamps.
  std::vector<std::pair<std::int64_t, capture::Timestamp>> timestamps;
  // Further columns of our own recordings: one entry per row of timestamps, or empty.
  struct Received {
    std::uint32_t sequence = 0;  // Frame::sequence
    std::uint64_t arrival = 0;   // Frame::arrival
    // The driver's own time stamp. If present, `timestamps` were smoothed live (camera_clock.h) and are not smoothed
    // again. Recordings before 0.3 lack it.
    std::optional<capture::Timestamp> stamped_at;
    capture::StampClock clock = {};  // Frame::clock; this host's own if not recorded
  };
  std::vector<Received> received;
  // Frames that were corrupted when recorded (rows without a frame number). Ascending in time.
  std::vector<std::pair<capture::Timestamp, Received>> corrupted;
  bool is_listed = false;                 // has a time-stamp file; if that is empty, the camera delivered nothing
  std::filesystem::path times_file = {};  // that file
  std::size_t times_unit = 0;             // of its times, index of files::time_units
  std::int64_t first_frame = 0;           // >= 0; frames first_frame, first_frame + every, ... are played, each at its
  std::int64_t every = 1;                 // >= 1; own time in the stream
};

struct Recording {
  std::filesystem::path file;                    // recording.yaml; for videos the command's words, not a file
  std::vector<RecordedCamera> cameras;           // in the order of the file
  std::vector<std::string> warnings;             // one line each, on truncated files
  std::optional<capture::Timestamp> started_at;  // UNIX time of the recording clock's zero, if known (key started_at)
};

// A camera from a command's word for its frames: FILE, BAG:/topic, and either with @u,v,width,height for a part of
// every picture. file: for messages. throws ConfigError
RecordedCamera recorded_camera(const std::string& name, const std::string& frames, const std::filesystem::path& file);

// "a.mkv@640,0,640,480" as its file and its crop. A file of that whole name is no crop. throws ConfigError
std::pair<std::string, std::optional<capture::Crop>> split_crop(const std::string& frames,
                                                                const std::filesystem::path& file);

// The value [u, v, width, height] of a key. throws ConfigError
capture::Crop crop_in(const yaml::YamlReader& mapping, std::string_view key);

// By the file's first bytes: Matroska and WebM, AVI, MP4 and MOV, JPEG, PNG. False if it cannot be read.
bool is_video_or_picture(const std::filesystem::path& file);

// Whether a folder holds the parts of a film (camcorders: .MTS, .m2ts), which `frames` may name instead of a video.
bool is_split_film(const std::filesystem::path& folder);

// What a file is that no part of huetrack reads, and what to do with it: HEIC, archives, bags that are cut off at their
// beginning, pointers of Git LFS. Empty: not known.
std::string advice_to_convert(const std::filesystem::path& file);

// path: the yaml file, or the folder that holds recording.yaml; or a ROS bag (bags/bag.h), all of whose topics of
// pictures are cameras. throws ConfigError
Recording read_recording(const std::filesystem::path& path);

// From a command's words: one such path; or, without a recording.yaml, one CAMERA=FRAMES per camera
// (recorded_camera()), with the videos' own times. throws ConfigError
Recording read_recording(std::span<const std::string> words);

}  // namespace huetrack::recordings
