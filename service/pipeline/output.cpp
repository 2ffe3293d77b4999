#include "pipeline/output.h"

namespace huetrack::pipeline {

pictures::PictureJob TrackedSet::picture(std::size_t particles) const {
  pictures::PictureJob job{frames, {estimates.begin(), estimates.end()}, {}, {}};
  constexpr double worth_a_frame = 0.001;  // layout: of a drawing; least share of the image that gets a box
  for (std::size_t t = 0; t < trackers.size(); ++t) {
    const auto shares = trackers[t].color_shares();
    for (std::size_t c = 0; c < shares.size(); ++c)
      if (shares[c].still >= worth_a_frame) job.still.push_back({t, int(c), shares[c].still_box});
  }
  job.particles.reserve(trackers.size());
  for (const auto& tracker : trackers) job.particles.push_back(tracker.particles(particles));
  return job;
}

}  // namespace huetrack::pipeline
