// Files that people bring, and no part of huetrack reads: what each is, and what makes it readable.
#include <algorithm>
#include <array>
#include <fstream>
#include <string_view>

#include "calib/files/text_file.h"
#include "recordings/bags/bag.h"
#include "recordings/recording.h"

namespace huetrack::recordings {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t head_bytes = 64;  // the longest beginning is that of Git LFS, with 43

std::string head_of(const fs::path& file) {
  std::string head(head_bytes, '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(in.gcount()));
  return head;
}

// As an argument for a shell.
std::string quoted(const fs::path& file) {
  constexpr std::string_view plain =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._+-";  // never need quotes
  const std::string name = file.filename().string();
  if (name.find_first_not_of(plain) == std::string::npos) return name;
  std::string out = "'";
  for (const char c : name) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return files::printable(out + "'");
}

std::string advice_on_picture(const fs::path& file, std::string_view head) {
  const std::string_view brand = head.size() >= 12 && head.substr(4, 4) == "ftyp" ? head.substr(8, 4) : "";
  fs::path jpg = fs::path(file).replace_extension(".jpg");
  if (jpg == file) jpg.replace_filename(file.stem().string() + "_converted.jpg");
  const std::string command = "convert it, with `heif-convert -q 98 " + quoted(file) + " " + quoted(jpg) +
                              "` (Debian package libheif-examples)";
  static constexpr std::array<std::string_view, 6> heic{"heic", "heix", "hevc", "heim", "mif1", "msf1"};
  if (brand == "avif" || brand == "avis") return "is an AVIF picture, which is not read: " + command;
  if (std::ranges::find(heic, brand) != heic.end())
    return "is a HEIC picture, as phones take them, which is not read: " + command + ", or let the phone store JPEG";
  return {};
}

// Compressed as a whole, or packed with others.
std::string advice_on_archive(const fs::path& file, std::string_view head) {
  struct Kind {
    std::string_view begin, name, command;
  };
  static constexpr std::array<Kind, 6> kinds{{{"\x28\xb5\x2f\xfd", "zstd", "unzstd"},
                                              {"\x1f\x8b", "gzip", "gunzip"},
                                              {"\xfd"
                                               "7zXZ",
                                               "xz", "unxz"},
                                              {"BZh", "bzip2", "bunzip2"},
                                              {"\x04\x22\x4d\x18", "lz4", "unlz4"},
                                              {"PK\x03\x04", "zip", "unzip"}}};
  for (const Kind& kind : kinds)
    if (head.starts_with(kind.begin))
      return "is compressed as a whole (" + std::string(kind.name) + "): `" + std::string(kind.command) + " " +
             quoted(file) + "` makes it readable";
  return {};
}

}  // namespace

std::string advice_to_convert(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return {};
  const std::string head = head_of(file);
  if (head.starts_with("version https://git-lfs.github.com/spec/v"))
    return "is not the file itself but a pointer of Git LFS to it: `git lfs pull` fetches it";
  for (const std::string& advice :
       {advice_on_picture(file, head), advice_on_archive(file, head), bags::problem_of_beginning(file)})
    if (!advice.empty()) return advice;
  return {};
}

}  // namespace huetrack::recordings
