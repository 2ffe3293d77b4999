#include "capture/jpeg/jpeg_index.h"

#include <algorithm>
#include <cstdlib>
#include <mutex>
#include <numeric>
#include <span>
#include <utility>

#include "capture/jpeg/entropy_bytes.h"
#include "capture/jpeg/huffman_tables.h"
#include "capture/jpeg/inverse_transform.h"
#include "capture/jpeg/jpeg_header.h"
#include "capture/jpeg/mcu_kernels.h"

namespace huetrack::capture {
namespace {

constexpr std::size_t most_bytes = std::size_t{1} << 28;  // their bits are counted in 32 bits

// Bits that are worth a lane of their own: a lane that begins anywhere finds the true codes after some 2000 bits.
constexpr std::size_t least_lane_bits = 16384;

std::size_t in_units(int n, int unit) {
  return static_cast<std::size_t>((n + unit - 1) / unit);
}

// The samples of a block with this DC coefficient (dequantised) and swing: rounding takes them no further than 1.
SampleBounds bounds_of_samples(std::int16_t dc, std::uint64_t swing) {
  constexpr std::uint64_t most_swing = 256 * 64;
  constexpr int most_sound_dc = 4096;  // beyond it, or with a larger swing, the transform's sums may wrap
  if (swing >= most_swing || std::abs(int{dc}) > most_sound_dc) return {};
  const int off = static_cast<int>(swing / 64) + 2, mean = 128 + (dc >> 3);
  return {static_cast<std::uint8_t>(std::clamp(mean - off, 0, 255)),
          static_cast<std::uint8_t>(std::clamp(mean + 1 + off, 0, 255))};
}

}  // namespace

struct JpegIndexPool::Impl {
  explicit Impl(int most) : most_free(static_cast<std::size_t>(std::max(most, 0))) { free.reserve(most_free); }

  const std::size_t most_free;
  std::mutex mutex;
  std::vector<std::unique_ptr<JpegIndex>> free;
};

JpegIndexPool::JpegIndexPool(int most_free) : impl_(std::make_shared<Impl>(most_free)) {}
JpegIndexPool::~JpegIndexPool() = default;

// All of it is made anew by make(), in memory of earlier frames where there is enough.
struct JpegIndex::Impl {
  bool make(std::span<const std::uint8_t> jpeg, int width, int height);
  bool make_tables();
  void lay_out_blocks();
  bool skip_all();
  void skip_intervals(std::size_t first, std::size_t intervals);
  bool skip_interval(std::size_t mcus, const EntropyBytes::Interval& interval);
  std::size_t lanes_of(std::size_t mcus, const EntropyBytes::Interval& interval);
  bool join(McuLane lane, std::span<const McuLane> guessed, std::size_t end);
  bool is_end_sound(std::span<const std::uint8_t> jpeg, int padding) const;
  bool sum_differences();
  void make_eighth();
  // Of these MCUs, one after the other: bounds of each component of the blocks first .. end - 1 of an MCU.
  std::vector<SampleBounds> bounds(std::span<const std::uint32_t> mcus, std::size_t first, std::size_t end) const;

  std::size_t components() const { return static_cast<std::size_t>(header.components); }
  std::size_t block_columns(std::size_t c) const {
    return mcu_columns * static_cast<std::size_t>(header.component[c].h);
  }
  std::size_t block_rows(std::size_t c) const { return mcu_rows * static_cast<std::size_t>(header.component[c].v); }
  McuLane lane_at(std::size_t mcu, std::size_t most, const EntropyBytes::Interval& interval) {
    return {.bit = 8 * interval.begin,
            .stop = 8 * interval.end,
            .left = most,
            .positions = positions.data() + mcu,
            .differences = dc.data() + mcu * blocks.size()};
  }

