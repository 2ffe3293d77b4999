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
  text,  // for people
  csv,   // what `huetrackd replay --tracks` writes too; t is the UNIX capture time, s
  json,  // one object per sample, every field; a number that does not exist is null
  tum,  // timestamp tx ty tz qx qy qz qw, for evo and the like: positions where there is one, poses where the camera is
        // tracking (a coasting one is predicted, and tum cannot say so)
  osc,  // a bundle of Open Sound Control, see osc.h: bytes, not a line
};

// What comes before the first sample: the CSV's header line, or nothing.
std::string header(Format format);

// One sample as one line; nothing for a tum line without a position, or of a camera that is not tracking.
//   received_at    when it arrived here, UNIX ns; for the latency in the text
//   target_width   the text pads the target's name to it
std::string line(Format format, const msg::ObjectPosition& sample, std::int64_t received_at, std::size_t target_width);

// Header and line for the poses of a tracked camera. The CSV has the covariance's upper triangle, c11 c12 .. c66.
std::string camera_header(Format format);
std::string line(Format format, const msg::CameraPose& sample, std::int64_t received_at, std::size_t camera_width);

// The status for people, several lines.
//   now     UNIX ns
//   times   the last of this service, if there are any
//   poses   the last of each tracked camera; those of the status' cameras are shown
//   sets    the last of each target that is several objects; those of the status' targets are shown
//   clocks  the last of this service, if it has cameras of other hosts
std::string text(const msg::ServiceStatus& status, std::int64_t now, const msg::CameraTimes* times = nullptr,
                 std::span<const msg::CameraPose> poses = {}, std::span<const msg::ObjectSet> sets = {},
                 const msg::HostClocks* clocks = nullptr);
// Of a camera host, some lines.
std::string text(const msg::CameraHost& host);

}  // namespace huetrack::client
