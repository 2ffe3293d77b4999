#include "config/camera_tracking_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/files/config_error.h"
#include "calib/files/csv_table.h"
#include "config/board_start.h"

namespace huetrack::config {
namespace {

Eigen::Vector3d point_of(const std::vector<double>& row) {
  return {row[0], row[1], row[2]};
}

}  // namespace

int CameraTrackingConfig::starts() const {
  return int(!rectangle.empty()) + int(!points.empty()) + int(!board.empty()) + int(!leds.empty());
}

NumberRows read_number_rows(const std::filesystem::path& file, const std::vector<CsvColumn>& columns,
                            std::size_t required) {
  std::vector<std::string> names;  // for CsvTable
  for (const CsvColumn& column : columns) {
    names.push_back(std::string(column.name) + "|" + column.other_name);
    if (names.size() > required) names.back() += "?";
  }
  files::CsvTable table(file, std::vector<std::string_view>(names.begin(), names.end()));
  std::size_t count = required, missing = columns.size();
  for (std::size_t c = required; c < columns.size(); ++c) {
    if (table.has(c))
      count = columns.size();
    else
      missing = std::min(missing, c);
  }
  if (missing < count) table.fail("the header has no column " + std::string(columns[missing].name));
  NumberRows rows;
  while (table.next()) {
    std::vector<double>& row = rows.emplace_back();
    for (std::size_t c = 0; c < count; ++c) {
      row.push_back(table.number(c));
      if (!std::isfinite(row.back())) table.fail(table.name(c) + " must be a finite number");
    }
  }
  if (rows.empty()) throw files::ConfigError(file, 0, "has no rows");
  return rows;
}

std::optional<StartRowProblem> start_row_problem(const NumberRows& rows, const calib::Camera& camera) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i].size() == 5 && !camera.contains(calib::RawPixel{{rows[i][3], rows[i][4]}}))
      return StartRowProblem{
          i, fmt::format("the pixel ({:g}, {:g}) is outside the image of {}, which is {}x{}", rows[i][3], rows[i][4],
                         camera.name, camera.image_size.width, camera.image_size.height)};
    for (std::size_t j = 0; j < i; ++j)
      if (point_of(rows[i]) == point_of(rows[j]))
        return StartRowProblem{i, fmt::format("the point ({:g}, {:g}, {:g}) is repeated, it is in row {} too",
                                              rows[i][0], rows[i][1], rows[i][2], j + 1)};
  }
  return std::nullopt;
}

int line_of_row(const std::filesystem::path& file, std::size_t row) {
  files::CsvTable table(file, {});
  for (std::size_t rows = 0; rows <= row && table.next();) ++rows;
  return table.line();
}

camera_tracking::CameraTrackerOptions tracker_options(const CameraTrackingConfig& config) {
  camera_tracking::CameraTrackerOptions options;
  options.method = config.method;
  options.particle_count = config.particle_count.value_or(0);
  options.seed = config.seed;
  options.load_map = config.load_map;
  options.as_printed = config.as_printed;
  if (!config.rectangle.empty()) {
    camera_tracking::RectangleStart start;
    for (const auto& row : config.rectangle) {
      start.corners.push_back(point_of(row));
      if (row.size() == 5) start.pixels.emplace_back(row[3], row[4]);
    }
    options.start = start;
  } else if (!config.points.empty()) {
    camera_tracking::PointsStart start;
    for (const auto& row : config.points) {
      start.points.push_back(point_of(row));
      start.pixels.emplace_back(row[3], row[4]);
    }
    options.start = start;
  } else if (!config.board.empty()) {
    options.start = board_start(config.board);
  } else if (config.leds.empty()) {  // only the loaded map
    options.start = camera_tracking::FoundStart{
        [](const capture::Image&) -> std::optional<camera_tracking::PointsStart> { return std::nullopt; }};
  } else {
    camera_tracking::LedStart start;
    for (const auto& row : config.leds) start.leds.push_back(point_of(row));
    for (const auto& row : config.led_schedule) start.schedule.push_back(static_cast<int>(row[0]));
    start.slot_s = config.led_slot_s;
    start.room_min = config.led_room_min;
    start.room_max = config.led_room_max;
    options.start = start;
  }
  return options;
}

}  // namespace huetrack::config
