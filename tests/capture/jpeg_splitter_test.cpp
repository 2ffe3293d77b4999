#include "capture/frames/jpeg_splitter.h"

#include <gmock/gmock.h>

#include <string>

#include "capture/mjpeg_server.h"

namespace huetrack::capture {
namespace {

std::string jpeg_text(int grey) {
  const auto bytes = jpeg_picture(64, 48, grey);
  return {bytes.begin(), bytes.end()};
}

// Split from pieces of any size.
std::vector<std::string> split(const std::string& stream, std::size_t piece) {
  JpegSplitter splitter;
  std::vector<std::string> jpegs;
  for (std::size_t at = 0; at < stream.size(); at += piece) {
    const auto some = stream.substr(at, piece);
    splitter.add({reinterpret_cast<const std::uint8_t*>(some.data()), some.size()});
    while (const auto jpeg = splitter.next()) jpegs.emplace_back(jpeg->begin(), jpeg->end());
  }
  if (const auto jpeg = splitter.rest()) jpegs.emplace_back(jpeg->begin(), jpeg->end());
  return jpegs;
}

TEST(JpegSplitter, FindsJpegsWhateverLiesBetweenThem) {
  const std::vector<std::string> jpegs{jpeg_text(40), jpeg_text(90), jpeg_text(140)};
  for (const std::string between :
       {"", "\r\n--frame\r\nContent-Type: image/jpeg\r\nContent-Length: 12\r\n\r\n", "\r\nnonsense\xff", "\xff\xd8"})
    for (const std::string before : {"", "--frame\r\n\r\n", "HTTP/1.1 200 OK\r\n\r\n"})
      for (const std::size_t piece : {1, 2, 7, 4096}) {
        SCOPED_TRACE(before + "|" + between + " by " + std::to_string(piece));
        EXPECT_EQ(split(before + jpegs[0] + between + jpegs[1] + between + jpegs[2] + between, piece), jpegs);
      }
}

TEST(JpegSplitter, AThumbnailIsAPartOfItsPicture) {
  const std::string inner = jpeg_text(90), outer = jpeg_text(40);
  const std::size_t length = inner.size() + 2;
  const std::string with_thumbnail = outer.substr(0, 2) + "\xff\xe1" + static_cast<char>(length >> 8) +
                                     static_cast<char>(length & 0xff) + inner + outer.substr(2);
  EXPECT_THAT(split(with_thumbnail + outer, 100), testing::ElementsAre(with_thumbnail, outer));
}

TEST(JpegSplitter, APictureWithoutAnEndCounts) {
  const std::string whole = jpeg_text(40);
  const std::string cut = whole.substr(0, whole.size() - 20);
  EXPECT_THAT(split(cut + whole + whole.substr(0, 300), 50), testing::ElementsAre(cut, whole, whole.substr(0, 300)));
}

TEST(JpegSplitter, ForgetsWhatIsNoPicture) {
  JpegSplitter splitter;
  const std::vector<std::uint8_t> text(100'000, 'a');
  splitter.add(text);
  EXPECT_FALSE(splitter.next());
  EXPECT_LE(splitter.pending(), 2u);
}

}  // namespace
}  // namespace huetrack::capture
