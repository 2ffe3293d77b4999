// What is kept of a long recording is what the teacher takes of it, and it comes from all of it.
#include "color_teaching/spread_moments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/frames/image_copy.h"
#include "color_teaching/color_teacher.h"
#include "scene/scene.h"

namespace huetrack::color_teaching {
namespace {

using namespace testing;
using namespace std::chrono_literals;

constexpr auto period = 33ms;

// A recording's frames, all of one picture: memory is reckoned by what they would take.
struct Filmed {
  Filmed(int cameras, calib::ImageSize size, capture::PixelFormat format)
      : rig(scene::SceneBuilder{}.cameras_on_ring({.count = cameras, .image_size = size}).build().rig),
        image(capture::make_image(format, capture::ColorRange::full, size.width, size.height).image) {}
  capture::Frame frame(int camera, int number) const {
    capture::Frame out;
    out.camera = camera;
    out.captured_at = capture::Timestamp(number * period);
    out.pixels = image;
    return out;
  }
  // from: per camera, its first frame
  std::vector<capture::FrameSet> kept(int frames, const std::vector<int>& from) const {
    SpreadMoments moments(from.size());
    for (int n = 0; n < frames; ++n)
      for (std::size_t c = 0; c < from.size(); ++c)
        if (n >= from[c]) moments.add(frame(int(c), n));
    return moments.take();
  }
  // How many of these the teacher takes, which has one such set already.
  std::size_t taken(const std::vector<capture::FrameSet>& moments) const {
    capture::FrameSet pointed_into;
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) pointed_into.frames.emplace_back(frame(int(c), 0));
    ColorTeacher teacher(rig, pointed_into);
    std::size_t count = 0;
    while (count < moments.size() && teacher.add_moment(moments[count])) ++count;
    return std::min(count + 1, moments.size());  // false: that it was the last one
  }
  calib::CameraRig rig;
  capture::Image image;
};

void expect_evenly_over(const std::vector<capture::FrameSet>& moments, capture::Duration length) {
  ASSERT_GE(moments.size(), 2u);
  const auto at = [&](std::size_t i) { return moments[i].frames[0]->captured_at.time_since_epoch(); };
  const capture::Duration apart = at(1) - at(0);
  EXPECT_LT(at(0), apart);
  for (std::size_t i = 2; i < moments.size(); ++i) EXPECT_EQ(at(i) - at(i - 1), apart) << i;
  EXPECT_LE(length - at(moments.size() - 1), apart + period);
}

TEST(SpreadMoments, OfSmallPicturesAsManyAsVote) {
  const Filmed filmed(2, {320, 240}, capture::PixelFormat::yuyv);
  for (const int frames : {249, 256, 257, 1000, 5000, 20'000}) {
    SCOPED_TRACE(frames);
    const auto moments = filmed.kept(frames, {0, 0});
    EXPECT_GE(moments.size(), ColorTeacher::most_moments / 2);
    EXPECT_LT(moments.size(), ColorTeacher::most_moments);
    EXPECT_EQ(filmed.taken(moments), moments.size());
    expect_evenly_over(moments, frames * period);
  }
}

TEST(SpreadMoments, OfLargePicturesWhatMemoryIsFor) {
  const Filmed filmed(2, {1920, 1080}, capture::PixelFormat::bgr);
  const std::size_t of_set = 2 * capture::packed_bytes(filmed.image);
  const std::size_t most = ColorTeacher::most_moment_bytes / of_set;
  ASSERT_LT(most, ColorTeacher::most_moments / 2);
  // The second camera comes later: what was kept until then makes room.
  for (const int second_from : {0, 700}) {
    SCOPED_TRACE(second_from);
    const auto moments = filmed.kept(2000, {0, second_from});
    EXPECT_GE(moments.size(), most / 2);
    EXPECT_LT(moments.size(), most);  // the one that is pointed into is there, too
    EXPECT_EQ(filmed.taken(moments), moments.size());
    expect_evenly_over(moments, 2000 * period);
  }
}

TEST(SpreadMoments, NoneWhereOneIsAllThatMemoryIsFor) {
  const Filmed filmed(1, {9000, 8000}, capture::PixelFormat::grey);
  EXPECT_THAT(filmed.kept(100, {0}), IsEmpty());
}

}  // namespace
}  // namespace huetrack::color_teaching
