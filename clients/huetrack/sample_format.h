// Samples as text. Pure functions: numbers do not depend on the locale, and every line ends with '\n'.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "idl/camera_host.h"
#include "idl/camera_times.h"
#include "idl/huetrack.h"
#include "idl/object_set.h"

namespace huetrack::client {

inline constexpr std::int64_t ns_per_s = 1'000'000'000;

enum class Format : std::uint8_t {
  text,  // readable
  csv,   // what `huetrackd replay --tracks` writes too; t is the UNIX capture time, s
  json,  // one object per sample with all fields; NaN is null
  tum,   // timestamp tx ty tz qx qy qz qw, for evo: positions if valid, poses only while tracking (TUM has no states)
  osc,   // a bundle of Open Sound Control, see osc.h: bytes, not a line
};

// The CSV's header line; empty for other formats.
std::string header(Format format);

// One sample as one line; nothing for a tum line without a position, or of a camera that is not tracking.
//   received_at    UNIX ns; for the latency in the text
//   target_width   to which the text pads the target's name
std::string line(Format format, const msg::ObjectPosition& sample, std::int64_t received_at, std::size_t target_width);

// Header and line for the poses of a tracked camera. The CSV has the covariance's upper triangle, c11 c12 .. c66.
std::string camera_header(Format format);
std::string line(Format format, const msg::CameraPose& sample, std::int64_t received_at, std::size_t camera_width);

// The status as readable text, several lines.
//   now     UNIX ns
//   times   the latest of this service, if any
//   poses   the latest of each tracked camera; those of the status' cameras are shown
//   sets    the latest of each target with several objects; those of the status' targets are shown
//   clocks  the latest of this service, if it has remote cameras
//   positions  those that came meanwhile; those of the status' targets count
std::string text(const msg::ServiceStatus& status, std::int64_t now, const msg::CameraTimes* times = nullptr,
                 std::span<const msg::CameraPose> poses = {}, std::span<const msg::ObjectSet> sets = {},
                 const msg::HostClocks* clocks = nullptr, std::span<const msg::ObjectPosition> positions = {});
// Of a camera host, several lines.
std::string text(const msg::CameraHost& host);

}  // namespace huetrack::client
