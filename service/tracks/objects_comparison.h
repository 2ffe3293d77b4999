// Compares the objects of one target (`count`) with a ground truth of several balls. Objects and balls are matched by
// distance, not by name.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "object_tracking/object_estimate.h"
#include "truth/truth.h"

namespace huetrack::tracks {

// Sums over the frame sets. MOTA: Bernardin and Stiefelhagen 2008; IDF1: Ristani et al. 2016.
struct ObjectsFigures {
  std::size_t balls = 0;            // that were in the volume
  std::size_t ball_sets = 0;        // balls in the volume, summed over the sets
  std::size_t found = 0;            // of these: with an object in state tracking within 10 cm
  std::size_t false_positions = 0;  // in state tracking, and of no ball
  std::size_t switches = 0;         // a ball's object is another than before
  double rms_m = 0;                 // of the found ones
  double mota = 0, idf1 = 0;        // at most 1
};

// thread-compatible.
class ObjectsComparison {
 public:
  // balls: names in the truth, which outlives this. Balls outside the volume count neither way.
  ObjectsComparison(const truth::Truth& truth, std::vector<std::string> balls, const Eigen::AlignedBox3d& volume);

  // The target's estimates of one frame set, captured at `at`.
  void add(truth::Timestamp at, std::span<const object_tracking::ObjectEstimate> estimates);
  ObjectsFigures figures() const;

 private:
  using Objects = std::vector<const object_tracking::ObjectEstimate*>;
  Eigen::MatrixXd distances(const std::vector<std::size_t>& balls, const Objects& objects) const;
  std::vector<int> matches(const std::vector<std::size_t>& balls, const Objects& objects,
                           const Eigen::MatrixXd& distances_m) const;

  const truth::Truth* truth_;
  std::vector<std::string> balls_;
  Eigen::AlignedBox3d volume_;
  ObjectsFigures sums_;
  double squares_m2_ = 0;
  std::map<std::size_t, std::uint32_t> last_;                              // object of each ball
  std::map<std::size_t, std::size_t> ball_sets_;                           // of each ball
  std::map<std::uint32_t, std::size_t> object_sets_;                       // of each object, where it counts
  std::map<std::pair<std::size_t, std::uint32_t>, std::size_t> together_;  // sets of ball and object
};

// One line for people.
std::string to_text(const ObjectsFigures& figures);

}  // namespace huetrack::tracks
