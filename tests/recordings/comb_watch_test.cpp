// What recordings do with the comb watch (tests/capture/comb_watch_test.cpp).
#include "capture/frames/comb_watch.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdio>
#include <fstream>

#include "capture/clips.h"
#include "capture/comb_film.h"
#include "capture/temporary_folder.h"
#include "recordings/replay_source.h"
#include "recordings/video_reader.h"

namespace huetrack::recordings {
namespace {

using capture::CombRows;
using capture::CombWatch;
using capture::PixelFormat;
using testing::HasSubstr;

TEST(CombWatch, IsAskedOfEveryRecording) {
  const capture::TemporaryFolder folder;
  std::mt19937_64 random(1);
  for (int k = 0; k < 80; ++k) {
    const auto image = capture::comb_picture({.format = PixelFormat::grey, .rows = CombRows::top_first}, k % 8, random);
    std::ofstream pgm(folder / (std::to_string(k) + ".pgm"), std::ios::binary);
    pgm << "P5\n" << image.width << ' ' << image.height << "\n255\n";
    for (int v = 0; v < image.height; ++v)
      pgm.write(reinterpret_cast<const char*>(image.planes[0].data + v * image.planes[0].stride), image.width);
  }
  Recording recording;
  recording.cameras.resize(1);
  recording.cameras[0].name = "cam";
  recording.cameras[0].frames = folder / "%d.pgm";
  recording.cameras[0].fps = 30;
  const auto mistakes = [&] {
    const std::vector<std::string> names{"cam"};
    ReplaySource source(recording, names, {});
    while (source.next({})) {
    }
    return source.mistakes();
  };
  EXPECT_THAT(mistakes(), testing::ElementsAre(HasSubstr("is interlaced: every picture holds two moments")));
  recording.cameras[0].first_field = capture::FirstField::top;
  EXPECT_THAT(mistakes(), testing::IsEmpty());
}

// HD video of interlaced cameras: the matrix of its colours is BT.709's.
TEST(CombWatch, SeesTheColoursAsTheyAreCoded) {
  const capture::TemporaryFolder folder;
  for (const auto matrix : {AVCOL_SPC_BT709, AVCOL_SPC_SMPTE170M})
    for (const bool is_mixed : {false, true}) {
      std::mt19937_64 random(1);
      capture::Clip clip{.format = AV_PIX_FMT_YUV420P, .matrix = matrix, .width = 160, .height = 120, .frames = 80};
      clip.fields = capture::Clip::Fields::top_first;
      clip.paint = [&](AVFrame& frame, int k) {
        const auto image =
            capture::comb_picture({.rows = CombRows::top_first, .mixes_colors = is_mixed}, k % 8, random);
        for (int plane = 0; plane < 3; ++plane) {
          const auto at = std::size_t(plane);
          for (int y = 0; y < capture::plane_rows(image.format, plane, image.height); ++y)
            std::copy_n(image.planes[at].data + y * image.planes[at].stride,
                        capture::plane_row_bytes(image.format, plane, image.width),
                        frame.data[at] + y * frame.linesize[at]);
        }
      };
      capture::write_clip(folder / "a.mkv", clip);
      Recording recording;
      recording.cameras.resize(1);
      recording.cameras[0].name = "cam";
      recording.cameras[0].frames = folder / "a.mkv";
      const std::vector<std::string> names{"cam"};
      ReplaySource source(recording, names, {});
      while (source.next({})) {
      }
      if (is_mixed)
        EXPECT_THAT(source.mistakes(), testing::ElementsAre(HasSubstr("its colours are mixed from both fields")));
      else
        EXPECT_THAT(source.mistakes(), testing::IsEmpty());
    }
}

TEST(CombWatch, HasAMarginInAllFilmsBesideTheProject) {
  const std::filesystem::path data = HUETRACK_SHARED_DATA;
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no " << data;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(data)) {
    const auto ending = entry.path().extension();
    if (ending != ".mkv" && ending != ".mp4" && ending != ".avi") continue;
    RecordedCamera camera;
    camera.name = "cam";
    camera.frames = entry.path();
    std::vector<std::string> warnings;
    VideoReader reader(camera, 1, warnings);
    CombWatch watch;
    for (int k = 0; k < 120; ++k)
      if (const auto shown = reader.next()) watch.see(shown->image);
    std::printf("  ratio %5.3f of %7lld moving pixels: %s\n", watch.evidence().ratio(),
                static_cast<long long>(watch.evidence().moving), std::filesystem::relative(entry.path(), data).c_str());
    EXPECT_LT(watch.evidence().ratio(), 0.7) << entry.path();
    EXPECT_FALSE(watch.take_problem()) << entry.path();
  }
}

}  // namespace
}  // namespace huetrack::recordings
