// USB bandwidth that a camera's stream reserves: the host reserves that of the alternate setting that the driver
// selected, whatever the camera then sends. Read from the device's descriptors and from sysfs.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/v4l2/v4l2_device.h"

namespace huetrack::capture {

// One alternate setting of a video streaming interface (USB Video Class 1.5, 3.9 and 3.10).
struct UsbStreamSetting {
  int interface = 0;
  int alternate = 0;
  bool is_isochronous = false;  // false: bulk, which uses what is left and reserves nothing
  int bytes = 0;                // per interval; isochronous only
  double intervals_per_s = 0;
  double mbps() const { return 8e-6 * bytes * intervals_per_s; }
};

// All settings with an endpoint, of the streaming interfaces that the video control interface lists. (Setting 0 of an
// isochronous camera has none: no stream.)
//   descriptors    as in sysfs: the device's, then those of its configurations
//   speed_mbps     the device's speed, which sets the interval (USB 2.0, 9.6.6; USB 3.2, 9.6.7)
// Pure. Damaged descriptors end the list; no exception.
std::vector<UsbStreamSetting> usb_stream_settings(std::span<const std::uint8_t> descriptors, int configuration,
                                                  int control_interface, double speed_mbps);

struct UsbReservation {
  std::vector<UsbStreamSetting> in_force;  // the selected ones: none without an isochronous stream
  double most_mbps = 0;                    // of the largest setting; 0: a bulk camera
  double mbps() const;
};
// nullopt: unknown to sysfs, or not a USB Video Class camera.
std::optional<UsbReservation> usb_reservation(const UsbPlace& place);

std::string to_string(
    const UsbReservation& reservation);  // "196.6 Mbit/s reserved (alternate setting 7: 3072 bytes ...)"

}  // namespace huetrack::capture
