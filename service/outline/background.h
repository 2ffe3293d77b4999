// Background of one view: per sample the running mean of the pictures in which the object did not cover it, learnt
// while the object is tracked. A value that is repeatedly different replaces the mean, so the model follows light and
// scene. Units: grey values (0..255); samples of chroma as the picture shares them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "outline/picture.h"

namespace huetrack::outline {

// Pixels that belong to the object, or may.
struct ObjectDisc {
  Eigen::Vector2d px;
  double radius_px = 0;
};

struct BackgroundNoiseTuning {
  int max_count = 16;         // pictures; then the mean forgets exponentially: 0.5 s at 30 Hz (experiment)
  float initial_noise = 2.f;  // grey values, 1 sigma of one picture, until it was measured; a webcam in room light
  float model_light = 1.5f;   // grey values by which the models of background and edge err, 1 sigma (experiment)
  float model_chroma = 1.f;   // grey values, the same of chroma (experiment)
};
inline constexpr BackgroundNoiseTuning background_noise{};

// thread-compatible; one per view. Bounded memory: 2 KB per tile of 16x16 pixels, at most max_tiles of them; the tile
// that was updated longest ago is replaced.
class Background {
 public:
  static constexpr int tile_px = 16;              // layout: bytes of a tile
  static constexpr std::size_t max_tiles = 1200;  // capacity: 2.4 MB

  Background(int width, int height);

  // Updates a few tiles: of those between `object` and its position after `ahead_px` the least known, and some of the
  // others in turn. Of a partial picture only the first kind; what lies outside the part keeps its mean.
  // hidden: discs that are not background.
  void learn(const Picture& picture, const ObjectDisc& object, const Eigen::Vector2d& ahead_px,
             const ObjectDisc* hidden, std::size_t hidden_count);
  // For pictures that come rarely: updates all tiles.
  void learn_all(const Picture& picture, const ObjectDisc* hidden, std::size_t hidden_count);
  void forget();

  // Light of the background at these pixels. count: pictures in the mean; 0: unknown.
  void light(const Places& at, float* light, float* count) const;
  // Light and chroma. A pixel has the chroma of the sample in which it lies; a sample of chroma has the mean light of
  // its pixels, known where all of them are. picture: how chroma is shared.
  struct Values {
    float *light, *blue, *red, *light_count, *chroma_count;
  };
  void at_pixels(const Picture& picture, const Places& at, const Values& out) const;
  void at_chroma(const Picture& picture, const Places& at, const Values& out) const;
  // Of a single picture, its noise and the model's error: standard deviation in grey values.
  float light_noise() const { return std::hypot(light_.noise, background_noise.model_light); }
  float chroma_noise() const { return std::hypot(chroma_.noise, background_noise.model_chroma); }

 private:
  static constexpr int samples = tile_px * tile_px;
  using Means = std::array<std::int16_t, samples>;  // grey values in 1/64
  struct Tile {
    int index = -1;  // in the picture
    Means light{}, blue{}, red{};
    std::array<std::uint8_t, samples> light_count{}, chroma_count{};
  };
  // Kept apart from the tiles, because the choice of tiles compares many of them.
  struct Updates {
    std::uint32_t count = 0;
    std::uint64_t last = 0;  // picture number
  };
  struct Noise {
    float noise;
    double sum = 0, count = 0;
    void add(double sum_of_deviations, double of, float min_noise);
  };
  struct Chosen {
    int index;
    std::uint64_t rank;
  };
  // Access to the tiles of pictures that share chroma in the same way.
  struct TileMap {
    const std::int16_t* slots;
    const Tile *tiles, *unknown;
    unsigned across;
    const Tile& operator()(unsigned tile_u, unsigned tile_v) const {
      if (slots == nullptr) return *unknown;
      const std::int16_t slot = slots[tile_v * across + tile_u];
      return slot < 0 ? *unknown : tiles[slot];
    }
  };
  TileMap all_tiles() const { return {slots_.data(), tiles_.data(), &unknown_, static_cast<unsigned>(across_)}; }
  TileMap tiles_of(const Picture& picture) const {
    TileMap tiles = all_tiles();
    if (picture.columns != columns_ || picture.rows != rows_) tiles.slots = nullptr;
    return tiles;
  }
  bool accepts(const Picture& picture);
  Tile& tile_for(int index);
  void update_tile(const Picture& picture, int index, const ObjectDisc* hidden, std::size_t hidden_count);

  int width_, height_, across_, down_;
  int columns_ = 0, rows_ = 0;       // that share chroma
  std::vector<std::int16_t> slots_;  // per tile of the picture, -1: none
  std::vector<Updates> updates_;     // per tile of the picture
  std::vector<Tile> tiles_;
  Tile unknown_;  // of count 0
  std::vector<Chosen> chosen_;
  std::uint64_t pictures_ = 0;
  int next_ = 0, unknown_tiles_ = 0;
  Noise light_{background_noise.initial_noise}, chroma_{background_noise.initial_noise};
};

}  // namespace huetrack::outline
