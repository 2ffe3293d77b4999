#include "recordings/joined_parts.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "calib/files/config_error.h"

namespace huetrack::recordings {
namespace {

namespace fs = std::filesystem;

// ISO 13818-1, 2.4.3.2; camcorders store a time of four bytes before every packet, broadcasters 16 bytes behind it.
constexpr std::uint8_t sync_byte = 0x47;
constexpr std::size_t header_bytes = 4;
constexpr std::array<JoinedParts::Layout, 3> layouts{{{188, 0}, {192, 4}, {204, 0}}};
constexpr std::size_t packets_of_evidence = 8;
// Of a part's begin and end, where the counters of its PIDs are looked for: 0.3 s of the fastest AVCHD (28 Mbit/s).
constexpr std::size_t searched_bytes = std::size_t{1} << 20;
constexpr std::size_t io_bytes = std::size_t{1} << 16;

JoinedParts::Layout layout_of(std::span<const std::uint8_t> begin) {
  for (const auto& layout : layouts) {
    const std::size_t count = std::min(packets_of_evidence, begin.size() / layout.packet);
    bool fits = count > 0;
    for (std::size_t k = 0; k < count; ++k) fits = fits && begin[k * layout.packet + layout.header] == sync_byte;
    if (fits) return layout;
  }
  return {};
}

struct Header {
  std::size_t pid;
  bool begins_unit, has_payload;
  std::int8_t counter;
};
Header header_at(const std::uint8_t* bytes) {
  return {.pid = (bytes[1] & std::size_t{0x1F}) << 8 | bytes[2],
          .begins_unit = (bytes[1] & 0x40) != 0,
          .has_payload = (bytes[3] & 0x10) != 0,
          .counter = static_cast<std::int8_t>(bytes[3] & 0x0F)};
}

template <typename Use>
void for_each_header(std::span<const std::uint8_t> packets, const JoinedParts::Layout& layout, const Use& use) {
  for (std::size_t at = layout.header; layout.packet > 0 && at + header_bytes <= packets.size(); at += layout.packet)
    if (packets[at] == sync_byte) use(header_at(&packets[at]), at);
}

std::int8_t counted(int number) {
  return static_cast<std::int8_t>(number & 0x0F);
}

}  // namespace

JoinedParts::JoinedParts(const std::vector<fs::path>& parts) : open_part_(parts.size()) {
  std::vector<std::uint8_t> begin(packets_of_evidence * layouts.back().packet);
  for (const fs::path& file : parts) {
    std::error_code error;
    const std::uint64_t bytes = fs::file_size(file, error);
    if (error) throw files::ConfigError(file, 0, "cannot be read: " + error.message());
    const Part& part = parts_.emplace_back(Part{.file = file, .begin = size_, .size = bytes});
    const std::size_t read = read_raw(part, 0, begin);
    parts_.back().layout = layout_of(std::span(begin).first(read));
    size_ += bytes;
  }
  shift_counters();
  auto* buffer = static_cast<unsigned char*>(capture::not_null(av_malloc(io_bytes)));
  const auto read_packet = [](void* self, std::uint8_t* to, int count) {
    const auto got = static_cast<JoinedParts*>(self)->read({to, static_cast<std::size_t>(count)});
    return got > 0 ? static_cast<int>(got) : AVERROR_EOF;
  };
  const auto seek_to = [](void* opaque, std::int64_t offset, int whence) -> std::int64_t {
    auto* self = static_cast<JoinedParts*>(opaque);
    if ((whence & AVSEEK_SIZE) != 0) return static_cast<std::int64_t>(self->size());
    const std::int64_t from = whence == SEEK_CUR   ? static_cast<std::int64_t>(self->at())
                              : whence == SEEK_END ? static_cast<std::int64_t>(self->size())
                                                   : 0;
    if (from + offset < 0) return AVERROR(EINVAL);
    self->seek(static_cast<std::uint64_t>(from + offset));
    return from + offset;
  };
  io_ = avio_alloc_context(buffer, static_cast<int>(io_bytes), 0, this, read_packet, nullptr, seek_to);
  if (io_ == nullptr) av_free(buffer);
  capture::not_null(io_);
}

JoinedParts::~JoinedParts() {
  av_freep(&io_->buffer);  // FFmpeg may have replaced it
  avio_context_free(&io_);
}

// A PID that begins a picture (or sound, table) with a part is counted on from the part before; one that is in the
// middle of it belongs to what the part before ends with, whose counters then go on, or packets are lost.
void JoinedParts::shift_counters() {
  std::vector<std::uint8_t> bytes(searched_bytes);
  const auto last = std::make_unique<Counters>();  // as played, up to the part before
  last->fill(unknown);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    Part& part = parts_[i];
    if (part.layout.packet == 0) {
      last->fill(unknown);
      continue;
    }
    auto shift = std::make_unique<Counters>();
    shift->fill(0);
    Counters first;
    first.fill(unknown);
    const std::size_t at_begin = read_raw(part, 0, bytes);
    for_each_header(std::span(bytes).first(at_begin), part.layout, [&](const Header& header, std::size_t) {
      if (!header.has_payload || first[header.pid] != unknown) return;
      first[header.pid] = header.counter;
      const std::int8_t before = (*last)[header.pid];
      if (before != unknown && header.begins_unit) (*shift)[header.pid] = counted(before + 1 - header.counter);
    });
    const std::uint64_t packets = part.size / part.layout.packet, searched = searched_bytes / part.layout.packet;
    const std::uint64_t from = (packets - std::min(packets, searched)) * part.layout.packet;
    const std::size_t at_end = read_raw(part, from, bytes);
    for_each_header(std::span(bytes).first(at_end), part.layout, [&](const Header& header, std::size_t) {
      if (header.has_payload) (*last)[header.pid] = counted(header.counter + (*shift)[header.pid]);
    });
    if (std::ranges::any_of(*shift, [](std::int8_t by) { return by != 0; })) part.shift = std::move(shift);
  }
}

