// What encoded pictures say of themselves.
#include "capture/frames/picture_tags.h"

#include <gmock/gmock.h>

#include <string>
#include <vector>

namespace huetrack::capture {
namespace {

using Bytes = std::vector<std::uint8_t>;

void add(Bytes& bytes, std::string_view text) {
  bytes.insert(bytes.end(), text.begin(), text.end());
}
void add(Bytes& bytes, std::size_t value, int size, bool is_little) {
  for (int i = 0; i < size; ++i) bytes.push_back(std::uint8_t(value >> 8 * (is_little ? i : size - 1 - i)));
}

// A TIFF's first directory: some width, and the orientation.
Bytes directory_with(unsigned tag, bool is_little) {
  Bytes bytes(2, is_little ? 'I' : 'M');
  add(bytes, 42, 2, is_little), add(bytes, 8, 4, is_little), add(bytes, 2, 2, is_little);
  add(bytes, 0x0100, 2, is_little), add(bytes, 3, 2, is_little), add(bytes, 1, 4, is_little);
  add(bytes, 64, 2, is_little), add(bytes, 0, 2, is_little);
  add(bytes, 0x0112, 2, is_little), add(bytes, 3, 2, is_little), add(bytes, 1, 4, is_little);
  add(bytes, tag, 2, is_little), add(bytes, 0, 2, is_little);
  add(bytes, 0, 4, is_little);
  return bytes;
}
std::string as_text(const Bytes& bytes) {
  return {bytes.begin(), bytes.end()};
}

Bytes png_chunk(std::string_view name, std::string_view data) {
  Bytes bytes;
  add(bytes, data.size(), 4, false), add(bytes, name), add(bytes, data), add(bytes, 0, 4, false);
  return bytes;
}

std::vector<std::pair<std::string, Bytes>> pictures_with(unsigned tag, bool is_little) {
  const std::string directory = as_text(directory_with(tag, is_little));
  const std::string exif = std::string("Exif\0\0", 6) + directory;
  Bytes jpeg{0xFF, 0xD8, 0xFF, 0xE0, 0, 4, 0, 0, 0xFF, 0xE1};
  add(jpeg, exif.size() + 2, 2, false), add(jpeg, exif);
  Bytes png;
  add(png, "\x89PNG\r\n\x1a\n");
  for (const auto& chunk : {png_chunk("IHDR", std::string(13, '\1')), png_chunk("IDAT", "pixels"),
                            png_chunk("eXIf", directory), png_chunk("IEND", "")})
    add(png, as_text(chunk));
  std::vector<std::pair<std::string, Bytes>> pictures{{"JPEG", jpeg}, {"PNG", png}};
  for (const std::string& data : {directory, exif}) {
    Bytes webp;
    add(webp, "RIFF"), add(webp, 0, 4, true), add(webp, "WEBPVP8 "), add(webp, 3, 4, true), add(webp, "abc");
    webp.push_back(0);  // to an even size
    add(webp, "EXIF"), add(webp, data.size(), 4, true), add(webp, data);
    pictures.emplace_back("WebP", webp);
  }
  pictures.emplace_back("TIFF", directory_with(tag, is_little));
  return pictures;
}

TEST(PictureTags, ReadsTheOrientationOfEveryKind) {
  for (const bool is_little : {true, false})
    for (unsigned tag = 1; tag <= 8; ++tag)
      for (const auto& [kind, bytes] : pictures_with(tag, is_little)) {
        const PictureTags tags = tags_of(bytes);
        EXPECT_EQ(tags.orientation, orientation_of_tag(tag)) << kind << tag;
        EXPECT_EQ(bytes[tags.orientation_at], tag) << kind;
        for (std::size_t size = 0; size < bytes.size(); ++size)  // never beyond the end
          tags_of(Bytes(bytes.begin(), bytes.begin() + std::ptrdiff_t(size)));
      }
}

TEST(PictureTags, PicturesThatSayNothingHaveNone) {
  for (const auto& [kind, bytes] : pictures_with(9, true)) {
    EXPECT_EQ(tags_of(bytes).orientation, std::nullopt) << kind;
    EXPECT_EQ(tags_of(bytes).orientation_at, 0u) << kind;
  }
  for (const Bytes& bytes : {Bytes{}, Bytes{0xFF, 0xD8, 0xFF, 0xDB, 0, 3, 1}, Bytes{'I', 'I', '*', 0}})
    EXPECT_EQ(tags_of(bytes).orientation, std::nullopt);
}

TEST(PictureTags, ReadsTheBitsOfAPng) {
  Bytes png{0x89, 'P', 'N', 'G', 13, 10, 26, 10};
  add(png, as_text(png_chunk("sBIT", "\x0c\x0b\x0c"))), add(png, as_text(png_chunk("IDAT", "")));
  EXPECT_EQ(tags_of(png).significant_bits, 12);
  for (std::size_t size = 0; size < png.size(); ++size) tags_of(Bytes(png.begin(), png.begin() + std::ptrdiff_t(size)));
  png[12] = 'x';
  EXPECT_EQ(tags_of(png).significant_bits, 0);
}

}  // namespace
}  // namespace huetrack::capture
