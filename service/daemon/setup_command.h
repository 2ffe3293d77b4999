// `huetrackd setup`: writes a first configuration for this host's cameras, runs it, and starts the web page.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/v4l2/v4l2_device.h"
#include "daemon/live.h"

namespace huetrack::daemon {

// A camera of this host, for the configuration.
struct SetUpCamera {
  std::filesystem::path device;  // by-path name if udev gives one
  int width = 0, height = 0;
  std::string model;       // for people
  double fps = 0;          // requested; 0: unknown
  double bytes_per_s = 0;  // approximate data rate of its frames
};

// The usable cameras, by device number; adds the others, with reasons, to `left_out`.
std::vector<SetUpCamera> cameras_of_this_host(std::vector<std::string>& left_out, const std::stop_token& stop);

// Sets the rate nearest to 30 frames/s that a usable format has at this size (drivers have arbitrary defaults), and its
// data rate. Pure.
void choose_rate(std::span<const capture::OfferedFormat> formats, SetUpCamera& camera);

// A configuration of these cameras without calibration and targets, which the page may change. memory_bytes: of this
// host; the pre-roll of a minute takes at most a quarter of it.
// rig: file name of the rig beside it; empty: the cameras are not calibrated yet.
std::string first_configuration(std::span<const SetUpCamera> cameras, double memory_bytes, const std::string& rig = {});

// Rig of one camera that is not calibrated, of a horizontal field of view in degrees, 0 to 170 exclusive; nullopt: 60
// is assumed. No distortion; world at the camera: x forwards, y to the left, z up. Its uncertainty is that of usual
// lenses (calib/model/usual_lens.h); of a stated field of view, 5 % of the focal length.
std::string rig_of_one_camera(const SetUpCamera& camera, std::optional<double> fov_deg);

struct SetUpCommand {
  std::filesystem::path config;
  bool with_page = true;            // false: only write the file
  std::optional<double> fov_deg{};  // horizontal field of view of a single camera
  std::filesystem::path film{};     // of one camera: the configuration is for it, and nothing is run; empty: none
};

// Writes configuration and rig for a film of one camera, cam0. throws std::exceptions of one readable line: the film
// cannot be read, or a file is there already.
void set_up_film(const SetUpCommand& command, const std::stop_token& stop);

// An existing configuration is run as it stands. With one camera it also writes the rig (rig_of_one_camera()), beside
// it. throws std::exceptions of one readable line: there is no camera, a file cannot be written, or the rig's is there
// already; and as run() does.
void set_up(const SetUpCommand& command, LiveRequests& requests, const std::stop_token& stop);

}  // namespace huetrack::daemon
