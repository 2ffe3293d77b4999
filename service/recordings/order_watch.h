// Detects pictures of a series of files that are played in another order than that in which they were taken, by how far
// things move from one picture to the next. Two kinds of order are tried: by another number in the names
// (frame_0_1.png: is 0 or 1 the leading one?), and one that begins at another file (a ring buffer, a counter that began
// again). Private to this module.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "capture/frames/frame.h"

namespace huetrack::recordings {

// Mean brightness of blocks of pixels.
struct Blocks {
  int width = 0, height = 0;  // blocks; 0: none
  std::vector<std::uint8_t> levels;
};
Blocks blocks_of(const capture::Image& image);

// How far brightness has to be moved, along rows and along columns, to make b of a: levels times blocks, so in
// proportion to the distance that an object moved. Infinite: their sizes differ.
double moved_between(const Blocks& a, const Blocks& b);

// thread-compatible.
class OrderWatch {
 public:
  // In the order in which they are played.
  explicit OrderWatch(std::vector<std::filesystem::path> files);

  // The pictures in that order; some may be left out.
  void see(std::size_t file, const capture::Image& image);
  // At the end: what is wrong and what to do. nullopt: nothing is known to be.
  std::optional<std::string> problem() const;

 private:
  struct Candidate {
    std::vector<std::size_t> order;
    std::vector<std::pair<std::size_t, std::size_t>> successors;  // a file, and the next one in this order
  };
  // How many times less things move in its order; 1: not surely less.
  double advantage(const Candidate& candidate) const;
  std::optional<std::size_t> seam() const;
  std::string name(std::size_t file) const { return files_[file].filename().string(); }

  std::vector<std::filesystem::path> files_;
  std::vector<Candidate> candidates_;
  std::set<std::size_t> wanted_;          // files of candidates_
  std::map<std::size_t, Blocks> blocks_;  // of wanted_, as seen
  Blocks first_, last_;
  std::vector<std::pair<std::size_t, double>> steps_;  // to this file, from the one seen before
};

}  // namespace huetrack::recordings
