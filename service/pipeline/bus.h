// The output to DDS: positions and poses, as they come.
#pragma once

#include <vector>

#include "pipeline/output.h"
#include "pipeline/published_time.h"
#include "publish/estimate_publisher.h"

namespace huetrack::pipeline {

class Bus final : public Output {
 public:
  // Joins the bus, and says so in the log. throws as EstimatePublisher's constructor does. time: outlives this.
  Bus(const publish::EstimatePublisherOptions& options, const PublishedTime& time);

  void on_set(const TrackedSet& set) override;
  void on_camera_pose(const TrackedFrame& frame) override;

  publish::EstimatePublisher& publisher() { return publisher_; }
  const publish::EstimatePublisher& publisher() const { return publisher_; }
  // Of the last native sample of the last set. The tracking thread's.
  const publish::EstimatePublisher::Writing& last_writing() const { return writing_; }

 private:
  const PublishedTime& time_;
  const std::vector<int> counts_;  // by target, EstimatePublisherOptions::counts
  publish::EstimatePublisher publisher_;
  publish::EstimatePublisher::Writing writing_{};
};

}  // namespace huetrack::pipeline
