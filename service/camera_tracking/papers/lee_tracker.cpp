#include "camera_tracking/papers/lee_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "camera_tracking/papers/paper_tracker_base.h"
#include "camera_tracking/parallel_task.h"

namespace huetrack::papers {

namespace {

// Section 3.6: frame n is tracked with the features of frame n - 2, while frame n - 1 is mapped in parallel.
class LeeTracker final : public PaperTrackerBase {
 public:
  LeeTracker(const calib::Camera& camera, const CameraTrackerOptions& options)
      : PaperTrackerBase(camera, options),
        tracking_(camera, tracking_options(options), options.seed),
        mapping_(camera, {}, options.seed) {
    if (auto stored = take_loaded()) {
      mapping_.start(*stored);
      features_ = mapping_.features();
    }
  }

  CameraTrackerInside inside() const override {
    CameraTrackerInside out;
    for (const LeeFeature& f : features_) {
      CameraTrackerInside::Feature x;
      x.position = f.position, x.covariance = f.covariance, x.given = f.given;
      x.found_px.setConstant(std::numeric_limits<float>::quiet_NaN());
      bool in_view = false;
      for (const LeeFrame::Match& m : last_.matches) {
        if (m.id == f.id)
          x.px = m.projected.cast<float>(), x.found_px = m.found.cast<float>(), x.search = m.cloud.cast<float>(),
          in_view = true;
      }
      if (!in_view) {
        const auto px = camera_.model.project(last_.cam_from_world * f.position);
        if (!px || !camera_.contains(*px)) continue;
        x.px = px->px.cast<float>();
      }
      out.features.push_back(x);
    }
    out.particles = particles().world_from_cameras(300);
    return out;
  }

  std::vector<CameraMapPoint> map() const override {
    std::vector<CameraMapPoint> out;
    for (const LeeFeature& f : features_) {  // ascending ids
      const auto is_it = [&](int id) { return id == f.id; };
      auto state = CameraMapPoint::State::not_sought;
      if (std::ranges::any_of(last_.matches, is_it, &LeeFrame::Match::id)) state = CameraMapPoint::State::found;
      if (std::ranges::any_of(last_.missed, is_it)) state = CameraMapPoint::State::missed;
      out.push_back({static_cast<std::uint32_t>(f.id), f.position, f.covariance, state, f.given});
    }
    return out;
  }

 private:
  static LeeTracking::Options tracking_options(const CameraTrackerOptions& options) {
    LeeTracking::Options o;
    if (options.particle_count > 0) o.particle_count = static_cast<std::size_t>(options.particle_count);
    if (options.as_printed) o.cloud_share = 1, o.polish = false, o.wider_unseen = 1;
    return o;
  }

  void start(const std::shared_ptr<const Pyramid>& pyramid, const StartResult& started, std::uint64_t number) override {
    last_ = {};
    last_.number = number, last_.pyramid = pyramid, last_.cam_from_world = started.pose.cam_from_world;
    mapping_.start(last_, started);
    features_ = mapping_.features();
    tracking_.start(last_.cam_from_world);
  }
  void restart(const calib::Rigid3d& cam_from_world) override { tracking_.start(cam_from_world); }
  const PoseParticles& particles() const override { return tracking_.particles(); }
  SceneMap scene() const override { return scene_of(features_); }

  FilteredPose track(const std::shared_ptr<const Pyramid>& pyramid, std::uint64_t number) override {
    const bool mapping = last_.tracked && may_map();
    if (mapping) mapper_.start([this] { mapping_.map(last_); });
    LeeFrame now = tracking_.track(number, pyramid, features_);
    if (mapping) {
      mapper_.wait();
      features_ = mapping_.features();
    }
    last_ = std::move(now);
    FilteredPose out{last_.tracked,
                     last_.cam_from_world,
                     tracking_.in_view(),
                     static_cast<int>(last_.matches.size()),
                     static_cast<int>(features_.size()),
                     0,
                     1,
                     {},
                     last_.polished};
    for (const LeeFrame::Match& m : last_.matches) {
      const auto f = std::ranges::lower_bound(features_, m.id, {}, &LeeFeature::id);
      if (f == features_.end() || f->id != m.id) continue;
      out.map_sigma_m =
          std::hypot(out.map_sigma_m, std::sqrt(f->covariance.trace() / static_cast<double>(last_.matches.size())));
      out.depth_m = f->depth;
      out.seen.push_back({f->position, m.found, 1});
    }
    return out;
  }

  LeeTracking tracking_;
  LeeMapping mapping_;  // used by mapper_ only while it runs, as is last_
  LeeFrame last_;
  std::vector<LeeFeature> features_;  // the copy for tracking_
  ParallelTask mapper_;               // last: destroyed first
};

}  // namespace

std::unique_ptr<CameraTracker> make_lee_tracker(const calib::Camera& camera, const CameraTrackerOptions& options) {
  return std::make_unique<LeeTracker>(camera, options);
}

}  // namespace huetrack::papers
