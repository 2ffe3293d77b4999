#include "sample_format.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/files/median.h"
#include "calib/files/number_text.h"
#include "calib/files/text_file.h"
#include "idl/names.h"
#include "osc.h"

namespace huetrack::client {

namespace {

constexpr double ns_per_ms = 1e6;

bool has_position(const msg::ObjectPosition& sample) {
  return sample.state() == msg::TRACK_STATE_TRACKING || sample.state() == msg::TRACK_STATE_COASTING;
}

// Shortest round-trip text; "nan" without a sign.
std::string csv_number(double value) {
  return std::isnan(value) ? "nan" : fmt::format("{}", value);
}

std::string csv_line(const msg::ObjectPosition& s) {
  std::string out = fmt::format("{},{}", s.target(), files::seconds_text(s.captured_at()));
  const auto add = [&](double value) { fmt::format_to(std::back_inserter(out), ",{}", csv_number(value)); };
  std::ranges::for_each(s.position(), add);
  std::ranges::for_each(s.velocity(), add);
  for (const std::size_t upper : {0U, 1U, 2U, 4U, 5U, 8U}) add(s.covariance()[upper]);
  return out + fmt::format(",{},{},{}\n", idl::state_name(s.state()), s.views(), csv_number(s.confidence()));
}

std::string tum_line(const msg::ObjectPosition& s) {
  if (!has_position(s)) return "";
  return fmt::format("{} {} 0 0 0 1\n", files::seconds_text(s.captured_at()), fmt::join(s.position(), " "));
}

template <typename Float>
std::string json_number(Float value) {
  return std::isfinite(value) ? fmt::format("{}", value) : "null";
}

template <typename Floats>
std::string json_array(const Floats& values) {
  std::vector<std::string> texts;
  for (const auto value : values) texts.push_back(json_number(value));
  return fmt::format("[{}]", fmt::join(texts, ","));
}

std::string json_line(const msg::ObjectPosition& s) {
  std::vector<std::string> views;
  for (const msg::ViewSupport& view : s.per_view())
    views.push_back(fmt::format(
        R"({{"camera":{},"delivered":{},"in_view":{},"seen":{},"pixel":{},"radius_px":{},"support":{},"residual_px":{}}})",
        files::in_json_quotes(view.camera()), view.delivered(), view.in_view(), view.seen(), json_array(view.pixel()),
        json_number(view.radius_px()), json_number(view.support()), json_number(view.residual_px())));
  return fmt::format(
      R"({{"target":{},"t":{},"captured_at":{},"received_at":{},"published_at":{},"set_number":{},"state":"{}",)"
      R"("position":{},"velocity":{},"covariance":{},"map_position":{},"views":{},"confidence":{},)"
      R"("particle_count":{},"effective_sample_size":{},"per_view":[{}]}})"
      "\n",
      files::in_json_quotes(s.target()), files::seconds_text(s.captured_at()), s.captured_at(), s.received_at(),
      s.published_at(), s.set_number(), idl::state_name(s.state()), json_array(s.position()), json_array(s.velocity()),
      json_array(s.covariance()), json_array(s.map_position()), s.views(), json_number(s.confidence()),
      s.particle_count(), json_number(s.effective_sample_size()), fmt::join(views, ","));
}

// "-" for NaN and infinity.
std::string number(double value, int decimals, int width = 0) {
  return std::isfinite(value) ? fmt::format("{:{}.{}f}", value, width, decimals) : fmt::format("{:>{}}", "-", width);
}

// "-" for times of different clocks (a replay may publish its recording's times).
std::string latency_ms(std::int64_t from, std::int64_t to, int decimals, int width = 0) {
  const double ns = static_cast<double>(to) - static_cast<double>(from);
  return number(std::abs(ns) < 3600.0 * ns_per_s ? ns / ns_per_ms : std::nan(""), decimals, width);
}

std::string clock_time(std::int64_t ns) {  // local time, HH:MM:SS.mmm
  return fmt::format("{:%H:%M:%S}.{:03}", fmt::localtime(static_cast<std::time_t>(ns / ns_per_s)),
                     std::abs(ns % ns_per_s / 1'000'000));
}

std::string text_line(const msg::ObjectPosition& s, std::int64_t received_at, std::size_t target_width) {
  const auto sigma_mm = [&](std::size_t axis) { return number(1000 * std::sqrt(s.covariance()[4 * axis]), 1, 6); };
  return fmt::format(
      "{}  {:<{}}  {:<9}  x {}  y {}  z {} m   sigma {} {} {} mm   views {}/{}   confidence {}   latency {} + {} ms\n",
      clock_time(s.captured_at()), s.target(), target_width, idl::state_name(s.state()), number(s.position()[0], 4, 8),
      number(s.position()[1], 4, 8), number(s.position()[2], 4, 8), sigma_mm(0), sigma_mm(1), sigma_mm(2), s.views(),
      s.per_view().size(), number(s.confidence(), 2), latency_ms(s.captured_at(), s.published_at(), 1, 6),
      latency_ms(s.published_at(), received_at, 2));
}

std::string csv_line(const msg::CameraPose& s) {
  std::string out = fmt::format("{},{}", s.camera(), files::seconds_text(s.captured_at()));
  const auto add = [&](double value) { fmt::format_to(std::back_inserter(out), ",{}", csv_number(value)); };
  std::ranges::for_each(s.position(), add);
  std::ranges::for_each(s.orientation(), add);
  for (std::size_t row = 0; row < 6; ++row)
    for (std::size_t column = row; column < 6; ++column) add(s.covariance()[6 * row + column]);
  return out + fmt::format(",{},{},{},{}\n", idl::state_name(s.state()), s.features_in_view(), s.features_matched(),
                           csv_number(s.confidence()));
}

std::string tum_line(const msg::CameraPose& s) {
  if (s.state() != msg::CAMERA_STATE_TRACKING) return "";
  return fmt::format("{} {} {}\n", files::seconds_text(s.captured_at()), fmt::join(s.position(), " "),
                     fmt::join(s.orientation(), " "));
}

std::string json_line(const msg::CameraPose& s) {
  return fmt::format(
      R"({{"camera":{},"t":{},"captured_at":{},"received_at":{},"published_at":{},"frame_number":{},"state":"{}",)"
      R"("position":{},"orientation":{},"covariance":{},"features_in_view":{},"features_matched":{},"map_points":{},)"
      R"("confidence":{},"particle_count":{},"effective_sample_size":{}}})"
      "\n",
      files::in_json_quotes(s.camera()), files::seconds_text(s.captured_at()), s.captured_at(), s.received_at(),
      s.published_at(), s.frame_number(), idl::state_name(s.state()), json_array(s.position()),
      json_array(s.orientation()), json_array(s.covariance()), s.features_in_view(), s.features_matched(),
      s.map_points(), json_number(s.confidence()), s.particle_count(), json_number(s.effective_sample_size()));
}

std::string text_line(const msg::CameraPose& s, std::int64_t received_at, std::size_t camera_width) {
  const auto sigma = [&](std::size_t first, double unit) {  // of three axes together
    return unit * std::sqrt(s.covariance()[7 * first] + s.covariance()[7 * first + 7] + s.covariance()[7 * first + 14]);
  };
  return fmt::format(
      "{}  {:<{}}  {:<9}  x {}  y {}  z {} m   q {} {} {} {}   sigma {} mm {} deg   features {}/{}   latency {} + {} "
      "ms\n",
      clock_time(s.captured_at()), s.camera(), camera_width, idl::state_name(s.state()), number(s.position()[0], 4, 8),
      number(s.position()[1], 4, 8), number(s.position()[2], 4, 8), number(s.orientation()[0], 4, 7),
      number(s.orientation()[1], 4, 7), number(s.orientation()[2], 4, 7), number(s.orientation()[3], 4, 7),
      number(sigma(0, 1000), 1, 6), number(sigma(3, 180 / std::numbers::pi), 2, 5), s.features_matched(),
      s.features_in_view(), latency_ms(s.captured_at(), s.published_at(), 1, 6),
      latency_ms(s.published_at(), received_at, 2));
}

template <typename Sample>
std::string any_line(Format format, const Sample& sample, std::int64_t received_at, std::size_t name_width) {
  switch (format) {
    case Format::csv:
      return csv_line(sample);
    case Format::json:
      return json_line(sample);
    case Format::tum:
      return tum_line(sample);
    case Format::osc:
      return osc_bundle(sample);
    case Format::text:
      break;
  }
  return text_line(sample, received_at, name_width);
}

}  // namespace

std::string camera_header(Format format) {
  if (format != Format::csv) return "";
  std::string header = "camera,t,x,y,z,qx,qy,qz,qw";
  for (int row = 1; row <= 6; ++row)
    for (int column = row; column <= 6; ++column) header += fmt::format(",c{}{}", row, column);
  return header + ",state,features_in_view,features_matched,confidence\n";
}

std::string line(Format format, const msg::CameraPose& sample, std::int64_t received_at, std::size_t camera_width) {
  return any_line(format, sample, received_at, camera_width);
}

std::string header(Format format) {
  return format == Format::csv ? "target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence\n" : "";
}

std::string line(Format format, const msg::ObjectPosition& sample, std::int64_t received_at, std::size_t target_width) {
  return any_line(format, sample, received_at, target_width);
}

namespace {

// From the arrival of their pictures to the publication of these positions; empty: there are none.
std::string latency_words(const msg::ServiceStatus& s, std::span<const msg::ObjectPosition> positions) {
  std::vector<std::int64_t> ns;
  for (const msg::ObjectPosition& position : positions)
    if (std::ranges::any_of(s.targets(), [&](const std::string& target) {
          return position.target() == target || position.target().starts_with(target + "_");  // or one of its objects
        }))
      ns.push_back(position.published_at() - position.received_at());
  if (ns.empty()) return {};
  return fmt::format("{} ms from the last byte of its pictures to a position, median of {}",
                     latency_ms(0, files::median(ns), 1), ns.size());
}

// "pi-3: 40.013 ms ahead of ours +- 0.052, drifts by 50.1 ppm, answers within 0.21 ms; NTP says: kept to 0.30 ms".
std::string clock_words(const msg::HostClock& clock) {
  if (!clock.is_known()) return clock.host() + ": not compared with ours yet";
  if (clock.is_same_machine()) return clock.host() + ": ours, it is this machine";
  const auto ms = [](double seconds, int digits) { return number(1e3 * seconds, digits); };
  std::string out =
      fmt::format("{}: {} ms {} ours +- {}, drifts by {} ppm, answers within {} ms", clock.host(),
                  ms(std::abs(clock.offset_s()), 3), clock.offset_s() < 0 ? "behind" : "ahead of",
                  ms(clock.offset_sigma_s(), 3), number(1e6 * clock.drift(), 1), ms(clock.round_trip_s(), 2));
  if (std::isnan(clock.kept_s())) return out + "; no NTP or PTP on both";
  return out + fmt::format("; NTP or PTP: kept to {} ms{}", ms(clock.kept_s(), 2),
                           clock.is_contradicted() ? ", which is not so" : "");
}

}  // namespace

std::string text(const msg::ServiceStatus& s, std::int64_t now, const msg::CameraTimes* times,
                 std::span<const msg::CameraPose> poses, std::span<const msg::ObjectSet> sets,
                 const msg::HostClocks* clocks, std::span<const msg::ObjectPosition> positions) {
  std::string out =
      fmt::format("huetrackd {} on {}, process {}, mode {}, {} s ago\n", s.program_version(), s.host(), s.pid(),
                  s.mode(), number((static_cast<double>(now) - static_cast<double>(s.at())) / ns_per_s, 1));
  const auto add = [&](std::string_view label, const std::string& what) {
    fmt::format_to(std::back_inserter(out), "  {:<9} {}\n", label, what);
  };
  add("config", fmt::format("{}  identity {}", s.config_file(), s.config_identity()));
  const std::string history = s.rig_history().empty() ? "" : "; " + s.rig_history();
  add("rig", fmt::format("identity {}, world frame {}{}", s.rig_identity(), s.frame_id(), history));
  add("targets", s.targets().empty() ? "none" : fmt::format("{}", fmt::join(s.targets(), ", ")));
  add("tracking",
      fmt::format("{} frame sets per second; {} sets, {} of them incomplete, {} dropped; {} late frames",
                  number(s.set_rate_hz(), 1), s.sets(), s.incomplete_sets(), s.dropped_sets(), s.late_frames()));
  if (const std::string latency = latency_words(s, positions); !latency.empty()) add("latency", latency);
  add("sent", fmt::format("{} samples, {} failures", s.published(), s.publish_failures()));
  if (s.clock_offset_s() != 0)
    add("clock", fmt::format("capture times are the recording's plus {} s", number(s.clock_offset_s(), 3)));
  std::size_t width = 0;
  for (const msg::CameraStatus& camera : s.cameras()) width = std::max(width, camera.name().size());
  for (const msg::CameraStatus& camera : s.cameras()) {
    // A held replay delivers no frames: not a fault of its cameras.
    const bool is_held = s.mode() == "held" && (camera.health() == msg::CAMERA_HEALTH_WAITING ||
                                                camera.health() == msg::CAMERA_HEALTH_STALLED);
    const std::string message = is_held ? "" : camera.message();
    add("camera", fmt::format("{:<{}}  {:<10}  {} Hz, {} frames, {} dropped, {} corrupted{}{}{}", camera.name(), width,
                              is_held ? "held" : idl::name(camera.health()), number(camera.rate_hz(), 1, 5),
                              camera.frames(), camera.dropped(), camera.corrupted(),
                              camera.frames() > 0 ? ", the last " + number(camera.age_s(), 2) + " s ago" : "",
                              message.empty() ? "" : ": ", message));
  }
  for (std::size_t c = 0; clocks != nullptr && c < clocks->clocks().size(); ++c)
    add("clock", clock_words(clocks->clocks()[c]));
  const auto ms = [](double seconds) { return number(1e3 * seconds, 1); };
  for (std::size_t c = 0; times != nullptr && c < times->cameras().size(); ++c) {
    const msg::CameraTime& time = times->cameras()[c];
    const std::string how_sure = c == 0 ? "(held)" : fmt::format("+- {}", ms(time.latency_sigma_s()));
    add("times", fmt::format("{:<{}}  latency {} ms {}, readout {} ms +- {}", time.camera(), width,
                             ms(time.latency_s()), how_sure, ms(time.readout_s()), ms(time.readout_sigma_s())));
  }
  for (const msg::CameraPose& pose : poses)
    if (std::ranges::any_of(s.cameras(), [&](const auto& camera) { return camera.name() == pose.camera(); }))
      add("pose", fmt::format("{:<{}}  {:<10}  {} of {} features, {} map points", pose.camera(), width,
                              idl::state_name(pose.state()), pose.features_matched(), pose.features_in_view(),
                              pose.map_points()));
  for (const msg::ObjectSet& set : sets) {
    if (std::ranges::find(s.targets(), set.target()) == s.targets().end()) continue;
    add("objects", fmt::format("{}: {} of at most {}", set.target(), set.objects().size(), set.most()));
    std::size_t name_width = 0;
    for (const msg::ObjectInSet& object : set.objects()) name_width = std::max(name_width, object.name().size());
    for (const msg::ObjectInSet& object : set.objects())
      add("object",
          fmt::format("{:<{}}  {:<9}  x {}  y {}  z {} m   {} views", object.name(), name_width,
                      idl::state_name(object.state()), number(object.position()[0], 3, 7),
                      number(object.position()[1], 3, 7), number(object.position()[2], 3, 7), object.views()));
  }
  for (const std::string& warning : s.warnings()) add("warning", warning);
  if (s.warnings().empty()) add("warnings", "none");
  return out;
}

std::string text(const msg::CameraHost& host) {
  std::string out = fmt::format("camera host {}, huetrackd {}\n", host.host(), host.program_version());
  std::size_t width = 0;
  for (const msg::HostedCamera& camera : host.cameras()) width = std::max(width, camera.name().size());
  for (const msg::HostedCamera& camera : host.cameras()) {
    const std::string size =
        camera.width() == 0 ? ""
                            : fmt::format("{}x{} at {} Hz, ", camera.width(), camera.height(), number(camera.fps(), 1));
    fmt::format_to(std::back_inserter(out), "  {:<9} {:<{}}  {:<10}  {}{} frames, {} dropped, {} corrupted{}{}\n",
                   "camera", camera.name(), width, idl::name(camera.state()), size, camera.frames(), camera.dropped(),
                   camera.corrupted(), camera.message().empty() ? "" : ": ", camera.message());
  }
  return out;
}

}  // namespace huetrack::client
