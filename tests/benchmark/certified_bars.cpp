// How much of the true length errors a certificate's expanded uncertainty covers, over good and bad rigs: a bar with
// two balls is rendered twice before the same cameras, on two paths; the first recording is certified, the second one
// tells whether the certificate holds. The tracker has a rig that is off from the cameras: by a draw from the rig
// file's own covariance, or by a mistake.
//   certified_bars RIG.yaml [SEEDS] [two | one]    colours; default: both
#include <fmt/core.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdlib>

#include "calib/certify/certificate.h"
#include "calib/certify/one_color_bar.h"
#include "calib/model/lens_derivatives.h"
#include "calib/model/rig_yaml.h"
#include "certify/covered_by.h"
#include "model/rig_with_errors.h"
#include "object_tracking/trackers/object_tracker.h"
#include "particle_filter/random.h"
#include "scene/scene.h"

namespace {

using namespace huetrack;
using Eigen::Vector3d;

constexpr double length_m = 0.3;

Eigen::VectorXd normals(Eigen::Index count, std::uint64_t seed) {
  particle_filter::Rng rng(23, seed);
  std::vector<float> unit(static_cast<std::size_t>(count));
  rng.fill_normal(unit);
  Eigen::VectorXd out(count);
  for (Eigen::Index k = 0; k < count; ++k) out(k) = static_cast<double>(unit[static_cast<std::size_t>(k)]);
  return out;
}

Vector3d middle_of(const calib::CameraRig& rig) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const calib::Camera& camera : rig.cameras) {
    const Vector3d axis = camera.cam_from_world.rotation.conjugate() * Vector3d::UnitZ();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    sum += across;
    right += across * camera.centre();
  }
  return sum.inverse() * right;
}

// A bar that is carried through the volume, and turned.
struct Bar {
  Vector3d middle;
  double phase = 0;
  Vector3d end(double t, double sign) const {
    const Vector3d at = middle + Vector3d(0.5 * std::sin(0.61 * t + phase), 0.5 * std::cos(0.47 * t + 2 * phase),
                                          0.35 * std::sin(0.83 * t - phase));
    const double heading = 0.71 * t + phase, rise = 1.1 * std::sin(0.53 * t + 3 * phase);
    const Vector3d along(std::cos(heading) * std::cos(rise), std::sin(heading) * std::cos(rise), std::sin(rise));
    return at + sign * length_m / 2 * along;
  }
};

struct Recorded {
  std::vector<capture::FrameSet> sets;
  object_tracking::ObjectTrackerOptions options;
};

Recorded recorded(const calib::CameraRig& cameras, const Bar& bar, bool is_one_color, std::uint64_t seed,
                  double seconds) {
  scene::SceneBuilder builder;
  for (const calib::Camera& camera : cameras.cameras) builder.camera(camera);
  builder.ball({.name = "lime", .path = [=](double t) { return bar.end(t, -1); }});
  scene::BallOptions other{.name = "other", .path = [=](double t) { return bar.end(t, 1); }};
  if (!is_one_color) other.rgb = {0.90, 0.25, 0.60};
  builder.ball(other);
  Recorded out;
  out.sets = scene::render(builder.build(), {.set_count = static_cast<int>(30 * seconds), .seed = seed});
  out.options.volume = {bar.middle - Vector3d(1.1, 1.1, 1), bar.middle + Vector3d(1.1, 1.1, 1)};
  out.options.seed = seed;
  return out;
}

void note(const object_tracking::ObjectEstimate& e, certify::BallTrack& track) {
  if (e.state == object_tracking::TrackState::tracking)
    track.push_back({e.set_number, capture::seconds(e.at), e.position, e.velocity, e.covariance});
}

object_tracking::TargetOptions lime() {
  object_tracking::TargetOptions target;
  target.name = "lime", target.color = {70, 115, 0.3, 1, 0.1, 0.95};
  return target;
}

certify::OneColorBar of_two_colors(const calib::CameraRig& rig, const Recorded& recording) {
  object_tracking::TargetOptions pink;
  pink.name = "pink", pink.color = {310, 345, 0.3, 1, 0.1, 0.95};
  object_trackers::ObjectTracker a(rig, lime(), recording.options), b(rig, pink, recording.options);
  std::array<certify::BallTrack, 2> tracks;
  for (const auto& set : recording.sets) {
    note(a.update(set), tracks[0]);
    note(b.update(set), tracks[1]);
  }
  certify::OneColorBar out;
  out.lengths = certify::bar_lengths(tracks[0], tracks[1], length_m, rig);
  return out;
}

