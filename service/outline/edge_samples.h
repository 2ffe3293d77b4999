// Samples around a ball's edge in one picture, pixels or samples of chroma: place, measured value and background, in
// grey values and in linear light.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "outline/background.h"
#include "outline/picture.h"

namespace huetrack::outline {

// Structure of arrays in blocks, so that loops vectorise and a block stays in the cache.
struct EdgeSamples {
  static constexpr int block = 64;   // layout: samples
  static constexpr int group = 16;   // layout: the last block is filled to a multiple; what is beyond n has no weight
  static constexpr int most = 2048;  // capacity

  struct alignas(64) GreyValues {
    float light[block], blue[block], red[block];
  };
  struct alignas(64) Block {
    float u[block], v[block];                     // from the start's centre, pixels
    float measured[block];                        // the value that is fitted
    float red[block], green[block], blue[block];  // background, linear light
    float offset[block];                          // background's value less what the tone curve makes of its light
    float unsure[block];                          // the background's variance, in variances of a picture
    float trust[block];                           // 0..1
    float hidden[block];                          // 1: inside the outline this sample would show something else
    float covered[block];                         // share, when assembled last,
    float off[block];         // and the residual's square in variances after the robust loss, with the residual's sign
    GreyValues seen, behind;  // behind: the background, or a guess
    std::int32_t at_u[block], at_v[block];  // in the picture, or in its chroma
  };

  int n = 0;
  Block blocks[most / block];

  int block_count() const { return (n + block - 1) / block; }
  // Samples of block b, and the same with its padding.
  int count_in(int b) const { return b + 1 < block_count() ? block : n - b * block; }
  int filled_in(int b) const { return (count_in(b) + group - 1) / group * group; }
  // visit(block, index in it) for every sample.
  template <typename Visit>
  void for_each(Visit&& visit) {
    for (int b = 0; b < block_count(); ++b)
      for (int k = 0, count = count_in(b); k < count; ++k) visit(blocks[b], k);
  }
};

// The pixels of a picture around an outline; an even number of them where chroma is shared.
struct PixelGrid {
  int u0 = 0, v0 = 0, width = 0, height = 0;
  int columns = 1, rows = 1;  // that share chroma
};

// Where samples count: within reach of the edge, and some further inside.
struct EdgeBand {
  Eigen::Vector2d centre;        // of the outline, pixels
  Eigen::Matrix2d disc_from_px;  // maps the outline to the unit circle
  double radius_px = 0, reach_px = 0;
};
// columns, rows: pixels per sample; 1 for light, otherwise those that share chroma.
void select_samples(const EdgeBand& band, const PixelGrid& grid, int columns, int rows, EdgeSamples& out);

// Standard deviations of a single picture's values, grey values.
struct PictureNoise {
  float light = 0, chroma = 0;
};
// Reads values and background. An unknown background is guessed from the grid's rim, with the rim's variance.
void read_samples(const Picture& picture, const Background& behind, const EdgeBand& band, const PixelGrid& grid,
                  const PictureNoise& noise, EdgeSamples& light, EdgeSamples& chroma);

// Sets the background's linear light, the measured value and the offset. blue_part, red_part: the direction in chroma
// that is measured; both 0: light is.
void make_linear(EdgeSamples& samples, float blue_part, float red_part);

// Sets `hidden`: the value is the background's rather than the object's under any light, or its chroma is not the
// object's under any light and with any white added. object: light, blue, red.
void find_hidden(EdgeSamples& light, const float* object, const PictureNoise& noise);

}  // namespace huetrack::outline
