// A patch of the still room and its registration in a later image: Lucas-Kanade, inverse compositional (Baker and
// Matthews, IJCV 2004), of a shift, a gain and an offset. Gain and offset are projected out of the gradients
// beforehand. (OpenCV's calcOpticalFlowPyrLK needs both images whole and grey, and has no gain.) Pure; no exception.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>

#include "room_watch/kept_patch.h"
#include "room_watch/luma.h"

namespace huetrack::room_watch {

struct PatchFitTuning {
  int most_steps = 8;                // Gauss-Newton
  double settled_blocks = 0.02;      // last step; no place is known better: a fifth of the usual noise
  float max_shift_blocks = 4;        // from the start; farther away it is another patch
  float min_correlation = 0.75f;     // of a patch that is found: noise of 0.9 of its contrast
  float min_contrast = 0.25f;        // of a patch that is found, in its own: below, fog, a hand, something plain
  float search_correlation = 0.65f;  // of the best place in a search, which is made in steps of two blocks
  float search_margin = 0.08f;       // by which the best place's correlation exceeds all others'
  int search_neighbour_steps = 2;    // places this near to each other are one
};
inline constexpr PatchFitTuning patch_fit{};

struct Patch {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // in blocks, where it was learnt; whole numbers plus a half
  SeenPatch seen{};

  // Derived from `seen`: zero mean, gradients without their share of the values.
  std::array<float, patch_pixels> values{}, gradient_x{}, gradient_y{};
  float energy = 0;                                         // sum of the squared values
  Eigen::Matrix2f from_gradient = Eigen::Matrix2f::Zero();  // inverse of the sum of the gradients' squares
  float least_texture = 0;  // smaller eigenvalue of that sum, per pixel: squared grey levels per squared block
  // Detail: what a blur of one block removes, orthogonal to gain, offset and shift; its energy; and its share of the
  // values before that.
  std::array<float, patch_pixels> detail{};
  float detail_energy = 0, detail_of_values = 0;

  float contrast() const;  // rms of the values, grey levels
};

// nullopt: it has no texture in some direction.
std::optional<Patch> make_patch(const Eigen::Vector2d& centre, const SeenPatch& seen);

struct Found {
  enum class Outcome : std::uint8_t { found, differs, outside };
  Outcome outcome = Outcome::outside;                // differs: something else is there
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // in blocks; if found
  float correlation = 0;                             // -1..1
  float contrast = 0;                                // rms of what is there, grey levels
  float sigma = 0;                                   // of centre along each axis by the image's noise, blocks; if found
  // If found: the detail that is lost, in units of what a blur of one block removes; < 0: gained. Gain, offset and the
  // blur of interpolation are taken out.
  float loss = 0, loss_sigma = 0;
};

// Registers the patch near `start`, which should be right to about two blocks.
Found find(const Patch& patch, const Luma& luma, const Eigen::Vector2d& start);

// Correlation at this place to a block: -1..1, 0 where the image ends.
float correlation(const Patch& patch, const Luma& luma, const Eigen::Vector2d& centre);

// The patch after a Gaussian blur. nullopt: as make_patch.
std::optional<Patch> blurred(const Patch& patch, double sigma_blocks);
// The Gaussian blur, blocks, that removes so much of this patch's detail; 0 where detail was gained.
double blur_of(const Patch& patch, double loss);

// The place within +-reach blocks of `start` with the best correlation, to two blocks: a start for find(). nullopt: no
// place is good enough, or two apart are as good.
std::optional<Eigen::Vector2d> search(const Patch& patch, const Luma& luma, const Eigen::Vector2d& start, int reach);

}  // namespace huetrack::room_watch
