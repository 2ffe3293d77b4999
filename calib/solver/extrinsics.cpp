#include "calib/solver/extrinsics.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <future>
#include <limits>
#include <map>
#include <mutex>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

#include "calib/model/cross_matrix.h"
#include "calib/model/index.h"
#include "calib/model/median.h"
#include "calib/solver/adjustment_steps.h"
#include "calib/solver/ray_uncertainty.h"
#include "calib/solver/umeyama.h"

namespace huetrack::solver {
namespace {

using calib::index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;

// The rigid motion of the board that renumbers its points: point(symmetry[id]) = motion * point(id).
calib::Rigid3d motion_of(const board::Board& board, const std::vector<int>& symmetry) {
  Eigen::Matrix3Xd from(3, board.point_count()), to(3, board.point_count());
  for (int id = 0; id < board.point_count(); ++id) {
    from.col(id) = board.point(id);
    to.col(id) = board.point(symmetry[index(id)]);
  }
  const Eigen::Matrix4d t = umeyama(from, to, false);
  return {Eigen::Quaterniond(Eigen::Matrix3d(t.topLeftCorner<3, 3>())).normalized(), t.topRightCorner<3, 1>()};
}

// A view with its one or two candidate poses of the board, for the numbering as detected.
struct PosedView {
  const BoardView* view = nullptr;
  std::vector<BoardPose> poses;
  std::vector<std::size_t> corners;  // a few far apart, enough to score a pose
};

std::vector<std::size_t> far_corners(const board::Board& board, const BoardView& view) {
  std::set<std::size_t> chosen;
  for (const Vector2d& direction : {Vector2d{1, 1}, {1, -1}, {-1, 1}, {-1, -1}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
    std::size_t best = 0;
    for (std::size_t k = 1; k < view.ids.size(); ++k) {
      if (direction.dot(board.point(view.ids[k]).head<2>()) > direction.dot(board.point(view.ids[best]).head<2>()))
        best = k;
    }
    chosen.insert(best);
  }
  return {chosen.begin(), chosen.end()};
}

// The starting point of a joint adjustment: camera poses from consistent pairs, then board poses.
class Start {
 public:
  Start(const board::Board& board, const std::vector<AdjustedCamera>& cameras, const std::vector<BoardView>& views)
      : board_(board), cameras_(cameras) {
    for (const auto& symmetry : board.symmetries()) motions_.push_back(motion_of(board, symmetry));
    for (const BoardView& view : views) {
      const AdjustedCamera& camera = cameras[index(view.camera)];
      PosedView posed{&view, board_poses(board, view, camera.lens, camera.parameters), far_corners(board, view)};
      if (!posed.poses.empty()) sets_[view.set][view.camera] = std::move(posed);
    }
  }

  struct Link {
    CameraPair pair;
    calib::Rigid3d b_from_a;
  };

  // nullopt: no shared view.
  std::optional<Link> link(int a, int b) const {
    SharedViews shared;
    for (const auto& [set, views] : sets_) {
      const auto in_a = views.find(a), in_b = views.find(b);
      if (in_a != views.end() && in_b != views.end()) shared.emplace_back(&in_a->second, &in_b->second);
    }
    if (shared.empty()) return std::nullopt;
    Link best{{a, b, static_cast<int>(shared.size()), 0, 0, 0}, {}};
    // Every shared set proposes a relative pose; the one with most inlier sets wins.
    constexpr std::size_t most = 40;
    SharedViews some;
    for (std::size_t k = 0; k < std::min(most, shared.size()); ++k)
      some.push_back(shared[k * shared.size() / std::min(most, shared.size())]);
    best.pair.compared_sets = static_cast<int>(some.size());
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [from, to] : some) {
      for (const BoardPose& pose_a : from->poses) {
        for (const BoardPose& pose_b : to->poses) {
          for (const calib::Rigid3d& motion : motions_) {
            const calib::Rigid3d b_from_a = pose_b.cam_from_board * motion * calib::inverse(pose_a.cam_from_board);
            const auto [cost, consistent] = agreement(some, b_from_a, limit_px(b));
            if (cost >= least) continue;
            least = cost;
            best.b_from_a = b_from_a;
            best.pair.consistent_sets = consistent;
          }
        }
      }
    }
    return best;
  }

  // Board poses for these camera poses, with the views of each set renumbered consistently. Views that no pose explains
  // keep their numbering: outlier rejection removes them.
  Adjustment placed(const std::vector<AdjustedCamera>& cameras) const {
    Adjustment a;
    a.board = board_;
    a.cameras = cameras;
    const auto symmetries = board_.symmetries();
    const int last = sets_.empty() ? -1 : sets_.rbegin()->first;
    a.world_from_board.resize(index(last + 1));
    for (const auto& [set, views] : sets_) {
      calib::Rigid3d best;
      double least = std::numeric_limits<double>::infinity();
      for (const auto& [camera, posed] : views) {
        for (const BoardPose& pose : posed.poses) {
          const calib::Rigid3d world_from_board =
              calib::inverse(cameras[index(camera)].cam_from_world) * pose.cam_from_board;
          double cost = 0;
          for (const auto& [other, seen] : views) {
            cost +=
                std::min(off_px(seen, cameras[index(other)].cam_from_world * world_from_board), 4 * limit_px(other));
          }
          if (cost < least) {
            least = cost;
            best = world_from_board;
          }
        }
      }
      if (set > 0) best = as_before(best, a.world_from_board[index(set - 1)]);
      a.world_from_board[index(set)] = best;
      for (const auto& [camera, posed] : views) {
        BoardView view = *posed.view;
        const std::size_t numbering = best_motion(posed, cameras[index(camera)].cam_from_world * best).first;
        if (numbering > 0) {
          for (int& id : view.ids) id = symmetries[numbering][index(id)];
          board::sort_corners(view.ids, view.px);
        }
        a.views.push_back(std::move(view));
      }
    }
    return a;
  }

  // Centres of the board in both cameras' frames, for shared sets.
  std::pair<Eigen::Matrix3Xd, Eigen::Matrix3Xd> centres(int a, int b) const {
    Vector3d centre = Vector3d::Zero();
    for (int id = 0; id < board_.point_count(); ++id) centre += board_.point(id) / board_.point_count();
    std::vector<Vector3d> in_a, in_b;
    for (const auto& [set, views] : sets_) {
      const auto at_a = views.find(a), at_b = views.find(b);
      if (at_a == views.end() || at_b == views.end()) continue;
      in_a.push_back(at_a->second.poses.front().cam_from_board * centre);
      in_b.push_back(at_b->second.poses.front().cam_from_board * centre);
    }
    const auto matrix = [](const std::vector<Vector3d>& points) {
      Eigen::Matrix3Xd m(3, points.size());
      for (std::size_t k = 0; k < points.size(); ++k) m.col(static_cast<Eigen::Index>(k)) = points[k];
      return m;
    };
    return {matrix(in_a), matrix(in_b)};
  }

 private:
  // Among symmetric numberings, the one with the least rotation since the previous set.
  calib::Rigid3d as_before(const calib::Rigid3d& world_from_board, const calib::Rigid3d& before) const {
    calib::Rigid3d best = world_from_board;
    double least = std::numeric_limits<double>::infinity();
    for (const calib::Rigid3d& motion : motions_) {
      const calib::Rigid3d pose = world_from_board * motion;
      const double turn = before.rotation.angularDistance(pose.rotation);
      if (turn < least) {
        least = turn;
        best = pose;
      }
    }
    return best;
  }

  using SharedViews = std::vector<std::pair<const PosedView*, const PosedView*>>;  // of two cameras, by sets

  // Robust cost of a relative pose over the shared sets, and the number of inlier sets.
  std::pair<double, int> agreement(const SharedViews& sets, const calib::Rigid3d& b_from_a, double limit) const {
    double cost = 0;
    int consistent = 0;
    for (const auto& [in_a, in_b] : sets) {
      double off = std::numeric_limits<double>::infinity();
      for (const BoardPose& pose : in_a->poses) off = std::min(off, off_px(*in_b, b_from_a * pose.cam_from_board));
      consistent += off < limit ? 1 : 0;
      cost += std::min(off, 2 * limit);
    }
    return {cost, consistent};
  }

  double limit_px(int camera) const {  // residual of an inlier
    return std::max(2.0, 0.008 * cameras_[index(camera)].image_size.width);
  }

  // rms over a few corners, best numbering.
  double off_px(const PosedView& posed, const calib::Rigid3d& cam_from_board) const {
    return best_motion(posed, cam_from_board).second;
  }

  std::pair<std::size_t, double> best_motion(const PosedView& posed, const calib::Rigid3d& cam_from_board) const {
    const AdjustedCamera& camera = cameras_[index(posed.view->camera)];
    std::pair<std::size_t, double> best{0, std::numeric_limits<double>::infinity()};
    for (std::size_t m = 0; m < motions_.size(); ++m) {
      double sum = 0;
      for (const std::size_t k : posed.corners) {
        const Vector3d point = motions_[m] * board_.point(posed.view->ids[k]);
        Vector2d px;
        if (!project(camera.lens, camera.parameters, cam_from_board * point, px, nullptr, nullptr)) {
          sum = std::numeric_limits<double>::infinity();
          break;
        }
        sum += (px - posed.view->px[k]).squaredNorm();
      }
      const double rms = std::sqrt(sum / static_cast<double>(posed.corners.size()));
      if (rms < best.second) best = {m, rms};
    }
    return best;
  }

  const board::Board& board_;
  const std::vector<AdjustedCamera>& cameras_;
  std::vector<calib::Rigid3d> motions_;
  std::map<int, std::map<int, PosedView>> sets_;  // set -> camera -> view
};

// An error of these cameras alone: the others could be calibrated.
class CameraTrouble : public CalibrationError {
 public:
  CameraTrouble(std::vector<int> cameras, std::vector<Reason> reasons)
      : CalibrationError(std::move(reasons)), cameras_(std::move(cameras)) {}
  const std::vector<int>& cameras() const { return cameras_; }

