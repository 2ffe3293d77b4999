// What recordings do with the comb watch (tests/capture/comb_watch_test.cpp).
#include "capture/frames/comb_watch.h"

#include <gmock/gmock.h>

#include <cstdio>
#include <fstream>

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
