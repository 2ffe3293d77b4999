// Pixels, or samples of chroma, around a ball's edge in one picture: where they are, what is seen there and what is
// behind it, in grey values and in linear light.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "outline/background.h"
#include "outline/picture.h"

namespace huetrack::outline {

// In blocks of columns, so that many samples are done at once and what belongs together lies together.
struct EdgeSamples {
  static constexpr int block = 64;  // samples
  static constexpr int group = 16;  // of as many the last block's columns are filled: what is beyond n counts nothing
  static constexpr int most = 2048;

  struct alignas(64) GreyValues {
    float light[block], blue[block], red[block];
  };
  struct alignas(64) Block {
    float u[block], v[block];                     // from the start's centre, pixels
    float measured[block];                        // of what is seen
    float red[block], green[block], blue[block];  // linear light, behind
    float offset[block];                          // of what is behind from what the camera's curve makes of that
    float unsure[block];                          // its variance, in variances of a picture
    float trust[block];                           // 0..1
    float hidden[block];                          // 1: were it within the outline, it would show what is behind
    float covered[block];                         // when assembled last: the share,
    float off[block];         // and the residual's square in variances, as the robust loss has it, with its sign
    GreyValues seen, behind;  // what is behind it, or what that is guessed to be
    float looks[block];       // of how many pictures that is the mean; 0: guessed
    std::int32_t at_u[block], at_v[block];  // in the picture, or in its chroma
  };

  int n = 0;
  Block blocks[most / block];

  int block_count() const { return (n + block - 1) / block; }
  // Of block b: samples, and as many with what fills them up.
  int count_in(int b) const { return b + 1 < block_count() ? block : n - b * block; }
  int filled_in(int b) const { return (count_in(b) + group - 1) / group * group; }
  // visit(block, index in it) for every sample.
  template <typename Visit>
  void for_each(Visit&& visit) {
    for (int b = 0; b < block_count(); ++b)
      for (int k = 0, count = count_in(b); k < count; ++k) visit(blocks[b], k);
  }
};

// The pixels of a picture in which an outline is looked for; even numbers of them where chroma is shared.
struct PixelGrid {
  int u0 = 0, v0 = 0, width = 0, height = 0;
  int columns = 1, rows = 1;  // that share chroma
};

// Which samples count: those whose centres lie within reach of the edge, and some of those further inside.
struct EdgeBand {
  Eigen::Vector2d centre;        // of the outline, pixels
  Eigen::Matrix2d disc_from_px;  // it is the unit circle there
  double radius_px = 0, reach_px = 0;
};
// One sample for so many columns and rows of pixels: their own, 1, or those that share chroma.
void select_samples(const EdgeBand& band, const PixelGrid& grid, int columns, int rows, EdgeSamples& out);

// By how much a single picture's values are off, standard deviations in grey values.
struct PictureNoise {
  float light = 2, chroma = 2;
};
// What is seen there, and what is behind it. Where that is not known, it is taken for what is seen beyond it at the rim
// of the grid, as unsure as that differs all around.
void read_samples(const Picture& picture, const Background& behind, const EdgeBand& band, const PixelGrid& grid,
                  const PictureNoise& noise, EdgeSamples& light, EdgeSamples& chroma);

// As linear light R G B, and what the camera's curve does not explain of it. blue_part and red_part: what is measured
// of chroma; both 0: light is.
void make_linear(EdgeSamples& samples, float blue_part, float red_part);

// Of samples of light that lie within the outline: is what is seen there rather what is behind, which no light on the
// object could be mistaken for? object: light, blue, red as it is seen.
void find_hidden(EdgeSamples& light, const float* object, const PictureNoise& noise);

}  // namespace huetrack::outline
