#include "capture/frames/picture_layout.h"

#include <array>
#include <cmath>
#include <cstdio>

#include "capture/frames/image_copy.h"

namespace huetrack::capture {
namespace {

// One colour component of an image.
struct Channel {
  std::uint8_t* data;     // read-only where the image is
  std::ptrdiff_t stride;  // bytes
  int step;               // bytes from one column to the next
  int width, height;
};

std::vector<Channel> channels_of(const Image& image) {
  std::vector<Channel> channels;
  const auto add = [&](int plane, int offset, int step) {
    const Plane& bytes = image.planes[static_cast<std::size_t>(plane)];
    channels.push_back({const_cast<std::uint8_t*>(bytes.data) + offset, bytes.stride, step,
                        static_cast<int>(plane_row_bytes(image.format, plane, image.width)) / step,
                        plane_rows(image.format, plane, image.height)});
  };
  switch (image.format) {
    case PixelFormat::yuyv:
      add(0, 0, 2), add(0, 1, 4), add(0, 3, 4);
      break;
    case PixelFormat::nv12:
      add(0, 0, 1), add(1, 0, 2), add(1, 1, 2);
      break;
    case PixelFormat::i420:
    case PixelFormat::i422:
    case PixelFormat::i444:
      add(0, 0, 1), add(1, 0, 1), add(2, 0, 1);
      break;
    case PixelFormat::bgr:
      add(0, 0, 3), add(0, 1, 3), add(0, 2, 3);
      break;
    case PixelFormat::grey:
      add(0, 0, 1);
      break;
  }
  return channels;
}

PixelFormat turned_format(PixelFormat format, bool swaps_axes) {
  switch (format) {
    case PixelFormat::nv12:
      return PixelFormat::i420;
    case PixelFormat::yuyv:
    case PixelFormat::i422:
      return swaps_axes ? PixelFormat::i444 : PixelFormat::i422;
    default:
      return format;
  }
}

std::string shape_text(double aspect) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g : 1", aspect);
  return text.data();
}

}  // namespace

std::vector<std::string> notes_on(const PictureLayout& layout) {
  std::vector<std::string> notes;
  const std::string angle = std::to_string(std::lround(layout.turned_deg)) + " degrees";
  if (!layout.orientation.is_upright())
    notes.push_back("is tagged to be shown " +
                    (layout.turned_deg != 0 ? "turned by " + angle + (layout.is_mirrored ? " and mirrored" : "")
                                            : std::string("mirrored")) +
                    ": its pictures are, as in every player; the rig must be calibrated with pictures turned alike");
  else if (layout.turned_deg != 0)
    notes.push_back("is tagged to be shown turned by " + angle +
                    ", which is no multiple of 90: its pictures are used as stored");
  if (layout.is_interlaced)
    notes.push_back(
        "is interlaced: only the first field of every frame is used, with half of the rows; use a progressive mode of "
        "the camera");
  if (layout.pixel_aspect != 1)
    notes.push_back("has pixels of " + shape_text(layout.pixel_aspect) +
                    ": players stretch its pictures, but here, as in the rig, pixels are those that are stored");
  return notes;
}

Image turned(const Image& image, const Orientation& orientation) {
  if (orientation.is_upright() || !has_pixels(image)) return image;
  require_all(image);
  const bool swaps = orientation.swaps_axes();
  WritableImage made = make_image(turned_format(image.format, swaps), image.range, swaps ? image.height : image.width,
                                  swaps ? image.width : image.height);
  const std::vector<Channel> from = channels_of(image), to = channels_of(made.image);
  for (std::size_t c = 0; c < to.size(); ++c) {
    // Stored size of this channel at the target's resolution.
    const int width = swaps ? to[c].height : to[c].width, height = swaps ? to[c].width : to[c].height;
    const int first_x = orientation.column_by_column + orientation.row_by_column < 0 ? width - 1 : 0;
    const int first_y = orientation.column_by_row + orientation.row_by_row < 0 ? height - 1 : 0;
    for (int row = 0; row < to[c].height; ++row) {
      std::uint8_t* out = to[c].data + row * to[c].stride;
      // The inverse of the matrix is its transpose.
      int x = first_x + orientation.row_by_column * row, y = first_y + orientation.row_by_row * row;
      for (int column = 0; column < to[c].width; ++column, out += to[c].step) {
        *out =
            from[c].data[(y * from[c].height / height) * from[c].stride + (x * from[c].width / width) * from[c].step];
        x += orientation.column_by_column, y += orientation.column_by_row;
      }
    }
  }
  return made.image;
}

Image first_field(const Image& image, FirstField first) {
  if (!has_pixels(image)) return image;
  require_all(image);
  Image result = copy_of(image);
  for (int plane = 0; plane < 3; ++plane) {
    const std::size_t bytes = plane_row_bytes(image.format, plane, image.width);
    const int rows = plane_rows(image.format, plane, image.height);
    const Plane& at = result.planes[static_cast<std::size_t>(plane)];
    const auto row = [&](int y) { return const_cast<std::uint8_t*>(at.data) + y * at.stride; };  // copy_of() made it
    for (int y = first == FirstField::top ? 1 : 0; bytes > 0 && y < rows; y += 2) {
      const std::uint8_t* above = row(y > 0 ? y - 1 : std::min(y + 1, rows - 1));
      const std::uint8_t* below = row(y + 1 < rows ? y + 1 : std::max(y - 1, 0));
      std::uint8_t* out = row(y);
      for (std::size_t x = 0; x < bytes; ++x) out[x] = static_cast<std::uint8_t>((above[x] + below[x] + 1) / 2);
    }
  }
  return result;
}

std::optional<Orientation> orientation_of_tag(unsigned tag) {
  static constexpr std::array<Orientation, 8> tags{{{1, 0, 0, 1},
                                                    {-1, 0, 0, 1},
                                                    {-1, 0, 0, -1},
                                                    {1, 0, 0, -1},
                                                    {0, 1, 1, 0},
                                                    {0, 1, -1, 0},
                                                    {0, -1, -1, 0},
                                                    {0, -1, 1, 0}}};
  return tag >= 1 && tag <= tags.size() ? std::optional(tags[tag - 1]) : std::nullopt;
}

}  // namespace huetrack::capture
