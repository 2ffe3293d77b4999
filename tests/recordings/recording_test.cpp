#include "recordings/recording.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <fstream>

#include "calib/files/config_error.h"
#include "capture/temporary_folder.h"

namespace huetrack::recordings {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;
using namespace std::chrono_literals;

class ReadRecording : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder / name) << text; }
  Recording read(const std::string& yaml) const {
    write("recording.yaml", yaml);
    return read_recording(folder);
  }
  std::string error_of(const std::string& yaml) const {
    try {
      read(yaml);
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "(accepted)";
  }
  std::string error_of_csv(const std::string& csv) const {
    write("times.csv", csv);
    return error_of("version: 1\ncameras:\n  left: {frames: left.mkv, timestamps: times.csv}\n");
  }

  const capture::TemporaryFolder temporary;
  const std::filesystem::path folder = temporary.path();
};

capture::Timestamp at(capture::Duration since_zero) {
  return capture::Timestamp{since_zero};
}

TEST_F(ReadRecording, PipeDoesNotBlock) {
  const auto pipe = folder / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_FALSE(is_video_or_picture(pipe));
  EXPECT_THAT([&] { read_recording(pipe); }, testing::ThrowsMessage<files::ConfigError>(HasSubstr("not a file")));
}

TEST_F(ReadRecording, ReadsEveryKey) {
  write("right.csv",
        "\xEF\xBB\xBF"
        "stamp, frame ,t_s\r\na,0,0.5\r\n\r\nb,2,0.75\r\n");
  const Recording recording = read(
      "version: 1\n"
      "started_at: 1700000000.25\n"
      "cameras:\n"
      "  left: {frames: sub/../left.mkv, fps: 60, offset_s: -0.001, first_frame: 1, every: 2}\n"
      "  right: {frames: /abs/%06d.png, timestamps: right.csv}\n"
      "  plain: {frames: plain.mkv}\n");
  EXPECT_EQ(recording.file, folder / "recording.yaml");
  EXPECT_EQ(recording.started_at, at(1700000000250ms));
  ASSERT_EQ(recording.cameras.size(), 3u);
  const auto& [left, right, plain] = std::tie(recording.cameras[0], recording.cameras[1], recording.cameras[2]);
  EXPECT_EQ(left.name, "left");
  EXPECT_EQ(left.frames, folder / "left.mkv");
  EXPECT_EQ(left.fps, 60);
  EXPECT_EQ(left.offset, -1ms);
  EXPECT_EQ(left.first_frame, 1);
  EXPECT_EQ(left.every, 2);
  EXPECT_EQ(right.frames, "/abs/%06d.png");
  EXPECT_EQ(right.fps, 0);
  EXPECT_THAT(right.timestamps, ElementsAre(Pair(0, at(500ms)), Pair(2, at(750ms))));
  EXPECT_EQ(plain.fps, 0);
  EXPECT_EQ(plain.every, 1);
}

TEST_F(ReadRecording, AcceptsTheYamlFile) {
  write("other.yaml", "version: 1\ncameras:\n  left: {frames: left.mkv, fps: 30}\n");
  EXPECT_EQ(read_recording(folder / "other.yaml").cameras.at(0).frames, folder / "left.mkv");
}

TEST_F(ReadRecording, KeepsNanosecondsOfUnixTimes) {
  write("times.csv", "frame,t_s\n0,1672678250.931152347\n");
  const auto recording = read("version: 1\ncameras:\n  left: {frames: left.mkv, timestamps: times.csv}\n");
  EXPECT_EQ(recording.cameras.at(0).timestamps.at(0).second, at(1672678250931152347ns));
}

TEST_F(ReadRecording, NamesFileAndLineOfWhatIsWrong) {
  EXPECT_THAT(error_of("version: 2\ncameras:\n  left: {frames: l.mkv}\n"),
              AllOf(HasSubstr("recording.yaml:1"), HasSubstr("version")));
  EXPECT_THAT(error_of("version: 1\ncameras:\n  left: {frames: l.mkv, fsp: 30}\n"),
              AllOf(HasSubstr("recording.yaml:3"), HasSubstr("fsp"), HasSubstr("did you mean fps?")));
  EXPECT_THAT(error_of("version: 1\ncameras:\n  left:\n    frames: l.mkv\n    fps: 0\n"),
              AllOf(HasSubstr("recording.yaml:5"), HasSubstr("fps")));
  EXPECT_THAT(error_of("version: 1\ncameras:\n  left: {fps: 30}\n"), HasSubstr("frames"));
  EXPECT_THAT(error_of("version: 1\ncameras:\n  left: {frames: l.mkv, every: 0}\n"), HasSubstr("every"));
  EXPECT_THAT(error_of("version: 1\ncameras: {}\n"), HasSubstr("cameras"));
  EXPECT_THAT(error_of("version: 1\n"), HasSubstr("cameras"));
  EXPECT_THROW(read_recording(folder / "none"), files::ConfigError);
  write("times.csv", "frame,t_s\n0,0\n");
  EXPECT_THAT(error_of("version: 1\ncameras:\n  left: {frames: l.mkv, fps: 30, timestamps: times.csv}\n"),
              HasSubstr("together with fps"));
}