 private:
  std::vector<int> cameras_;
};

// Why two cameras' views contradict each other, from the board's centres in each camera's frame.
Reason explain_contradiction(const Start& start, const std::string& a, const std::string& b, int ia, int ib) {
  const auto [in_a, in_b] = start.centres(ia, ib);
  if (in_a.cols() < 4) return {": too few shared views to find out why"};
  const auto misfit = [&](const Eigen::Matrix3Xd& from, bool with_scale, double& scale) {
    const Eigen::Matrix4d t = umeyama(from, in_b, with_scale);
    scale = t.topLeftCorner<3, 3>().col(0).norm();
    const Eigen::Matrix3Xd off = ((t.topLeftCorner<3, 3>() * from).colwise() + t.topRightCorner<3, 1>()) - in_b;
    std::vector<double> lengths;
    for (Eigen::Index k = 0; k < off.cols(); ++k) lengths.push_back(off.col(k).norm());
    return calib::median(std::move(lengths));
  };
  double scale = 1, ignored = 1;
  Eigen::Matrix3Xd mirrored = in_a;
  mirrored.row(0) *= -1;
  const double rigid = misfit(in_a, false, ignored), similar = misfit(in_a, true, scale),
               mirror = misfit(mirrored, false, ignored);
  // An explanation must remove most of the misfit; a scale within 2 % is noise.
  constexpr double explained = 0.4, explained_by_far = 0.3, better_than_scale = 0.5, least_scale = 0.02;
  if (mirror < explained_by_far * rigid && mirror < better_than_scale * similar) {
    return {": the images of one of them are mirrored (left and right swapped)", Fault::mirrored_images};
  }
  if (similar < explained * rigid && std::abs(scale - 1) > least_scale) {
    return {fmt::format(": camera {} sees the board {:.2f} times as large as camera {} does", b, scale, a),
            Fault::different_sizes};
  }
  return {"", Fault::contradicting_views};
}

std::string names(const std::vector<CameraToCalibrate>& cameras, const std::vector<int>& some) {
  std::string text;
  for (std::size_t k = 0; k < some.size(); ++k) {
    if (k > 0) text += k + 1 == some.size() ? " and " : ", ";
    text += cameras[index(some[k])].name;
  }
  return text;
}

// Camera poses along a maximum spanning tree of shared views, from the reference.
void connect(std::vector<AdjustedCamera>& cameras, const std::vector<Start::Link>& links, const Start& start,
             int reference, const std::vector<CameraToCalibrate>& named) {
  const auto is_good = [](const CameraPair& p) {
    return p.consistent_sets >= 2 && 2 * p.consistent_sets >= p.compared_sets;
  };
  std::vector<bool> reached(cameras.size(), false);
  reached[index(reference)] = true;
  cameras[index(reference)].cam_from_world = {};
  for (std::size_t count = 1; count < cameras.size(); ++count) {
    const Start::Link* best = nullptr;
    const auto strength = [](const Start::Link& l) {
      return l.pair.shared_sets * l.pair.consistent_sets / l.pair.compared_sets;
    };
    for (const Start::Link& l : links) {
      if (reached[index(l.pair.a)] == reached[index(l.pair.b)] || !is_good(l.pair)) continue;
      if (!best || strength(l) > strength(*best)) best = &l;
    }
    if (best) {
      const auto [a, b] = std::pair(index(best->pair.a), index(best->pair.b));
      if (reached[a]) {
        cameras[b].cam_from_world = best->b_from_a * cameras[a].cam_from_world;
      } else {
        cameras[a].cam_from_world = calib::inverse(best->b_from_a) * cameras[b].cam_from_world;
      }
      reached[a] = reached[b] = true;
      continue;
    }
    std::vector<int> inside, outside;
    for (std::size_t c = 0; c < cameras.size(); ++c) (reached[c] ? inside : outside).push_back(static_cast<int>(c));
    const std::vector<int>& fewer = outside.size() <= inside.size() ? outside : inside;
    // Do pairs between the two parts contradict each other, or is there none?
    const Start::Link* bad = nullptr;
    int few = 0;
    for (const Start::Link& l : links) {
      if (reached[index(l.pair.a)] == reached[index(l.pair.b)]) continue;
      few = std::max(few, l.pair.shared_sets);
      if (l.pair.shared_sets >= 3 && (!bad || l.pair.shared_sets > bad->pair.shared_sets)) bad = &l;
    }
    if (bad) {
      const std::string &a = named[index(bad->pair.a)].name, &b = named[index(bad->pair.b)].name;
      throw CameraTrouble(fewer, after("cameras " + a + " and " + b + " saw the board together " +
                                           std::to_string(bad->pair.shared_sets) +
                                           " times, but contradict each other on their relative pose",
                                       {explain_contradiction(start, a, b, bad->pair.a, bad->pair.b)}));
    }
    throw CameraTrouble(
        fewer, {{.fact = "camera" + std::string(outside.size() > 1 ? "s " : " ") + names(named, outside) +
                         (few == 0 ? " never saw the board at the same time as "
                                   : " saw the board at the same time only " + std::to_string(few) + " times as ") +
                         names(named, inside),
                 .fault = Fault::no_overlap,
                 .cameras = {named[index(outside.front())].name, named[index(inside.front())].name}}});
  }
}

int placed_corners(const Adjustment& a) {
  int count = 0;
  for (const BoardView& view : a.views) count += static_cast<int>(view.ids.size());
  return count;
}

// Whether an estimated warp is significant, and larger than that of a carefully glued board.
bool is_warped(const Adjustment& a) {
  constexpr double sigmas = 4;
  Eigen::Vector3d low = a.board.point(0), high = low;
  for (int id = 0; id < a.board.point_count(); ++id) {
    low = low.cwiseMin(a.board.point(id));
    high = high.cwiseMax(a.board.point(id));
  }
  constexpr double least_bend = 0.001, least_stretch = 0.0005;  // of the board's size; of its squares
  const double bend_m = least_bend * (high - low).norm();
  const BoardWarp least(bend_m, bend_m, least_stretch);
  for (int i = 0; i < 3; ++i) {
    if (std::abs(a.warp(i)) > std::max(least(i), sigmas * a.warp_sigma(i)) && a.warp_sigma(i) > 0) return true;
  }
  return false;
}

// A lens that did not fold with its own camera's views may fold in the joint adjustment, outside of the covered part.
Adjustment adjust_unfolded(Adjustment a, const AdjustmentOptions& options) {
  Adjustment fit = adjust(std::move(a), options);
  for (const double weight : {1.0, 10.0, 100.0}) {
    bool folds = false;
    for (AdjustedCamera& camera : fit.cameras) {
      if (!camera.lens_is_free || covers_image(camera.model(), camera.image_size)) continue;
      camera.unfold = std::max(camera.unfold, weight);
      folds = true;
    }
    if (!folds) break;
    fit = adjust(std::move(fit), options);
  }
  return fit;
}

// The adjustment with a free warp of the board; nullopt: not significant.
std::optional<Adjustment> with_warp(Adjustment a, const AdjustmentOptions& options) {
  constexpr double least_gain = 0.98;  // of the noise
  const double before_px = a.noise_px;
  const int used = a.corners_used;
  a.warp_is_free = true;
  const auto explains = [&](const Adjustment& warped) {
    return warped.noise_px < least_gain * before_px || warped.corners_used > used / least_gain;
  };
  try {
    // Quick test on the used corners; rejected ones may fit now.
    constexpr double many = 0.95;
    int corners = 0;
    for (const BoardView& view : a.views) corners += static_cast<int>(view.ids.size());
    Adjustment glance = a;
    glance.views = inliers(a);
    glance.stamp_error_s = stamp_errors_of_inliers(a);
    glance = adjust(std::move(glance), {.find_outliers = false, .max_iterations = 20});
    if (used > many * corners && !(explains(glance) && is_warped(glance))) return std::nullopt;
    a.warp = glance.warp;
    Adjustment warped = adjust_unfolded(std::move(a), options);
    if (explains(warped) && is_warped(warped)) return warped;
  } catch (const CalibrationError&) {  // not determined
  }
  return std::nullopt;
}

// Covariance of a given lens without one in its file: as of a webcam calibrated with some thirty views, an rms ray
// error of usual_lens_share of the image's width, beyond a common rotation (nearly a shift of the principal point).
LensPrior usual_prior(const AdjustedCamera& camera) {
  constexpr double turn_share = 0.01;
  constexpr int columns = 16, rows = 12;
  const int count = parameter_count(camera.lens);
  const calib::CameraModel model = camera.model();
  MatrixXd by_lens(2 * columns * rows, count), by_turn(2 * columns * rows, 3);
  Eigen::Index used = 0;
  for (int i = 0; i < columns * rows; ++i) {
    const Vector2d px((i % columns + 0.5) / columns * camera.image_size.width,
                      (i / columns + 0.5) / rows * camera.image_size.height);
    const auto ray = model.ray({px});
    Vector2d projected;
    PixelByPoint by_point;
    PixelByLens by_parameters;
    if (!ray || !project(camera.lens, camera.parameters, *ray, projected, &by_point, &by_parameters)) continue;
    by_lens.middleRows<2>(used) = by_parameters.leftCols(count);
    by_turn.middleRows<2>(used) = -by_point * calib::cross_matrix(*ray);
    used += 2;
  }
  by_lens.conservativeResize(used, Eigen::NoChange);
  by_turn.conservativeResize(used, Eigen::NoChange);
  const MatrixXd turned = by_turn * by_turn.colPivHouseholderQr().solve(by_lens), bent = by_lens - turned;
  const auto information = [&](const MatrixXd& moved, double share) {
    const double sigma_px = share * camera.image_size.width, stations = static_cast<double>(used) / 2;
    return MatrixXd(moved.transpose() * moved * (count / (stations * sigma_px * sigma_px)));
  };
  return {camera.parameters, information(bent, usual_lens_share) + information(turned, turn_share)};
}

LensPrior prior_of(const AdjustedCamera& camera) {
  if (camera.lens_covariance.size() == 0) return usual_prior(camera);
  // Scaled to a unit diagonal: pixels and coefficients differ by many powers of ten.
  const Eigen::VectorXd scale = camera.lens_covariance.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const MatrixXd correlation = scale.asDiagonal() * camera.lens_covariance * scale.asDiagonal();
  const auto size = correlation.rows();
  constexpr double least = 1e-9;  // keeps it invertible
  return {camera.parameters, scale.asDiagonal() *
                                 (correlation + least * MatrixXd::Identity(size, size))
                                     .ldlt()
                                     .solve(MatrixXd(MatrixXd::Identity(size, size))) *
                                 scale.asDiagonal()};
}

// Views that are far more consistent within each camera than between cameras are not simultaneous. Jointly refined
// lenses would absorb that.
bool is_in_step(const Adjustment& refined, double alone_px, const Adjustment& placed) {
  constexpr double not_synchronised = 1.6, least_left = 0.8;
  return refined.noise_px < not_synchronised * alone_px && refined.corners_used > least_left * placed_corners(placed);
}

// The joint adjustment with given lenses refined under their priors, if that explains the views of all cameras
// significantly better; nullopt: they are kept. One camera's views hardly separate a wrong lens from nearer boards, or
// from a rolling shutter; errors of a held lens go into poses and times.
std::optional<Adjustment> with_given_lenses(Extrinsics& result, const Adjustment& placed, const Adjustment& held,
                                            const ExtrinsicsOptions& options, const std::vector<bool>& found) {
  if (std::ranges::count(found, false) == 0) return std::nullopt;
  if (options.progress) options.progress("the joint adjustment, with the lenses", 1, 3);
  Adjustment a = held;
  // Stamp errors and motion prior are estimated again: a wrong lens inflates them.
  a.stamp_error_s.clear();
  a.motion_prior = {};
  for (AdjustedCamera& camera : a.cameras) camera.stamp_sigma_s = 0;
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    a.cameras[c].lens_is_free = true;
    if (!found[c]) a.cameras[c].lens_prior = prior_of(a.cameras[c]);
  }
  // A focal length error of 1 % moves its camera by centimetres, but times absorb all but 1 % of the noise. The gain
  // must exceed chance: each freed parameter explains one residual of noise.
  constexpr double least_gain = 0.995, gain_by_parameter = 5, most_lost = 0.95;
  try {
    a = adjust_unfolded(std::move(a), options.adjustment);
  } catch (const CalibrationError&) {
    return std::nullopt;
  }
  int freed = 0;
  for (std::size_t c = 0; c < a.cameras.size(); ++c) freed += found[c] ? 0 : parameter_count(a.cameras[c].lens);
  const double gain = 4.0 * a.corners_used * std::log(held.noise_px / a.noise_px);  // of -2 log likelihood
  if (a.noise_px > least_gain * held.noise_px || gain < gain_by_parameter * freed ||
      a.corners_used < most_lost * held.corners_used || !is_in_step(a, result.alone_px, placed))
    return std::nullopt;
  // The lenses must also differ significantly by the scatter between sets: the gain above assumes independent corners.
  constexpr double clearly_other = 2;
  double most = 0;  // largest difference of a lens in its standard deviations
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (found[c]) continue;
    const RayUncertainty rays = ray_uncertainty(a, static_cast<int>(c));
    most = std::max(most, difference(held.cameras[c], a.cameras[c], rays.covered).covered_px / rays.covered_px);
  }
  if (most < clearly_other) return std::nullopt;
  result.held_px = held.noise_px;
  return a;
}

