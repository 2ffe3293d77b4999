// A camera that is a part of every picture, in recordings.
#include <gmock/gmock.h>

#include "calib/files/config_error.h"
#include "capture/clips.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::recordings {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class CroppedRecording : public testing::Test {
 protected:
  void SetUp() override {
    capture::write_clip(folder / "stereo.mkv", {.format = AV_PIX_FMT_YUV420P, .width = 128, .frames = 3});
  }
  Recording with(const std::string& cameras) {
    capture::write_text(folder / "recording.yaml", "version: 1\ncameras:\n" + cameras);
    return read_recording(folder);
  }
  std::string error_of(const std::string& camera) {
    try {
      ReplaySource(with("  cam: {frames: stereo.mkv, " + camera + "}\n"), std::vector<std::string>{"cam"});
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "(accepted)";
  }

  const capture::TemporaryFolder temporary;
  const std::filesystem::path folder = temporary.path();
};

TEST_F(CroppedRecording, TwoCamerasShareAFile) {
  const std::vector<std::string> names{"left", "right", "whole"};
  ReplaySource source(with("  left: {frames: stereo.mkv, crop: [0, 0, 64, 48]}\n"
                           "  right: {frames: stereo.mkv, crop: [64, 2, 62, 44]}\n"
                           "  whole: {frames: stereo.mkv}\n"),
                      names);
  EXPECT_EQ(source.cameras()[1].width, 62);
  EXPECT_EQ(source.cameras()[1].height, 44);
  for (int k = 0; k < 3; ++k) {
    const auto left = source.next({}), right = source.next({}), whole = source.next({});
    ASSERT_TRUE(left && right && whole);
    EXPECT_EQ(left->captured_at, whole->captured_at);
    EXPECT_EQ(right->captured_at, whole->captured_at);
    EXPECT_EQ(right->pixels.planes[1].stride, whole->pixels.planes[1].stride);  // no copy
    for (const auto& [u, v] : {std::pair(0, 0), {5, 7}, {61, 43}}) {
      const auto a = capture::yuv_at(left->pixels, u, v), b = capture::yuv_at(whole->pixels, u, v);
      EXPECT_EQ(std::tie(a.y, a.u, a.v), std::tie(b.y, b.u, b.v));
      const auto c = capture::yuv_at(right->pixels, u, v), d = capture::yuv_at(whole->pixels, u + 64, v + 2);
      EXPECT_EQ(std::tie(c.y, c.u, c.v), std::tie(d.y, d.u, d.v));
    }
  }
}

TEST_F(CroppedRecording, RefusesWhatIsNoPart) {
  EXPECT_THAT(error_of("crop: [100, 0, 64, 48]"),
              AllOf(HasSubstr("stereo.mkv"), HasSubstr("crop [100, 0, 64, 48]"),
                    HasSubstr("no part of the picture, which is 128x48"), HasSubstr("camera cam")));
  EXPECT_THAT(error_of("crop: [1, 0, 64, 48]"), HasSubstr("must have even columns and rows: the pictures are i420"));
  EXPECT_THAT(error_of("crop: [0, 1, 64, 46]"), HasSubstr("must have even columns and rows"));
  EXPECT_THAT(error_of("crop: [0.5, 0, 64, 48]"), HasSubstr("is not [u, v, width, height] in whole pixels"));
  EXPECT_THAT(error_of("crop: [0, 0, 64]"), HasSubstr("recording.yaml:3"));
  EXPECT_THAT(error_of("crop: [0, 0, 64, 0]"), HasSubstr("is not [u, v, width, height]"));
  EXPECT_EQ(error_of("crop: [64, 0, 64, 48]"), "(accepted)");
}

TEST_F(CroppedRecording, AWordOfACommandHasACropToo) {
  const std::string file = (folder / "stereo.mkv").string();
  const Recording recording =
      read_recording(std::vector<std::string>{"left=" + file + "@0,0,64,48", "right=" + file + "@64,0,64,48"});
  EXPECT_EQ(recording.cameras[1].frames, file);
  EXPECT_EQ(recording.cameras[1].crop, (capture::Crop{64, 0, 64, 48}));
  EXPECT_THAT([&] { read_recording(std::vector<std::string>{"left=" + file + "@0,0,64"}); },
              testing::ThrowsMessage<files::ConfigError>(HasSubstr("write @u,v,width,height")));
  EXPECT_EQ(read_recording(std::vector<std::string>{"left=me@home.mp4"}).cameras[0].frames.filename(), "me@home.mp4");
  // A file may have an @ in its name.
  std::filesystem::copy(file, folder / "b@1,2,3,4");
  EXPECT_FALSE(read_recording(std::vector<std::string>{"left=" + (folder / "b@1,2,3,4").string()}).cameras[0].crop);
}

}  // namespace
}  // namespace huetrack::recordings