std::size_t JoinedParts::read_raw(const Part& part, std::uint64_t from, std::span<std::uint8_t> to) {
  const auto index = static_cast<std::size_t>(&part - parts_.data());
  if (open_part_ != index) {
    open_.close();
    open_.clear();
    open_.open(part.file, std::ios::binary);
    open_part_ = index;
  }
  open_.clear();
  open_.seekg(static_cast<std::streamoff>(from));
  open_.read(reinterpret_cast<char*>(to.data()), static_cast<std::streamsize>(to.size()));
  return static_cast<std::size_t>(std::max<std::streamsize>(0, open_.gcount()));
}

std::size_t JoinedParts::read(std::span<std::uint8_t> to) {
  const auto next = std::ranges::upper_bound(parts_, at_, {}, &Part::begin);
  if (at_ >= size_ || to.empty() || next == parts_.begin()) return 0;
  const Part& part = *std::prev(next);
  const std::uint64_t offset = at_ - part.begin;
  const std::size_t wanted = std::min<std::uint64_t>(to.size(), part.size - offset);
  if (!part.shift) {
    const std::size_t got = read_raw(part, offset, to.first(wanted));
    at_ += got;
    return got;
  }
  const std::size_t within = offset % part.layout.packet;
  packets_.resize((within + wanted + part.layout.packet - 1) / part.layout.packet * part.layout.packet);
  const std::size_t read = read_raw(part, offset - within, packets_);
  for_each_header(std::span(packets_).first(read), part.layout, [&](const Header& header, std::size_t at) {
    const std::int8_t counter = counted(header.counter + (*part.shift)[header.pid]);
    packets_[at + 3] = static_cast<std::uint8_t>((packets_[at + 3] & 0xF0) | counter);
  });
  const std::size_t got = read > within ? std::min(wanted, read - within) : 0;
  std::memcpy(to.data(), packets_.data() + within, got);
  at_ += got;
  return got;
}

}  // namespace huetrack::recordings
