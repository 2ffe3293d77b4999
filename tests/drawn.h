// Random vectors that are the same whatever compiles the tests.
#pragma once

#include <Eigen/Core>

namespace huetrack {

// n draws, the last coordinate's first: the order in which arguments of a call are evaluated is the compiler's choice.
template <int n, typename Generator, typename Draw>
Eigen::Vector<double, n> drawn(Generator& rng, Draw&& draw) {
  Eigen::Vector<double, n> out;
  for (int i = n - 1; i >= 0; --i) out[i] = draw(rng);
  return out;
}

}  // namespace huetrack
