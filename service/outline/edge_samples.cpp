#include "outline/edge_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <type_traits>

#include "outline/camera_curve.h"
#include "particle_filter/vector_clones.h"

namespace huetrack::outline {
namespace {

struct EdgeSamplingTuning {
  double most_of_edge = 320;        // samples; more add no accuracy (experiment)
  double least_of_edge = 128;       // samples of a large ball; fewer miss what hides a part of it (experiment)
  double large_radius_px = 16;      // from here on fewer samples do: the model's error grows with the radius
  float blur_reach_px = 1.2f;       // of the band's reach; further out only the background is seen
  int outer_step = 3;               // one of so many samples there
  int inner_step = 5;               // one of so many samples well inside a ball of medium size
  int large_inner_step = 11;        // and well inside a large ball
  float unknown_variance = 400;     // of an unknown background, in variances of a picture, at most
  double min_guessed_variance = 4;  // of a background that is guessed from the rim, at least
};
constexpr EdgeSamplingTuning edge_sampling{};

struct OcclusionTuning {
  float distinct_sigmas2 = 64;   // squared distance from the object's colour of what is not the object: 8 sigma
  float nearer2 = 0.5f;          // hidden: squared distance from the background, in that from the object's colour
  float darkest_light = 0.25f;   // the object's colour under any light: from a quarter of its own brightness
  float brightest_light = 1.6f;  // to so much
};
constexpr OcclusionTuning occlusion{};
constexpr int block = EdgeSamples::block;
using Block = EdgeSamples::Block;

// The rim of the grid, in samples of light or of chroma.
struct Rim {
  int u0, v0, across, down;
  float u_centre, v_centre;
  static constexpr int most = 512;  // capacity
  // Some of its samples, all around.
  int walk(std::int32_t* us, std::int32_t* vs) const {
    const int some = 1 + (across + down) / 64;  // layout: at most 128 of them
    int n = 0;
    for (int v = 0; v < down && n < most; v += v + some < down ? some : std::max(1, down - 1 - v)) {
      for (int u = 0; u < across && n < most; u += v == 0 || v == down - 1 ? some : std::max(1, across - 1))
        us[n] = u0 + u, vs[n++] = v0 + v;
    }
    return n;
  }
};

// Where rays from the centre through these places meet the rim.
HUETRACK_CLONES void find_beyond(const Rim& rim, int n, const int* __restrict at_u, const int* __restrict at_v,
                                 int* __restrict u, int* __restrict v) {
  const int u0 = rim.u0, v0 = rim.v0;
  const float u_centre = rim.u_centre, v_centre = rim.v_centre;
  const auto right = static_cast<float>(rim.across - 1), bottom = static_cast<float>(rim.down - 1);
  for (int k = 0; k < n; ++k) {
    const float du = static_cast<float>(at_u[k] - u0) - u_centre, dv = static_cast<float>(at_v[k] - v0) - v_centre;
    const auto times_to = [](float d, float centre, float end) __attribute__((always_inline)) {
      constexpr float near = 1e-6f;  // maths: keeps a division finite
      const float length = d < 0 ? -d : d, way = d < 0 ? centre : end - centre;
      return way / (length < near ? near : length);
    };
    const float to_side = times_to(du, u_centre, right), to_end = times_to(dv, v_centre, bottom);
    const float nearer = to_side < to_end ? to_side : to_end, far = nearer < 1 ? 1 : nearer;
    const float on_u = u_centre + far * du, on_v = v_centre + far * dv;
    const float in_u = on_u < 0 ? 0 : on_u > right ? right : on_u, in_v = on_v < 0 ? 0 : on_v > bottom ? bottom : on_v;
    u[k] = u0 + static_cast<int>(in_u + 0.5f), v[k] = v0 + static_cast<int>(in_v + 0.5f);
  }
}

// Variance in variances of a single picture; half of it, because the nearest sample of the rim explains the rest.
float variance_of(const float* values, int n, float sigma) {
  double sum = 0, squares = 0;
  for (int i = 0; i < n; ++i) {
    const auto x = static_cast<double>(values[i]);
    sum += x, squares += x * x;
  }
  const double all = squares / n - sum * sum / (static_cast<double>(n) * n);
  return static_cast<float>(std::clamp(0.5 * all / static_cast<double>(sigma * sigma),
                                       edge_sampling.min_guessed_variance,
                                       static_cast<double>(edge_sampling.unknown_variance)));
}

// Positions relative to the start's centre.
HUETRACK_CLONES void place(int n, const std::int32_t* __restrict at_u, const std::int32_t* __restrict at_v,
                           float columns, float rows, float u_off, float v_off, float* __restrict u,
                           float* __restrict v) {
  for (int k = 0; k < n; ++k) {
    u[k] = static_cast<float>(at_u[k]) * columns + u_off;
    v[k] = static_cast<float>(at_v[k]) * rows + v_off;
  }
}

HUETRACK_CLONES void make_linear_block(int n, float blue_part, float red_part, float light_part, Block& of) {
  const EdgeSamples::GreyValues &behind = of.behind, &seen = of.seen;
  for (int k = 0; k < n; ++k) {
    const LinearLight lit = linear_light(behind.light[k], behind.blue[k], behind.red[k]);
    of.red[k] = lit.red, of.green[k] = lit.green, of.blue[k] = lit.blue;
    const LightChroma shown = ycc(white * grey_of(lit.red), white * grey_of(lit.green), white * grey_of(lit.blue));
    of.measured[k] = light_part * seen.light[k] + blue_part * seen.blue[k] + red_part * seen.red[k];
    of.offset[k] = light_part * (behind.light[k] - shown.light) + blue_part * (behind.blue[k] - shown.blue) +
                   red_part * (behind.red[k] - shown.red);
  }
}

HUETRACK_CLONES void find_hidden_block(int n, const float* object, float per_light, float per_chroma, Block& of) {
  const float o0 = object[0] * per_light, o1 = object[1] * per_chroma, o2 = object[2] * per_chroma;
  const float chroma2 = o1 * o1 + o2 * o2;
  const float per_object2 = 1 / (o0 * o0 + chroma2), per_chroma2 = chroma2 > 0 ? 1 / chroma2 : 0;
  const auto from_object2 = [&](float c0, float c1, float c2) __attribute__((always_inline)) {
    float as = (c0 * o0 + c1 * o1 + c2 * o2) * per_object2;
    as = as < occlusion.darkest_light     ? occlusion.darkest_light
         : as > occlusion.brightest_light ? occlusion.brightest_light
                                          : as;
    const float d0 = c0 - as * o0, d1 = c1 - as * o1, d2 = c2 - as * o2;
    return d0 * d0 + d1 * d1 + d2 * d2;
  };
  const EdgeSamples::GreyValues &behind = of.behind, &seen = of.seen;
  for (int k = 0; k < n; ++k) {
    const float b0 = behind.light[k] * per_light, b1 = behind.blue[k] * per_chroma, b2 = behind.red[k] * per_chroma;
    const float s0 = seen.light[k] * per_light, s1 = seen.blue[k] * per_chroma, s2 = seen.red[k] * per_chroma;
    const float d0 = s0 - b0, d1 = s1 - b1, d2 = s2 - b2;
    const float distinct = from_object2(b0, b1, b2) >= occlusion.distinct_sigmas2 ? 1.f : 0.f;
    const float nearer = d0 * d0 + d1 * d1 + d2 * d2 <= occlusion.nearer2 * from_object2(s0, s1, s2) ? 1.f : 0.f;
    // Chroma is proportional to the light of the colour, and white adds none.
    float as = (s1 * o1 + s2 * o2) * per_chroma2;
    as = as < 0 ? 0 : as > occlusion.brightest_light ? occlusion.brightest_light : as;
    const float e1 = s1 - as * o1, e2 = s2 - as * o2;
    const float other = e1 * e1 + e2 * e2 >= occlusion.distinct_sigmas2 ? 1.f : 0.f;
    of.hidden[k] = other > 0 ? other : distinct * nearer;
  }
}

// Per row the half-open range of samples within an ellipse; empty where from == to.
struct RowSpans {
  static constexpr int most = 128;  // capacity: OutlierPixels::largest_grid
  int from[most], to[most];
};
// a u^2 + 2 b u v + c v^2 is the square of the distance from the centre, in radii.
struct SpannedRows {
  float a, b, c;
  float first_u, per_column, across;  // of the first column; of a pixel; columns
  float first_v, row_px;
  int down;
};
HUETRACK_CLONES void find_spans(const SpannedRows& of, float rho2, RowSpans& out) {
  const float a = of.a, b = of.b, c = of.c, per_a = 1 / of.a;
  const float first_u = of.first_u, per_column = of.per_column, across = of.across;
  const float first_v = of.first_v, row_px = of.row_px;
  for (int j = 0; j < of.down; ++j) {
    const float v = first_v + static_cast<float>(j) * row_px;
    const float left = b * b * v * v - a * (c * v * v - rho2);
    const float half = std::sqrt(left > 0 ? left : 0) * per_a, middle = -b * v * per_a;
    const auto at = [=](float u) __attribute__((always_inline)) {
      const float column = (u - first_u) * per_column;
      const float inside = column < 0 ? 0 : column > across ? across : column;
      const int below = static_cast<int>(inside);
      return below + (static_cast<float>(below) < inside ? 1 : 0);
    };
    out.from[j] = at(middle - half);
    out.to[j] = left > 0 ? at(middle + half) : out.from[j];
  }
}

// Positions of the samples taken, all trusted. (u_off, v_off): from the grid to the centre.
void place_all(const EdgeBand& band, int columns, int rows, float u_off, float v_off, EdgeSamples& out) {
  // Padding lies far outside, where nothing is covered.
  const auto far = static_cast<float>(1e3 * (band.radius_px + band.reach_px));
  for (int n = 0; n < out.block_count(); ++n) {
    Block& of = out.blocks[n];
    const int count = out.count_in(n), filled = out.filled_in(n);
    for (int k = count; k < filled; ++k) of.at_u[k] = of.at_v[k] = 0;
    place(filled, of.at_u, of.at_v, static_cast<float>(columns), static_cast<float>(rows), u_off, v_off, of.u, of.v);
    std::fill_n(of.trust, count, 1.f), std::fill_n(of.hidden, filled, 0.f);
    for (int k = count; k < filled; ++k) of.u[k] = of.v[k] = far, of.trust[k] = 0;
  }
}

}  // namespace

void select_samples(const EdgeBand& band, const PixelGrid& grid, int columns, int rows, EdgeSamples& out) {
  out.n = 0;
  const auto radius = static_cast<float>(band.radius_px), reach = static_cast<float>(band.reach_px);
  const auto squared = [](float x) { return x > 0 ? x * x : 0; };
  // Squared radii: of the band, of the blurred edge, and inside which only the ball is seen.
  const float outer = squared(1 + reach / radius), soft = squared(1 + (reach - edge_sampling.blur_reach_px) / radius),
              inner = squared(1 - reach / radius);
  const Eigen::Matrix2f m = band.disc_from_px.cast<float>();
  const float m00 = m(0, 0), m01 = m(0, 1), m10 = m(1, 0), m11 = m(1, 1);
  const float all = std::numbers::pi_v<float> * radius * radius *
                    (soft - inner + (outer - soft) / static_cast<float>(edge_sampling.outer_step)) /
                    static_cast<float>(columns * rows);
  const double enough = std::clamp(edge_sampling.most_of_edge * edge_sampling.large_radius_px / band.radius_px,
                                   edge_sampling.least_of_edge, edge_sampling.most_of_edge);
  const int some = std::max(1, static_cast<int>(std::ceil(static_cast<double>(all) / enough)));
  const int across = grid.width / columns, down = grid.height / rows;
  const int u_first = grid.u0 / columns, v_first = grid.v0 / rows;
  const auto u_off = static_cast<float>(0.5 * (columns - 1) - band.centre.x());
  const auto v_off = static_cast<float>(0.5 * (rows - 1) - band.centre.y());
  RowSpans of_outer, of_soft, of_inner;
  const SpannedRows spanned{m00 * m00 + m10 * m10,
                            m00 * m01 + m10 * m11,
                            m01 * m01 + m11 * m11,
                            static_cast<float>(grid.u0) + u_off,
                            1 / static_cast<float>(columns),
                            static_cast<float>(across),
                            static_cast<float>(grid.v0) + v_off,
                            static_cast<float>(rows),
                            down};
  find_spans(spanned, outer, of_outer), find_spans(spanned, soft, of_soft);
  const bool has_some_within = band.radius_px > edge_sampling.large_radius_px / 2;
  if (has_some_within) find_spans(spanned, inner, of_inner);
  const auto take = [&](int i, int j) {
    if (out.n == EdgeSamples::most) return;
    Block& to = out.blocks[static_cast<unsigned>(out.n) / block];
    const auto k = static_cast<unsigned>(out.n++) % block;
    to.at_u[k] = u_first + i, to.at_v[k] = v_first + j;
  };
  // Steps are compile-time constants, because division is slow.
  const auto take_rows = [&](auto within) {
    int wait = 0;  // steps until the next sample is taken
    // Every step-th sample, staggered from row to row, and of these one of `some`.
    const auto take_some = [&](auto step, int j, int from, int to, int stagger) {
      if (from >= to) return;
      int i = from + (step - (from + stagger * j) % step) % step + wait * step;
      for (; i < to; i += step * some) take(i, j);
      wait = (i - to) / step;
    };
    constexpr std::integral_constant<int, 1> each;
    constexpr std::integral_constant<int, edge_sampling.outer_step> beyond;
    for (int j = 0; j < down; ++j) {
      const int from = of_outer.from[j], to = of_outer.to[j];
      const bool has_soft = of_soft.from[j] < of_soft.to[j];
      const int soft_from = has_soft ? of_soft.from[j] : to, soft_to = has_soft ? of_soft.to[j] : to;
      const bool has_inner = within > 1 && of_inner.from[j] < of_inner.to[j];
      const int inner_from = has_inner ? of_inner.from[j] : soft_to, inner_to = has_inner ? of_inner.to[j] : soft_to;
      take_some(beyond, j, from, soft_from, 1);
      take_some(each, j, soft_from, inner_from, 0);
      take_some(within, j, inner_from, inner_to, 3);
      take_some(each, j, inner_to, soft_to, 0);
      take_some(beyond, j, soft_to, to, 1);
    }
  };
  if (band.radius_px > edge_sampling.large_radius_px)
    take_rows(std::integral_constant<int, edge_sampling.large_inner_step>{});
  else if (has_some_within)
    take_rows(std::integral_constant<int, edge_sampling.inner_step>{});
  else
    take_rows(std::integral_constant<int, 1>{});
  place_all(band, columns, rows, u_off, v_off, out);
}

namespace {

// Guesses an unknown background from the rim of the grid.
class Guess {
 public:
  Guess(const Picture& picture, const EdgeBand& band, const PixelGrid& grid, const PictureNoise& noise)
      : picture_(picture),
        noise_(noise),
        pixels_{grid.u0,
                grid.v0,
                grid.width,
                grid.height,
                static_cast<float>(band.centre.x() - grid.u0),
                static_cast<float>(band.centre.y() - grid.v0)},
        samples_{grid.u0 / grid.columns,
                 grid.v0 / grid.rows,
                 grid.width / grid.columns,
                 grid.height / grid.rows,
                 pixels_.u_centre / static_cast<float>(grid.columns),
                 pixels_.v_centre / static_cast<float>(grid.rows)} {}

