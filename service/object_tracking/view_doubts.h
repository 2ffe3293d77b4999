// Whether the views of one object contradict one another, and by how much: what a calibration that is no longer right
// does, or a camera that is late, or another one than the rig says. Facts only.
//
// Two views that see an object at one moment have four coordinates for three unknowns: across their epipolar lines they
// must agree, wherever it is and however it moves. How far they do not, beside what is expected of both, is kept per
// pair of cameras over the recent past, as a robust scale (a quantile, so that a frame that is shown once more or
// something else of the colour moves nothing). What a pair has in excess is laid on cameras:
//   scale^2 of a pair = expected + a_i S_i + a_j S_j,   S >= 0: variance that a camera's error has in excess, px^2
// One camera that is wrong is likelier than two at a time: where one alone explains all that disagrees (all pairs
// without it agree), it has all of it; two that could each, as two cameras by themselves, share alike. Where none
// explains it alone, least squares over all pairs. What has been seen fades slowly: an error of a camera may show in
// one place, and in another lie along the epipolar lines.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace huetrack::object_tracking {

// Where a view saw the object beside where it would be if it were on a path that all views are compared with. That path
// need not be the right one: what two views say of each other hardly depends on it.
struct SeenBeside {
  int camera = 0;
  double at_s = 0;                       // when, on any clock that the views share
  Eigen::Vector2d px;                    // measured
  Eigen::Vector2d off_px;                // measured, less the path's projection at that time
  Eigen::Matrix2d covariance;            // px^2, of off_px
  Eigen::Matrix<double, 2, 3> jacobian;  // d px / d p_world on the path, px/m
};

// How far two views are apart across their epipolar lines: off = across_i off_px_i + across_j off_px_j, in pixels, with
// |across_i|^2 + |across_j|^2 = 1.
struct Disagreement {
  double off_px = 0;
  double expected_px2 = 0;          // variance of off_px
  double share_i = 0, share_j = 0;  // of a unit of variance in each coordinate of a view, in that of off_px
  // across_i, across_j: an error of a view moves off_px by its product with these. Zero: nobody knows.
  Eigen::Vector2d across_i = Eigen::Vector2d::Zero(), across_j = Eigen::Vector2d::Zero();
};
// way_variance_m2: how far the object may have left the path between the two moments, on each axis.
// false: their rays are nearly parallel, and say nothing of each other.
bool disagreement(const SeenBeside& i, const SeenBeside& j, double way_variance_m2, Disagreement& out);

// Whether two views that see the object this large could contradict one another at all: what is expected to be further
// apart than half of it agrees with anything.
bool could_contradict(const Disagreement& seen, double radius_i_px, double radius_j_px);

struct PairHistoryTuning {
  std::size_t kept = 32;  // residuals in a pair's window: about 1 s
  // Places at which a pair must be consistent to count as right: wrong views are consistent where the object crosses
  // what their error leaves of an epipolar line, once by chance, hardly twice without being inconsistent in between.
  std::size_t places = 2;
};
inline constexpr PairHistoryTuning pair_history{};

// thread-compatible. Allocates only when it is made.
class ViewDoubts {
 public:
  // radius_m: of the object.
  ViewDoubts(std::size_t cameras, double radius_m);

  // What the views of one set say, one entry per camera at most. velocity_sigma_m_s, acceleration_m_s2: how far the
  // object may leave the path between two moments.
  void compare(std::span<const SeenBeside> views, double velocity_sigma_m_s, double acceleration_m_s2);
  // What was found out otherwise about two cameras.
  void add(std::size_t i, std::size_t j, const Disagreement& seen);
  // The camera stands elsewhere: what was seen of it before says nothing any more.
  void forget(std::size_t camera);

  bool any() const { return any_; }
  // Views contradict one another, and no two of them have agreed anywhere since: nobody knows whom to believe.
  bool is_nobody_believed() const { return is_nobody_believed_; }
  double variance_px2(std::size_t camera) const { return variance_px2_[camera]; }  // S; 0: no contradiction

  // Of a pair, in units of what was expected: 1 when all is as it should be. 0: hardly ever seen together.
  double scale2(std::size_t i, std::size_t j) const { return pair(i, j).scale2; }

 private:
  struct Pair {
    float squares[pair_history.kept];  // off_px^2 / expected_px2, a ring
    float sorted[pair_history.kept];   // the ring's values, ascending
    std::size_t count = 0;
    double expected_px2 = 0, share_i = 0, share_j = 0;  // means over the recent past
    double scale2 = 0;
    double excess_px2 = 0;   // of off_px, beyond what was expected: now, or as far as it has lasted
    double lasting_px2 = 0;  // what of excess_px2 has lasted
    // Where the two agreed, since they last contradicted one another: in the pictures of both, for a rig that is wrong
    // does not know the place.
    Eigen::Vector4d places[pair_history.places];
    std::size_t place_count = 0;
    bool was_sure = false;
    bool is_sure() const { return place_count == pair_history.places; }
    bool is_usual() const;
  };
  void note_place(Pair& pair, const Disagreement& seen, const SeenBeside& i, const SeenBeside& j) const;
  const Pair& pair(std::size_t i, std::size_t j) const;
  Pair& pair(std::size_t i, std::size_t j) { return const_cast<Pair&>(std::as_const(*this).pair(i, j)); }
  template <typename F>
  void for_each_pair(F&& each) const;  // that has been seen together: (pair, i, j)
  static void keep(Pair& pair, float square);
  static void note(Pair& pair, const Disagreement& seen);
  static double scale2_of(const Pair& pair);
  void share_out();
  bool lay_on_one();
  bool are_others_proven(std::size_t without) const;
  void doubt_all();
  double error_px2(std::size_t camera, double usual_px2) const;

  std::size_t cameras_;
  double radius_m_;
  std::vector<Pair> pairs_;  // i < j
  // Were this camera the only one that is off: by how much, as its pairs say together (normal equations, 1/px^2, 1/px).
  struct Alone {
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    Eigen::Vector2d vector = Eigen::Vector2d::Zero();
  };
  std::vector<Alone> alone_;  // per camera
  std::vector<double> variance_px2_, up_, down_;
  bool any_ = false, is_nobody_believed_ = false;
};

}  // namespace huetrack::object_tracking
