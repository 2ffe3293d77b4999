#include "capture/frames/comb_watch.h"

#include <gmock/gmock.h>

#include <deque>

#include "capture/comb_film.h"
#include "capture/field_source.h"

namespace huetrack::capture {
namespace {

using testing::HasSubstr;

std::optional<std::string> watched(const CombFilm& film, int pictures = 80, std::optional<StatedFields> stated = {}) {
  std::mt19937_64 random(1);
  CombWatch watch;
  std::optional<std::string> problem;
  for (int k = 0; k < pictures; ++k) {
    watch.see(comb_picture(film, k % 8, random), stated);
    if (auto found = watch.take_problem()) {
      EXPECT_FALSE(problem) << "named twice";
      problem = found;
    }
  }
  return problem;
}

TEST(CombWatch, NamesPicturesOfTwoMomentsAndTheFieldThatIsFirst) {
  for (const PixelFormat format : {PixelFormat::i420, PixelFormat::nv12, PixelFormat::yuyv, PixelFormat::bgr}) {
    const auto top = watched({.format = format, .rows = CombRows::top_first});
    ASSERT_TRUE(top);
    EXPECT_THAT(*top, HasSubstr("add fields: top"));
    const auto bottom = watched({.format = format, .rows = CombRows::bottom_first});
    ASSERT_TRUE(bottom);
    EXPECT_THAT(*bottom, HasSubstr("add fields: bottom"));
  }
}

// Raw samples behind a colour filter, of which green is brighter than red and blue.
TEST(CombWatch, NamesAMosaicOfColors) {
  std::mt19937_64 random(1);
  CombWatch watch;
  std::optional<std::string> problem;
  for (int k = 0; k < 80 && !problem; ++k) {
    const Image picture = comb_picture({.format = PixelFormat::grey}, k % 8, random);
    WritableImage raw = make_image(PixelFormat::grey, ColorRange::full, picture.width, picture.height);
    for (int v = 0; v < picture.height; ++v)
      for (int u = 0; u < picture.width; ++u) {
        const int level = picture.planes[0].data[v * picture.planes[0].stride + u];
        raw.data[0][v * raw.image.planes[0].stride + u] = static_cast<std::uint8_t>(u % 2 != v % 2 ? level : level / 3);
      }
    watch.see(raw.image);
    problem = watch.take_problem();
  }
  EXPECT_THAT(problem, testing::Optional(AllOf(HasSubstr("raw mosaic"), testing::Not(HasSubstr("interlaced")))));
}

TEST(CombWatch, NamesFieldsThatAreStatedInTheWrongOrder) {
  for (const CombRows rows : {CombRows::top_first, CombRows::bottom_first})
    for (const FirstField first : {FirstField::top, FirstField::bottom})
      for (const bool is_tagged : {false, true}) {
        const auto problem = watched({.rows = rows}, 80, StatedFields{.first = first, .is_tagged = is_tagged});
        const bool is_right = (rows == CombRows::top_first) == (first == FirstField::top);
        EXPECT_EQ(problem.has_value(), !is_right);
        if (problem) {
          EXPECT_THAT(*problem,
                      HasSubstr(rows == CombRows::top_first ? "that the top field was" : "that the bottom field"));
        }
      }
}

TEST(CombWatch, NamesStatedFieldsOfAFilmThatIsNotInterlaced) {
  EXPECT_THAT(watched({}, 300, StatedFields{}), testing::Optional(HasSubstr("leave fields out")));
  EXPECT_FALSE(watched({}, 300, StatedFields{.is_tagged = true})) << "half of the rows are enough";
  EXPECT_FALSE(watched({.noise = 30, .step_px = 0}, 80, StatedFields{}));
}

// A combed film that a program took for progressive: no field has its own colours. Codecs leave weak ones.
TEST(CombWatch, NamesMixedColors) {
  for (const PixelFormat format : {PixelFormat::i420, PixelFormat::nv12})
    for (const double color : {60., 15.}) {
      CombFilm film{.format = format, .rows = CombRows::top_first, .mixes_colors = true, .color = color};
      EXPECT_THAT(watched(film, 40, StatedFields{}), testing::Optional(HasSubstr("colours are mixed"))) << color;
      EXPECT_THAT(watched(film, 40), testing::Optional(testing::AllOf(HasSubstr("colours are mixed"),
                                                                      testing::Not(HasSubstr("add fields")))))
          << color;
      film.mixes_colors = false;
      EXPECT_FALSE(watched(film, 300, StatedFields{})) << color;
      EXPECT_THAT(watched(film, 40), testing::Optional(HasSubstr("add fields: top"))) << color;
    }
  const CombFilm grey{.rows = CombRows::top_first, .mixes_colors = true, .color = 0};
  EXPECT_FALSE(watched(grey, 300, StatedFields{}));
  EXPECT_THAT(watched(grey), testing::Optional(HasSubstr("add fields: top")));
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
  const Image still = comb_picture({.rows = CombRows::top_first}, 0, random);
  long kept = 0;
  for (int k = 0; k < 640; ++k) {
    const long before = still.owner.use_count();
    watch.see(still);
    kept += still.owner.use_count() > before ? 1 : 0;
  }
  EXPECT_LE(kept, 640 / 64 + 5);
  bool is_named = false;
  for (int k = 0; k < 120; ++k) {
    watch.see(comb_picture({.rows = CombRows::top_first}, k % 8, random));
    is_named = is_named || watch.take_problem();
  }
  EXPECT_TRUE(is_named);
}

class FilmFrames final : public FrameSource {
 public:
  explicit FilmFrames(std::deque<Frame> frames) : frames_(std::move(frames)) {}
  std::optional<Frame> next(std::stop_token) override {
    if (frames_.empty()) return std::nullopt;
    Frame frame = std::move(frames_.front());
    frames_.pop_front();
    return frame;
  }