// The joint adjustment, with lenses by options.refine_lens. found: per camera: its lens is estimated from these views,
// not given. Sets adjustment, refinement and board_is_warped.
void refine(Extrinsics& result, const Adjustment& placed, const ExtrinsicsOptions& options,
            const std::vector<bool>& found) {
  const auto freed = [&](Adjustment a) {
    for (std::size_t c = 0; c < a.cameras.size(); ++c) {
      a.cameras[c].lens_is_free = found[c] || options.refine_lens == RefineLens::yes;
    }
    return a;
  };
  const auto take = [&](Adjustment adjusted, LensRefinement refinement) {
    result.refinement = refinement;
    auto warped = with_warp(adjusted, options.adjustment);
    result.board_is_warped = warped.has_value();
    result.adjustment = warped ? std::move(*warped) : std::move(adjusted);
  };
  const bool any_found = std::ranges::count(found, true) > 0;
  if (options.refine_lens == RefineLens::yes)
    return take(adjust_unfolded(freed(placed), options.adjustment), LensRefinement::asked_for);
  Adjustment held = adjust(placed, options.adjustment);
  if (options.refine_lens == RefineLens::no)
    return take(std::move(held), any_found ? LensRefinement::kept_as_found : LensRefinement::kept_as_given);
  if (!any_found) {
    auto refined = with_given_lenses(result, placed, held, options, found);
    return refined ? take(std::move(*refined), LensRefinement::given_refined)
                   : take(std::move(held), LensRefinement::kept_as_given);
  }
  if (options.progress) options.progress("the joint adjustment, with the lenses", 1, 3);
  const Adjustment refined = adjust_unfolded(freed(held), options.adjustment);
  take(refined, LensRefinement::refined);
  const bool in_step = is_in_step(result.adjustment, result.alone_px, placed);
  // Estimated lenses first: given ones must not absorb their errors.
  if (auto all = with_given_lenses(result, placed, in_step ? refined : held, options, found))
    return take(std::move(*all), LensRefinement::given_refined);
  if (!in_step) take(std::move(held), LensRefinement::not_synchronised);
}

