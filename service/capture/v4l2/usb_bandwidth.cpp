#include "capture/v4l2/usb_bandwidth.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>

namespace huetrack::capture {
namespace {

constexpr int video_class = 0x0e, control_subclass = 1, streaming_subclass = 2;

enum DescriptorType : std::uint8_t {
  configuration_descriptor = 0x02,
  interface_descriptor = 0x04,
  endpoint_descriptor = 0x05,
  class_specific_interface = 0x24,
  superspeed_companion = 0x30,
  superspeed_plus_isochronous_companion = 0x31,
};

int word_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  return bytes[at] | bytes[at + 1] << 8;
}

// An isochronous endpoint's payload per interval, and how often an interval comes.
void set_bandwidth(UsbStreamSetting& setting, std::span<const std::uint8_t> endpoint, double speed_mbps) {
  const int exponent = std::clamp<int>(endpoint[6], 1, 16) - 1;  // bInterval
  const double base_hz = speed_mbps < 100 ? 1000 : 8000;         // frames or microframes
  setting.intervals_per_s = base_hz / double(1 << exponent);
  const int packet = word_at(endpoint, 4);  // wMaxPacketSize
  const int transactions = speed_mbps < 100 ? 1 : 1 + (packet >> 11 & 3);
  setting.bytes = (packet & 0x7ff) * transactions;
}

template <typename Number>
std::optional<Number> number_in(const std::filesystem::path& file) {
  std::ifstream in(file);
  Number number{};
  return in >> number ? std::optional(number) : std::nullopt;
}

}  // namespace

std::vector<UsbStreamSetting> usb_stream_settings(std::span<const std::uint8_t> descriptors, int configuration,
                                                  int control_interface, double speed_mbps) {
  std::vector<UsbStreamSetting> settings;
  std::vector<int> streaming;  // interfaces that our control interface lists
  bool is_ours = false;        // the configuration
  bool in_control = false, in_streaming = false;
  int interface = 0, alternate = 0;
  UsbStreamSetting* last = nullptr;  // setting of the last endpoint
  for (std::size_t at = 0; at + 2 <= descriptors.size();) {
    const std::size_t length = descriptors[at];
    if (length < 2 || at + length > descriptors.size()) break;
    const auto one = descriptors.subspan(at, length);
    at += length;
    switch (one[1]) {
      case configuration_descriptor:
        if (length >= 6) is_ours = one[5] == configuration;
        break;
      case interface_descriptor:
        if (length < 9) break;
        interface = one[2];
        alternate = one[3];
        last = nullptr;
        in_control = is_ours && one[5] == video_class && one[6] == control_subclass && interface == control_interface;
        in_streaming = is_ours && one[5] == video_class && one[6] == streaming_subclass &&
                       std::ranges::find(streaming, interface) != streaming.end();
        break;
      case class_specific_interface:  // of the control interface, the header: bInCollection, baInterfaceNr
        if (in_control && length >= 12 && one[2] == 1)
          for (std::size_t i = 12; i < std::min<std::size_t>(length, 12 + one[11]); ++i) streaming.push_back(one[i]);
        break;
      case endpoint_descriptor:
        if (!in_streaming || length < 7) break;
        settings.push_back({.interface = interface, .alternate = alternate, .is_isochronous = (one[3] & 3) == 1});
        last = &settings.back();
        if (last->is_isochronous) set_bandwidth(*last, one, speed_mbps);
        break;
      case superspeed_companion:
        if (last != nullptr && last->is_isochronous && length >= 6) last->bytes = word_at(one, 4);
        break;
      case superspeed_plus_isochronous_companion:
        if (last != nullptr && last->is_isochronous && length >= 8)
          last->bytes = word_at(one, 4) | word_at(one, 6) << 16;
        break;
      default:
        break;
    }
  }
  return settings;
}

double UsbReservation::mbps() const {
  double sum = 0;
  for (const auto& setting : in_force) sum += setting.mbps();
  return sum;
}

std::optional<UsbReservation> usb_reservation(const UsbPlace& place) {
  if (place.interface < 0) return std::nullopt;
  const std::filesystem::path device = "/sys/bus/usb/devices/" + place.port;
  const auto configuration = number_in<int>(device / "bConfigurationValue");
  std::ifstream file(device / "descriptors", std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  if (!configuration || bytes.empty()) return std::nullopt;
  const auto settings =
      usb_stream_settings(std::span(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()), *configuration,
                          place.interface, place.speed_mbps);
  if (settings.empty()) return std::nullopt;
  UsbReservation reservation;
  for (const auto& setting : settings) {
    if (!setting.is_isochronous) continue;
    reservation.most_mbps = std::max(reservation.most_mbps, setting.mbps());
    const auto selected = number_in<int>(
        device / (place.port + ":" + std::to_string(*configuration) + "." + std::to_string(setting.interface)) /
        "bAlternateSetting");
    if (selected == setting.alternate) reservation.in_force.push_back(setting);
  }
  return reservation;
}

std::string to_string(const UsbReservation& reservation) {
  if (reservation.most_mbps == 0) return "bulk: nothing is reserved";
  std::string sentence = fmt::format("{:.0f} Mbit/s reserved", reservation.mbps());
  for (const auto& setting : reservation.in_force)
    sentence += fmt::format(" (alternate setting {}: {} bytes, {:.0f} times a second)", setting.alternate,
                            setting.bytes, setting.intervals_per_s);
  return sentence;
}

}  // namespace huetrack::capture
