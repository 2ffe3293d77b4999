#include "capture/jpeg/jpeg_index.h"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <mutex>
#include <span>
#include <utility>

#include "capture/jpeg/entropy_bytes.h"
#include "capture/jpeg/huffman_tables.h"
#include "capture/jpeg/inverse_transform.h"
#include "capture/jpeg/jpeg_header.h"
#include "capture/jpeg/mcu_index.h"

namespace huetrack::capture {
namespace {

constexpr std::size_t most_bytes = std::size_t{1} << 28;  // their bits are counted in 32 bits

std::size_t in_units(int n, int unit) {
  return static_cast<std::size_t>((n + unit - 1) / unit);
}

// The samples of a block with this DC coefficient (dequantised) and swing: rounding takes them no further than 1.
SampleBounds bounds_of_samples(std::int16_t dc, unsigned swing) {
  constexpr unsigned most_swing = 256 * 64;
  constexpr int most_sound_dc = 4096;  // beyond it, or with a larger swing, the transform's sums may wrap
  if (swing >= most_swing || std::abs(int{dc}) > most_sound_dc) return {};
  const int off = static_cast<int>(swing / 64) + 2, mean = 128 + (dc >> 3);
  return {static_cast<std::uint8_t>(std::clamp(mean - off, 0, 255)),
          static_cast<std::uint8_t>(std::clamp(mean + 1 + off, 0, 255))};
}

}  // namespace

// make() overwrites all members but one, in the memory of earlier frames where it suffices.
struct JpegIndex::Impl {
  bool make(std::span<const std::uint8_t> jpeg, int width, int height);
  bool make_tables();
  void lay_out_blocks();
  bool is_end_sound(std::span<const std::uint8_t> jpeg, int padding) const;
  void make_eighth();
  // `count` MCUs from `mcu` on, of one row. Their components from `first` on, into planes whose first pixel belongs to
  // the first of these MCUs.
  void decode(std::size_t mcu, std::size_t count, std::size_t first, const std::array<std::uint8_t*, 3>& planes,
              const std::array<std::ptrdiff_t, 3>& strides) const;

  std::size_t components() const { return static_cast<std::size_t>(header.components); }
  std::size_t mcus() const { return mcu_columns * mcu_rows; }
  std::size_t block_columns(std::size_t c) const {
    return mcu_columns * static_cast<std::size_t>(header.component[c].h);
  }
  std::size_t block_rows(std::size_t c) const { return mcu_rows * static_cast<std::size_t>(header.component[c].v); }
  Scan scan() const {
    return {.data = data,
            .blocks = {.all = blocks, .luma = luma},
            .mcus = mcus(),
            .restart_interval = static_cast<std::size_t>(header.restart_interval)};
  }

