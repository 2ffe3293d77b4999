#include "page/recording_library.h"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <memory>
#include <span>
#include <stdexcept>
#include <string_view>

#include "capture/frames/file_descriptor.h"
#include "idl/control_words.h"

namespace huetrack::page {
namespace {

namespace fs = std::filesystem;
using capture::FileDescriptor;
using idl::is_recording_name;

constexpr std::size_t most_files = 200;                 // of a recording: two per camera, and five
constexpr std::uint64_t block = 512;                    // of a tar
constexpr std::uint64_t end_of_tar = 2 * block;         // zeros
constexpr std::string_view times_header = "frame,t_s";  // begin of a file of frame times
constexpr std::size_t longest_row = 256;                // of such a file

struct File {
  std::string name;
  std::uint64_t bytes = 0;
  std::int64_t changed_at_s = 0, changed_at_ns = 0;
};

FileDescriptor open_folder(const fs::path& folder) {
  return FileDescriptor(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
}
// Opens an entry of a folder, without following links.
FileDescriptor open_inside(const FileDescriptor& folder, const std::string& name, int flags) {
  return FileDescriptor(::openat(folder.get(), name.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC | flags));
}

// All entries of a folder, by name.
std::vector<std::string> all_names_in(const FileDescriptor& folder) {
  const auto close = [](DIR* open) { ::closedir(open); };
  const int own = ::openat(folder.get(), ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);  // closedir() closes it
  const std::unique_ptr<DIR, decltype(close)> entries(own < 0 ? nullptr : ::fdopendir(own), close);
  std::vector<std::string> names;
  while (entries) {
    const dirent* const entry = ::readdir(entries.get());
    if (entry == nullptr) break;
    const std::string_view name = entry->d_name;
    if (name != "." && name != "..") names.emplace_back(name);
  }
  std::ranges::sort(names);
  return names;
}

// Names that a recording, or a file of one, may have.
std::vector<std::string> names_in(const FileDescriptor& folder) {
  std::vector<std::string> names = all_names_in(folder);
  std::erase_if(names, [](const std::string& name) { return !is_recording_name(name); });
  return names;
}

// Its regular files, by name.
std::vector<File> files_in(const FileDescriptor& folder) {
  std::vector<File> files;
  for (const std::string& name : names_in(folder)) {
    struct stat about {};
    if (::fstatat(folder.get(), name.c_str(), &about, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(about.st_mode)) continue;
    files.push_back({name, std::uint64_t(about.st_size), about.st_mtim.tv_sec, about.st_mtim.tv_nsec});
    if (files.size() == most_files) break;
  }
  return files;
}

bool has_recording(const std::vector<File>& files) {
  return std::ranges::any_of(files, [](const File& file) { return file.name == "recording.yaml"; });
}

// Bytes of a file at an offset; fewer at its end.
std::string part_of(const FileDescriptor& file, std::uint64_t from, std::size_t most) {
  std::string part(most, '\0');
  std::size_t got = 0;
  while (got < most) {
    const ssize_t n = ::pread(file.get(), part.data() + got, most - got, off_t(from + got));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    got += std::size_t(n);
  }
  part.resize(got);
  return part;
}

// The second column of a row; nullopt: not a number.
std::optional<double> time_of(std::string_view row) {
  const std::size_t comma = row.find(',');
  if (comma == std::string_view::npos) return std::nullopt;
  double time = 0;
  const std::string_view text = row.substr(comma + 1);
  if (std::from_chars(text.data(), text.data() + text.size(), time).ec != std::errc{}) return std::nullopt;
  return time;
}

// First and last time of a camera; nullopt: none. Reads only both ends of the file.
std::optional<std::pair<double, double>> times_of(const FileDescriptor& folder, const File& file) {
  const FileDescriptor times = open_inside(folder, file.name, 0);
  const std::string begin = part_of(times, 0, 2 * longest_row);
  const std::string end = part_of(times, file.bytes > longest_row ? file.bytes - longest_row : 0, longest_row);
  if (!begin.starts_with(times_header) || !end.ends_with('\n')) return std::nullopt;
  const std::size_t last_row = end.size() < 2 ? std::string::npos : end.rfind('\n', end.size() - 2);
  if (last_row == std::string::npos) return std::nullopt;
  const auto first = time_of(std::string_view(begin).substr(std::min(begin.find('\n'), begin.size() - 1) + 1));
  const auto last = time_of(std::string_view(end).substr(last_row + 1));
  if (!first || !last) return std::nullopt;
  return std::pair(*first, *last);
}

ListedRecording described(const std::string& name, const FileDescriptor& folder, const std::vector<File>& files) {
  ListedRecording recording{.name = name};
  std::optional<double> ended_at_s;
  for (const File& file : files) {
    recording.bytes += file.bytes;
    if (file.name.ends_with(".mkv")) ++recording.cameras;
    if (!file.name.ends_with(".csv")) continue;
    const auto times = times_of(folder, file);
    if (!times) continue;
    recording.begun_at_s = std::min(recording.begun_at_s.value_or(times->first), times->first);
    ended_at_s = std::max(ended_at_s.value_or(times->second), times->second);
  }
  if (ended_at_s) recording.length_s = *ended_at_s - *recording.begun_at_s;
  return recording;
}

// ---- The tar file: POSIX ustar. Per file a header and its content, padded to whole blocks.

constexpr std::uint64_t whole_blocks(std::uint64_t bytes) {
  return (bytes + block - 1) / block * block;
}

std::uint64_t tar_size(const std::vector<File>& files) {
  std::uint64_t size = end_of_tar;
  for (const File& file : files) size += block + whole_blocks(file.bytes);
  return size;
}

// Octal digits and a zero; above 8 GiB the binary number with the high bit set, as in GNU tar.
void put_number(std::span<char> field, std::uint64_t value) {
  const std::string octal = fmt::format("{:0{}o}", value, field.size() - 1);
  if (octal.size() < field.size()) {
    std::ranges::copy(octal, field.begin());
    return;
  }
  for (std::size_t i = field.size(); i-- > 0; value >>= 8) field[i] = char(value & 0xFF);
  field[0] = char(0x80);
}

std::array<char, block> header_of(const std::string& recording, const File& file) {
  std::array<char, block> header{};
  const auto field = [&](std::size_t at, std::size_t size) { return std::span(header).subspan(at, size); };
  const auto put = [&](std::size_t at, std::string_view text) { std::ranges::copy(text, header.begin() + long(at)); };
  put(0, file.name);
  put_number(field(100, 8), 0644);
  put_number(field(108, 8), 0);  // owner: the unpacking user
  put_number(field(116, 8), 0);
  put_number(field(124, 12), file.bytes);
  put_number(field(136, 12), std::uint64_t(std::max<std::int64_t>(file.changed_at_s, 0)));
  put(148, "        ");  // checksum over the header with blanks here
  put(156, "0");         // a regular file
  put(257, std::string_view("ustar\00000", 8));
  put(345, recording);  // the folder
  std::uint64_t sum = 0;
  for (const char c : header) sum += static_cast<unsigned char>(c);
  put_number(field(148, 7), sum);
  header[154] = '\0';
  return header;
}

// FNV-1a 64
std::string identity_of(const std::vector<File>& files) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const File& file : files)
    for (const char c : fmt::format("{}/{}/{}.{}\n", file.name, file.bytes, file.changed_at_s, file.changed_at_ns))
      hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return fmt::format("{:016x}", hash);
}

// Bytes [from, from + bytes.size()) of the tar file; the rest is zero. throws std::runtime_error
void fill(std::span<std::uint8_t> bytes, std::uint64_t from, const std::string& recording, const FileDescriptor& folder,
          const std::vector<File>& files) {
  const std::uint64_t to = from + bytes.size();
  const auto put = [&](std::uint64_t at, std::string_view text) {  // its part in [from, to)
    const std::uint64_t first = std::max(at, from), last = std::min(at + text.size(), to);
    if (first < last) std::memcpy(bytes.data() + (first - from), text.data() + (first - at), last - first);
  };
  std::uint64_t at = 0;
  for (const File& file : files) {
    const std::uint64_t content = at + block;
    if (at < to && content > from) {
      const auto header = header_of(recording, file);
      put(at, {header.data(), header.size()});
    }
    const std::uint64_t first = std::max(content, from), last = std::min(content + file.bytes, to);
    if (first < last) {
      const FileDescriptor open = open_inside(folder, file.name, 0);
      const std::string part = part_of(open, first - content, last - first);
      if (part.size() != last - first)
        throw std::runtime_error(fmt::format("{}/{} cannot be read: {}", recording, file.name, std::strerror(errno)));
      put(first, part);
    }
    at = content + whole_blocks(file.bytes);
  }
}

}  // namespace

std::vector<ListedRecording> RecordingLibrary::list(std::size_t most) const {
  std::vector<ListedRecording> recordings;
  const FileDescriptor library = open_folder(folder_);
  if (library.get() < 0) return recordings;
  std::vector<std::string> names = names_in(library);
  std::ranges::reverse(names);
  for (const std::string& name : names) {
    if (recordings.size() == most) break;
    const FileDescriptor folder = open_inside(library, name, O_DIRECTORY);
    if (folder.get() < 0) continue;
    const std::vector<File> files = files_in(folder);
    if (has_recording(files)) recordings.push_back(described(name, folder, files));
  }
  return recordings;
}

namespace {

// throws std::runtime_error if there is none.
FileDescriptor open_recording(const FileDescriptor& library, const std::string& name) {
  if (!is_recording_name(name)) throw std::runtime_error("that is not a valid name of a recording");
  FileDescriptor folder = library.get() < 0 ? FileDescriptor() : open_inside(library, name, O_DIRECTORY);
  if (folder.get() < 0 || !has_recording(files_in(folder)))
    throw std::runtime_error(fmt::format("there is no recording {}", name));
  return folder;
}

}  // namespace

void RecordingLibrary::remove(const std::string& name) const {
  const FileDescriptor library = open_folder(folder_);
  const FileDescriptor folder = open_recording(library, name);
  const auto refused = [&] {
    return std::runtime_error(fmt::format("{} cannot be deleted: {}", name, std::strerror(errno)));
  };
  std::vector<std::string> files = all_names_in(folder);
  for (const std::string& file : files) {
    struct stat about {};
    if (::fstatat(folder.get(), file.c_str(), &about, AT_SYMLINK_NOFOLLOW) == 0 && S_ISDIR(about.st_mode))
      throw std::runtime_error(
          fmt::format("{} contains a folder, {}, so it is not only a recording: delete it manually", name, file));
  }
  // recording.yaml is deleted last, so that an interrupted deletion can be repeated.
  std::ranges::stable_partition(files, [](const std::string& file) { return file != "recording.yaml"; });
  for (const std::string& file : files)
    if (::unlinkat(folder.get(), file.c_str(), 0) != 0) throw refused();
  if (::unlinkat(library.get(), name.c_str(), AT_REMOVEDIR) != 0) throw refused();
}

RecordingPiece RecordingLibrary::read(const std::string& name, std::uint64_t from, std::size_t most_bytes) const {
  const FileDescriptor library = open_folder(folder_);
  const FileDescriptor folder = open_recording(library, name);
  const std::vector<File> files = files_in(folder);
  RecordingPiece piece{.tar_bytes = tar_size(files), .identity = identity_of(files)};
  if (from >= piece.tar_bytes) return piece;
  piece.bytes.resize(std::size_t(std::min<std::uint64_t>(most_bytes, piece.tar_bytes - from)));
  fill(piece.bytes, from, name, folder, files);
  return piece;
}

}  // namespace huetrack::page
