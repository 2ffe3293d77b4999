// What FFmpeg has to say: nothing of it is printed; errors are kept for the warning or exception that they explain.
#pragma once

#include <mutex>
#include <string>

namespace huetrack::capture {

// The first error that FFmpeg logged, and how many. thread-safe: slices may be decoded on FFmpeg's own threads, which
// find it in their AVCodecContext's `opaque`.
class FfmpegLog {
 public:
  void add(std::string text);
  int count() const;
  std::string take();  // the first error since the last call, in brackets after a space; empty when there was none

 private:
  mutable std::mutex mutex_;
  int count_ = 0;      // guarded by mutex_
  std::string first_;  // guarded by mutex_
};

// For as long as it lives, what FFmpeg logs on this thread goes to `log`, which must outlive it.
class FfmpegLogScope {
 public:
  explicit FfmpegLogScope(FfmpegLog& log);
  ~FfmpegLogScope();
  FfmpegLogScope(const FfmpegLogScope&) = delete;
  FfmpegLogScope& operator=(const FfmpegLogScope&) = delete;

 private:
  FfmpegLog* outer_;
};

// FFmpeg prints nothing from here on, for the rest of the process. thread-safe.
void take_over_ffmpeg_log();

}  // namespace huetrack::capture
