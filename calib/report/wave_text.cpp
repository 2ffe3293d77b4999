#include "calib/report/wave_text.h"

#include <array>
#include <cstdio>
#include <numbers>

namespace huetrack::report {
namespace {

std::string line(const char* format, auto... values) {
  std::array<char, 512> buffer;
  std::snprintf(buffer.data(), buffer.size(), format, values...);
  return std::string(buffer.data()) + "\n";
}

}  // namespace

std::string to_text(const wave::WaveResult& result) {
  constexpr double deg = 180 / std::numbers::pi;
  std::string out = result.usable() ? "VERDICT: usable\n" : "VERDICT: doubtful\n";
  for (const auto& doubt : result.doubts) out += "  - " + doubt + "\n";
  out += line("%.1f s of waving, %.2f x %.2f x %.2f m, jerks of %.0f m/s^3; the ball is %.2f px rms off",
              result.duration_s, result.extent_m.x(), result.extent_m.y(), result.extent_m.z(), result.jerk_m_s3,
              result.rms_px);
  out += line("expected error of positions where the ball was: %.1f mm rms, and by the scale %.1f mm",
              1e3 * result.expected_m, 1e3 * result.by_scale_m);
  if (result.expected_in_volume_m)
    out += line("in the whole volume: %.1f mm rms, and by the scale %.1f mm", 1e3 * *result.expected_in_volume_m,
                1e3 * result.by_scale_in_volume_m);
  out += line("the two halves of the recording differ by %.1f mm there; %.1f mm was to be expected",
              1e3 * result.halves_m, 1e3 * result.halves_sigma_m);
  out += line("scale: from %s; good to %.2f %%; the ball looks %.2f times as large as its radius says",
              result.scale_from.c_str(), 1e2 * result.scale_sigma, result.size_ratio);
  out += line("%-12s %7s %7s %7s %8s %9s %15s %13s %10s %9s", "camera", "frames", "seen", "used", "rms px", "coverage",
              "position +- mm", "axes +- deg", "moved mm", "turned");
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const wave::WaveCamera& camera = result.cameras[c];
    out += line("%-12s %7d %7d %7d %8.2f %8.0f%% %15.1f %13.3f %10.1f %9.2f", result.rig.cameras[c].name.c_str(),
                camera.frames, camera.seen, camera.used, camera.rms_px, 1e2 * camera.coverage,
                1e3 * camera.centre_sigma_m.norm(), deg * camera.rotation_sigma_rad.norm(), 1e3 * camera.moved_m,
                deg * camera.turned_rad);
  }
  for (const wave::WavePair& pair : result.pairs) {
    out += line("%s and %s saw it together in %d frames",
                result.rig.cameras[static_cast<std::size_t>(pair.a)].name.c_str(),
                result.rig.cameras[static_cast<std::size_t>(pair.b)].name.c_str(), pair.shared);
  }
  for (const auto& note : result.notes) out += "note: " + note + "\n";
  return out;
}

}  // namespace huetrack::report
