// Epipolar consistency of the views of one object: detects a wrong calibration, a late camera, or a camera that is not
// the one the rig says, and distributes it as extra variance over the cameras. Facts only. Model: design.md.
//
// Two views of an object at one moment have four coordinates for three unknowns: across their epipolar lines they must
// agree, wherever the object is. Per pair of cameras, a quantile of the squared normalised residuals over the last
// second estimates their variance ratio, robust against repeated frames and confused regions. The excess is explained
// by cameras:
//   residual variance of pair (i, j) = expected + share_i S_i + share_j S_j,   S >= 0, px^2
// by a single camera if all pairs without it are consistent, else by least squares. Excess fades over 20 s, as a
// camera's error may lie along the epipolar lines now; two places at which the pair is consistent disprove that, as far
// as they discriminate.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace huetrack::object_tracking {

// A view's residual to a path that all views are compared with. The path need not be right: pairs hardly depend on it.
struct PathResidual {
  int camera = 0;
  double at_s = 0;                       // time, on any clock that the views share
  Eigen::Vector2d px;                    // measured
  Eigen::Vector2d off_px;                // measured - projected path
  Eigen::Matrix2d covariance;            // px^2, of off_px
  Eigen::Matrix<double, 2, 3> jacobian;  // d px / d p_world on the path, px/m
  bool is_cut = false;                   // clutter may hide a part of the object: no evidence against a camera
};

// Residual of two views across their epipolar lines: off = across_i . off_px_i + across_j . off_px_j, in pixels, with
// |across_i|^2 + |across_j|^2 = 1.
struct EpipolarResidual {
  double off_px = 0;
  double expected_px2 = 0;                                                                 // variance of off_px
  double share_i = 0, share_j = 0;                                                         // |across_i|^2, |across_j|^2
  Eigen::Vector2d across_i = Eigen::Vector2d::Zero(), across_j = Eigen::Vector2d::Zero();  // zero: unknown
};
// path_variance_m2: of the object's deviation from the path between the two times, per axis. false: nearly parallel
// rays.
bool epipolar_residual(const PathResidual& i, const PathResidual& j, double path_variance_m2, EpipolarResidual& out);

// The expected residual is below half the object's radius: otherwise the pair is consistent with anything.
bool is_discriminating(const EpipolarResidual& seen, double radius_i_px, double radius_j_px);

struct PairHistoryTuning {
  std::size_t kept = 32;          // residuals in a pair's window: about 1 s at 30 fps
  std::size_t min_residuals = 8;  // of a pair, from which their quantile is used; until then a start settles
  std::size_t places = 2;         // places at which a pair must be consistent to count as right; one occurs by chance
};
inline constexpr PairHistoryTuning pair_history{};

// thread-compatible. Allocates only when constructed.
class EpipolarConsistency {
 public:
  EpipolarConsistency(std::size_t cameras, double radius_m);  // of the object

  // One frame set, at most one residual per camera. velocity_sigma_m_s, acceleration_m_s2: deviation from the path
  // between two times.
  void compare(std::span<const PathResidual> views, double velocity_sigma_m_s, double acceleration_m_s2);
  void add(std::size_t i, std::size_t j, const EpipolarResidual& seen);  // found otherwise
  void forget(std::size_t camera);                                       // its pose changed

  bool any() const { return any_; }
  // Views are inconsistent, and no two of them have been consistent at any place since: none can be trusted.
  bool no_consistent_pair() const { return no_consistent_pair_; }
  double variance_px2(std::size_t camera) const { return variance_px2_[camera]; }  // S
  // Variance of the residuals over the expected one, without S: mean of all pairs over some 16 sets, each up to what
  // still counts as consistent; at least 1. The measurements' variance is larger than stated by this factor, as by
  // fingers on a ball (Birge 1932).
  double noise_scale2() const;
  // Residual variance over the expected one; 0: too few residuals.
  double scale2(std::size_t i, std::size_t j) const { return pair(i, j).scale2; }

 private:
  struct Pair {
    float squares[pair_history.kept];  // off_px^2 / expected_px2, a ring
    float sorted[pair_history.kept];   // the same, ascending
    std::size_t count = 0;
    double expected_px2 = 0, share_i = 0, share_j = 0;  // running means
    double scale2 = 0;
    double excess_px2 = 0;    // variance of off_px beyond the expected one
    double lasting_px2 = 0;   // the part of it that fades slowly
    double noise_scale2 = 0;  // running mean of off_px^2 / expected_px2; 0: none yet
    // Where the pair was consistent since it last was not: in both images, as a wrong rig does not know the place.
    Eigen::Vector4d places[pair_history.places];
    std::size_t place_count = 0;
    bool was_sure = false;
    bool is_sure() const { return place_count == pair_history.places; }
    bool is_consistent() const;
  };
  void note_place(Pair& pair, const EpipolarResidual& seen, const PathResidual& i, const PathResidual& j) const;
  const Pair& pair(std::size_t i, std::size_t j) const;
  Pair& pair(std::size_t i, std::size_t j) { return const_cast<Pair&>(std::as_const(*this).pair(i, j)); }
  template <typename F>
  void for_each_pair(F&& each) const;  // with residuals: (pair, i, j)
  static void keep(Pair& pair, float square);
  static void note(Pair& pair, const EpipolarResidual& seen);
  static double scale2_of(const Pair& pair);
  void explain();
  bool explain_by_one();
  bool are_others_proven(std::size_t without) const;
  void inflate_all();
  double error_px2(std::size_t camera, double usual_px2) const;

  std::size_t cameras_;
  double radius_m_;
  std::vector<Pair> pairs_;  // i < j
  // Normal equations of a camera's error if it alone is wrong, 1/px^2 and 1/px.
  struct Alone {
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    Eigen::Vector2d vector = Eigen::Vector2d::Zero();
  };
  std::vector<Alone> alone_;  // per camera
  std::vector<double> variance_px2_, up_, down_;
  bool any_ = false, no_consistent_pair_ = false;
};

}  // namespace huetrack::object_tracking
