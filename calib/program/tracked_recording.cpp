#include "calib/program/tracked_recording.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <initializer_list>
#include <memory>
#include <thread>

#include "calib/gather/picture_source.h"
#include "pipeline/session.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"
#include "reports/mistake_report.h"
#include "reports/rig_report.h"

namespace huetrack::program {
namespace {

class Collector final : public pipeline::Output {
 public:
  Collector(const std::vector<object_tracking::TargetOptions>& targets, Tracked& out) : targets_(targets), out_(out) {}
  void on_set(const pipeline::TrackedSet& set) override {
    ++out_.sets;
    const bool is_complete =
        std::ranges::all_of(set.frames.frames, [](const auto& frame) { return frame.has_value(); });
    out_.incomplete += is_complete ? 0 : 1;
    for (const auto& e : set.estimates)
      out_.estimates[object_tracking::object_name(targets_[e.target].name, e.object)].push_back(e);
    for (std::size_t t = 0; t < set.trackers.size(); ++t)
      if (set.trackers[t].further_object()) out_.further[targets_[t].name].insert(set.frames.number);
  }

 private:
  const std::vector<object_tracking::TargetOptions>& targets_;
  Tracked& out_;
};

}  // namespace

Tracked tracked(const config::ServiceConfig& config, const std::string& file, const std::stop_token& stop) {
  const recordings::Recording recording = recordings::read_recording(file);
  for (const auto& warning : recording.warnings) std::printf("note: %s\n", warning.c_str());
  auto source = std::make_unique<recordings::ReplaySource>(
      recording, config.rig.camera_names(),
      recordings::ReplayOptions{.decoder_threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency())),
                                .timing = config::frame_timing(config.rig),
                                .takes_matches = true});
  pipeline::SessionSources sources;
  std::vector<pipeline::SessionCamera> known;
  for (const recordings::ReplayCamera& camera : source->cameras())
    known.push_back({.camera = static_cast<int>(known.size()),
                     .period = camera.frame_period,
                     .pixels = pipeline::SessionCamera::Pixels{camera.format, camera.range}});
  sources.cameras = [known] { return known; };
  sources.is_ascending = std::ranges::all_of(
      recording.cameras, [](const auto& camera) { return camera.received.empty() && camera.corrupted.empty(); });
  sources.sources.push_back(std::move(source));
  Tracked out;
  pipeline::Session session(config, std::move(sources), {});
  Collector collector(config.targets, out);
  reports::RigReport cameras(config);
  reports::MistakeReport mistakes(config, true);
  for (pipeline::Output* output : std::initializer_list<pipeline::Output*>{&collector, &cameras, &mistakes})
    session.add(*output);
  const auto began = std::chrono::steady_clock::now();
  session.run(stop);
  if (stop.stop_requested()) throw gather::InputError("stopped");
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - began;
  if (out.sets > 0) out.set_ms = took.count() / static_cast<double>(out.sets);
  for (const auto& sentences : {cameras.summary(), mistakes.summary()})
    out.named.insert(out.named.end(), sentences.begin(), sentences.end());
  return out;
}

}  // namespace huetrack::program