  JpegHeader header;
  EntropyBytes data;
  std::array<ComponentTables, 3> tables;
  std::array<std::size_t, 3> table_of{};  // each component's tables
  std::size_t mcu_columns = 0, mcu_rows = 0;
  std::vector<std::size_t> blocks;                   // of an MCU: their components
  std::vector<const ComponentTables*> block_tables;  // and tables
  std::size_t luma = 0;                              // blocks of an MCU that are of its first component
  std::vector<McuBegin> positions;                   // of MCUs
  std::vector<std::int16_t> dc;                      // of all blocks, MCU by MCU, modulo 2^16
  std::vector<std::size_t> interval_ends;            // bits behind each interval's last MCU
  struct Guess {                                     // what a lane that began anywhere has skipped
    std::vector<McuBegin> positions;
    std::vector<std::int16_t> differences;
  };
  std::array<Guess, most_mcu_lanes - 1> guesses;
  std::mutex eighth_mutex;  // it is made when it is asked for
  bool has_eighth = false;
  std::vector<std::uint8_t> eighth;
};

bool JpegIndex::Impl::make(std::span<const std::uint8_t> jpeg, int width, int height) {
  if (jpeg.size() >= most_bytes) return false;
  const auto read = read_jpeg_header(jpeg, width, height);
  if (!read) return false;
  header = *read;
  has_eighth = false;
  if (!make_tables()) return false;
  lay_out_blocks();
  const std::size_t mcus = positions.size();
  const auto interval = static_cast<std::size_t>(header.restart_interval);
  return data.take(jpeg, header.scan, interval == 0 ? 1 : (mcus + interval - 1) / interval) && skip_all() &&
         is_end_sound(jpeg, header.padding) && sum_differences();
}

bool JpegIndex::Impl::make_tables() {
  for (std::size_t c = 0; c < components(); ++c) {
    const auto& codes = header.component[c];
    table_of[c] = c;
    for (std::size_t earlier = 0; earlier < c; ++earlier)
      if (header.component[earlier].dc == codes.dc && header.component[earlier].ac == codes.ac)
        table_of[c] = std::min(table_of[c], earlier);
    if (table_of[c] == c && !tables[c].make(codes.dc, codes.ac)) return false;
  }
  return true;
}

void JpegIndex::Impl::lay_out_blocks() {
  mcu_columns = in_units(header.width, header.mcu_width());
  mcu_rows = in_units(header.height, header.mcu_height());
  blocks.clear();
  block_tables.clear();
  for (std::size_t c = 0; c < components(); ++c)
    for (int i = 0; i < header.component[c].h * header.component[c].v; ++i) {
      blocks.push_back(c);
      block_tables.push_back(&tables[table_of[c]]);
    }
  luma = static_cast<std::size_t>(header.component[0].h * header.component[0].v);
  positions.resize(mcu_columns * mcu_rows);
  dc.resize(positions.size() * blocks.size());
}

bool JpegIndex::Impl::skip_all() {
  interval_ends.clear();
  if (header.restart_interval == 0) {
    if (!skip_interval(positions.size(), data.intervals[0])) return false;
  } else {
    for (std::size_t first = 0; first < data.intervals.size(); first += most_mcu_lanes)
      skip_intervals(first, std::min(most_mcu_lanes, data.intervals.size() - first));
  }
  return std::ranges::all_of(positions, &McuBegin::is_decodable);
}

// Each interval is a lane.
void JpegIndex::Impl::skip_intervals(std::size_t first, std::size_t intervals) {
  std::array<McuLane, most_mcu_lanes> lanes;
  const auto of_interval = static_cast<std::size_t>(header.restart_interval);
  for (std::size_t i = 0; i < intervals; ++i) {
    const std::size_t mcu = (first + i) * of_interval;
    lanes[i] = lane_at(mcu, std::min(of_interval, positions.size() - mcu), data.intervals[first + i]);
  }
  skip_mcus(data.bytes.data(), block_tables, luma, std::span(lanes).first(intervals));
  for (std::size_t i = 0; i < intervals; ++i) {
    if (lanes[i].left > 0) lanes[i].positions->bit = McuBegin::not_decodable;  // too few bits
    interval_ends.push_back(lanes[i].bit);
  }
}

std::size_t JpegIndex::Impl::lanes_of(std::size_t mcus, const EntropyBytes::Interval& interval) {
  // A lane with a wrong guess of which block of an MCU it begins with decodes chroma by luma's tables, loses the codes,
  // and so gets another guess. With one table for all it would keep the first one.
  if (blocks.size() > 1 && std::ranges::count(table_of, 0U) == header.components) return 1;
  const std::size_t lanes =
      std::clamp<std::size_t>(8 * (interval.end - interval.begin) / least_lane_bits, 1, most_mcu_lanes);
  for (std::size_t i = 1; i < lanes; ++i) {
    guesses[i - 1].positions.resize(mcus);
    guesses[i - 1].differences.resize(mcus * blocks.size());
  }
  return lanes;
}

// All MCUs of an image without restart markers. Lane 0 begins where the interval does, the others somewhere in it, with
// the first block of an MCU as they guess.
bool JpegIndex::Impl::skip_interval(std::size_t mcus, const EntropyBytes::Interval& interval) {
  std::array<McuLane, most_mcu_lanes> lanes;
  const std::size_t n = lanes_of(mcus, interval), bytes_of_lane = (interval.end - interval.begin) / n;
  lanes[0] = lane_at(0, mcus, interval);
  for (std::size_t i = 1; i < n; ++i) {
    lanes[i] = {.bit = 8 * (interval.begin + i * bytes_of_lane),
                .stop = 8 * interval.end,
                .left = mcus,
                .positions = guesses[i - 1].positions.data(),
                .differences = guesses[i - 1].differences.data()};
    lanes[i - 1].stop = lanes[i].bit;
  }
  skip_mcus(data.bytes.data(), block_tables, luma, std::span(lanes).first(n));
  return join(lanes[0], std::span(lanes).subspan(1, n - 1), 8 * interval.end);
}

// The true MCUs are those of `lane`, to one that begins where an MCU of the next guessed lane begins: from there on,
// that one is true. And so on.
bool JpegIndex::Impl::join(McuLane lane, std::span<const McuLane> guessed, std::size_t end) {
  for (std::size_t next = 0; next < guessed.size(); ++next) {
    const Guess& guess = guesses[next];
    const auto begins = std::span(guess.positions).first(guess.positions.size() - guessed[next].left);
    auto begin = begins.begin();
    while (lane.left > 0) {
      while (begin != begins.end() && (begin->bit < lane.bit || !begin->is_decodable())) ++begin;
      if (begin == begins.end() || begin->bit == lane.bit) break;
      lane.stop = std::min(std::size_t{begin->bit}, end);
      skip_mcus(data.bytes.data(), block_tables, luma, std::span(&lane, 1));
      if (lane.bit >= end) break;
    }
    const auto taken = std::min(begins.end() - begin, static_cast<std::ptrdiff_t>(lane.left));
    if (taken == 0) continue;
    const auto per_mcu = static_cast<std::ptrdiff_t>(blocks.size());
    lane.bit = begin + taken == begins.end() ? guessed[next].bit : begin[taken].bit & ~McuBegin::not_decodable;
    lane.positions = std::copy_n(begin, taken, lane.positions);
    lane.differences =
        std::copy_n(guess.differences.begin() + (begin - begins.begin()) * per_mcu, taken * per_mcu, lane.differences);
    lane.left -= static_cast<std::size_t>(taken);
  }
  lane.stop = end;
  skip_mcus(data.bytes.data(), block_tables, luma, std::span(&lane, 1));
  interval_ends.push_back(lane.bit);
  return lane.left == 0;
}

// Each interval has the bits that its MCUs took, few bytes more, and the image ends behind the last one.
bool JpegIndex::Impl::is_end_sound(std::span<const std::uint8_t> jpeg, int padding) const {
  for (std::size_t i = 0; i < data.intervals.size(); ++i) {
    const std::size_t used = (interval_ends[i] + 7) / 8, end = data.intervals[i].end;
    if (used > end || end - used > most_jpeg_padding) return false;
    const auto rest = std::span(data.bytes).subspan(used, end - used);
    padding += static_cast<int>(rest.size() + static_cast<std::size_t>(std::ranges::count(rest, 0xFF)));
    if (padding > most_jpeg_padding) return false;
  }
  std::size_t at = data.end_of_scan;
  for (;;) {
    const auto marker = next_jpeg_marker(jpeg, at, padding);
    if (!marker) return false;
    if (*marker == 0xD9) return true;
    if (*marker < 0xD0 || *marker > 0xD7) return false;
  }
}

// Differences to values. False: one that 32 bits do not hold, which libjpeg refuses.
bool JpegIndex::Impl::sum_differences() {
  const std::size_t interval =
      header.restart_interval == 0 ? positions.size() : static_cast<std::size_t>(header.restart_interval);
  std::size_t first = 0;
  for (std::size_t c = 0; c < components(); ++c) {
    const auto of_mcu = static_cast<std::size_t>(header.component[c].h * header.component[c].v);
    std::int16_t* mcu = dc.data() + first;
    for (std::size_t begin = 0; begin < positions.size(); begin += interval) {
      std::int32_t last = 0;
      for (std::size_t n = std::min(interval, positions.size() - begin); n > 0; --n, mcu += blocks.size())
        for (std::size_t i = 0; i < of_mcu; ++i) {
          if (__builtin_add_overflow(last, mcu[i], &last)) return false;
          mcu[i] = static_cast<std::int16_t>(last);
        }
    }
    first += of_mcu;
  }
  return true;
}

void JpegIndex::Impl::make_eighth() {
  eighth.resize(dc.size());
  std::uint8_t* plane = eighth.data();
  const std::int16_t* of_component = dc.data();
  for (std::size_t c = 0; c < components(); ++c) {
    const auto h = static_cast<std::size_t>(header.component[c].h), v = static_cast<std::size_t>(header.component[c].v);
    const int step = header.component[c].steps[0];
    for (std::size_t i = 0; i < h * v; ++i) {
      const std::int16_t* mcu = of_component + i;
      for (std::size_t row = 0; row < mcu_rows; ++row) {
        std::uint8_t* const pixels = plane + (row * v + i / h) * block_columns(c) + i % h;
        for (std::size_t column = 0; column < mcu_columns; ++column, mcu += blocks.size())
          pixels[column * h] = jpeg_mean(static_cast<std::int16_t>(*mcu * step));
      }
    }
    plane += block_columns(c) * block_rows(c);
    of_component += h * v;
  }
}

std::vector<SampleBounds> JpegIndex::Impl::bounds(std::span<const std::uint32_t> mcus, std::size_t first,
                                                  std::size_t end) const {
  const std::size_t component = blocks[first], count = blocks[end - 1] + 1 - component;
  std::array<Swings, 3> swings_of_component;
  for (std::size_t c = component; c < component + count; ++c)
    swings_of_component[c] = swings_of(header.component[c].steps.data());
  std::vector<BoundedBlock> bounded;
  for (std::size_t i = first; i < end; ++i) bounded.push_back({block_tables[i], &swings_of_component[blocks[i]]});
  std::vector<std::uint32_t> bits(mcus.size());
  std::ranges::transform(mcus, bits.begin(),
                         [&](std::uint32_t mcu) { return first == 0 ? positions[mcu].bit : positions[mcu].chroma; });
  std::vector<std::uint64_t> swings(mcus.size() * bounded.size());
  find_swings(data.bytes.data(), bits, bounded, swings.data());
  std::vector<SampleBounds> out(mcus.size() * count, {.min = 255, .max = 0});
  auto swing = swings.begin();
  for (std::size_t n = 0; n < mcus.size(); ++n)
    for (std::size_t i = first; i < end; ++i) {
      const int step = header.component[blocks[i]].steps[0];
      const SampleBounds block =
          bounds_of_samples(static_cast<std::int16_t>(dc[mcus[n] * blocks.size() + i] * step), *swing++);
      SampleBounds& all = out[n * count + blocks[i] - component];
      all = {.min = std::min(all.min, block.min), .max = std::max(all.max, block.max)};
    }
  return out;
}

JpegIndex::JpegIndex() : impl_(std::make_unique<Impl>()) {}
JpegIndex::~JpegIndex() = default;

std::shared_ptr<const JpegIndex> JpegIndex::build(std::shared_ptr<const std::vector<std::uint8_t>> jpeg, int width,
                                                  int height, JpegIndexPool* pool) {
  std::unique_ptr<JpegIndex> index;
  const std::shared_ptr<JpegIndexPool::Impl> shelf = pool ? pool->impl_ : nullptr;
  if (shelf) {
    const std::lock_guard lock(shelf->mutex);
    if (!shelf->free.empty()) {
      index = std::move(shelf->free.back());
      shelf->free.pop_back();
    }
  }
  if (!index) index.reset(new JpegIndex);
  const bool is_made = index->impl_->make(*jpeg, width, height);
  // Weak: a free index still refers to this deleter (by std::enable_shared_from_this), and the pool must not keep
  // itself.
  std::shared_ptr<JpegIndex> shared(index.release(), [weak = std::weak_ptr(shelf)](JpegIndex* done) {
    std::unique_ptr<JpegIndex> back(done);
    const auto home = weak.lock();
    if (!home) return;
    const std::lock_guard lock(home->mutex);
    if (home->free.size() < home->most_free) home->free.push_back(std::move(back));
  });
  return is_made ? shared : nullptr;
}

PixelFormat JpegIndex::format() const {
  return impl_->header.format;
}
ColorRange JpegIndex::range() const {
  return impl_->header.range;
}
int JpegIndex::width() const {
  return impl_->header.width;
}
int JpegIndex::height() const {
  return impl_->header.height;
}
int JpegIndex::mcu_width() const {
  return impl_->header.mcu_width();
}
int JpegIndex::mcu_height() const {
  return impl_->header.mcu_height();
}
int JpegIndex::mcu_columns() const {
  return static_cast<int>(impl_->mcu_columns);
}
int JpegIndex::mcu_rows() const {
  return static_cast<int>(impl_->mcu_rows);
}

void JpegIndex::decode(int mcu_v, int mcu_u0, int mcu_u1, const std::array<std::uint8_t*, 3>& planes,
                       const std::array<std::ptrdiff_t, 3>& strides) const {
  const Impl& impl = *impl_;
  const std::size_t first = static_cast<std::size_t>(mcu_v) * impl.mcu_columns + static_cast<std::size_t>(mcu_u0);
  std::array<DecodedBlock, 10> of_mcu;
  std::size_t n = 0;
  for (std::size_t c = 0; c < impl.components(); ++c) {
    const auto& component = impl.header.component[c];
    for (int v = 0; v < component.v; ++v)
      for (int h = 0; h < component.h; ++h) {
        const std::ptrdiff_t row = std::ptrdiff_t{mcu_v} * component.v + v;
        const std::ptrdiff_t column = std::ptrdiff_t{mcu_u0} * component.h + h;
        of_mcu[n] = {.tables = impl.block_tables[n],
                     .steps = component.steps.data(),
                     .dc = impl.dc.data() + first * impl.blocks.size() + n,
                     .dc_step = static_cast<std::ptrdiff_t>(impl.blocks.size()),
                     .pixels = planes[c] + 8 * row * strides[c] + 8 * column,
                     .stride = strides[c],
                     .pixel_step = std::ptrdiff_t{8} * component.h};
        ++n;
      }
  }
  decode_mcus(impl.data.bytes.data(),
              std::span(impl.positions).subspan(first, static_cast<std::size_t>(std::max(mcu_u1 - mcu_u0, 0))),
              std::span(of_mcu).first(n));
}

Image JpegIndex::eighth() const {
  Impl& impl = *impl_;
  {
    const std::lock_guard lock(impl.eighth_mutex);
    if (!impl.has_eighth) impl.make_eighth();
    impl.has_eighth = true;
  }
  Image image{.format = format(),
              .range = range(),
              .width = static_cast<int>(impl.block_columns(0)),
              .height = static_cast<int>(impl.block_rows(0)),
              .planes = {},
              .owner = shared_from_this()};
  const std::uint8_t* next = impl.eighth.data();
  for (std::size_t c = 0; c < impl.components(); ++c) {
    image.planes[c] = {next, static_cast<std::ptrdiff_t>(impl.block_columns(c))};
    next += impl.block_columns(c) * impl.block_rows(c);
  }
  return image;
}

std::vector<ChromaBounds> JpegIndex::chroma_bounds() const {
  const Impl& impl = *impl_;
  std::vector<ChromaBounds> out(impl.positions.size(), {.u = {128, 128}, .v = {128, 128}});
  if (impl.components() == 1) return out;
  std::vector<std::uint32_t> all(out.size());
  std::iota(all.begin(), all.end(), 0U);
  const auto found = impl.bounds(all, impl.luma, impl.blocks.size());
  for (std::size_t mcu = 0; mcu < out.size(); ++mcu) out[mcu] = {.u = found[2 * mcu], .v = found[2 * mcu + 1]};
  return out;
}

void JpegIndex::find_luma_bounds(std::span<const std::uint32_t> mcus, SampleBounds* out) const {
  std::ranges::copy(impl_->bounds(mcus, 0, impl_->luma), out);
}

}  // namespace huetrack::capture