TEST_F(ReadRecording, NamesFileAndLineOfABadTimeStamp) {
  EXPECT_THAT(error_of("version: 1\ncameras:\n  left: {frames: l.mkv, timestamps: none.csv}\n"), HasSubstr("none.csv"));
  EXPECT_THAT(error_of_csv(""), HasSubstr("is empty"));
  EXPECT_THAT(error_of_csv("frame,t_s\n"), HasSubstr("lists no frames"));
  EXPECT_THAT(error_of_csv("frame,when\n0,0\n"), AllOf(HasSubstr("times.csv:1"), HasSubstr("t_s")));
  EXPECT_THAT(error_of_csv("frame,t_s\n0,0\n1\n"), HasSubstr("times.csv:3"));
  EXPECT_THAT(error_of_csv("frame,t_s\n0,0\n1.5,1\n"), AllOf(HasSubstr("times.csv:3"), HasSubstr("\"1.5\"")));
  EXPECT_THAT(error_of_csv("frame,t_s\n0,0\n-1,1\n"), HasSubstr("times.csv:3"));
  EXPECT_THAT(error_of_csv("frame,t_s\n0,zero\n"), AllOf(HasSubstr("times.csv:2"), HasSubstr("\"zero\"")));
  EXPECT_THAT(error_of_csv("frame,t_s\n0,nan\n"), HasSubstr("times.csv:2"));
  EXPECT_THAT(error_of_csv("frame,t_s\n0,1e30\n"), HasSubstr("times.csv:2"));
  EXPECT_THAT(error_of_csv("frame,t_s\n0,0\n1,0.1\n2,0.1\n"), AllOf(HasSubstr("times.csv:4"), HasSubstr("later")));
  EXPECT_THAT(error_of_csv("frame,t_s\n0,0\n1,0.2\n2,0.1\n"), HasSubstr("times.csv:4"));
  EXPECT_THAT(error_of_csv("frame,t_s\n0,0\n0,0.2\n"), AllOf(HasSubstr("times.csv:3"), HasSubstr("frame 0")));
}

TEST_F(ReadRecording, AcceptsVideosAsWords) {
  const std::vector<std::string> words{"left=a.mp4", "right=" + (folder / "x=1.mkv").string()};
  const Recording recording = read_recording(words);
  ASSERT_EQ(recording.cameras.size(), 2U);
  EXPECT_EQ(recording.cameras[0].name, "left");
  EXPECT_EQ(recording.cameras[0].frames, std::filesystem::absolute("a.mp4"));
  EXPECT_EQ(recording.cameras[0].fps, 0) << "the video's own times";
  EXPECT_EQ(recording.cameras[1].frames, folder / "x=1.mkv");
  // A folder is a folder, whatever its name.
  std::filesystem::create_directory(folder / "a=b");
  std::ofstream(folder / "a=b/recording.yaml") << "version: 1\ncameras:\n  left: {frames: l.mkv, fps: 30}\n";
  EXPECT_EQ(read_recording(std::vector{(folder / "a=b").string()}).cameras.at(0).frames, folder / "a=b/l.mkv");
  const auto error = [](const std::vector<std::string>& given) -> std::string {
    try {
      read_recording(given);
    } catch (const files::ConfigError& e) {
      return e.what();
    }
    return "(accepted)";
  };
  EXPECT_EQ(error({"left=a.mp4", "left=b.mp4"}), "left=a.mp4 left=b.mp4: names camera left twice");
  EXPECT_THAT(error({"left=a.mp4", "b.mp4"}), HasSubstr("\"b.mp4\" is no CAMERA=FILE"));
  EXPECT_THAT(error({"=a.mp4"}), HasSubstr("is no CAMERA=FILE"));
  EXPECT_THAT(error({"left="}), HasSubstr("is no CAMERA=FILE"));
}

TEST_F(ReadRecording, NamesWhatOtherFilesAre) {
  const auto error = [&](const std::string& name, const std::string& bytes) -> std::string {
    std::ofstream(folder / name, std::ios::binary) << bytes;
    try {
      read_recording(folder / name);
    } catch (const files::ConfigError& e) {
      return e.what();
    }
    return "(accepted)";
  };
  const std::string noise("\xE1\x9F\x03\x80 version: \x00\xFF\x17", 16);
  for (const std::string ending : {".mcap", ".bag", ".db3", ".MCAP"})
    for (const std::string& bytes : {noise, std::string(), std::string("\x89MC")})
      EXPECT_THAT(error("run" + ending, bytes),
                  testing::AllOf(HasSubstr("run" + ending), HasSubstr("does not begin like one")))
          << bytes.size();
  EXPECT_THAT(error("my run.mcap.zst", std::string("\x28\xb5\x2f\xfd") + noise),
              HasSubstr("`unzstd 'my run.mcap.zst'`"));
  EXPECT_THAT(error("run.bag.gz", "\x1f\x8b" + noise), HasSubstr("`gunzip run.bag.gz`"));
  EXPECT_THAT(error("run.mcap", "version https://git-lfs.github.com/spec/v1\noid sha256:1\n"),
              HasSubstr("git lfs pull"));
}

}  // namespace
}  // namespace huetrack::recordings
