#include "recordings/comb_watch.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>

#include "capture/temporary_folder.h"
#include "recordings/replay_source.h"
#include "recordings/video_reader.h"

namespace huetrack::recordings {
namespace {

using capture::PixelFormat;
using testing::HasSubstr;

enum class Rows { progressive, top_first, bottom_first };

struct Film {
  PixelFormat format = PixelFormat::i420;
  Rows rows = Rows::progressive;
  double noise = 2;        // levels, standard deviation
  bool has_blind = false;  // a background of stripes, two rows each
  double step_px = 6;      // of the disc, a field
};

// A bright disc that moves to the right, one picture every two fields.
capture::Image picture(const Film& film, int k, std::mt19937_64& random) {
  constexpr int width = 160, height = 120, radius = 12;
  const auto made = capture::make_image(film.format, capture::ColorRange::full, width, height);
  std::normal_distribution<double> noise(0, film.noise);
  const int step = film.format == PixelFormat::bgr ? 3 : film.format == PixelFormat::yuyv ? 2 : 1;
  for (int v = 0; v < height; ++v) {
    const bool is_late = film.rows != Rows::progressive && (v % 2 == 0) != (film.rows == Rows::top_first);
    const double u0 = 20 + film.step_px * (2 * k + (is_late ? 1 : 0));
    for (int u = 0; u < width; ++u) {
      const double distance = std::hypot(u - u0, v - height / 2);
      const double background = film.has_blind && v / 2 % 2 == 0 ? 90 : 60;
      const double inside = std::clamp(radius - distance + 0.5, 0., 1.);
      const double level = background + inside * (180 - background) + noise(random);
      for (int i = 0; i < step; ++i)
        made.data[0][v * made.image.planes[0].stride + u * step + i] =
            static_cast<std::uint8_t>(std::clamp(level, 0., 255.));
    }
  }
  return made.image;
}

std::optional<std::string> watched(const Film& film, int pictures = 80, std::optional<StatedFields> stated = {}) {
  std::mt19937_64 random(1);
  CombWatch watch;
  std::optional<std::string> problem;
  for (int k = 0; k < pictures; ++k) {
    watch.see(picture(film, k % 8, random), stated);
    if (auto found = watch.take_problem()) {
      EXPECT_FALSE(problem) << "named twice";
      problem = found;
    }
  }
  return problem;
}

TEST(CombWatch, NamesPicturesOfTwoMomentsAndTheFieldThatIsFirst) {
  for (const PixelFormat format : {PixelFormat::i420, PixelFormat::nv12, PixelFormat::yuyv, PixelFormat::bgr}) {
    const auto top = watched({.format = format, .rows = Rows::top_first});
    ASSERT_TRUE(top);
    EXPECT_THAT(*top, HasSubstr("add fields: top"));
    const auto bottom = watched({.format = format, .rows = Rows::bottom_first});
    ASSERT_TRUE(bottom);
    EXPECT_THAT(*bottom, HasSubstr("add fields: bottom"));
  }
}

TEST(CombWatch, NamesFieldsThatAreStatedInTheWrongOrder) {
  for (const Rows rows : {Rows::top_first, Rows::bottom_first})
    for (const capture::FirstField first : {capture::FirstField::top, capture::FirstField::bottom})
      for (const bool is_tagged : {false, true}) {
        const auto problem = watched({.rows = rows}, 80, StatedFields{.first = first, .is_tagged = is_tagged});
        const bool is_right = (rows == Rows::top_first) == (first == capture::FirstField::top);
        EXPECT_EQ(problem.has_value(), !is_right);
        if (problem) {
          EXPECT_THAT(*problem,
                      HasSubstr(rows == Rows::top_first ? "that the top field was" : "that the bottom field"));
        }
      }
}

TEST(CombWatch, NamesStatedFieldsOfAFilmThatIsNotInterlaced) {
  EXPECT_THAT(watched({}, 300, StatedFields{}), testing::Optional(HasSubstr("leave fields out")));
  EXPECT_FALSE(watched({}, 300, StatedFields{.is_tagged = true})) << "half of the rows are enough";
  EXPECT_FALSE(watched({.noise = 30, .step_px = 0}, 80, StatedFields{}));
}

TEST(CombWatch, NamesNoProgressiveFilm) {
  for (const double noise : {0., 2., 10., 30.})
    for (const double step_px : {0., 1., 6.})
      EXPECT_FALSE(watched({.noise = noise, .step_px = step_px})) << noise << " " << step_px;
  for (const double noise : {0., 2.}) EXPECT_FALSE(watched({.noise = noise, .has_blind = true})) << noise;
}

// A comparison decodes two pictures whole; when something moves at last, it is seen within seconds.
TEST(CombWatch, LooksSeldomWhileNothingMoves) {
  std::mt19937_64 random(1);
  CombWatch watch;
  const capture::Image still = picture({.rows = Rows::top_first}, 0, random);
  long kept = 0;
  for (int k = 0; k < 640; ++k) {
    const long before = still.owner.use_count();
    watch.see(still);
    kept += still.owner.use_count() > before ? 1 : 0;
  }
  EXPECT_LE(kept, 640 / 64 + 5);
  bool is_named = false;
  for (int k = 0; k < 120; ++k) {
    watch.see(picture({.rows = Rows::top_first}, k % 8, random));
    is_named = is_named || watch.take_problem();
  }
  EXPECT_TRUE(is_named);
}

TEST(CombWatch, IsAskedOfEveryRecording) {
  const capture::TemporaryFolder folder;
  std::mt19937_64 random(1);
  for (int k = 0; k < 80; ++k) {
    const auto image = picture({.format = PixelFormat::grey, .rows = Rows::top_first}, k % 8, random);
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
  EXPECT_THAT(mistakes(), testing::ElementsAre(HasSubstr("is interlaced, but does not say so")));
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