  // Sets the light of those places whose count is 0. At most 4 blocks of places.
  void light(const Places& at, const float* count, float* light) const {
    const Unknown rest = unknown_of(pixels_, at, count);
    float values[most];
    read_light(picture_, {rest.u, rest.v, rest.n}, values);
    for (int i = 0; i < rest.n; ++i) light[rest.of[i]] = values[i];
  }
  void chroma(const Places& at, const float* count, float* blue, float* red) const {
    const Unknown rest = unknown_of(samples_, at, count);
    float blues[most], reds[most];
    read_chroma(picture_, {rest.u, rest.v, rest.n}, blues, reds);
    for (int i = 0; i < rest.n; ++i) blue[rest.of[i]] = blues[i], red[rest.of[i]] = reds[i];
  }
  float light_variance() {
    if (light_variance_ > 0) return light_variance_;
    std::int32_t us[Rim::most], vs[Rim::most];
    float light[Rim::most];
    const int n = pixels_.walk(us, vs);
    read_light(picture_, {us, vs, n}, light);
    return light_variance_ = variance_of(light, n, noise_.light);
  }
  float chroma_variance() {
    if (chroma_variance_ > 0) return chroma_variance_;
    std::int32_t us[Rim::most], vs[Rim::most];
    float blue[Rim::most], red[Rim::most];
    const int n = samples_.walk(us, vs);
    read_chroma(picture_, {us, vs, n}, blue, red);
    return chroma_variance_ = std::max(variance_of(blue, n, noise_.chroma), variance_of(red, n, noise_.chroma));
  }

