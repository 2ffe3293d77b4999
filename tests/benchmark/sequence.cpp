#include "benchmark/sequence.h"

#include <algorithm>

#include "calib/files/csv_table.h"
#include "calib/model/rig_yaml.h"
#include "capture/frame_synchronizer.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::figures {

int TruthRow::views_that_see() const {
  return static_cast<int>(std::ranges::count_if(visible, [](double share) { return share > 0.5; }));
}

std::optional<TruthRow> Sequence::row(const std::string& target, capture::Timestamp at) const {
  const auto found = truth.find(target);
  if (found == truth.end() || found->second.empty()) return std::nullopt;
  const std::vector<TruthRow>& rows = found->second;
  constexpr auto same_time = std::chrono::microseconds(100);  // times in files are rounded
  const auto next = std::ranges::lower_bound(rows, at, {}, &TruthRow::at);
  if (next != rows.end() && next->at - at < same_time) return *next;
  if (next == rows.begin()) return std::nullopt;
  const auto before = std::prev(next);
  if (at - before->at < same_time) return *before;
  if (next == rows.end()) return std::nullopt;
  const double share = capture::seconds(at - before->at) / capture::seconds(next->at - before->at);
  TruthRow out = share < 0.5 ? *before : *next;
  out.at = at;
  out.position = (1 - share) * before->position + share * next->position;
  return out;
}

std::filesystem::path shared_data() {
  return HUETRACK_SHARED_DATA;
}
bool have(const std::string& folder) {
  return std::filesystem::exists(shared_data() / folder / "recording.yaml");
}

Sequence load_sequence(const std::filesystem::path& folder, int every, unsigned phases) {
  Sequence out;
  out.name = folder.filename().string();
  out.rig = calib::read_rig(folder / "rig.yaml");
  recordings::Recording recording = recordings::read_recording(folder);
  const std::vector<std::string> names = out.rig.camera_names();
  if (every > 1) {
    out.name += ", free-running, first frames";
    for (std::size_t i = 0; i < recording.cameras.size(); ++i)
      out.name += (i == 0 ? " " : ",") + std::to_string(phases >> i & 1);
    for (std::size_t i = 0; i < recording.cameras.size(); ++i) {
      recording.cameras[i].every = every;
      recording.cameras[i].first_frame = phases >> i & 1;
    }
  }
  recordings::ReplaySource source(recording, names);
  capture::Duration period = source.cameras().front().frame_period;
  for (const recordings::ReplayCamera& camera : source.cameras()) period = std::min(period, camera.frame_period);
  capture::FrameSynchronizer synchronizer({.camera_count = static_cast<int>(names.size()),
                                           .tolerance = capture::duration_of(0.55 * capture::seconds(period)),
                                           .ascending_input = true});
  while (auto frame = source.next({})) {
    for (capture::FrameSet& set : synchronizer.push(std::move(*frame))) out.sets.push_back(std::move(set));
  }
  while (auto last = synchronizer.flush()) out.sets.push_back(std::move(*last));

  if (const auto file = folder / "groundtruth.csv"; std::filesystem::exists(file)) {
    std::vector<std::string> columns{"t", "ball", "x", "y", "z"};
    for (const std::string& name : names) columns.push_back("vis_" + name + "?");
    const std::vector<std::string_view> views(columns.begin(), columns.end());
    files::CsvTable table(file, views);
    while (table.next()) {
      TruthRow row{table.time(0), {table.number(2), table.number(3), table.number(4)}, {}};
      for (std::size_t c = 0; c < names.size() && table.has(5 + c); ++c) row.visible.push_back(table.number(5 + c));
      out.truth[std::string(table.text(1))].push_back(std::move(row));
    }
  }
  return out;
}

object_tracking::TargetOptions lime_ball() {
  object_tracking::TargetOptions t;
  t.name = "lime";
  t.color.hue_min_deg = 65, t.color.hue_max_deg = 115;
  return t;
}

object_tracking::TargetOptions pink_ball() {
  object_tracking::TargetOptions t;
  t.name = "pink";
  t.color.hue_min_deg = 310, t.color.hue_max_deg = 355;
  return t;
}

object_tracking::TargetOptions red_square() {
  object_tracking::TargetOptions t;
  t.name = "red";
  t.radius_m = 0.0085;
  const color::HsiRange warm_and_dark{340, 358, 0.60, 1.0, 0.08, 0.40};
  const color::HsiRange cool{335, 356, 0.22, 0.60, 0.25, 0.60};
  t.color = warm_and_dark;
  t.camera_colors = {{"cam1", warm_and_dark}, {"cam2", cool}};
  return t;
}

object_tracking::ObjectTrackerOptions rendered_options(object_tracking::Observation observation, std::uint64_t seed) {
  object_tracking::ObjectTrackerOptions o;
  o.observation = observation;
  o.seed = seed;
  o.volume = {{-1, -1, 0.1}, {1, 1, 2.1}};
  return o;
}

object_tracking::ObjectTrackerOptions red_square_options(object_tracking::Observation observation, std::uint64_t seed) {
  object_tracking::ObjectTrackerOptions o = rendered_options(observation, seed);
  o.volume = {{-0.3, -0.2, -1.2}, {0.4, 0.5, -0.3}};
  o.pixel_noise_px = 1.4;  // this rig's reprojection error, see the data's README
  return o;
}

}  // namespace huetrack::figures