// Frees the kept given lenses under their priors, on the used corners, for their covariance and their difference from
// the given ones. nullopt: none is kept.
std::optional<Adjustment> with_open_lenses(const Adjustment& held, const std::vector<bool>& found) {
  Adjustment open = held;
  open.views = inliers(held);
  open.stamp_error_s = stamp_errors_of_inliers(held);
  bool any = false;
  for (std::size_t c = 0; c < open.cameras.size(); ++c) {
    AdjustedCamera& camera = open.cameras[c];
    if (found[c] || camera.lens_is_free || held.views_used(static_cast<int>(c)) == 0) continue;
    camera.lens_prior = prior_of(camera);
    camera.lens_is_free = any = true;
  }
  if (!any) return std::nullopt;
  try {
    return adjust(std::move(open), {.find_outliers = false, .max_iterations = 20});
  } catch (const CalibrationError&) {
    return std::nullopt;
  }
}

// Adds to an adjustment with held lenses the uncertainty that they cause, by the one with freed lenses.
void state_as_open(Adjustment& held, const Adjustment& open) {
  Eigen::VectorXd off = parameter_difference(open, held);
  for (std::size_t c = 0; c < held.cameras.size(); ++c) {
    const AdjustedCamera &a = held.cameras[c], &b = open.cameras[c];
    if (open.time_offset[c] >= 0)
      off.segment<2>(open.time_offset[c]) << b.latency.value_s - a.latency.value_s,
          b.readout.value_s - a.readout.value_s;
  }
  held.covariance = open.covariance + off * off.transpose();
  held.lens_offset = open.lens_offset;
  held.pose_offset = open.pose_offset;
  held.time_offset = open.time_offset;
  held.warp_sigma = open.warp_sigma;
  set_time_sigmas(held);
}

