#include "pipeline/output.h"

namespace huetrack::pipeline {

pictures::PictureJob TrackedSet::picture(std::size_t particles) const {
  pictures::PictureJob job{frames, {estimates.begin(), estimates.end()}, {}};
  job.particles.reserve(trackers.size());
  for (const auto& tracker : trackers) job.particles.push_back(tracker.particles(particles));
  return job;
}

}  // namespace huetrack::pipeline
