#include "truth/motion_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>

#include "calib/files/config_error.h"
#include "calib/files/number_text.h"
#include "calib/files/text_file.h"

namespace huetrack::truth {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// Lines of a table, split at a separator; a blank separates by any number of them.
class Rows {
 public:
  explicit Rows(const std::filesystem::path& file) : file_(file), stream_(files::open_text_file(file)) {}

  bool next(char separator) {
    if (!stream_.getline(buffer_.data(), std::streamsize(buffer_.size()))) {
      if (stream_.eof() && !stream_.bad()) return false;
      fail(fmt::format("is longer than {} characters", buffer_.size()));
    }
    ++line_;
    std::string_view rest = buffer_.data();
    if (line_ == 1 && rest.starts_with("\xef\xbb\xbf")) rest.remove_prefix(3);
    while (!rest.empty() && (rest.back() == '\r' || rest.back() == ' ')) rest.remove_suffix(1);
    cells_.clear();
    while (true) {
      const std::size_t end = std::min(rest.find(separator), rest.size());
      std::string_view cell = rest.substr(0, end);
      while (cell.size() > 1 && cell.front() == '"' && cell.back() == '"') cell = cell.substr(1, cell.size() - 2);
      if (separator != ' ' || !cell.empty()) cells_.push_back(cell);
      if (end == rest.size()) return true;
      rest.remove_prefix(end + 1);
    }
  }
  [[noreturn]] void fail(const std::string& what) const { throw files::ConfigError(file_, line_, what); }

  std::size_t size() const { return cells_.size(); }
  std::string_view operator[](std::size_t i) const { return i < cells_.size() ? cells_[i] : std::string_view(); }
  std::vector<std::string> copy() const { return {cells_.begin(), cells_.end()}; }
  bool is_blank() const {
    return std::ranges::all_of(cells_, [](std::string_view cell) { return cell.empty(); });
  }
  // NaN: the cell is empty, or says nothing.
  double value(std::size_t i) const {
    const std::string_view cell = (*this)[i];
    if (cell.empty() || cell == "null" || cell == "NaN" || cell == "nan") return nan;
    const auto number = files::number_of<double>(cell);
    if (!number) fail(fmt::format("\"{}\" is not a number", files::printable(cell)));
    return *number;
  }
  double number(std::size_t i, const char* what) const {
    const double got = value(i);
    if (!std::isfinite(got)) fail(fmt::format("{} must be a number", what));
    return got;
  }

