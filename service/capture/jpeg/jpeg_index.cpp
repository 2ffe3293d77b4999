#include "capture/jpeg/jpeg_index.h"

#include <algorithm>
#include <mutex>
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
constexpr std::int64_t most_dc = std::int64_t{1} << 30;   // libjpeg refuses what 32 bits do not hold

std::size_t in_units(int n, int unit) {
  return static_cast<std::size_t>((n + unit - 1) / unit);
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
  // One value per block of a component, in whole MCUs.
  struct Blocks {
    std::vector<std::int16_t> dc;
    std::size_t columns = 0, rows = 0;
  };

  bool make(std::span<const std::uint8_t> jpeg, int width, int height);
  bool make_tables();
  void lay_out_blocks();
  bool skip_all();
  bool is_end_sound(std::span<const std::uint8_t> jpeg, int padding) const;
  void make_eighth();

  std::size_t components() const { return static_cast<std::size_t>(header.components); }

  JpegHeader header;
  EntropyBytes data;
  std::array<ComponentTables, 3> tables;
  std::array<std::size_t, 3> table_of{};  // each component's tables
  std::size_t mcu_columns = 0, mcu_rows = 0;
  std::array<Blocks, 3> blocks;
  std::vector<std::uint32_t> positions;    // of MCUs, bits
  std::vector<std::size_t> interval_ends;  // bits behind each interval's last MCU
  std::vector<std::uint8_t> eighth;
};

bool JpegIndex::Impl::make(std::span<const std::uint8_t> jpeg, int width, int height) {
  if (jpeg.size() >= most_bytes) return false;
  auto read = read_jpeg_header(jpeg, width, height);
  if (!read) return false;
  header = *read;
  if (!make_tables()) return false;
  lay_out_blocks();
  const std::size_t mcus = mcu_columns * mcu_rows;
  const auto interval = static_cast<std::size_t>(header.restart_interval);
  if (!data.take(jpeg, header.scan, interval == 0 ? 1 : (mcus + interval - 1) / interval)) return false;
  if (!skip_all() || !is_end_sound(jpeg, header.padding)) return false;
  make_eighth();
  return true;
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
  positions.resize(mcu_columns * mcu_rows);
  for (std::size_t c = 0; c < components(); ++c) {
    blocks[c].columns = mcu_columns * static_cast<std::size_t>(header.component[c].h);
    blocks[c].rows = mcu_rows * static_cast<std::size_t>(header.component[c].v);
    blocks[c].dc.resize(blocks[c].columns * blocks[c].rows);
  }
}

bool JpegIndex::Impl::skip_all() {
  std::array<McuBlock, 10> of_mcu;
  const auto interval_of = [&](std::size_t mcu) {
    return header.restart_interval == 0 ? 0 : mcu / static_cast<std::size_t>(header.restart_interval);
  };
  McuBits bits{.bytes = data.bytes.data(), .limit = data.bytes.data() + data.intervals.back().end, .bit = 0};
  std::array<std::int64_t, 3> dc{};
  interval_ends.clear();
  for (std::size_t row = 0; row < mcu_rows; ++row) {
    std::size_t n = 0;
    for (std::size_t c = 0; c < components(); ++c) {
      const auto& component = header.component[c];
      for (int v = 0; v < component.v; ++v)
        for (int h = 0; h < component.h; ++h) {
          const std::size_t block_row = row * static_cast<std::size_t>(component.v) + static_cast<std::size_t>(v);
          of_mcu[n++] = {.tables = &tables[table_of[c]],
                         .component = c,
                         .dc = blocks[c].dc.data() + block_row * blocks[c].columns + h,
                         .step = component.h};
        }
    }
    const std::size_t row_end = (row + 1) * mcu_columns;
    for (std::size_t mcu = row * mcu_columns; mcu < row_end;) {
      const std::size_t interval = interval_of(mcu);
      std::size_t end = row_end;
      if (header.restart_interval != 0)
        end = std::min(end, (interval + 1) * static_cast<std::size_t>(header.restart_interval));
      if (interval != interval_ends.size()) {
        interval_ends.push_back(bits.bit);
        bits.bit = 8 * data.intervals[interval].begin;
        dc = {};
      }
      if (!skip_mcus(bits, std::span(of_mcu).first(n), std::span(positions).subspan(mcu, end - mcu), dc)) return false;
      mcu = end;
    }
    // No component has so many blocks in a row that it could leave 32 bits and come back.
    if (std::ranges::any_of(dc, [](std::int64_t d) { return d < -most_dc || d > most_dc; })) return false;
  }
  interval_ends.push_back(bits.bit);
  return true;
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

void JpegIndex::Impl::make_eighth() {
  std::size_t bytes = 0;
  for (std::size_t c = 0; c < components(); ++c) bytes += blocks[c].dc.size();
  eighth.resize(bytes);
  auto out = eighth.begin();
  for (std::size_t c = 0; c < components(); ++c) {
    const int step = header.component[c].steps[0];
    out = std::ranges::transform(blocks[c].dc, out, [step](std::int16_t dc) {
            return jpeg_mean(static_cast<std::int16_t>(dc * step));
          }).out;
  }
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
  std::shared_ptr<JpegIndex> shared(index.release(), [shelf](JpegIndex* done) {
    std::unique_ptr<JpegIndex> back(done);
    if (!shelf) return;
    const std::lock_guard lock(shelf->mutex);
    if (shelf->free.size() < shelf->most_free) shelf->free.push_back(std::move(back));
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
  std::array<DecodedBlock, 10> of_mcu;
  std::size_t n = 0;
  for (std::size_t c = 0; c < impl.components(); ++c) {
    const auto& component = impl.header.component[c];
    for (int v = 0; v < component.v; ++v)
      for (int h = 0; h < component.h; ++h) {
        const std::ptrdiff_t row = std::ptrdiff_t{mcu_v} * component.v + v;
        const std::ptrdiff_t column = std::ptrdiff_t{mcu_u0} * component.h + h;
        of_mcu[n++] = {
            .tables = &impl.tables[impl.table_of[c]],
            .steps = component.steps.data(),
            .dc = impl.blocks[c].dc.data() + row * static_cast<std::ptrdiff_t>(impl.blocks[c].columns) + column,
            .step = component.h,
            .pixels = planes[c] + 8 * row * strides[c] + 8 * column,
            .stride = strides[c],
            .pixel_step = std::ptrdiff_t{8} * component.h};
      }
  }
  const std::size_t first = static_cast<std::size_t>(mcu_v) * impl.mcu_columns + static_cast<std::size_t>(mcu_u0);
  decode_mcus(impl.data.bytes.data(),
              std::span(impl.positions).subspan(first, static_cast<std::size_t>(std::max(mcu_u1 - mcu_u0, 0))),
              std::span(of_mcu).first(n));
}

Image JpegIndex::eighth() const {
  const Impl& impl = *impl_;
  Image image{.format = format(),
              .range = range(),
              .width = static_cast<int>(impl.blocks[0].columns),
              .height = static_cast<int>(impl.blocks[0].rows),
              .planes = {},
              .owner = shared_from_this()};
  const std::uint8_t* next = impl.eighth.data();
  for (std::size_t c = 0; c < impl.components(); ++c) {
    image.planes[c] = {next, static_cast<std::ptrdiff_t>(impl.blocks[c].columns)};
    next += impl.blocks[c].dc.size();
  }
  return image;
}

}  // namespace huetrack::capture
