// What the kernel reserves for USB cameras, out of descriptors as cameras give them.
#include "capture/v4l2/usb_bandwidth.h"

#include <gmock/gmock.h>

namespace huetrack::capture {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes joined(std::initializer_list<Bytes> parts) {
  Bytes all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}
Bytes device() {
  return {18, 1, 0, 2, 0xef, 2, 1, 64, 0x6d, 4, 0x25, 8, 0, 0, 0, 0, 0, 1};
}
Bytes configuration(std::uint8_t value) {
  return {9, 2, 0, 0, 2, value, 0, 0x80, 250};
}
Bytes interface(std::uint8_t number, std::uint8_t alternate, std::uint8_t subclass) {
  return {9, 4, number, alternate, 1, 0x0e, subclass, 0, 0};
}
Bytes control_header(std::uint8_t streaming) {
  return {13, 0x24, 1, 0, 1, 0x4e, 0, 0, 0, 0, 0, 1, streaming};
}
Bytes endpoint(std::uint8_t attributes, int packet, std::uint8_t interval) {
  return {7, 5, 0x81, attributes, std::uint8_t(packet & 0xff), std::uint8_t(packet >> 8), interval};
}
constexpr std::uint8_t isochronous = 5, bulk = 2, control = 1, streaming = 2;

Bytes webcam() {  // two cameras in one device: interfaces 0 and 1, 2 and 3
  return joined({device(), configuration(1), interface(0, 0, control), control_header(1), interface(1, 0, streaming),
                 interface(1, 1, streaming), endpoint(isochronous, 192, 1), interface(1, 2, streaming),
                 endpoint(isochronous, 2 << 11 | 1024, 1), interface(2, 0, control), control_header(3),
                 interface(3, 0, streaming), interface(3, 1, streaming), endpoint(isochronous, 512, 4)});
}

TEST(UsbStreamSettings, OfHighSpeedCountTransactionsAndMicroframes) {
  const auto settings = usb_stream_settings(webcam(), 1, 0, 480);
  ASSERT_EQ(settings.size(), 2u);
  EXPECT_EQ(settings[0].alternate, 1);
  EXPECT_EQ(settings[0].interface, 1);
  EXPECT_TRUE(settings[0].is_isochronous);
  EXPECT_NEAR(settings[0].mbps(), 192 * 8 * 8e-3, 1e-9);
  EXPECT_EQ(settings[1].alternate, 2);
  EXPECT_EQ(settings[1].bytes, 3 * 1024);
  EXPECT_NEAR(settings[1].mbps(), 196.608, 1e-9);
}

TEST(UsbStreamSettings, AreThoseOfTheControlInterfacesList) {
  const auto settings = usb_stream_settings(webcam(), 1, 2, 480);
  ASSERT_EQ(settings.size(), 1u);
  EXPECT_EQ(settings[0].interface, 3);
  EXPECT_EQ(settings[0].intervals_per_s, 1000);  // every 2^(4-1) microframes
  EXPECT_TRUE(usb_stream_settings(webcam(), 1, 1, 480).empty());
  EXPECT_TRUE(usb_stream_settings(webcam(), 2, 0, 480).empty());  // another configuration is selected
}

TEST(UsbStreamSettings, OfFullSpeedCountFrames) {
  const auto settings = usb_stream_settings(webcam(), 1, 0, 12);
  ASSERT_EQ(settings.size(), 2u);
  EXPECT_EQ(settings[0].intervals_per_s, 1000);
  EXPECT_EQ(settings[1].bytes, 1024);
}

TEST(UsbStreamSettings, OfSuperSpeedComeFromTheCompanion) {
  const Bytes companion{6, 0x30, 15, 1, 0, 0x78};  // wBytesPerInterval 30720
  const auto settings =
      usb_stream_settings(joined({device(), configuration(1), interface(0, 0, control), control_header(1),
                                  interface(1, 1, streaming), endpoint(isochronous, 1024, 1), companion}),
                          1, 0, 5000);
  ASSERT_EQ(settings.size(), 1u);
  EXPECT_EQ(settings[0].bytes, 30720);
}

TEST(UsbStreamSettings, OfABulkCameraReserveNothing) {
  const auto settings =
      usb_stream_settings(joined({device(), configuration(1), interface(0, 0, control), control_header(1),
                                  interface(1, 0, streaming), endpoint(bulk, 512, 0)}),
                          1, 0, 480);
  ASSERT_EQ(settings.size(), 1u);
  EXPECT_FALSE(settings[0].is_isochronous);
  EXPECT_EQ(settings[0].mbps(), 0);
}

TEST(UsbStreamSettings, DamageEndsTheList) {
  const Bytes whole = webcam();
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const auto settings = usb_stream_settings(std::span(whole).first(length), 1, 0, 480);
    EXPECT_LE(settings.size(), 2u);
  }
  Bytes endless = whole;
  endless[18] = 0;  // a descriptor of no length
  EXPECT_TRUE(usb_stream_settings(endless, 1, 0, 480).empty());
}

}  // namespace
}  // namespace huetrack::capture
