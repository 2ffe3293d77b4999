// What an index of a JPEG costs (capture/jpeg) beside libjpeg-turbo: reading all coefficients (jpeg_read_coefficients),
// and decoding to planes (JpegDecoder). CPU time of this thread for one frame: the least of all rounds, each over
// several different frames, because branch predictors learn a small frame by heart.
//   jpeg_speed [rounds [film...]]
#include <malloc.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "capture/clips.h"
#include "capture/frames/jpeg_decoder.h"
#include "capture/jpeg/jpeg_index.h"
#include "capture/jpeg_maker.h"

namespace {

using namespace huetrack::capture;
using Jpeg = std::shared_ptr<const std::vector<std::uint8_t>>;

double cpu_s() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::vector<Jpeg> frames_of(const std::filesystem::path& film, int most) {
  std::vector<Jpeg> frames;
  AVFormatContext* input = nullptr;
  check(avformat_open_input(&input, film.c_str(), nullptr, nullptr), "open");
  const std::unique_ptr<AVPacket, void (*)(AVPacket*)> packet(av_packet_alloc(),
                                                              [](AVPacket* p) { av_packet_free(&p); });
  while (static_cast<int>(frames.size()) < most && av_read_frame(input, packet.get()) == 0) {
    frames.push_back(std::make_shared<std::vector<std::uint8_t>>(packet->data, packet->data + packet->size));
    av_packet_unref(packet.get());
  }
  avformat_close_input(&input);
  return frames;
}

std::vector<Jpeg> generated(int width, int height) {
  std::vector<Jpeg> frames;
  for (unsigned seed = 1; seed <= 8; ++seed)
    frames.push_back(std::make_shared<std::vector<std::uint8_t>>(
        make_jpeg({.width = width, .height = height, .quality = 90, .noise = 2.7, .chroma_noise = 0.6, .seed = seed})));
  return frames;
}

void read_coefficients(const std::vector<std::uint8_t>& jpeg) {
  jpeg_decompress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_decompress(&info);
  jpeg_mem_src(&info, jpeg.data(), static_cast<unsigned long>(jpeg.size()));
  jpeg_read_header(&info, TRUE);
  jpeg_read_coefficients(&info);
  jpeg_finish_decompress(&info);
  jpeg_destroy_decompress(&info);
}

// For each frame once; seconds per frame.
double least_of(int rounds, std::size_t frames, const std::function<void(std::size_t)>& of_frame) {
  double least = 1e9;
  for (int round = 0; round < rounds; ++round) {
    const double begin = cpu_s();
    for (std::size_t i = 0; i < frames; ++i) of_frame(i);
    least = std::min(least, (cpu_s() - begin) / static_cast<double>(frames));
  }
  return least;
}

bool print_figures(const char* name, const std::vector<Jpeg>& frames, int rounds) {
  JpegIndexPool pool(static_cast<int>(frames.size()));
  JpegDecoder decoder;
  std::vector<std::shared_ptr<const JpegIndex>> indices;
  std::size_t bytes = 0;
  for (const Jpeg& jpeg : frames) {
    indices.push_back(JpegIndex::build(jpeg));
    if (!indices.back()) {
      std::fprintf(stderr, "%s: a frame is not baseline JPEG\n", name);
      return false;
    }
    bytes += jpeg->size();
  }
  const JpegIndex& first = *indices.front();
  const int width = first.mcu_columns() * first.mcu_width(), height = first.mcu_rows() * first.mcu_height();
  const WritableImage planes = make_image(first.format(), first.range(), width, height);
  std::array<std::ptrdiff_t, 3> strides{};
  std::size_t blocks = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const int plane = static_cast<int>(i);
    strides[i] = planes.image.planes[i].stride;
    blocks += plane_row_bytes(first.format(), plane, width) *
              static_cast<std::size_t>(plane_rows(first.format(), plane, height)) / 64;
  }
  const double index =
      least_of(rounds, frames.size(), [&](std::size_t i) { JpegIndex::build(frames[i], 0, 0, &pool); });
  const double coefficients = least_of(rounds, frames.size(), [&](std::size_t i) { read_coefficients(*frames[i]); });
  const double decoded = least_of(rounds, frames.size(), [&](std::size_t i) { decoder.decode(*frames[i]); });
  const double on_demand = least_of(rounds, frames.size(), [&](std::size_t i) {
    for (int v = 0; v < first.mcu_rows(); ++v) indices[i]->decode(v, 0, first.mcu_columns(), planes.data, strides);
  });
  const auto ns_per_block = [&](double s) { return 1e9 * s / static_cast<double>(blocks); };
  std::printf("%-22s %4dx%-4d %7zu %9.3f %9.3f %6.2f %9.3f %6.2f %10.1f %10.1f\n", name, first.width(), first.height(),
              bytes / frames.size(), 1e3 * index, 1e3 * coefficients, coefficients / index, 1e3 * decoded,
              decoded / index, ns_per_block(on_demand), ns_per_block(decoded));
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 20;
  // Memory is warm for all: else libjpeg's is given back to the kernel after each frame.
  mallopt(M_MMAP_THRESHOLD, 1 << 28);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  std::printf("%-22s %9s %7s %9s %9s %6s %9s %6s %10s %10s\n", "", "", "bytes", "index ms", "coeff. ms", "ratio",
              "planes ms", "ratio", "ns/block", "libjpeg's");
  bool is_fine = true;
  const std::filesystem::path rendered = std::filesystem::path(HUETRACK_SHARED_DATA) / "rendered";
  for (const char* film : {"webcams/cam0.mkv", "juggling/cam0.mkv", "fast_60fps/cam0.mkv"}) {
    if (!std::filesystem::exists(rendered / film))
      std::printf("%-22s not there\n", film);
    else
      is_fine = print_figures(film, frames_of(rendered / film, 16), rounds) && is_fine;
  }
  for (int i = 2; i < argc; ++i)
    is_fine =
        print_figures(std::filesystem::path(argv[i]).filename().c_str(), frames_of(argv[i], 16), rounds) && is_fine;
  for (const auto& [width, height] : {std::pair{640, 480}, std::pair{1280, 720}, std::pair{1920, 1080}})
    is_fine = print_figures("generated, quality 90", generated(width, height), rounds) && is_fine;
  return is_fine ? 0 : 1;
}
