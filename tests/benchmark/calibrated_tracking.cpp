// How honest positions are by a rig that was really calibrated: views of a board before the recording's own cameras,
// with a stated noise, are solved anew for every seed, lenses and all; the recording is tracked with the rig that comes
// of it, with its uncertainty and without.
//   calibrated_tracking SETS NOISE_PX SEEDS FOLDER...      a FOLDER has recording, rig.yaml, groundtruth.csv, and
//                                                          huetrackd.yaml, or a target that is called lime
// prints NEES (3 is perfect) and the share inside the 95 % ellipsoid. The rig's world is turned and shifted to the true
// one, as well as a rigid motion can over the volume: where the world lies is nobody's error (calib/formats.md).
#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "benchmark/sequence.h"
#include "benchmark/tracking_figures.h"
#include "calib/model/median.h"
#include "calib/report/advice.h"
#include "calib/solver/extrinsics.h"
#include "calib/solver/volume_accuracy.h"
#include "calib/solver/world_frame.h"
#include "config/service_config.h"
#include "drawn.h"
#include "object_tracking/trackers/object_tracker.h"
#include "solver/synthetic_rig.h"

namespace {

using namespace huetrack;
using Eigen::Vector3d;

struct Honesty {
  double nees = 0, inside = 0, squares = 0;
  int samples = 0;
  void add(const object_tracking::ObjectEstimate& e, const Vector3d& truth) {
    const Vector3d off = e.position - truth;
    const double d2 = off.dot(e.covariance.inverse() * off);
    constexpr double chi2_95 = 7.815;  // three degrees of freedom
    nees += d2, inside += d2 <= chi2_95 ? 1 : 0, squares += off.squaredNorm(), ++samples;
  }
  void add(const Honesty& o) { nees += o.nees, inside += o.inside, squares += o.squares, samples += o.samples; }
  std::string text() const {
    const double n = std::max(1, samples);
    return fmt::format("rms {:5.2f} mm, NEES {:6.2f}, inside {:5.1f} %", 1e3 * std::sqrt(squares / n), nees / n,
                       100 * inside / n);
  }
};

// A board that is carried through the volume before these cameras, each time turned towards one of them.
std::vector<solver::BoardView> board_views(const calib::CameraRig& rig, const board::Board& board,
                                           const solver::WorldBox& box, int sets, double noise_px, unsigned seed) {
  std::mt19937_64 rng(seed);
  std::vector<solver::BoardView> views;
  Vector3d centre = Vector3d::Zero();
  for (int id = 0; id < board.point_count(); ++id) centre += board.point(id) / board.point_count();
  for (int set = 0; set < 200 && sets > 0; ++set) {
    const Vector3d share(solver::uniform(rng), solver::uniform(rng), solver::uniform(rng));
    const Vector3d place = box.low + (box.high - box.low).cwiseProduct(share);
    Vector3d to = Vector3d::Zero();
    for (const calib::Camera& camera : rig.cameras)
      to += (0.5 + solver::uniform(rng)) * (camera.centre() - place).normalized();
    // The board's z points away from who looks at it, its rows are about level.
    Eigen::Matrix3d facing;
    facing.col(2) = -to.normalized();
    facing.col(0) = Vector3d::UnitZ().cross(facing.col(2)).normalized();
    facing.col(1) = facing.col(2).cross(facing.col(0));
    const Vector3d tilt =
        0.6 * Vector3d(2 * solver::uniform(rng) - 1, 2 * solver::uniform(rng) - 1, 2 * solver::uniform(rng) - 1);
    const Eigen::Quaterniond turn = Eigen::AngleAxisd(tilt.norm(), tilt.normalized()) * Eigen::Quaterniond(facing);
    const calib::Rigid3d world_from_board{turn, place - turn * centre};
    std::vector<solver::BoardView> of_set;
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      solver::BoardView view{static_cast<int>(c), set, rig.cameras[c].name + " " + std::to_string(set), {}, {}};
      for (int id = 0; id < board.point_count(); ++id) {
        const auto px = rig.cameras[c].project_world(world_from_board * board.point(id));
        if (!px || !rig.cameras[c].contains(*px)) break;
        view.ids.push_back(id);
        view.px.push_back(px->px + noise_px * drawn<2>(rng, solver::normal));
      }
      if (static_cast<int>(view.ids.size()) == board.point_count()) of_set.push_back(view);
    }
    if (of_set.size() < 2) continue;
    views.insert(views.end(), of_set.begin(), of_set.end());
    --sets;
  }
  return views;
}

