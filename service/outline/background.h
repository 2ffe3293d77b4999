// What stands behind the object in one view, learnt while it is tracked: in tiles around the object and where it goes,
// from pixels that it does not cover. A mean per sample, of so many looks; what is seen otherwise again and again
// replaces it, so that it follows the light and the scene.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "outline/picture.h"

namespace huetrack::outline {

// Where pixels are the object's, or may be.
struct ObjectDisc {
  Eigen::Vector2d px;
  double radius_px = 0;
};

// thread-compatible; one per view. Its memory is bounded: 2 KB for a tile of 16x16 pixels, and no more than most_tiles
// of them, of which the one that was not looked at for longest gives way.
class Background {
 public:
  static constexpr int tile_px = 16;
  static constexpr std::size_t most_tiles = 1200;

  // tiles: how many of them are kept, of which the one that was not looked at for longest gives way
  Background(int width, int height, std::size_t tiles = most_tiles);

  // A few tiles of this picture: of those between `object` and where it will be after `ahead_px`, the ones that are
  // known least, and some of all others in turn; of a part of a picture none of these, and what lies beyond it remains
  // as it was. hidden: what is not background.
  void learn(const Picture& picture, const ObjectDisc& object, const Eigen::Vector2d& ahead_px,
             const ObjectDisc* hidden, std::size_t hidden_count);
  // For pictures that come rarely: all tiles, and of those that are well known by now one of four. hidden: as in
  // learn().
  void learn_all(const Picture& picture, const ObjectDisc* hidden, std::size_t hidden_count);
  void forget();

  // What is behind these pixels, as read_light() gives what is seen. looks: how many pictures it is the mean of; 0: not
  // known.
  void light(const Places& at, float* light, float* looks) const;
  // All of it. Of pixels the chroma is that of the sample in which each lies; of samples of chroma the light is the
  // mean of their pixels', and known where all of these are. picture: how chroma is shared.
  struct Values {
    float *light, *blue, *red, *light_looks, *chroma_looks;
  };
  void at_pixels(const Picture& picture, const Places& at, const Values& out) const;
  void at_chroma(const Picture& picture, const Places& at, const Values& out) const;
  // Of a single picture, standard deviation in grey values.
  float light_noise() const { return light_.noise; }
  float chroma_noise() const { return chroma_.noise; }

 private:
  static constexpr int samples = tile_px * tile_px;
  using Means = std::array<std::int16_t, samples>;  // grey values in 1/64
  struct Tile {
    int index = -1;  // in the picture
    Means light{}, blue{}, red{};
    std::array<std::uint8_t, samples> light_looks{}, chroma_looks{};
  };
  // Of a tile of the picture; by themselves, as many are compared with one another for each that is looked at.
  struct Looked {
    std::uint32_t looks = 0;
    std::uint64_t at = 0;
  };
  struct Noise {
    float noise;
    double sum = 0, count = 0;
    void add(double sum_of_off, double of, float least);
  };
  struct Chosen {
    int index;
    std::uint64_t rank;
  };
  const Tile* tile_at(int index) const {
    const std::int16_t slot = slots_[static_cast<std::size_t>(index)];
    return slot < 0 ? nullptr : &tiles_[static_cast<std::size_t>(slot)];
  }
  bool is_such(const Picture& picture);
  Tile& tile_for(int index);
  void look(const Picture& picture, int index, const ObjectDisc* hidden, std::size_t hidden_count);
  const Tile& known_at(unsigned tile_u, unsigned tile_v) const {
    const Tile* tile = tile_at(static_cast<int>(tile_v) * across_ + static_cast<int>(tile_u));
    return tile == nullptr ? unknown_ : *tile;
  }
  // The same for many places of pictures that share chroma so, from values at hand.
  struct Known {
    const std::int16_t* slots;
    const Tile *tiles, *unknown;
    unsigned across;
    const Tile& operator()(unsigned tile_u, unsigned tile_v) const {
      if (slots == nullptr) return *unknown;
      const std::int16_t slot = slots[tile_v * across + tile_u];
      return slot < 0 ? *unknown : tiles[slot];
    }
  };
  Known known_of(const Picture& picture) const {
    const bool has_learnt_such = picture.columns == columns_ && picture.rows == rows_;
    return {has_learnt_such ? slots_.data() : nullptr, tiles_.data(), &unknown_, static_cast<unsigned>(across_)};
  }

  int width_, height_, across_, down_;
  std::size_t tiles_kept_;
  int columns_ = 0, rows_ = 0;       // that share chroma
  std::vector<std::int16_t> slots_;  // per tile of the picture, -1: none
  std::vector<Looked> looked_;       // per tile of the picture
  std::vector<Tile> tiles_;
  Tile unknown_;  // of no looks
  std::vector<Chosen> chosen_;
  std::uint64_t pictures_ = 0;
  int next_ = 0, unknown_tiles_ = 0, rare_pictures_ = 0;
  Noise light_{2.f}, chroma_{2.f};
};

}  // namespace huetrack::outline