// Where k1, k2, p1, p2 explain a camera's views, k3 may still not be 0 where no corner was: the covariance averages
// over both models by their probabilities (Bayesian model averaging). Those cameras become radtan5, with k3 as it is:
// 0.
void state_missing_k3(Adjustment& a, const std::vector<std::optional<Intrinsics>>& lenses) {
  Adjustment open = a;
  open.views = inliers(a);
  open.stamp_error_s = stamp_errors_of_inliers(a);
  double most_likely = 0;
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (!lenses[c] || !a.cameras[c].lens_is_free || a.cameras[c].lens != LensModel::radtan4) continue;
    const double likely = probability_of_k3(*lenses[c]);
    if (likely > 0) open.cameras[c].lens = LensModel::radtan5;
    most_likely = std::max(most_likely, likely);
  }
  if (most_likely == 0) return;
  try {
    open = adjust(std::move(open), {.find_outliers = false, .max_iterations = 20});
  } catch (const CalibrationError&) {
    return;
  }
  const MatrixXd without = a.covariance;
  std::vector<Eigen::Index> at(index(static_cast<int>(without.rows())));  // of `without` in the other
  const auto place = [&](int from, int to, int count) {
    for (int i = 0; from >= 0 && i < count; ++i) at[index(from + i)] = to + i;
  };
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    place(a.lens_offset[c], open.lens_offset[c], parameter_count(a.cameras[c].lens));
    place(a.pose_offset[c], open.pose_offset[c], 6);
    place(a.time_offset[c], open.time_offset[c], 2);
    a.cameras[c].lens = open.cameras[c].lens;
  }
  state_as_open(a, open);
  a.covariance *= most_likely;
  a.covariance(at, at) += (1 - most_likely) * without;
  set_time_sigmas(a);
}