certify::OneColorBar of_one_color(const calib::CameraRig& rig, const Recorded& recording) {
  object_tracking::TargetOptions target = lime();
  target.count = 2;
  object_trackers::ObjectTracker tracker(rig, target, recording.options);
  std::vector<certify::BallTrack> tracks;
  std::set<std::uint64_t> sets_with_third;
  std::vector<object_tracking::ObjectEstimate> estimates;
  for (const auto& set : recording.sets) {
    tracker.update(set, estimates);
    if (tracker.further_object()) sets_with_third.insert(set.number);
    for (const auto& e : estimates) {
      tracks.resize(std::max<std::size_t>(tracks.size(), e.object + 1));
      note(e, tracks[e.object]);
    }
  }
  return certify::one_color_bar(tracks, sets_with_third, length_m, rig);
}

certify::OneColorBar measured(const calib::CameraRig& cameras, const calib::CameraRig& rig, const Bar& bar,
                              bool is_one_color, std::uint64_t seed, double seconds) {
  const Recorded recording = recorded(cameras, bar, is_one_color, seed, seconds);
  return is_one_color ? of_one_color(rig, recording) : of_two_colors(rig, recording);
}

struct Fault {
  const char* name;
  calib::CameraRig (*make)(const calib::CameraRig&, std::uint64_t);
};
const Fault faults[] = {{"draw",
                         [](const calib::CameraRig& r, std::uint64_t seed) {
                           return calib::with_errors(r, r.uncertainty->factor() * normals(r.uncertainty->size(), seed));
                         }},
                        {"turned",
                         [](const calib::CameraRig& r, std::uint64_t seed) {  // one camera, by about 0.3 degrees
                           calib::CameraRig out = r;
                           calib::Tangent6d turn = calib::Tangent6d::Zero();
                           turn.head<3>() = 3e-3 * normals(3, seed);
                           calib::Camera& camera = out.cameras[seed % out.cameras.size()];
                           camera.cam_from_world = calib::exp(turn) * camera.cam_from_world;
                           return out;
                         }},
                        {"scaled",
                         [](const calib::CameraRig& r, std::uint64_t seed) {  // the board's squares were measured wrong
                           calib::CameraRig out = r;
                           const double scale = 1 + 0.01 * normals(1, seed)(0);
                           for (calib::Camera& camera : out.cameras) camera.cam_from_world.translation *= scale;
                           return out;
                         }},
                        {"focal", [](const calib::CameraRig& r, std::uint64_t seed) {  // somebody touched a zoom
                           calib::CameraRig out = r;
                           calib::Camera& camera = out.cameras[seed % out.cameras.size()];
                           calib::LensParameters lens = calib::parameters_of(camera.model);
                           lens.head<2>() *= 1 + 0.01 * normals(1, seed)(0);
                           camera.model = calib::model_like(camera.model, lens);
                           return out;
                         }}};

// Of the lengths of the second recordings, by all rigs.
void certify_bars(const calib::CameraRig& rig, int seeds, bool is_one_color) {
  double covered = 0, stated = 0;
  int runs = 0;
  for (const Fault& fault : faults) {
    double of_fault = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      const auto s = static_cast<std::uint64_t>(seed);
      const calib::CameraRig cameras = fault.make(rig, s);
      const Vector3d middle = middle_of(cameras);
      const certify::OneColorBar first = measured(cameras, rig, {middle, 0.9 * seed}, is_one_color, 2 * s, 40);
      const certify::OneColorBar second =
          measured(cameras, rig, {middle, 0.9 * seed + 2.2}, is_one_color, 2 * s + 1, 25);
      const certify::Certificate c = certify::certificate_of(first.lengths, 0);
      const double share = certify::covered_by(c.expanded_m, second.lengths);
      fmt::print(
          "{:7} {:2}: {} lengths, {} of their own, expanded {:5.2f} mm (stated {:5.2f}), rms {:5.2f}, mean {:+5.2f}; "
          "inside what was stated {:5.1f} %, of the second recording covered {:5.1f} %",
          fault.name, seed, c.lengths, c.independent, 1e3 * c.expanded_m, 1e3 * c.stated_expanded_m, 1e3 * c.rms_m,
          1e3 * c.mean_m, 100 * c.inside_stated, 100 * share);
      if (is_one_color)
        fmt::print("; one ball alone {} + {}, a third object {} + {}, not the bar {} + {}", first.only_one,
                   second.only_one, first.with_third, second.with_third, first.others.size(), second.others.size());
      fmt::print("\n");
      of_fault += share, covered += share, stated += c.inside_stated, ++runs;
    }
    fmt::print("{:7}: covered {:.1f} %\n", fault.name, 100 * of_fault / seeds);
  }
  fmt::print("{}: covered {:.1f} %; inside what the covariances stated {:.1f} %\n",
             is_one_color ? "one colour" : "two colours", 100 * covered / runs, 100 * stated / runs);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 1;
  const calib::CameraRig rig = calib::read_rig(argv[1]);
  const int seeds = argc > 2 ? std::atoi(argv[2]) : 5;
  const std::string_view colors = argc > 3 ? argv[3] : "";
  if (!rig.uncertainty) return 1;
  if (colors != "one") certify_bars(rig, seeds, false);
  if (colors != "two") certify_bars(rig, seeds, true);
}
