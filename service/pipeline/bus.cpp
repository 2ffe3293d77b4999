#include "pipeline/bus.h"

#include <spdlog/spdlog.h>

#include "capture/timing/capture_clock.h"

namespace huetrack::pipeline {

Bus::Bus(const publish::EstimatePublisherOptions& options, const PublishedTime& time)
    : time_(time), counts_(options.counts), publisher_(options) {
  spdlog::info("publishing on {}", publisher_.description());
}

void Bus::on_set(const TrackedSet& set) {
  const capture::Timestamp now = capture::unix_now();
  writing_ = {now, now};  // kept if nothing is written
  for (const auto& estimate : set.estimates)
    publisher_.publish(estimate.target, estimate, time_.of(estimate.at), set.received_at, &writing_);
  for (std::size_t t = 0, begin = 0; t < counts_.size(); ++t) {
    std::size_t end = begin;
    while (end < set.estimates.size() && set.estimates[end].target == t) ++end;
    if (counts_[t] > 1)
      publisher_.publish_set(t, set.estimates.subspan(begin, end - begin), time_.of(set.frames.at), set.received_at);
    begin = end;
  }
}

void Bus::on_camera_pose(const TrackedFrame& frame) {
  publisher_.publish(frame.estimate, time_.of(frame.estimate.at), frame.received_at);
}

}  // namespace huetrack::pipeline