// Consistency checks: halves, and kept given lenses. Both widen the covariance.
void check_itself(Extrinsics& result, const std::vector<bool>& found) {
  Adjustment& held = result.adjustment;
  result.moved_within = find_moved_within(held);
  state_missing_k3(held, result.lenses);
  std::optional<Adjustment> open = with_open_lenses(held, found);
  result.halves = compare_halves(open ? *open : held);
  widen_by(open ? *open : held, result.halves);
  result.given_lens_checks.resize(held.cameras.size());
  if (!open) return;
  for (std::size_t c = 0; c < held.cameras.size(); ++c) {
    if (!open->cameras[c].lens_is_free || held.cameras[c].lens_is_free) continue;
    const RayUncertainty rays = ray_uncertainty(*open, static_cast<int>(c));
    result.given_lens_checks[c] = GivenLensCheck{difference(held.cameras[c], open->cameras[c], rays.covered).covered_px,
                                                 rays.covered_px, held.cameras[c].lens_covariance.size() > 0};
  }
  state_as_open(held, *open);
}

// Priors of the cameras' times. One latency is held: the first given one, or the reference's.
void set_times(std::vector<AdjustedCamera>& cameras, const std::vector<CameraToCalibrate>& given, int reference) {
  // Limits of webcams; an upside-down sensor has a negative readout.
  constexpr double usual_latency_s = 0.05, usual_readout_s = 0.03;
  const auto set = [](AdjustedTime& time, std::optional<double> value, std::optional<double> sigma, double usual_s) {
    time.value_s = time.prior_s = value.value_or(0);
    time.prior_sigma_s = value ? sigma.value_or(0) : usual_s;
  };
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const calib::CameraTiming& timing = cameras[c].timing = given[c].timing;
    set(cameras[c].latency, timing.latency_s, timing.latency_sigma_s, usual_latency_s);
    set(cameras[c].readout, timing.readout_s, timing.readout_sigma_s, usual_readout_s);
  }
  const auto first =
      std::ranges::find_if(given, [](const CameraToCalibrate& camera) { return camera.timing.latency_s.has_value(); });
  const std::size_t held = first == given.end() ? index(reference) : static_cast<std::size_t>(first - given.begin());
  cameras[held].latency.prior_sigma_s = 0;
}

// Given lenses that were exchanged between cameras.
void refuse_swapped(const board::Board& board, const std::vector<AdjustedCamera>& cameras,
                    const std::vector<std::vector<BoardView>>& own,
                    const std::vector<std::optional<LensCheck>>& checks) {
  const auto fits = [&](std::size_t lens, std::size_t views) {
    if (cameras[lens].image_size != cameras[views].image_size) return false;
    AdjustedCamera other = cameras[lens];
    other.lens_covariance.resize(0, 0);
    return !check_lens(board, other, own[views]).contradiction;
  };
  for (std::size_t a = 0; a < cameras.size(); ++a) {
    for (std::size_t b = a + 1; b < cameras.size(); ++b) {
      if (!checks[a] || !checks[b] || !checks[a]->contradiction || !checks[b]->contradiction) continue;
      if (fits(a, b) && fits(b, a)) {
        throw CalibrationError("cameras " + cameras[a].name + " and " + cameras[b].name +
                               " look swapped: the views of each fit the lens that was given for the other");
      }
    }
  }
}

