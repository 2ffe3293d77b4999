#include "room_watch/luma.h"

#include <algorithm>

namespace huetrack::room_watch {
namespace {

struct LumaTuning {
  int usual_width = 480;  // blocks across an image: a tenth of a block is 0.01 to 0.02 degrees at 60 to 90 degrees
};
constexpr LumaTuning luma_tuning{};

int step_of(capture::PixelFormat format) {
  if (format == capture::PixelFormat::yuyv) return 2;
  return format == capture::PixelFormat::bgr ? 3 : 1;
}

}  // namespace

int scale_for(int image_width) {
  return std::max(1, (image_width + luma_tuning.usual_width / 2) / luma_tuning.usual_width);
}

Luma::Luma(const capture::Image& image, int scale)
    : on_demand_(image.on_demand.get()),
      first_(image.planes[0].data + (image.format == capture::PixelFormat::bgr ? 1 : 0)),
      stride_(image.planes[0].stride),
      step_(step_of(image.format)),
      scale_(scale),
      columns_(image.width / scale),
      rows_(image.height / scale) {}

float Luma::mean(int column, int row) const {
  const std::uint8_t* corner =
      first_ + std::ptrdiff_t(row) * scale_ * stride_ + std::ptrdiff_t(column) * scale_ * step_;
  int sum = 0;
  for (int j = 0; j < scale_; ++j)
    for (int i = 0; i < scale_; ++i) sum += corner[j * stride_ + std::ptrdiff_t(i) * step_];
  return float(sum) / float(scale_ * scale_);
}

bool Luma::read(int column, int row, int columns, int rows, float* out) const {
  if (column < 0 || row < 0 || column + columns > columns_ || row + rows > rows_) return false;
  require(column, row, columns, rows);
  for (int j = 0; j < rows; ++j) {
    float* const line = out + std::ptrdiff_t(j) * columns;
    if (scale_ > 1) {
      for (int i = 0; i < columns; ++i) line[i] = mean(column + i, row + j);
      continue;
    }
    const std::uint8_t* const from = first_ + std::ptrdiff_t(row + j) * stride_ + std::ptrdiff_t(column) * step_;
    if (step_ == 1) {
      for (int i = 0; i < columns; ++i) line[i] = float(from[i]);
    } else {
      for (int i = 0; i < columns; ++i) line[i] = float(from[std::ptrdiff_t(i) * step_]);
    }
  }
  return true;
}

}  // namespace huetrack::room_watch
