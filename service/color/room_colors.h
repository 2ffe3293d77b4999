// Where a disc of a target's colour stands out in a room that shares the colour. Every matching pixel has an evidence,
//
//   log p(pixel | target) - log p(pixel | room),
//
// where the target's colours are uniform over its range, and the room's are counted: how often each bin of raw colours
// is seen in this view. A vivid ball on a wooden table of its hue has colours that hardly any other pixel has.
// Where the usual value of a pixel is known, and it shows another one, that value disturbed is part of the room, too.
// The model is that of histogram back-projection (Swain and Ballard 1991) with a likelihood ratio (Jones and Rehg
// 2002).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "color/color_model.h"
#include "color/color_region.h"
#include "color/color_window.h"

namespace huetrack::color {

// A disc in raw pixels.
struct Disc {
  Eigen::Vector2d px;
  double radius_px;
};

// thread-compatible; one per view and target.
class RoomColors {
 public:
  static constexpr int steps = 12;  // layout: bins per channel, over the extent of the target's colours

  // Counts the pixels of the view's frame that match now, but for those in `objects`. Colours that were counted for
  // another table are forgotten. The frame has pixels. memory_samples: calls of which the counts are the mean.
  void learn(MatchBits& view, const ColorTable& table, capture::PixelFormat format, std::span<const Disc> objects,
             int memory_samples);
  // Natural logarithm of a matching pixel's odds, in units of 1 / evidence_unit. After learn().
  std::int16_t evidence(const MatchBits& view, int u, int v) const;
  static std::int16_t evidence_of_no_match();
  // The same of any pixel near an object, in every room: 0 where it does not match, and less the more the pixel is as
  // the background that is known there; as_background: log p(pixel | background) - log p(pixel | anything), 0: it is
  // not.
  static std::int16_t evidence_near_object(const MatchBits& view, int u, int v, bool matches, double as_background);
  static double hidden_share();                // of an object's pixels, on average
  static constexpr double evidence_unit = 16;  // layout

 private:
  static constexpr std::size_t bins = std::size_t(steps) * steps * steps;
  std::size_t bin(const std::array<std::uint8_t, 3>& raw) const;

  std::array<std::uint8_t, 3> least_{}, most_{};  // extent of the target's colours
  std::vector<float> seen_;                       // pixels per frame, per bin
  std::vector<float> now_;                        // work space of learn()
  double samples_ = 0;                            // in seen_
  double colors_ = 1;                             // raw ones that are the target's
  std::vector<std::int16_t> evidence_;            // per bin
};

// thread-compatible. Keeps its work space between frames.
class DiscFinder {
 public:
  // Discs of radii from smallest_px to largest_px that stand out from what is around them, best first: their centres'
  // mean and covariance by the likelihood of their pixels; area and spread: of the pixels that stand out.
  // view.room() is not null. Valid until the next call.
  const std::vector<ColorRegion>& find(MatchBits& view, PixelBox box, double smallest_px, double largest_px);

  // Mean and covariance of the centre of the disc near `start` of which the evidence of the box's pixels is: row by
  // row, in units of 1 / RoomColors::evidence_unit. The box lies in the picture. Its area is 0 where no pixel speaks
  // for it.
  ColorRegion measure(PixelBox box, std::span<const std::int16_t> evidence, const Disc& start);

  // The ring around a disc in which nothing should stand out; its outer radius in those of the disc.
  static double ring_to();
  static bool is_in_ring(const Disc& disc, const Eigen::Vector2d& px);

 private:
  struct Peak {
    double score;
    Disc disc;
  };
  void weigh(MatchBits& view, const PixelBox& box);
  void sum_up();
  double sum(double u0, double v0, double u1, double v1) const;  // of evidence_, relative to the box
  double score(double u, double v, double radius_px) const;
  static double most_score(double radius_px);
  void find_peaks(double radius_px, double least);
  double of_disc(const Disc& disc) const;  // logarithm of its likelihood, up to a constant
  ColorRegion measured(Disc disc) const;

  PixelBox box_{0, 0, -1, -1};
  int width_ = 0, height_ = 0;          // of the box
  std::vector<std::int16_t> evidence_;  // per pixel of the box
  std::vector<std::int32_t> sums_;      // of the pixels above and left of a corner
  std::vector<float> scores_;           // work space: of one radius
  std::vector<Peak> peaks_;
  std::vector<ColorRegion> regions_;
};

}  // namespace huetrack::color
