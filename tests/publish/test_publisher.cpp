// test_publisher DOMAIN: publishes the known samples, the states in turn, every 20 ms, and the status once a second,
// until it is ended: what stands in for huetrackd where a test needs a publisher in another process.
#include <csignal>
#include <cstdlib>
#include <thread>

#include "publish/known_samples.h"

namespace {
volatile std::sig_atomic_t ended = 0;
}

int main(int argc, char** argv) {
  using namespace huetrack;
  if (argc != 2) return 2;
  std::signal(SIGTERM, [](int) { ended = 1; });
  publish::EstimatePublisherOptions options = publish::known_options(std::atoi(argv[1]));
  options.counts = {1, publish::known_count};
  publish::EstimatePublisher publisher(options);
  for (unsigned n = 0; !ended; ++n) {
    if (n % 50 == 0) {
      publisher.publish_status(publish::known_status());
      publisher.publish_times(publish::known_status().at, publish::known_times());
    }
    const object_tracking::TrackState state = publish::states[n % publish::states.size()];
    publisher.publish(0, publish::known_estimate(state), publish::captured_at(state), publish::received_at(state));
    constexpr auto tracking = object_tracking::TrackState::tracking;
    publisher.publish_set(1, publish::known_objects(), publish::captured_at(tracking), publish::received_at(tracking));
    const camera_tracking::CameraEstimate pose =
        publish::known_pose(publish::camera_states[n % publish::camera_states.size()]);
    publisher.publish(pose, pose.at, pose.at + std::chrono::milliseconds(3));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}
