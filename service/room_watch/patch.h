// A small piece of the still room as a camera saw it, and where it is now: Lucas and Kanade's registration, inverse
// compositional (Baker and Matthews, Lucas-Kanade 20 years on, IJCV 2004), of a shift, a gain and an offset. Gain and
// offset are taken out of the gradients beforehand, so light that changes costs no unknown.
// OpenCV's calcOpticalFlowPyrLK wants whole grey images of both moments, and knows no gain. Pure; no exception.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>

#include "room_watch/kept_patch.h"
#include "room_watch/luma.h"

namespace huetrack::room_watch {

struct Patch {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // in blocks, where it was seen; whole numbers plus a half
  SeenPatch seen{};

  // What follows from `seen`: zero mean, in an order in which the compiler adds several at once.
  std::array<float, patch_pixels> values{}, gradient_x{}, gradient_y{};
  float energy = 0;                                         // sum of the squared values
  Eigen::Matrix2f from_gradient = Eigen::Matrix2f::Zero();  // inverse of the sum of the gradients' squares
  float least_texture = 0;  // smaller eigenvalue of that sum, per pixel: squared grey levels per squared block
  // What a blur of one block takes away, less what gain, offset and shift explain of it; the sum of its squares; and by
  // how much of the values it is all in all.
  std::array<float, patch_pixels> detail{};
  float detail_energy = 0, detail_of_values = 0;

  float contrast() const;  // rms of the values, grey levels
};

// nullopt: it has no texture in some direction.
std::optional<Patch> make_patch(const Eigen::Vector2d& centre, const SeenPatch& seen);

struct Found {
  enum class Outcome : std::uint8_t { found, differs, outside };
  Outcome outcome = Outcome::outside;                // differs: what is there is something else
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // in blocks; of found
  float correlation = 0;                             // -1..1
  float contrast = 0;                                // rms of what is there now, grey levels
  float sigma = 0;                                   // of centre along each axis by the image's noise, blocks; of found
  // Of found: the detail that is lost, in units of what a blur of one block takes; below 0: there is more than there
  // was. Light's gain and offset, and the blur of reading between blocks, are taken out.
  float loss = 0, loss_sigma = 0;
};

// From `start` on, which should be right to about two blocks.
Found find(const Patch& patch, const Luma& luma, const Eigen::Vector2d& start);

// How like what is there, and not near it, is to the patch: -1..1, 0 where the image ends.
float correlation(const Patch& patch, const Luma& luma, const Eigen::Vector2d& centre);

// What a lens that is out of focus by that Gaussian blur shows of it. nullopt: as make_patch.
std::optional<Patch> blurred(const Patch& patch, double sigma_blocks);
// The Gaussian blur in blocks that takes that much of this patch's detail; 0 where there is more than there was.
double blur_of(const Patch& patch, double loss);

// The place within +-reach blocks around `start` where it fits best, to a block: to go on from with find().
// nullopt: nothing there is like it, or two places apart are as like.
std::optional<Eigen::Vector2d> search(const Patch& patch, const Luma& luma, const Eigen::Vector2d& start, int reach);

}  // namespace huetrack::room_watch
