// The key camera_tracking: the moving camera, and the source of its first pose.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::config {

// Rows of numbers, inline or from a CSV file.
using NumberRows = std::vector<std::vector<double>>;

struct CameraTrackingConfig {
  std::string camera;  // of the rig; empty: no camera is tracked
  camera_tracking::CameraMethod method = camera_tracking::CameraMethod::huetrack;
  std::optional<int> particle_count;  // > 0; nullopt: the method's own
  std::uint64_t seed = 1;
  bool as_printed = false;
  std::filesystem::path load_map, save_map;  // empty: none
  // The start: exactly one of these four; with load_map, at most one.
  NumberRows rectangle;         // x y z, or x y z u v with pixels in the first frame
  NumberRows points;            // x y z u v
  std::filesystem::path board;  // board file
  NumberRows leds;              // x y z
  NumberRows led_schedule;      // one row per slot: the lit LED; empty: not identified
  double led_slot_s = 0;        // see LedStart
  Eigen::Vector3d led_room_min = camera_tracking::LedStart{}.room_min,
                  led_room_max = camera_tracking::LedStart{}.room_max;

  int starts() const;  // number of starts given
};

// A column of such a file, with an alternative name.
struct CsvColumn {
  const char* name;
  const char* other_name;
};
// Reads the columns in this order; those from `required` on are all present or all absent. throws ConfigError with file
// and line.
NumberRows read_number_rows(const std::filesystem::path& file, const std::vector<CsvColumn>& columns,
                            std::size_t required);

// The first row of a rectangle or of known points with a pixel outside the camera's image, or with a repeated point.
// row: from 0; nullopt: none.
struct StartRowProblem {
  std::size_t row = 0;
  std::string message;
};
std::optional<StartRowProblem> start_row_problem(const NumberRows& rows, const calib::Camera& camera);

// The line of a CSV file, from 1, of a row of read_number_rows().
int line_of_row(const std::filesystem::path& file, std::size_t row);

// For make_camera_tracker(). throws ConfigError for an invalid board file.
camera_tracking::CameraTrackerOptions tracker_options(const CameraTrackingConfig& config);

}  // namespace huetrack::config
