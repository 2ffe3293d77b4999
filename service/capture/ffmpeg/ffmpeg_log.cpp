#include "capture/ffmpeg/ffmpeg_log.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/log.h>
}

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <utility>

namespace huetrack::capture {
namespace {

thread_local FfmpegLog* log_of_this_thread = nullptr;

void on_log(void* source, int level, const char* format, va_list arguments) {
  if (level > AV_LOG_ERROR) return;
  FfmpegLog* log = log_of_this_thread;
  const bool is_of_codec = source && *static_cast<const AVClass* const*>(source) == avcodec_get_class();
  if (!log && is_of_codec)
    log = static_cast<FfmpegLog*>(static_cast<const AVCodecContext*>(source)->opaque);  // a slice thread of ours
  if (!log) return;
  std::array<char, 160> line{};  // an excerpt is enough; FFmpeg's callback leaves no choice but printf
  std::vsnprintf(line.data(), line.size(), format, arguments);
  std::string text(line.data());
  std::ranges::replace_if(
      text, [](unsigned char c) { return c < 0x20 || c > 0x7E; }, ' ');
  while (text.ends_with(' ') || text.ends_with('.')) text.pop_back();
  if (!text.empty()) log->add(std::move(text), is_of_codec ? FfmpegLog::Source::codec : FfmpegLog::Source::container);
}

}  // namespace

void FfmpegLog::add(std::string text, Source source) {
  const std::scoped_lock lock(mutex_);
  if (count_++ == 0) first_ = std::move(text);
  container_count_ += source == Source::container ? 1 : 0;
}

int FfmpegLog::count() const {
  const std::scoped_lock lock(mutex_);
  return count_;
}

int FfmpegLog::container_count() const {
  const std::scoped_lock lock(mutex_);
  return container_count_;
}

std::string FfmpegLog::take() {
  const std::scoped_lock lock(mutex_);
  count_ = container_count_ = 0;
  const std::string text = std::exchange(first_, {});
  return text.empty() ? text : " (" + text + ")";
}

FfmpegLogScope::FfmpegLogScope(FfmpegLog& log) : outer_(std::exchange(log_of_this_thread, &log)) {}

FfmpegLogScope::~FfmpegLogScope() {
  log_of_this_thread = outer_;
}

void take_over_ffmpeg_log() {
  static std::once_flag once;
  std::call_once(once, [] { av_log_set_callback(on_log); });
}

}  // namespace huetrack::capture
