// The place of a ball while something else is around it, as the hand that holds it: then its region is that of the part
// that is visible, and its edge partly another one's. The ball's radius is known, and each pixel near it says whether
// the ball may be there. It has the ball's colour; or it shows the background that is known there, so the ball is not
// in front of it; or something else, which is as likely in front of the ball as next to it. The likelihood of the
// disc's centre follows (room_colors.h).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "color/room_colors.h"
#include "object_tracking/target_views.h"
#include "outline/background.h"
#include "outline/picture.h"

namespace huetrack::object_tracking {

struct KnownBackground {
  const outline::Background* values;  // not null
  double noise_excess = 1;            // noise next to the ball over that of the background, as JPEG makes it; >= 1
};

struct DiscPlace {
  Eigen::Vector2d px;          // centre, raw pixels
  Eigen::Matrix2d covariance;  // px^2, by the likelihood of the pixels
  double bare = 0;  // 0..1, share of the disc that shows the background, of which a pillar in front is a part
};

// thread-compatible. Keeps its work space between frames.
class CoveredBall {
 public:
  // region: its centroid, raw pixels, and the radius of the disc that has the ball's colour. picture: the view's.
  // nullopt: there is nothing but the ball and its background, the picture is grey, or it does not have all pixels.
  std::optional<DiscPlace> measure(const TargetView& view, const outline::Picture& picture,
                                   const KnownBackground& behind, const color::Disc& region);

 private:
  // What every step-th pixel of a box shows; ring_of: only those in its ring, or nullptr. false: the picture does not
  // have them.
  bool look(const TargetView& view, const outline::Picture& picture, const KnownBackground& behind,
            const color::PixelBox& box, int step, const color::Disc* ring_of);
  bool is_something_around(const color::Disc& disc) const;

  struct Values {
    std::vector<float> light, blue, red;
    void resize(std::size_t n) { light.resize(n), blue.resize(n), red.resize(n); }
  };
  color::DiscFinder finder_;
  // Work space, per pixel.
  std::vector<int> u_, v_, sample_u_, sample_v_;  // of the pixel, and of its sample of chroma
  Values seen_, known_;
  std::vector<float> light_count_, chroma_count_;
  std::vector<std::int16_t> evidence_;  // that the ball is there, in units of 1 / RoomColors::evidence_unit
  std::vector<std::uint8_t> is_other_;  // neither the ball's colour, less the room's, nor the known background
};

}  // namespace huetrack::object_tracking
