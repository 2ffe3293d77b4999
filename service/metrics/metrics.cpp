#include "metrics/metrics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace huetrack::metrics {
namespace {

std::string number(double value) {
  if (std::isnan(value)) return "NaN";
  return fmt::format("{:.9g}", value);
}

std::string label(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out + '"';
}

class Text {
 public:
  void family(std::string_view family, std::string_view type, std::string_view help) {
    family_ = family;
    text_.append("# HELP ").append(family).append(" ").append(help).append("\n");
    text_.append("# TYPE ").append(family).append(" ").append(type).append("\n");
  }
  void sample(const std::string& labels, double value, std::string_view suffix = "") {
    text_.append(family_).append(suffix);
    if (!labels.empty()) text_.append("{").append(labels).append("}");
    text_.append(" ").append(number(value)).append("\n");
  }
  void histogram(const std::string& labels, const LatencyHistogram::Snapshot& snapshot) {
    const std::string before = labels.empty() ? "" : labels + ",";
    std::uint64_t below = 0;
    for (std::size_t i = 0; i < LatencyHistogram::bounds_s.size(); ++i) {
      below += snapshot.counts[i];
      sample(before + "le=\"" + number(LatencyHistogram::bounds_s[i]) + "\"", double(below), "_bucket");
    }
    sample(before + "le=\"+Inf\"", double(snapshot.count()), "_bucket");
    sample(labels, snapshot.sum_s, "_sum");
    sample(labels, double(snapshot.count()), "_count");
  }
  std::string take() { return std::move(text_); }

 private:
  std::string family_, text_;
};

}  // namespace

void LatencyHistogram::add(capture::Duration latency) {
  const auto bucket = std::ranges::lower_bound(bounds_s, capture::seconds(latency)) - bounds_s.begin();
  counts_[std::size_t(bucket)].fetch_add(1, std::memory_order_relaxed);
  sum_ns_.fetch_add(latency.count(), std::memory_order_relaxed);
}

LatencyHistogram::Snapshot LatencyHistogram::snapshot() const {
  Snapshot snapshot;
  for (std::size_t i = 0; i < counts_.size(); ++i) snapshot.counts[i] = counts_[i].load(std::memory_order_relaxed);
  snapshot.sum_s = 1e-9 * double(sum_ns_.load(std::memory_order_relaxed));
  return snapshot;
}

std::uint64_t LatencyHistogram::Snapshot::count() const {
  std::uint64_t sum = 0;
  for (const auto count : counts) sum += count;
  return sum;
}

double LatencyHistogram::Snapshot::quantile_s(double share) const {
  if (count() == 0) return std::numeric_limits<double>::quiet_NaN();
  double wanted = share * static_cast<double>(count()), lower_s = 0;
  for (std::size_t i = 0; i < bounds_s.size(); ++i) {
    const auto in_bucket = static_cast<double>(counts[i]);
    if (wanted <= in_bucket) return lower_s + (in_bucket > 0 ? wanted / in_bucket : 0) * (bounds_s[i] - lower_s);
    wanted -= in_bucket;
    lower_s = bounds_s[i];
  }
  return bounds_s.back();
}