struct LensOfCamera {
  AdjustedCamera camera;
  std::optional<Intrinsics> found;
  std::optional<LensCheck> check;
  double alone_px = 0;
  std::vector<Reason> trouble;  // empty: there is a lens
};

LensOfCamera lens_of(const board::Board& board, const CameraToCalibrate& given, const std::vector<BoardView>& views,
                     const ExtrinsicsOptions& options) {
  LensOfCamera lens;
  lens.camera.name = given.name;
  lens.camera.image_size = given.image_size;
  if (given.model) {
    lens.camera.lens = lens_model_of(*given.model);
    lens.camera.parameters = parameters_of(*given.model);
    constexpr std::size_t enough_to_judge = 6;
    if (options.refine_lens == RefineLens::automatic && views.size() >= enough_to_judge) {
      lens.check = check_lens(board, lens.camera, views);
      lens.alone_px = lens.check->refined.noise_px;
    }
    // A k3 of 0 may be uncertain.
    if (lens.camera.lens == LensModel::radtan4 && given.lens_covariance.rows() == parameter_count(LensModel::radtan5))
      lens.camera.lens = LensModel::radtan5;
    if (given.lens_covariance.rows() == parameter_count(lens.camera.lens))
      lens.camera.lens_covariance = given.lens_covariance;
    return lens;
  }
  try {
    lens.found = calibrate_intrinsics(board, given.name, given.image_size, views, options.intrinsics);
  } catch (const CalibrationError& error) {
    lens.trouble = error.reasons();
    return lens;
  }
  const AdjustedCamera& camera = lens.found->adjustment.cameras.front();
  lens.camera.lens = camera.lens;
  lens.camera.parameters = camera.parameters;
  lens.camera.lens_covariance = lens.found->adjustment.covariance;
  lens.camera.unfold = camera.unfold;
  lens.alone_px = lens.found->adjustment.noise_px;
  return lens;
}

// Lenses camera by camera, on all cores. own: views per camera.
std::vector<LensOfCamera> lenses_of(const board::Board& board, const std::vector<CameraToCalibrate>& cameras,
                                    const std::vector<std::vector<BoardView>>& own, const ExtrinsicsOptions& options) {
  std::mutex progress_mutex;
  std::vector<std::pair<int, int>> progress(cameras.size(), {0, 8});  // done and total; guarded by progress_mutex
  const auto report_progress = [&](std::size_t c, int done, int total) {
    const std::scoped_lock lock(progress_mutex);
    progress[c] = {done, total};
    int all_done = 0, all = 0;
    for (const auto& [d, t] : progress) all_done += d, all += t;
    if (options.progress) options.progress("the lenses", all_done, all);
  };
  std::vector<std::future<LensOfCamera>> found;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    found.push_back(std::async(std::launch::async, [&, c] {
      ExtrinsicsOptions own_options = options;
      own_options.intrinsics.progress = [&](const std::string&, int done, int total) {
        report_progress(c, done, total);
      };
      LensOfCamera lens = lens_of(board, cameras[c], own[c], own_options);
      report_progress(c, 8, 8);
      return lens;
    }));
  }
  std::vector<LensOfCamera> lenses;
  for (auto& lens : found) lenses.push_back(lens.get());
  return lenses;
}

// rms of the used corners of both cameras in shared sets, px.
double rms_of_pair(const Adjustment& a, const CameraPair& pair) {
  std::map<int, std::array<bool, 2>> seen;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    if (a.fits[v].dropped) continue;
    if (a.views[v].camera == pair.a) seen[a.views[v].set][0] = true;
    if (a.views[v].camera == pair.b) seen[a.views[v].set][1] = true;
  }
  double sum = 0;
  int count = 0;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    const BoardView& view = a.views[v];
    if ((view.camera != pair.a && view.camera != pair.b) || !seen[view.set][0] || !seen[view.set][1]) continue;
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      if (!a.fits[v].used[k]) continue;
      sum += a.fits[v].residuals[k].squaredNorm();
      ++count;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

}  // namespace

Adjustment place_boards(const board::Board& board, const calib::CameraRig& rig, const std::vector<BoardView>& given) {
  std::vector<AdjustedCamera> cameras;
  for (const calib::Camera& camera : rig.cameras) {
    AdjustedCamera held;
    held.name = camera.name;
    held.image_size = camera.image_size;
    held.lens = lens_model_of(camera.model);
    held.parameters = parameters_of(camera.model);
    held.cam_from_world = camera.cam_from_world;
    held.timing = camera.timing;
    held.lens_is_free = held.pose_is_free = false;
    cameras.push_back(held);
  }
  std::vector<BoardView> views = given;
  std::ranges::sort(views, {}, [](const BoardView& v) { return std::tie(v.set, v.camera, v.image); });
  return Start(board, cameras, views).placed(cameras);
}

bool is_determined(const Adjustment& adjustment, const AdjustedTime& time) {
  constexpr double share = 0.1;
  if (adjustment.stamp_sigma_s > worst_stamps_of_camera_s) return false;
  return time.prior_sigma_s > 0 && time.sigma_s > 0 && time.sigma_s < share * time.prior_sigma_s;
}