 private:
  std::deque<Frame> frames_;
};

// Cameras 0 and 1, of one device; the second one is interlaced.
LiveCamera two_cameras(int pictures) {
  std::mt19937_64 random(1);
  std::deque<Frame> frames;
  for (int k = 0; k < pictures; ++k)
    for (const int camera : {0, 1}) {
      Frame& frame = frames.emplace_back();
      frame.camera = camera;
      frame.encoded = std::make_shared<const std::vector<std::uint8_t>>(1);
      frame.pixels =
          comb_picture({.rows = camera == 0 ? CombRows::progressive : CombRows::bottom_first}, k % 8, random);
    }
  return {.camera = 0,
          .source = std::make_unique<FilmFrames>(std::move(frames)),
          .health = [] { return CameraHealth{}; },
          .take_events =
              [] {
                CameraEvent event;
                event.message = "its own";
                return std::vector{event};
              }};
}

TEST(FieldSource, NamesAnInterlacedCameraOnce) {
  LiveCamera first = two_cameras(80);
  LiveCamera second{.camera = 1,
                    .source = nullptr,
                    .health =
                        [] {
                          CameraHealth health;
                          health.warning = "many are damaged";
                          return health;
                        },
                    .take_events = [] { return std::vector<CameraEvent>(); }};
  watch_fields(first, {&second}, {});
  while (first.source->next({})) {
  }
  EXPECT_EQ(first.health().warning, "");
  EXPECT_EQ(first.take_events().size(), 1u) << "its own";
  EXPECT_EQ(second.health().warning, "many are damaged") << "is the worse problem";
  const auto events = second.take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_TRUE(events.front().is_problem);
  EXPECT_THAT(events.front().message, HasSubstr("add fields: bottom"));
  EXPECT_TRUE(second.take_events().empty());
}

TEST(FieldSource, PlaysTheStatedField) {
  LiveCamera whole = two_cameras(80), first = two_cameras(80);
  watch_fields(first, {}, {{1, FirstField::bottom}});
  while (const auto frame = first.source->next({})) {
    const auto as_it_was = whole.source->next({});
    ASSERT_EQ(frame->encoded == nullptr, frame->camera == 1) << "its bytes are of both fields";
    const Image expected = frame->camera == 0 ? as_it_was->pixels : first_field(as_it_was->pixels, FirstField::bottom);
    for (int v = 0; v < expected.height; ++v) ASSERT_EQ(yuv_at(frame->pixels, 80, v).y, yuv_at(expected, 80, v).y);
  }
  EXPECT_EQ(first.take_events().size(), 1u) << "its own";
}

TEST(FieldSource, NamesAFieldThatIsNotTheFirst) {
  LiveCamera first = two_cameras(80);
  watch_fields(first, {}, {{1, FirstField::top}});
  auto* const source = static_cast<FieldSource*>(first.source.get());
  while (source->next({})) {
  }
  EXPECT_THAT(source->warning(1), HasSubstr("write fields: bottom"));
}

}  // namespace
}  // namespace huetrack::capture
