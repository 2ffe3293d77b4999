#include "pipeline/bus.h"

#include <spdlog/spdlog.h>

#include "capture/capture_clock.h"

namespace huetrack::pipeline {

Bus::Bus(const publish::EstimatePublisherOptions& options, const PublishedTime& time)
    : time_(time), publisher_(options) {
  spdlog::info("publishing on {}", publisher_.description());
}

void Bus::on_set(const TrackedSet& set) {
  const capture::Timestamp now = capture::unix_now();
  writing_ = {now, now};  // it stays so where nothing can be written
  for (const auto& estimate : set.estimates)
    publisher_.publish(estimate.target, estimate, time_.of(estimate.at), set.received_at, &writing_);
}

void Bus::on_camera_pose(const TrackedFrame& frame) {
  publisher_.publish(frame.estimate, time_.of(frame.estimate.at), frame.received_at);
}

}  // namespace huetrack::pipeline
