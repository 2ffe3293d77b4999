// What a USB camera's stream takes of its bus: the host keeps the bandwidth of the alternate setting that the driver
// has chosen, whatever the camera then sends. From the device's own descriptors and from what sysfs says is in force.
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
  bool is_isochronous = false;  // false: bulk, which takes what is left and has nothing kept for it
  int bytes = 0;                // per interval; isochronous only
  double intervals_per_s = 0;
  double mbps() const { return 8e-6 * bytes * intervals_per_s; }
};

// All settings with an endpoint, of the streaming interfaces that the video control interface names. Setting 0 of an
// isochronous camera has none: it is the one without a stream.
//   descriptors    as sysfs has them: the device's, then those of its configurations
//   speed_mbps     that the device runs at: it decides what an interval is (USB 2.0, 9.6.6; USB 3.2, 9.6.7)
// Pure. Damaged descriptors end the list; no exception.
std::vector<UsbStreamSetting> usb_stream_settings(std::span<const std::uint8_t> descriptors, int configuration,
                                                  int control_interface, double speed_mbps);

struct UsbReservation {
  std::vector<UsbStreamSetting> in_force;  // of the settings that are selected now: none without an isochronous stream
  double most_mbps = 0;                    // that its largest setting would reserve; 0: it is a bulk camera
  double mbps() const;
};
// nullopt: sysfs does not say, or it is not a USB Video Class camera.
std::optional<UsbReservation> usb_reservation(const UsbPlace& place);

std::string to_string(
    const UsbReservation& reservation);  // "196.6 Mbit/s reserved (alternate setting 7: 3072 bytes ...)"

}  // namespace huetrack::capture