// Places of the volume, and where the found rig says they are.
struct Places {
  std::vector<Vector3d> by_found, truly;
};
Places places_by(const calib::CameraRig& found, const calib::CameraRig& truth, const solver::WorldBox& box) {
  Places out;
  for (int k = 0; k < 343; ++k) {
    const Vector3d p = box.low + (box.high - box.low).cwiseProduct(Vector3d(k % 7, k / 7 % 7, k / 49) / 6);
    std::vector<std::pair<int, Eigen::Vector2d>> pixels;
    for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
      const auto px = truth.cameras[c].project_world(p);
      if (px && truth.cameras[c].contains(*px)) pixels.emplace_back(static_cast<int>(c), px->px);
    }
    if (pixels.size() < 2) continue;
    out.by_found.push_back(solver::triangulate(found, pixels));
    out.truly.push_back(p);
  }
  return out;
}

// In the world of the true rig, as well as a rigid motion finds it for the places of the volume.
calib::CameraRig in_true_world(const calib::CameraRig& found, const calib::CameraRig& truth,
                               const solver::WorldBox& box) {
  const Places places = places_by(found, truth, box);
  return solver::in_world(found, solver::align_points(places.by_found, places.truly, false));
}

double median_off_m(const calib::CameraRig& found, const calib::CameraRig& truth, const solver::WorldBox& box) {
  const Places places = places_by(found, truth, box);
  std::vector<double> off_m;
  for (std::size_t k = 0; k < places.truly.size(); ++k) off_m.push_back((places.by_found[k] - places.truly[k]).norm());
  return calib::median(std::move(off_m));
}

struct Subject {
  figures::Sequence sequence;
  object_tracking::TargetOptions target;
  object_tracking::ObjectTrackerOptions options;
};

Subject subject_of(const std::filesystem::path& folder) {
  Subject s{figures::load_sequence(folder), figures::lime_ball(),
            figures::rendered_options(object_tracking::Observation::huetrack, 1)};
  if (std::filesystem::exists(folder / "huetrackd.yaml")) {
    const config::ServiceConfig config = config::load_service_config(folder / "huetrackd.yaml");
    s.target = config.targets.front();
    s.options = config.object_tracking;
  }
  return s;
}

Honesty track(const Subject& subject, const calib::CameraRig& rig) {
  Honesty out;
  object_trackers::ObjectTracker tracker(rig, subject.target, subject.options);
  for (const capture::FrameSet& set : subject.sequence.sets) {
    const auto estimate = tracker.update(set);
    const auto truth = subject.sequence.row(subject.target.name, estimate.at);
    if (estimate.has_position() && truth) out.add(estimate, truth->position);
  }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 5) return 1;
  const int sets = std::atoi(argv[1]), seeds = std::atoi(argv[3]);
  const double noise_px = std::atof(argv[2]);
  board::Board board;
  board.columns = 9, board.rows = 6, board.pitch = {0.06, 0.06};
  Honesty with, without;
  for (int f = 4; f < argc; ++f) {
    const Subject subject = subject_of(argv[f]);
    const calib::CameraRig& truth = subject.sequence.rig;
    const Vector3d middle = (subject.options.volume.min + subject.options.volume.max) / 2;
    const solver::WorldBox box{middle - Vector3d(0.5, 0.5, 0.4), middle + Vector3d(0.5, 0.5, 0.4)};
    Honesty exact_rig = track(subject, truth);
    fmt::print("{}: by the true rig {}\n", argv[f], exact_rig.text());
    for (int seed = 1; seed <= seeds; ++seed) {
      std::vector<solver::CameraToCalibrate> cameras;
      for (const calib::Camera& camera : truth.cameras)
        cameras.push_back({camera.name, camera.image_size, std::nullopt, camera.timing});
      calib::CameraRig rig;
      double expected_m = 0, really_m = 0;
      try {
        auto found = solver::calibrate_extrinsics(
            board, cameras, board_views(truth, board, box, sets, noise_px, static_cast<unsigned>(seed)));
        const calib::CameraRig aligned = in_true_world(solver::rig_of(found.adjustment), truth, box);
        for (std::size_t c = 0; c < aligned.cameras.size(); ++c)
          found.adjustment.cameras[c].cam_from_world = aligned.cameras[c].cam_from_world;
        const solver::VolumeAccuracy volume = solver::predict_accuracy(found.adjustment, box, {9, 9, 7});
        expected_m = volume.median_by_calibration_m;
        really_m = median_off_m(aligned, truth, box);
        rig = aligned;
        rig.uncertainty = solver::uncertainty_of(found.adjustment, volume);
      } catch (const solver::CalibrationError& error) {
        fmt::print("  calibration {:2}: {}\n", seed, report::with_advice(error));
        continue;
      }
      const Honesty a = track(subject, rig);
      rig.uncertainty.reset();
      const Honesty b = track(subject, rig);
      fmt::print("  calibration {:2}, {:.2f} mm expected, {:.2f} really: {}; without {}\n", seed, 1e3 * expected_m,
                 1e3 * really_m, a.text(), b.text());
      with.add(a), without.add(b);
    }
  }
  fmt::print("all: {}; without {}\n", with.text(), without.text());
}