  JpegHeader header;
  EntropyBytes data;
  std::array<ComponentTables, 3> tables;
  std::array<std::size_t, 3> table_of{};  // each component's tables
  std::array<Swings, 3> swings{};         // of each component
  std::size_t mcu_columns = 0, mcu_rows = 0;
  std::vector<SkippedBlock> blocks;  // of an MCU
  std::size_t luma = 0;              // blocks of an MCU that are of its first component
  McuIndex index;
  std::atomic<bool> are_bounds_wanted = false;
  int searched_in_a_row = 0;  // of the frames that were in this memory before, the last ones; at most 2
  std::mutex eighth_mutex;    // guards the eighth, which is made when it is asked for
  bool has_eighth = false;
  std::vector<std::uint8_t> eighth;
};

bool JpegIndex::Impl::make(std::span<const std::uint8_t> jpeg, int width, int height) {
  if (jpeg.size() >= most_bytes) return false;
  const auto read = read_jpeg_header(jpeg, width, height);
  if (!read) return false;
  header = *read;
  has_eighth = false;
  searched_in_a_row = are_bounds_wanted ? std::min(searched_in_a_row + 1, 2) : 0;
  are_bounds_wanted = false;
  if (!make_tables()) return false;
  lay_out_blocks();
  const auto interval = static_cast<std::size_t>(header.restart_interval);
  return data.take(jpeg, header.scan, interval == 0 ? 1 : (mcus() + interval - 1) / interval) &&
         index.make(scan(), searched_in_a_row > 1) && is_end_sound(jpeg, header.padding);
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
  for (std::size_t c = 0; c < components(); ++c) {
    const auto& component = header.component[c];
    swings[c] = swings_of(component.steps.data());
    blocks.insert(blocks.end(), static_cast<std::size_t>(component.h * component.v),
                  {.component = c, .tables = &tables[table_of[c]], .swings = &swings[c]});
  }
  luma = static_cast<std::size_t>(header.component[0].h * header.component[0].v);
}

// Each interval has the bits that its MCUs took, few bytes more, and the image ends behind the last one.
bool JpegIndex::Impl::is_end_sound(std::span<const std::uint8_t> jpeg, int padding) const {
  for (std::size_t i = 0; i < data.intervals.size(); ++i) {
    const std::size_t used = (index.interval_ends()[i] + 7) / 8, end = data.intervals[i].end;
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

void JpegIndex::Impl::make_eighth() {
  const auto& dc = index.mcus().dc;
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

void JpegIndex::Impl::decode(std::size_t mcu, std::size_t count, std::size_t first,
                             const std::array<std::uint8_t*, 3>& planes,
                             const std::array<std::ptrdiff_t, 3>& strides) const {
  const McuArrays& mcus = index.mcus();
  std::array<DecodedBlock, 10> of_mcu;
  std::size_t n = 0;
  for (std::size_t i = 0, in_component = 0; i < blocks.size(); ++i, ++in_component) {
    const std::size_t c = blocks[i].component;
    if (i > 0 && c != blocks[i - 1].component) in_component = 0;
    if (c < first) continue;
    const auto& component = header.component[c];
    const auto v = static_cast<std::ptrdiff_t>(in_component) / component.h;
    const auto h = static_cast<std::ptrdiff_t>(in_component) % component.h;
    of_mcu[n++] = {.tables = blocks[i].tables,
                   .steps = component.steps.data(),
                   .dc = mcus.dc.data() + mcu * blocks.size() + i,
                   .dc_step = static_cast<std::ptrdiff_t>(blocks.size()),
                   .pixels = planes[c] + 8 * v * strides[c] + 8 * h,
                   .stride = strides[c],
                   .pixel_step = std::ptrdiff_t{8} * component.h};
  }
  const auto& begins = first == 0 ? mcus.begins : mcus.chroma_begins;
  decode_mcus(data.bytes.data(), std::span(begins).subspan(mcu, count), std::span(of_mcu).first(n));
}

JpegIndex::JpegIndex() : impl_(std::make_unique<Impl>()) {}
JpegIndex::~JpegIndex() = default;

std::shared_ptr<const JpegIndex> JpegIndex::build(std::shared_ptr<const std::vector<std::uint8_t>> jpeg, int width,
                                                  int height, JpegIndexPool* pool) {
  auto index = pool != nullptr ? pool->take() : std::make_shared<JpegIndex>();
  return index->impl_->make(*jpeg, width, height) ? std::move(index) : nullptr;
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
  if (mcu_u0 >= mcu_u1) return;
  const Impl& impl = *impl_;
  std::array<std::uint8_t*, 3> at{};
  for (std::size_t c = 0; c < impl.components(); ++c) {
    const auto& component = impl.header.component[c];
    at[c] = planes[c] + std::ptrdiff_t{8} * component.v * mcu_v * strides[c] + std::ptrdiff_t{8} * component.h * mcu_u0;
  }
  impl.decode(static_cast<std::size_t>(mcu_v) * impl.mcu_columns + static_cast<std::size_t>(mcu_u0),
              static_cast<std::size_t>(mcu_u1 - mcu_u0), 0, at, strides);
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

std::vector<PixelBounds> JpegIndex::bounds() const {
  Impl& impl = *impl_;
  impl.are_bounds_wanted = true;
  McuIndex made_now;
  const McuArrays* mcus = &impl.index.mcus();
  if (mcus->swings.empty()) {
    made_now.make(impl.scan(), true);
    mcus = &made_now.mcus();
  }
  const SampleBounds chroma = impl.components() == 1 ? SampleBounds{.min = 128, .max = 128} : no_sample;
  std::vector<PixelBounds> out(impl.mcus(), {.y = no_sample, .u = chroma, .v = chroma});
  for (std::size_t mcu = 0, i = 0; mcu < out.size(); ++mcu) {
    const std::array<SampleBounds*, 3> of{&out[mcu].y, &out[mcu].u, &out[mcu].v};
    for (const SkippedBlock& block : impl.blocks) {
      const int step = impl.header.component[block.component].steps[0];
      of[block.component]->include(bounds_of_samples(static_cast<std::int16_t>(mcus->dc[i] * step), mcus->swings[i]));
      ++i;
    }
  }
  return out;
}

void JpegIndex::narrow_chroma(std::size_t mcu, PixelBounds& bounds) const {
  const Impl& impl = *impl_;
  if (impl.components() == 1) return;
  constexpr std::size_t most_samples = 3 * 64;  // an MCU has at most 10 blocks, 3 of each component of chroma
  std::array<std::array<std::uint8_t, most_samples>, 2> samples;
  const auto& component = impl.header.component[1];  // the third one has the same sampling
  const std::ptrdiff_t stride = std::ptrdiff_t{8} * component.h;
  impl.decode(mcu, 1, 1, {nullptr, samples[0].data(), samples[1].data()}, {0, stride, stride});
  const auto count = static_cast<std::size_t>(64 * component.h * component.v);
  const auto range_of = [&](const auto& all) {
    const auto [min, max] = std::ranges::minmax(std::span(all).first(count));
    return SampleBounds{.min = min, .max = max};
  };
  bounds.u = range_of(samples[0]);
  bounds.v = range_of(samples[1]);
}

}  // namespace huetrack::capture
