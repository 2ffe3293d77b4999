#include "osc.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <string_view>

#include "idl/names.h"
#include "sample_format.h"

namespace huetrack::client {
namespace {

constexpr std::int64_t unix_since_1900_s = 2'208'988'800;  // NTP counts from 1900

template <typename Unsigned>
void append_big_endian(std::string& out, Unsigned value) {
  for (int shift = 8 * (int(sizeof value) - 1); shift >= 0; shift -= 8) out += static_cast<char>(value >> shift & 0xff);
}

// Ended by at least one zero, and as long as a multiple of four.
void append_text(std::string& out, std::string_view text) {
  out += text;
  out.append(4 - text.size() % 4, '\0');
}

std::string message(const std::string& address, std::string_view text) {
  std::string out;
  append_text(out, address);
  append_text(out, ",s");
  append_text(out, text);
  return out;
}

std::string message(const std::string& address, std::span<const double> values) {
  std::string out;
  append_text(out, address);
  append_text(out, "," + std::string(values.size(), 'f'));
  for (const double value : values) append_big_endian(out, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
  return out;
}

class Bundle {
 public:
  explicit Bundle(std::int64_t unix_ns) {
    append_text(bytes_, "#bundle");
    const std::int64_t seconds = unix_ns / ns_per_s - (unix_ns % ns_per_s < 0 ? 1 : 0);
    const auto rest_ns = static_cast<std::uint64_t>(unix_ns - seconds * ns_per_s);
    append_big_endian(bytes_, static_cast<std::uint32_t>(seconds + unix_since_1900_s));
    append_big_endian(bytes_, static_cast<std::uint32_t>((rest_ns << 32U) / ns_per_s));
  }
  void add(const std::string& message) {
    append_big_endian(bytes_, static_cast<std::uint32_t>(message.size()));
    bytes_ += message;
  }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

std::string address_part(std::string name) {
  std::ranges::replace_if(
      name, [](char c) { return c <= ' ' || std::string_view("#*,/?[]{}\x7f").find(c) != std::string_view::npos; },
      '_');
  return name;
}

bool all_finite(std::span<const double> values) {
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}

}  // namespace

std::string osc_bundle(const msg::ObjectPosition& sample) {
  const std::string address = "/huetrack/" + address_part(sample.target());
  Bundle bundle(sample.captured_at());
  bundle.add(message(address + "/state", idl::state_name(sample.state())));
  if (all_finite(sample.position())) {
    const auto& c = sample.covariance();
    const double sigma[] = {std::sqrt(c[0]), std::sqrt(c[4]), std::sqrt(c[8])};
    bundle.add(message(address + "/position", sample.position()));
    if (all_finite(sample.velocity())) bundle.add(message(address + "/velocity", sample.velocity()));
    if (all_finite(sigma)) bundle.add(message(address + "/sigma", sigma));
  }
  return bundle.take();
}

std::string osc_bundle(const msg::CameraPose& sample) {
  const std::string address = "/huetrack/camera/" + address_part(sample.camera());
  Bundle bundle(sample.captured_at());
  bundle.add(message(address + "/state", idl::state_name(sample.state())));
  if (all_finite(sample.position()) && all_finite(sample.orientation())) {
    const auto& c = sample.covariance();
    const double sigma[] = {std::sqrt(c[0]), std::sqrt(c[7]), std::sqrt(c[14])};
    bundle.add(message(address + "/position", sample.position()));
    bundle.add(message(address + "/orientation", sample.orientation()));
    if (all_finite(sigma)) bundle.add(message(address + "/sigma", sigma));
  }
  return bundle.take();
}

}  // namespace huetrack::client
