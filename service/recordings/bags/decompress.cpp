#include "recordings/bags/decompress.h"

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <functional>
#include <memory>

#include "calib/files/text_file.h"
#include "recordings/bags/bag.h"

namespace huetrack::bags {
namespace {

enum class Progress { more, complete, failed };

// One step of a decompressor: takes from the first span, writes to the second, and says how much of each.
struct Step {
  Progress progress = Progress::failed;
  std::size_t taken = 0, written = 0;
  std::string problem = {};
};
using Decompressor = std::function<Step(std::span<const std::uint8_t>, std::span<std::uint8_t>)>;

Decompressor zstd() {
  std::shared_ptr<ZSTD_DStream> stream(::ZSTD_createDStream(), [](ZSTD_DStream* s) { ::ZSTD_freeDStream(s); });
  return [stream](std::span<const std::uint8_t> from, std::span<std::uint8_t> to) -> Step {
    ZSTD_inBuffer in{from.data(), from.size(), 0};
    ZSTD_outBuffer out{to.data(), to.size(), 0};
    const std::size_t left = ::ZSTD_decompressStream(stream.get(), &out, &in);
    if (::ZSTD_isError(left) != 0) return {Progress::failed, in.pos, out.pos, ::ZSTD_getErrorName(left)};
    return {left == 0 ? Progress::complete : Progress::more, in.pos, out.pos};
  };
}

Decompressor lz4() {
  LZ4F_dctx* made = nullptr;
  ::LZ4F_createDecompressionContext(&made, LZ4F_VERSION);
  std::shared_ptr<LZ4F_dctx> context(made, [](LZ4F_dctx* c) { ::LZ4F_freeDecompressionContext(c); });
  return [context](std::span<const std::uint8_t> from, std::span<std::uint8_t> to) -> Step {
    std::size_t taken = from.size(), written = to.size();
    const std::size_t left = ::LZ4F_decompress(context.get(), to.data(), &written, from.data(), &taken, nullptr);
    if (::LZ4F_isError(left) != 0) return {Progress::failed, 0, 0, ::LZ4F_getErrorName(left)};
    return {left == 0 ? Progress::complete : Progress::more, taken, written};
  };
}

Decompressor bz2() {
  std::shared_ptr<bz_stream> stream(new bz_stream{}, [](bz_stream* s) {
    ::BZ2_bzDecompressEnd(s);
    delete s;
  });
  const bool is_made = ::BZ2_bzDecompressInit(stream.get(), 0, 0) == BZ_OK;
  return [stream, is_made](std::span<const std::uint8_t> from, std::span<std::uint8_t> to) -> Step {
    if (!is_made) return {Progress::failed, 0, 0, "no memory"};
    stream->next_in = reinterpret_cast<char*>(const_cast<std::uint8_t*>(from.data()));
    stream->avail_in = static_cast<unsigned>(from.size());
    stream->next_out = reinterpret_cast<char*>(to.data());
    stream->avail_out = static_cast<unsigned>(to.size());
    const int result = ::BZ2_bzDecompress(stream.get());
    const Step step{.progress = result == BZ_STREAM_END ? Progress::complete
                                : result == BZ_OK       ? Progress::more
                                                        : Progress::failed,
                    .taken = from.size() - stream->avail_in,
                    .written = to.size() - stream->avail_out,
                    .problem = result < 0 ? "bzip2 error " + std::to_string(result) : std::string()};
    return step;
  };
}

}  // namespace

Decompressed decompress(std::string_view method, std::span<const std::uint8_t> bytes, std::optional<std::size_t> size) {
  Decompressed out{.buffer = make_buffer(0)};
  if (method != "zstd" && method != "lz4" && method != "bz2") {
    out.problem =
        "is compressed with \"" + files::printable(method) + "\": convert it, with `mcap compress --compression zstd`";
    return out;
  }
  if (size.value_or(0) > largest_bytes) {
    out.problem = "declares " + std::to_string(*size >> 20) + " MiB in one piece, more than the " +
                  std::to_string(largest_bytes >> 20) + " MiB that are supported";
    return out;
  }
  const Decompressor step = method == "zstd" ? zstd() : method == "lz4" ? lz4() : bz2();
  // What a damaged file declares is not allocated at once.
  const std::size_t most = size.value_or(largest_bytes);
  std::size_t room = std::min(most, bytes.size() * 4 + (1U << 16));
  out.buffer = make_buffer(room);
  while (true) {
    const Step done = step(bytes, std::span(*out.buffer).subspan(out.size, room - out.size));
    bytes = bytes.subspan(done.taken);
    out.size += done.written;
    if (done.progress == Progress::failed) {
      out.problem = "does not decompress: " + done.problem;
      break;
    }
    if (done.progress == Progress::complete) break;
    if (out.size == room && room < most) {
      room = std::min(most, 2 * room);
      out.buffer->resize(room + buffer_padding);
    } else if (done.taken == 0 && done.written == 0) {
      out.problem = bytes.empty() ? "is cut off" : "is longer than it declares";
      break;
    }
  }
  if (out.problem.empty() && size && out.size != *size) out.problem = "is shorter than it declares";
  out.buffer->resize(out.size + buffer_padding);
  std::fill(out.buffer->end() - buffer_padding, out.buffer->end(), std::uint8_t{0});
  return out;
}

}  // namespace huetrack::bags
