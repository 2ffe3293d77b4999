// Latencies and counts of `run`, for metrics and status.
#pragma once

#include <atomic>
#include <span>
#include <vector>

#include "metrics/metrics.h"
#include "pipeline/bus.h"
#include "pipeline/output.h"

namespace huetrack::metrics {

// Add it to the session after the bus. Getters: any thread.
class PipelineMeter final : public pipeline::Output {
 public:
  // cameras: of the rig; bus: null without DDS
  PipelineMeter(std::size_t cameras, std::size_t targets, const pipeline::Bus* bus);

  void on_frame(const capture::Frame& frame, capture::Timestamp received_at) override {
    capture_to_dequeue_[std::size_t(frame.camera)].add(received_at - frame.captured_at);
  }
  void on_set(const pipeline::TrackedSet& set) override;

  std::vector<TargetFigures> targets() const;
  LatencyFigures latencies() const;

 private:
  void count_objects(std::span<const object_tracking::ObjectEstimate> estimates);

  struct Target {
    std::atomic<object_tracking::TrackState> state = object_tracking::TrackState::searching;
    std::atomic<double> effective_sample_size = 0;
    std::atomic<int> particles = 0;
    std::atomic<int> tracked = 0, coasting = 0;
    std::atomic<std::uint64_t> found = 0;
    std::atomic<std::uint32_t> mistakes = 0;  // one bit per kind
  };
  const pipeline::Bus* const bus_;
  std::vector<Target> targets_;
  std::vector<LatencyHistogram> capture_to_dequeue_;
  LatencyHistogram dequeue_to_write_, dequeue_to_publish_, capture_to_publish_;
};

}  // namespace huetrack::metrics
