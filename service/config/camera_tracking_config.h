// The configuration's key camera_tracking: which camera moves, and from what its pose is known first.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::config {

// Rows of numbers, written in the configuration or read from a CSV file that it names.
using NumberRows = std::vector<std::vector<double>>;

struct CameraTrackingConfig {
  std::string camera;  // of the rig; empty: no camera is tracked
  camera_tracking::CameraMethod method = camera_tracking::CameraMethod::huetrack;
  std::optional<int> particle_count;  // > 0; nullopt: the method's own
  std::uint64_t seed = 1;
  bool as_printed = false;
  std::filesystem::path load_map, save_map;  // empty: none
  // The start: exactly one of these four is given; with load_map, at most one.
  NumberRows rectangle;         // x y z, or x y z u v with the corners' pixels in the first frame
  NumberRows points;            // x y z u v
  std::filesystem::path board;  // board file
  NumberRows leds;              // x y z
  NumberRows led_schedule;      // one row per slot: the LED that is lit; empty: not identified
  double led_slot_s = 0;        // see LedStart
  Eigen::Vector3d led_room_min = camera_tracking::LedStart{}.room_min,
                  led_room_max = camera_tracking::LedStart{}.room_max;

  int starts() const;  // how many are given
};

// What the columns of such a file are called. A name may have a second form.
struct CsvColumn {
  const char* name;
  const char* other_name;
};
// The columns in this order; those from `required` on are all there or all left out. throws ConfigError naming file and
// line.
NumberRows read_number_rows(const std::filesystem::path& file, const std::vector<CsvColumn>& columns,
                            std::size_t required);

// What is wrong with a row of a rectangle or of known points that only the camera can tell: a pixel outside its image,
// or a point that is there twice. row counts from 0; nullopt: nothing.
struct StartRowProblem {
  std::size_t row = 0;
  std::string message;
};
std::optional<StartRowProblem> start_row_problem(const NumberRows& rows, const calib::Camera& camera);

// The line of a CSV file, from 1, in which read_number_rows() found this row.
int line_of_row(const std::filesystem::path& file, std::size_t row);

// For make_camera_tracker(). throws ConfigError: the board file is wrong.
camera_tracking::CameraTrackerOptions tracker_options(const CameraTrackingConfig& config);

}  // namespace huetrack::config
