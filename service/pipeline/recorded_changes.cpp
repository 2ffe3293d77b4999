#include "pipeline/recorded_changes.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <string_view>
#include <system_error>

#include "calib/files/csv_table.h"

namespace huetrack::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr auto file_name = "changes.csv";
constexpr std::array<std::string_view, 3> columns{"t_s", "change", "config"};
constexpr std::string_view left_out_name = "left_out", camera_left_out_name = "camera_left_out",
                           reloaded_name = "reloaded";

std::string row(capture::Timestamp at, std::string_view change, const std::string& config) {
  const auto ns = at.time_since_epoch().count();
  std::string fraction = std::to_string(ns % 1'000'000'000);
  fraction.insert(0, 9 - fraction.size(), '0');
  return std::to_string(ns / 1'000'000'000) + "." + fraction + "," + std::string(change) + "," + config + "\n";
}

}  // namespace

RecordedChanges read_changes(const fs::path& folder) {
  RecordedChanges changes;
  const fs::path file = folder / file_name;
  if (!fs::exists(file)) return changes;
  files::CsvTable table(file, columns);
  while (table.next()) {
    const capture::Timestamp at = table.time(0);
    if (table.text(1) == left_out_name) {
      changes.left_out.push_back(at);
    } else if (table.text(1) == camera_left_out_name) {
      changes.camera_left_out.push_back(at);
    } else if (table.text(1) == reloaded_name) {
      changes.reloads.push_back({at, folder / table.text(2)});
    } else {
      table.fail("unknown change " + table.quoted(1));
    }
  }
  std::ranges::sort(changes.left_out);
  std::ranges::sort(changes.camera_left_out);
  return changes;
}

ChangesWriter::ChangesWriter(fs::path folder) : folder_(std::move(folder)) {}

void ChangesWriter::left_out(capture::Timestamp at) {
  write(file_name, row(at, left_out_name, ""));
}

void ChangesWriter::camera_left_out(capture::Timestamp at) {
  write(file_name, row(at, camera_left_out_name, ""));
}

void ChangesWriter::reloaded(capture::Timestamp at, const std::string& config_yaml) {
  const std::string config = "huetrackd-" + std::to_string(++configs_) + ".yaml";
  write(config, config_yaml);  // before the row that names it
  write(file_name, row(at, reloaded_name, config));
}

void ChangesWriter::write(const fs::path& file, const std::string& text) {
  errno = 0;
  std::ofstream out(folder_ / file, std::ios::binary | std::ios::app);
  if (file == file_name && !has_begun_) {
    out << "t_s,change,config\n";
    has_begun_ = true;
  }
  out << text << std::flush;
  if (out || !failure_.empty()) return;
  failure_ = (folder_ / file).string() + ": " + std::generic_category().message(errno != 0 ? errno : EIO) +
             ": the recording will not replay to the same track";
}

}  // namespace huetrack::pipeline