 private:
  const std::filesystem::path file_;
  std::ifstream stream_;
  std::vector<char> buffer_ = std::vector<char>(files::longest_line);
  std::vector<std::string_view> cells_;
  int line_ = 0;
};

// A body's columns x, y, z in the rows, one after the other.
struct Body {
  std::string name;
  std::size_t column;
};

Timestamp time_of(double s) {
  return Timestamp(std::chrono::round<std::chrono::nanoseconds>(std::chrono::duration<double>(s)));
}

void add(const Rows& rows, double at_s, const Body& body, double unit_m, bool is_zero_missing, Samples& samples) {
  const Eigen::Vector3d p(rows.value(body.column), rows.value(body.column + 1), rows.value(body.column + 2));
  if (!p.allFinite() || (is_zero_missing && p.isZero(0))) return;
  auto& track = samples[body.name];
  if (!track.empty() && time_of(at_s) <= track.back().at) rows.fail("times must grow from row to row");
  track.push_back({time_of(at_s), unit_m * p});
}

double unit_of(const Rows& rows, std::string_view name) {
  if (name == "Meters" || name == "m") return 1;
  if (name == "Centimeters" || name == "cm") return 1e-2;
  if (name == "Millimeters" || name == "mm") return 1e-3;
  rows.fail(fmt::format("the length unit \"{}\" is unknown: m, cm or mm", files::printable(name)));
}

// docs.optitrack.com/motive/data-export/data-export-csv: a line of properties, rows of types, names and IDs, a row of
// Rotation and Position, one of X, Y, Z, then the frames.
Samples read_motive(Rows& rows) {
  double unit_m = 1;
  for (std::size_t i = 0; i + 1 < rows.size(); i += 2)
    if (rows[i] == "Length Units") unit_m = unit_of(rows, rows[i + 1]);
  std::vector<std::string> types, names, kinds;
  while (rows.next(',')) {
    if (rows[0] == "Frame") break;
    if (rows[1] == "Name") names = rows.copy();
    if (rows[2] == "Rigid Body" || rows[2] == "Marker" || rows[2] == "Rigid Body Marker") types = rows.copy();
    if (names.empty() && !types.empty() && types != rows.copy() && !rows.is_blank() && rows[1] != "Type")
      names = rows.copy();  // older versions do not label the row
    kinds = rows.copy();
  }
  if (rows[0] != "Frame") rows.fail("has no row that begins with Frame");
  std::vector<Body> bodies;
  for (std::size_t c = 2; c + 2 < rows.size(); ++c)
    if (rows[c] == "X" && rows[c + 2] == "Z" && c < kinds.size() && kinds[c] == "Position" && c < names.size())
      bodies.push_back({names[c], c});
  if (bodies.empty()) rows.fail("has no Position of a rigid body or marker");
  Samples samples;
  while (rows.next(','))
    if (!rows.is_blank())
      for (const Body& body : bodies) add(rows, rows.number(1, "the time"), body, unit_m, false, samples);
  return samples;
}

// Sections of a title, the rate, a row of names, one of Frame, Sub Frame, X, Y, Z (Tracker: RX ... TX, TY, TZ), and one
// of units.
Samples read_vicon(Rows& rows) {
  Samples samples;
  do {
    const std::string title(rows[0]);
    if (title != "Trajectories" && title != "Objects" && title != "Segments") continue;
    if (!rows.next(',')) break;
    const double rate_hz = rows.number(0, "the rate");
    if (!(rate_hz > 0)) rows.fail("the rate must be > 0");
    rows.next(',');
    const std::vector<std::string> names = rows.copy();
    rows.next(',');
    std::vector<Body> bodies;
    std::string name;
    for (std::size_t c = 2; c + 2 < rows.size(); ++c) {
      if (c < names.size() && !names[c].empty()) name = names[c];
      if ((rows[c] == "X" && rows[c + 2] == "Z") || (rows[c] == "TX" && rows[c + 2] == "TZ"))
        bodies.push_back({name, c});
    }
    if (bodies.empty()) rows.fail("has no columns X, Y, Z or TX, TY, TZ");
    rows.next(',');
    const double unit_m = unit_of(rows, rows[bodies.front().column]);
    while (rows.next(',') && !rows.is_blank()) {
      const double at_s = (rows.number(0, "the frame") - 1 + rows.value(1) / 1000) / rate_hz;
      for (const Body& body : bodies) add(rows, at_s, body, unit_m, false, samples);
    }
  } while (rows.next(','));
  if (samples.empty()) rows.fail("has no positions in a section Trajectories, Objects or Segments");
  return samples;
}

// Lines of a key and values, then a table: with a header of Frame, Time and NAME X, ..., or of the markers' positions
// alone. Millimetres; a marker that was not seen has zeros or nothing.
Samples read_qualisys(Rows& rows) {
  std::vector<Body> bodies;
  double rate_hz = 0;
  std::size_t first = 0;
  do {
    if (rows[0] == "FREQUENCY") rate_hz = rows.number(1, "FREQUENCY");
    if (rows[0] == "DATA_INCLUDED" && rows[1] != "3D") rows.fail("has no 3D data: export the markers' positions (3D)");
    if (rows[0] == "MARKER_NAMES")
      for (std::size_t i = 1; i < rows.size(); ++i)
        if (!rows[i].empty()) bodies.push_back({std::string(rows[i]), 3 * (i - 1)});
    if (rows[0] == "Frame") first = 2;
    if (!rows[0].empty() && files::number_of<double>(rows[0])) break;
  } while (rows.next('\t'));
  if (bodies.empty() || !(rate_hz > 0)) rows.fail("has no MARKER_NAMES or no FREQUENCY");
  for (Body& body : bodies) body.column += first;
  Samples samples;
  double frame = 0;
  do {
    if (rows.is_blank()) continue;
    const double at_s = first > 0 ? rows.number(1, "the time") : frame++ / rate_hz;
    for (const Body& body : bodies) add(rows, at_s, body, 1e-3, true, samples);
  } while (rows.next('\t'));
  return samples;
}

// "timestamp tx ty tz qx qy qz qw", and comments.
Samples read_tum(Rows& rows) {
  Samples samples;
  do {
    if (rows.size() == 0 || rows[0].starts_with('#')) continue;
    if (rows.size() != 8) rows.fail("a row of TUM has 8 numbers: timestamp tx ty tz qx qy qz qw");
    add(rows, rows.number(0, "the time"), {"", 1}, 1, false, samples);
  } while (rows.next(' '));
  return samples;
}

bool is_tum(const std::filesystem::path& file) {
  Rows rows(file);
  while (rows.next(' ')) {
    if (rows.size() == 0 || rows[0].starts_with('#')) continue;
    if (rows.size() != 8) return false;
    for (std::size_t i = 0; i < 8; ++i)
      if (!files::number_of<double>(rows[i])) return false;
    return true;
  }
  return false;
}

}  // namespace

std::optional<Samples> read_motion_capture(const std::filesystem::path& file) {
  Rows rows(file);
  if (!rows.next(',')) return std::nullopt;
  const std::string_view first = rows[0];
  if (first == "Format Version") return read_motive(rows);
  constexpr std::array<std::string_view, 7> sections{"Trajectories", "Objects", "Segments",     "Devices",
                                                     "Joints",       "Events",  "Model Outputs"};
  if (rows.size() == 1 && std::ranges::count(sections, first) > 0) return read_vicon(rows);
  if (first.starts_with("NO_OF_FRAMES\t") || first.starts_with("FILE_VERSION\t")) {
    Rows of_tabs(file);
    of_tabs.next('\t');
    return read_qualisys(of_tabs);
  }
  if (!is_tum(file)) return std::nullopt;
  Rows of_blanks(file);
  of_blanks.next(' ');
  return read_tum(of_blanks);
}

}  // namespace huetrack::truth
