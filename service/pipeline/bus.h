// The output to DDS: publishes positions and poses.
#pragma once

#include <vector>

#include "pipeline/output.h"
#include "pipeline/published_time.h"
#include "publish/estimate_publisher.h"

namespace huetrack::pipeline {

class Bus final : public Output {
 public:
  // Joins the domain and logs it. time: outlives this. throws as EstimatePublisher's constructor.
  Bus(const publish::EstimatePublisherOptions& options, const PublishedTime& time);

  void on_set(const TrackedSet& set) override;
  void on_camera_pose(const TrackedFrame& frame) override;

  publish::EstimatePublisher& publisher() { return publisher_; }
  const publish::EstimatePublisher& publisher() const { return publisher_; }
  // Write times of the last native sample of the last set. The tracking thread's.
  const publish::EstimatePublisher::Writing& last_writing() const { return writing_; }

 private:
  const PublishedTime& time_;
  const std::vector<int> counts_;  // by target, EstimatePublisherOptions::counts
  publish::EstimatePublisher publisher_;
  publish::EstimatePublisher::Writing writing_{};
};

}  // namespace huetrack::pipeline