 private:
  static constexpr int most = 4 * block;  // capacity
  struct Unknown {
    int n = 0, of[most], u[most], v[most];
  };
  static Unknown unknown_of(const Rim& rim, const Places& at, const float* count) {
    Unknown out;
    int us[most], vs[most];
    for (int k = 0; k < at.n; ++k) {
      out.of[out.n] = k, us[out.n] = at.u[k], vs[out.n] = at.v[k];
      out.n += count[k] > 0 ? 0 : 1;
    }
    find_beyond(rim, out.n, us, vs, out.u, out.v);
    return out;
  }
  const Picture& picture_;
  PictureNoise noise_;
  Rim pixels_, samples_;
  float light_variance_ = 0, chroma_variance_ = 0;  // 0: not computed yet
};

// Background light of samples of chroma: the mean over their pixels.
void light_of_parts(const Background& behind, const Guess& guess, const PixelGrid& grid, const Places& samples,
                    float* light) {
  constexpr int most = 4 * block;  // capacity
  int us[most], vs[most], n = 0;
  for (int k = 0; k < samples.n; ++k)
    for (int j = 0; j < grid.rows; ++j)
      for (int i = 0; i < grid.columns; ++i)
        us[n] = samples.u[k] * grid.columns + i, vs[n++] = samples.v[k] * grid.rows + j;
  float of_parts[most], count[most];
  behind.light({us, vs, n}, of_parts, count);
  guess.light({us, vs, n}, count, of_parts);
  const int parts = grid.columns * grid.rows;
  for (int k = 0; k < samples.n; ++k)
    light[k] = std::accumulate(of_parts + k * parts, of_parts + (k + 1) * parts, 0.f) / static_cast<float>(parts);
}

bool are_all_known(const float* count, int n) {
  int unknown = 0;
  for (int k = 0; k < n; ++k) unknown += count[k] > 0 ? 0 : 1;
  return unknown == 0;
}

void fill_up(EdgeSamples::GreyValues& values, int from, int to) {
  for (int k = from; k < to; ++k) values.light[k] = values.blue[k] = values.red[k] = 0;
}

void set_variance(Block& of, int n, const float* count, float guessed) {
  for (int k = 0; k < n; ++k) of.unsure[k] = count[k] > 0 ? 1 / count[k] : guessed;
}

}  // namespace

void read_samples(const Picture& picture, const Background& behind, const EdgeBand& band, const PixelGrid& grid,
                  const PictureNoise& noise, EdgeSamples& light, EdgeSamples& chroma) {
  Guess guess(picture, band, grid, noise);
  alignas(64) std::int32_t us[block], vs[block];
  alignas(64) float light_count[block], chroma_count[block];
  // A pixel has the chroma of the sample in which it lies.
  const int columns = grid.columns - 1, rows = grid.rows - 1;  // binary shifts: 1 or 2 pixels
  for (int b = 0; b < light.block_count(); ++b) {
    Block& of = light.blocks[b];
    const int n = light.count_in(b), filled = light.filled_in(b);
    for (int k = 0; k < n; ++k) us[k] = of.at_u[k] >> columns, vs[k] = of.at_v[k] >> rows;
    read_light(picture, {of.at_u, of.at_v, n}, of.seen.light);
    read_chroma(picture, {us, vs, n}, of.seen.blue, of.seen.red);
    behind.at_pixels(picture, {of.at_u, of.at_v, n},
                     {of.behind.light, of.behind.blue, of.behind.red, light_count, chroma_count});
    if (!are_all_known(chroma_count, n)) guess.chroma({us, vs, n}, chroma_count, of.behind.blue, of.behind.red);
    const bool is_known = are_all_known(light_count, n);
    if (!is_known) guess.light({of.at_u, of.at_v, n}, light_count, of.behind.light);
    fill_up(of.seen, n, filled), fill_up(of.behind, n, filled), std::fill(light_count + n, light_count + filled, 1.f);
    set_variance(of, filled, light_count, is_known ? 0 : guess.light_variance());
  }
  for (int b = 0; b < chroma.block_count(); ++b) {
    Block& of = chroma.blocks[b];
    const int n = chroma.count_in(b), filled = chroma.filled_in(b);
    read_chroma(picture, {of.at_u, of.at_v, n}, of.seen.blue, of.seen.red);
    std::fill_n(of.seen.light, n, 0.f);
    behind.at_chroma(picture, {of.at_u, of.at_v, n},
                     {of.behind.light, of.behind.blue, of.behind.red, light_count, chroma_count});
    if (!are_all_known(light_count, n)) light_of_parts(behind, guess, grid, {of.at_u, of.at_v, n}, of.behind.light);
    const bool is_known = are_all_known(chroma_count, n);
    if (!is_known) guess.chroma({of.at_u, of.at_v, n}, chroma_count, of.behind.blue, of.behind.red);
    fill_up(of.seen, n, filled), fill_up(of.behind, n, filled), std::fill(chroma_count + n, chroma_count + filled, 1.f);
    set_variance(of, filled, chroma_count, is_known ? 0 : guess.chroma_variance());
  }
}

void make_linear(EdgeSamples& samples, float blue_part, float red_part) {
  const float light_part = blue_part == 0 && red_part == 0 ? 1.f : 0.f;
  for (int b = 0; b < samples.block_count(); ++b)
    make_linear_block(samples.filled_in(b), blue_part, red_part, light_part, samples.blocks[b]);
}

void find_hidden(EdgeSamples& light, const float* object, const PictureNoise& noise) {
  for (int b = 0; b < light.block_count(); ++b)
    find_hidden_block(light.filled_in(b), object, 1 / noise.light, 1 / noise.chroma, light.blocks[b]);
}

}  // namespace huetrack::outline