calib::CameraRig rig_of(const Adjustment& adjustment) {
  calib::CameraRig rig;
  const bool is_timed = std::ranges::any_of(
      adjustment.cameras, [&](const AdjustedCamera& camera) { return is_determined(adjustment, camera.latency); });
  for (const AdjustedCamera& camera : adjustment.cameras) {
    calib::CameraTiming timing = camera.timing;
    const auto take = [&](const AdjustedTime& time, std::optional<double>& value, std::optional<double>& sigma) {
      if (!is_determined(adjustment, time)) return;
      value = time.value_s;
      sigma = time.sigma_s;
    };
    take(camera.latency, timing.latency_s, timing.latency_sigma_s);
    take(camera.readout, timing.readout_s, timing.readout_sigma_s);
    // Time reference.
    if (is_timed && camera.latency.prior_sigma_s == 0) timing.latency_s = camera.latency.value_s;
    rig.cameras.push_back({camera.name, camera.image_size, camera.model(), camera.cam_from_world, timing});
  }
  return rig;
}

namespace {

Extrinsics calibrate_all(const board::Board& board, const std::vector<CameraToCalibrate>& cameras,
                         const std::vector<BoardView>& given, const ExtrinsicsOptions& options) {
  const auto report_progress = [&](const std::string& step, int done, int total) {
    if (options.progress) options.progress(step, done, total);
  };
  std::vector<BoardView> views = given;
  std::ranges::sort(views, {}, [](const BoardView& v) { return std::tie(v.set, v.camera, v.image); });
  std::vector<std::vector<BoardView>> own(cameras.size());
  for (const BoardView& view : views) own[index(view.camera)].push_back(view);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (own[c].empty())
      throw CameraTrouble({static_cast<int>(c)}, {{.fact = "camera " + cameras[c].name + " never saw the board"}});
  }
  Extrinsics result;
  std::vector<AdjustedCamera> adjusted;
  std::vector<bool> found;  // see refine()
  std::vector<std::optional<LensCheck>> checks;
  for (LensOfCamera& lens : lenses_of(board, cameras, own, options)) {
    if (!lens.trouble.empty()) throw CameraTrouble({static_cast<int>(adjusted.size())}, lens.trouble);
    found.push_back(lens.found.has_value());
    result.alone_px = std::max(result.alone_px, lens.alone_px);
    adjusted.push_back(std::move(lens.camera));
    checks.push_back(std::move(lens.check));
    result.lenses.push_back(std::move(lens.found));
  }
  refuse_swapped(board, adjusted, own, checks);
  result.contradictions.resize(cameras.size());
  result.kept_against.resize(cameras.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (checks[c]) result.kept_against[c] = checks[c]->too_little;
    if (!checks[c] || !checks[c]->contradiction) continue;
    result.contradictions[c] = checks[c]->contradiction;
    found[c] = true;
    adjusted[c].parameters = checks[c]->refined.cameras.front().parameters;
    adjusted[c].lens_covariance = checks[c]->refined.covariance;
  }
  report_progress("relative camera poses", 0, 3);
  const Start start(board, adjusted, views);
  std::vector<Start::Link> links;
  for (int a = 0; a < static_cast<int>(cameras.size()); ++a) {
    for (int b = a + 1; b < static_cast<int>(cameras.size()); ++b) {
      if (auto link = start.link(a, b)) links.push_back(*link);
    }
  }
  connect(adjusted, links, start, options.reference, cameras);
  for (std::size_t c = 0; c < adjusted.size(); ++c) {
    adjusted[c].pose_is_free = static_cast<int>(c) != options.reference;
    adjusted[c].lens_is_free = false;
  }
  report_progress("the joint adjustment", 1, 3);
  set_times(adjusted, cameras, options.reference);
  Adjustment placed = start.placed(adjusted);
  if (determine_motion(placed.views)) placed.motions.resize(placed.world_from_board.size());
  refine(result, placed, options, found);
  report_progress("split-half check", 2, 3);
  check_itself(result, found);
  for (const Start::Link& link : links) {
    result.pairs.push_back(link.pair);
    result.pairs.back().rms_px = rms_of_pair(result.adjustment, link.pair);
  }
  return result;
}

}  // namespace

Extrinsics calibrate_extrinsics(const board::Board& board, const std::vector<CameraToCalibrate>& cameras,
                                const std::vector<BoardView>& views, const ExtrinsicsOptions& options) {
  std::vector<int> kept(cameras.size());
  std::iota(kept.begin(), kept.end(), 0);
  std::vector<LeftOutCamera> left_out;
  for (;;) {
    std::vector<CameraToCalibrate> some;
    std::vector<int> place(cameras.size(), -1);  // index among the kept ones
    for (const int camera : kept) {
      place[index(camera)] = static_cast<int>(some.size());
      some.push_back(cameras[index(camera)]);
    }
    std::vector<BoardView> seen;
    for (const BoardView& view : views) {
      if (place[index(view.camera)] < 0) continue;
      seen.push_back(view);
      seen.back().camera = place[index(view.camera)];
    }
    ExtrinsicsOptions own = options;
    own.reference = std::max(0, place[index(options.reference)]);
    try {
      Extrinsics result = calibrate_all(board, some, seen, own);
      result.kept = std::move(kept);
      result.left_out = std::move(left_out);
      return result;
    } catch (const CameraTrouble& trouble) {
      if (!options.leave_out || kept.size() < trouble.cameras().size() + 2) throw;
      std::vector<int> without;
      for (std::size_t k = 0; k < kept.size(); ++k) {
        const bool out = std::ranges::find(trouble.cameras(), static_cast<int>(k)) != trouble.cameras().end();
        if (out) left_out.push_back({kept[k], trouble.reasons()});
        if (!out) without.push_back(kept[k]);
      }
      kept = std::move(without);
    }
  }
}

}  // namespace huetrack::solver