namespace {

void add_cameras(Text& text, const publish::ServiceStatus& status) {
  const auto cameras = [&](std::string_view family, std::string_view type, std::string_view help, auto value) {
    text.family(family, type, help);
    for (const auto& camera : status.cameras)
      if (camera.is_used) text.sample("camera=" + label(camera.name), double(value(camera)));
  };
  cameras("huetrack_camera_up", "gauge", "1 when the camera delivers",
          [](const auto& c) { return c.health == publish::CameraStatus::Health::delivering ? 1 : 0; });
  cameras("huetrack_camera_frames_total", "counter", "frames received", [](const auto& c) { return c.frames; });
  cameras("huetrack_camera_dropped_frames_total", "counter", "gaps in the driver's numbering",
          [](const auto& c) { return c.dropped; });
  cameras("huetrack_camera_corrupted_frames_total", "counter", "damaged frames, not used",
          [](const auto& c) { return c.corrupted; });
  cameras("huetrack_camera_repeated_frames_total", "counter", "frames that repeat the previous picture, not used",
          [](const auto& c) { return c.repeated; });
  cameras("huetrack_camera_rate_hertz", "gauge", "frames per second over the last seconds",
          [](const auto& c) { return c.rate_hz; });
  cameras("huetrack_camera_age_seconds", "gauge", "since the last frame was received",
          [](const auto& c) { return c.frames > 0 ? c.age_s : std::numeric_limits<double>::quiet_NaN(); });
}

// calibration: per camera of the status, or empty.
void add_calibration(Text& text, const publish::ServiceStatus& status,
                     std::span<const CalibrationFigures> calibration) {
  const auto calibrations = [&](std::string_view family, std::string_view help, auto value) {
    if (!calibration.empty()) text.family(family, "gauge", help);
    for (std::size_t c = 0; c < calibration.size(); ++c)
      text.sample("camera=" + label(status.cameras[c].name), double(value(calibration[c])));
  };
  calibrations("huetrack_camera_in_place", "1 if the camera stands where the rig says, judged by the room",
               [](const auto& c) { return c.is_in_place ? 1 : 0; });
  calibrations("huetrack_camera_turned_degrees", "rotation of the camera since the calibration",
               [](const auto& c) { return c.turned_deg; });
  calibrations("huetrack_camera_moved_meters", "shift of the camera since the calibration",
               [](const auto& c) { return c.moved_m; });
  calibrations("huetrack_camera_effect_meters", "resulting error of positions, if not corrected",
               [](const auto& c) { return c.effect_m; });
  calibrations("huetrack_camera_blur_pixels", "additional blur by a focus change since its room was learnt",
               [](const auto& c) { return c.blur_px; });
  calibrations("huetrack_camera_room_changed_share", "share of its picture with a changed room",
               [](const auto& c) { return c.changed_share; });
}

void add_clocks(Text& text, const publish::ServiceStatus& status) {
  const auto clocks = [&](const char* name, const char* help, auto value) {
    if (status.clocks.empty()) return;
    text.family(name, "gauge", help);
    for (const auto& clock : status.clocks)
      if (clock.clock.is_known) text.sample("host=" + label(clock.clock.host), value(clock.clock));
  };
  clocks("huetrack_host_clock_offset_seconds", "clock of a camera host minus ours, subtracted from its stamps",
         [](const auto& clock) { return clock.offset_s; });
  clocks("huetrack_host_clock_uncertainty_seconds", "standard deviation of that offset",
         [](const auto& clock) { return clock.sigma_s; });
}

void add_service(Text& text, const publish::ServiceStatus& status, const RecordingCounts& recording,
                 std::uint64_t published) {
  const auto one = [&](std::string_view family, std::string_view type, std::string_view help, double value) {
    text.family(family, type, help);
    text.sample("", value);
  };
  one("huetrack_sets_total", "counter", "frame sets tracked", double(status.sets));
  one("huetrack_incomplete_sets_total", "counter", "frame sets without every camera", double(status.incomplete_sets));
  one("huetrack_dropped_sets_total", "counter", "frame sets not tracked, because tracking was too slow",
      double(status.dropped_sets));
  one("huetrack_late_frames_total", "counter", "frames that arrived after their set", double(status.late_frames));
  one("huetrack_set_rate_hertz", "gauge", "frame sets tracked per second", status.set_rate_hz);
  one("huetrack_published_samples_total", "counter", "positions written to DDS", double(published));
  one("huetrack_warnings", "gauge", "sentences in the status sample's warnings", double(status.warnings.size()));
  one("huetrack_recording", "gauge", "1 while frames are being recorded", recording.is_recording ? 1 : 0);
  text.family("huetrack_recording_dropped_frames_total", "counter",
              "frames not recorded, because the disk was too slow");
  for (std::size_t c = 0; c < recording.dropped.size(); ++c)
    text.sample("camera=" + label(status.cameras[c].name), double(recording.dropped[c]));
}

void add_targets(Text& text, const publish::ServiceStatus& status, std::span<const TargetFigures> targets) {
  text.family("huetrack_target_state", "gauge", "1 for the current state of the target");
  for (std::size_t t = 0; t < targets.size(); ++t) {
    for (const auto state : {object_tracking::TrackState::searching, object_tracking::TrackState::tracking,
                             object_tracking::TrackState::coasting, object_tracking::TrackState::lost}) {
      text.sample("target=" + label(status.targets[t]) + ",state=" + label(object_tracking::name(state)),
                  targets[t].state == state ? 1 : 0);
    }
  }
  text.family("huetrack_target_effective_sample_size", "gauge", "of the target's particles");
  for (std::size_t t = 0; t < targets.size(); ++t)
    text.sample("target=" + label(status.targets[t]), targets[t].effective_sample_size);
  text.family("huetrack_target_particles", "gauge", "particles of the target");
  for (std::size_t t = 0; t < targets.size(); ++t)
    text.sample("target=" + label(status.targets[t]), targets[t].particles);
  text.family("huetrack_target_objects", "gauge", "current objects of the target, by state");
  for (std::size_t t = 0; t < targets.size(); ++t) {
    text.sample("target=" + label(status.targets[t]) + ",state=\"tracking\"", targets[t].tracked);
    text.sample("target=" + label(status.targets[t]) + ",state=\"coasting\"", targets[t].coasting);
  }
  text.family("huetrack_target_objects_found_total", "counter", "objects of the target found so far");
  for (std::size_t t = 0; t < targets.size(); ++t)
    text.sample("target=" + label(status.targets[t]), double(targets[t].found));
  text.family("huetrack_target_mistake", "gauge", "1 while this mistake in rig or configuration is detected");
  for (std::size_t t = 0; t < targets.size(); ++t)
    for (std::size_t kind = 0; kind < view_watch::mistake_kinds; ++kind)
      text.sample(
          "target=" + label(status.targets[t]) + ",kind=" + label(view_watch::name(view_watch::MistakeKind(kind))),
          targets[t].mistakes[kind] ? 1 : 0);
}

void add_latencies(Text& text, const publish::ServiceStatus& status, const LatencyFigures& latencies) {
  text.family("huetrack_capture_to_dequeue_seconds", "histogram",
              "from a frame's capture to its arrival (last byte, not decoded)");
  for (std::size_t c = 0; c < latencies.capture_to_dequeue.size(); ++c)
    text.histogram("camera=" + label(status.cameras[c].name), latencies.capture_to_dequeue[c]);
  text.family("huetrack_dequeue_to_write_seconds", "histogram",
              "from the arrival of a set's last frame (last byte, not decoded) to the DDS write of its position");
  text.histogram("", latencies.dequeue_to_write);
  text.family("huetrack_dequeue_to_publish_seconds", "histogram",
              "from the arrival of a set's last frame (last byte, not decoded) to the end of the DDS write");
  text.histogram("", latencies.dequeue_to_publish);
  text.family("huetrack_capture_to_publish_seconds", "histogram",
              "from the newest capture in a set to the end of the DDS write");
  text.histogram("", latencies.capture_to_publish);
}

}  // namespace

std::string to_prometheus(const publish::ServiceStatus& status, std::span<const TargetFigures> targets,
                          const LatencyFigures& latencies, const RecordingCounts& recording, std::uint64_t published,
                          std::span<const CalibrationFigures> calibration) {
  Text text;
  add_cameras(text, status);
  add_calibration(text, status, calibration);
  add_clocks(text, status);
  add_service(text, status, recording, published);
  add_targets(text, status, targets);
  add_latencies(text, status, latencies);
  return text.take();
}

}  // namespace huetrack::metrics
