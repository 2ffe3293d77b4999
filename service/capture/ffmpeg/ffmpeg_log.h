// Captures FFmpeg's log: nothing is printed; errors are kept for the warning or exception that they explain.
#pragma once

#include <mutex>
#include <string>

namespace huetrack::capture {

// Keeps the first error, and counts them. thread-safe: FFmpeg's slice threads find it in AVCodecContext::opaque.
class FfmpegLog {
 public:
  enum class Source { codec, container };
  void add(std::string text, Source source = Source::codec);
  int count() const;
  int container_count() const;  // of the file or protocol; decoders and parsers also remark on what is harmless
  std::string take();           // the first error since the last call as " (error)"; empty: none

 private:
  mutable std::mutex mutex_;
  int count_ = 0, container_count_ = 0;  // guarded by mutex_
  std::string first_;                    // guarded by mutex_
};

// During its lifetime FFmpeg logs of this thread go to `log`, which must outlive it.
class FfmpegLogScope {
 public:
  explicit FfmpegLogScope(FfmpegLog& log);
  ~FfmpegLogScope();
  FfmpegLogScope(const FfmpegLogScope&) = delete;
  FfmpegLogScope& operator=(const FfmpegLogScope&) = delete;

 private:
  FfmpegLog* outer_;
};

// Silences FFmpeg for the rest of the process. thread-safe.
void take_over_ffmpeg_log();

}  // namespace huetrack::capture
