#include "capture/frames/sample_code.h"

#include <algorithm>
#include <array>
#include <bit>

namespace huetrack::capture {
namespace {

constexpr std::size_t at_once = 8;
constexpr std::uint8_t above_all = 128;

std::uint8_t folded(unsigned difference) {
  const auto byte = static_cast<std::uint8_t>(difference);
  return static_cast<std::uint8_t>(byte << 1 ^ (byte >= 128 ? 0xff : 0));
}
std::uint8_t unfolded(std::uint8_t number) {
  return static_cast<std::uint8_t>(number >> 1 ^ ((number & 1) != 0 ? 0xff : 0));
}

unsigned bits_of(const std::uint8_t* numbers) {
  unsigned any = 0;
  for (std::size_t k = 0; k < at_once; ++k) any |= numbers[k];
  return static_cast<unsigned>(std::bit_width(any));
}

void put_numbers(const std::uint8_t* numbers, unsigned bits, std::vector<std::uint8_t>& out) {
  std::uint64_t all = 0;
  for (unsigned k = 0; k < at_once; ++k) all |= std::uint64_t{numbers[k]} << k * bits;
  for (unsigned byte = 0; byte < bits; ++byte) out.push_back(static_cast<std::uint8_t>(all >> 8 * byte));
}

// coded: `bits` bytes.
void take_numbers(const std::uint8_t* coded, unsigned bits, std::uint8_t* numbers) {
  std::uint64_t all = 0;
  for (unsigned byte = 0; byte < bits; ++byte) all |= std::uint64_t{coded[byte]} << 8 * byte;
  const std::uint64_t mask = (1U << bits) - 1;
  for (unsigned k = 0; k < at_once; ++k) numbers[k] = static_cast<std::uint8_t>(all >> k * bits & mask);
}

}  // namespace

void put_samples(std::span<const std::uint8_t> samples, std::size_t per_row, std::vector<std::uint8_t>& out) {
  std::array<std::uint8_t, 2 * at_once> numbers{};
  for (std::size_t from = 0; from < samples.size(); from += numbers.size()) {
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      const std::size_t i = from + k;
      if (i >= samples.size()) {
        numbers[k] = 0;
        continue;
      }
      const unsigned above = i < per_row ? above_all : samples[i - per_row];
      numbers[k] = folded(samples[i] - above);
    }
    const unsigned first = bits_of(&numbers[0]), second = bits_of(&numbers[at_once]);
    out.push_back(static_cast<std::uint8_t>(first | second << 4));
    put_numbers(&numbers[0], first, out);
    put_numbers(&numbers[at_once], second, out);
  }
}

bool take_samples(std::span<const std::uint8_t>& coded, std::size_t per_row, std::span<std::uint8_t> samples) {
  std::array<std::uint8_t, 2 * at_once> numbers{};
  for (std::size_t from = 0; from < samples.size(); from += numbers.size()) {
    if (coded.empty()) return false;
    const unsigned first = coded[0] & 15U, second = coded[0] >> 4;
    if (first > 8 || second > 8 || coded.size() < 1 + first + second) return false;
    take_numbers(&coded[0] + 1, first, &numbers[0]);
    take_numbers(&coded[0] + 1 + first, second, &numbers[at_once]);
    coded = coded.subspan(1 + first + second);
    std::copy_n(numbers.begin(), std::min(numbers.size(), samples.size() - from), &samples[from]);
  }
  for (std::size_t i = 0; i < std::min(per_row, samples.size()); ++i)
    samples[i] = static_cast<std::uint8_t>(above_all + unfolded(samples[i]));
  // Row by row: samples of one row do not depend on one another.
  for (std::size_t row = per_row; row < samples.size(); row += per_row) {
    const std::size_t n = std::min(per_row, samples.size() - row);
    std::uint8_t* const to = &samples[row];
    const std::uint8_t* const above = to - per_row;
    for (std::size_t i = 0; i < n; ++i) to[i] = static_cast<std::uint8_t>(above[i] + unfolded(to[i]));
  }
  return true;
}

}  // namespace huetrack::capture
