#include "outline/outline_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "particle_filter/vector_clones.h"

namespace huetrack::outline {
namespace {

constexpr float white = 255;  // grey values of an R G B of 1
// Linear light is as sharp as the lens; what colors add to it is softer: a sensor has one color per pixel.
constexpr float grey_red = 0.25f, grey_green = 0.5f, grey_blue = 0.25f;
constexpr float darkest = 1e-4f;  // linear

constexpr double reach_px = 4;           // beyond the edge, and within it: as far as an edge's softness carries
constexpr double least_radius_px = 1.5;  // smaller discs are all edge
constexpr int least_pixels = 24;
constexpr float least_contrast = 4;  // of the object's colour to what is behind it, in standard deviations of a pixel
// Samples around the edge, evenly chosen. A ball's model is off by a share of its radius, samples by what they are: the
// larger it is, the fewer are enough, down to what tells what hides it.
constexpr double most_of_edge = 320, least_of_edge = 128, small_radius_px = 16;
constexpr float model_light = 1.5f, model_chroma = 1.f;  // grey values by which the model itself is off
constexpr float unknown_behind = 400;  // the variance of a background that is not known, in those of a pixel
constexpr double least_guessed = 4;    // one that is guessed from what is around
constexpr float loss2 = 4;             // Cauchy's, beyond two standard deviations
constexpr double usual_loss = 0.66;    // what it makes of a normal residual's square
constexpr double worst_misfit = 9;
constexpr double least_visible = 0.25;  // of the edge
constexpr float glint_sigmas2 = 16;     // of a pixel within the outline over what light on a dull ball makes of it
// Natural logarithms: by how much pictures of one camera differ in blur, and what light that the model does not know
// makes of a single one's; pictures that follow one another show much the same, so that ten count as one.
constexpr double blur_of_one = 0.05, blur_of_light = 0.6, least_blur_sigma = 0.05;
constexpr double furthest_radii = 0.8, largest_growth = 0.35;
constexpr double longest_exposure_s = 0.04;

// The camera's curve, sRGB, from grey values 0..1 to light and back: a cubic, and its inverse by one step of Newton's.
constexpr float curve1 = 0.012522878f, curve2 = 0.682171111f, curve3 = 0.305306011f;
inline float light_of(float grey) {
  return grey * (curve1 + grey * (curve2 + grey * curve3));
}

struct LightChroma {
  float light, blue, red;
};
inline LightChroma ycc(float r, float g, float b) {
  const float y = y_red * r + y_green * g + y_blue * b;
  return {y, by_blue * (b - y), by_red * (r - y)};
}

inline float grey_of(float light) {
  const float root = std::sqrt(light);
  const float grey = root * (1.17f - 0.17f * root);
  return grey - (light_of(grey) - light) / (curve1 + grey * (2 * curve2 + grey * 3 * curve3));
}

HUETRACK_CLONES void lights_behind(int n, const float* __restrict light, const float* __restrict blue,
                                   const float* __restrict red, float* __restrict r, float* __restrict g,
                                   float* __restrict b) {
  for (int i = 0; i < n; ++i) {
    const float gr = (light[i] + red[i] / by_red) / white, gb = (light[i] + blue[i] / by_blue) / white;
    const float gg = (light[i] / white - y_red * gr - y_blue * gb) / y_green;
    const auto lit = [](float grey) {
      const float c = grey < 0 ? 0 : grey > 1.2f ? 1.2f : grey;
      const float l = light_of(c);
      return l < darkest ? darkest : l;
    };
    r[i] = lit(gr), g[i] = lit(gg), b[i] = lit(gb);
  }
}

// What the camera's curve makes of those lights.
HUETRACK_CLONES void shown_behind(int n, const float* __restrict r, const float* __restrict g,
                                  const float* __restrict b, float* __restrict light, float* __restrict blue,
                                  float* __restrict red) {
  for (int i = 0; i < n; ++i) {
    const float gr = white * grey_of(r[i]), gg = white * grey_of(g[i]), gb = white * grey_of(b[i]);
    const float y = y_red * gr + y_green * gg + y_blue * gb;
    light[i] = y, blue[i] = by_blue * (gb - y), red[i] = by_red * (gr - y);
  }
}

// In eight lanes.
using Lanes = float __attribute__((vector_size(32), may_alias));

// Adds up the products of three columns with three others, n of each: as many sums as registers hold.
template <int stride>
inline __attribute__((always_inline)) void add_products(const float* a, const float* b, int n, Lanes* sums) {
  const auto *a0 = reinterpret_cast<const Lanes*>(a), *a1 = reinterpret_cast<const Lanes*>(a + stride),
             *a2 = reinterpret_cast<const Lanes*>(a + 2 * stride);
  const auto *b0 = reinterpret_cast<const Lanes*>(b), *b1 = reinterpret_cast<const Lanes*>(b + stride),
             *b2 = reinterpret_cast<const Lanes*>(b + 2 * stride);
  Lanes s00{}, s01{}, s02{}, s10{}, s11{}, s12{}, s20{}, s21{}, s22{};
  for (int i = 0; i < n / 8; ++i) {
    s00 += a0[i] * b0[i], s01 += a0[i] * b1[i], s02 += a0[i] * b2[i];
    s10 += a1[i] * b0[i], s11 += a1[i] * b1[i], s12 += a1[i] * b2[i];
    s20 += a2[i] * b0[i], s21 += a2[i] * b1[i], s22 += a2[i] * b2[i];
  }
  sums[0] += s00, sums[1] += s01, sums[2] += s02;
  sums[3] += s10, sums[4] += s11, sums[5] += s12;
  sums[6] += s20, sums[7] += s21, sums[8] += s22;
}

double sum_of(const Lanes& lanes) {
  double sum = 0;
  for (int l = 0; l < 8; ++l) sum += static_cast<double>(lanes[l]);
  return sum;
}

// Of samples that lie within the outline: is what is seen there rather what is behind, which no light on the object
// could be mistaken for? per_sigma: of light and chroma.
HUETRACK_CLONES void find_hidden(int n, const float* __restrict seen_light, const float* __restrict seen_blue,
                                 const float* __restrict seen_red, const float* __restrict light,
                                 const float* __restrict blue, const float* __restrict red, const float* object,
                                 float per_light, float per_chroma, float* __restrict hidden) {
  constexpr float telling_sigmas2 = 64, nearer2 = 0.5f, darker = 0.25f, brighter = 1.6f;
  const float o0 = object[0] * per_light, o1 = object[1] * per_chroma, o2 = object[2] * per_chroma;
  const float per_object2 = 1 / (o0 * o0 + o1 * o1 + o2 * o2);
  const auto from_object2 = [&](float c0, float c1, float c2) {
    float as = (c0 * o0 + c1 * o1 + c2 * o2) * per_object2;
    as = as < darker ? darker : as > brighter ? brighter : as;
    const float d0 = c0 - as * o0, d1 = c1 - as * o1, d2 = c2 - as * o2;
    return d0 * d0 + d1 * d1 + d2 * d2;
  };
  for (int i = 0; i < n; ++i) {
    const float b0 = light[i] * per_light, b1 = blue[i] * per_chroma, b2 = red[i] * per_chroma;
    const float s0 = seen_light[i] * per_light, s1 = seen_blue[i] * per_chroma, s2 = seen_red[i] * per_chroma;
    const float d0 = s0 - b0, d1 = s1 - b1, d2 = s2 - b2;
    const bool is_telling = from_object2(b0, b1, b2) >= telling_sigmas2;
    const bool is_nearer = d0 * d0 + d1 * d1 + d2 * d2 <= nearer2 * from_object2(s0, s1, s2);
    hidden[i] = is_telling && is_nearer ? 1.f : 0.f;
  }
}

// How samples of light, or of chroma, lie in the box around the object.
struct Grid {
  int u0, v0, across, down;
  double u_centre, v_centre;
  Eigen::Vector2i on_rim(int u, int v) const {
    const double right = across - 1, bottom = down - 1, du = u - u0 - u_centre, dv = v - v0 - v_centre;
    const double to_side = du > 0 ? (right - u_centre) / du : du < 0 ? -u_centre / du : 1e9;
    const double to_end = dv > 0 ? (bottom - v_centre) / dv : dv < 0 ? -v_centre / dv : 1e9;
    const double far = std::max(1.0, std::min(to_side, to_end));
    const auto on = [](double x, double most) { return static_cast<int>(std::lround(std::clamp(x, 0.0, most))); };
    return {u0 + on(u_centre + far * du, right), v0 + on(v_centre + far * dv, bottom)};
  }
  // Variance along the rim, in those of a single picture; half of it is what a neighbour does not tell.
  template <typename Value>
  float variance(float sigma, Value&& value) const {
    double sum = 0, squares = 0, n = 0;
    for (int v = 0; v < down; ++v) {
      for (int u = 0; u < across; u += v == 0 || v == down - 1 ? 1 : std::max(1, across - 1)) {
        const double x = static_cast<double>(value(u0 + u, v0 + v));
        sum += x, squares += x * x, ++n;
      }
    }
    const double all = squares / n - sum * sum / (n * n);
    return static_cast<float>(
        std::clamp(0.5 * all / static_cast<double>(sigma * sigma), least_guessed, static_cast<double>(unknown_behind)));
  }
};

}  // namespace

// What is the same for all rows of one kind.
struct OutlineFit::Kind {
  float by_red, by_green, by_blue;  // of a pixel's R', G', B', what is seen
  float sigma;
  float blur2, more2, extra_u, extra_v, smear2;  // px^2: of light; more of it of color; of the sample; per (px/s)^2
  float cu, cv, m00, m01, m10, m11;
  float vx, vy, exposure;
  int moments;
  std::array<float, 8> moment;    // in exposures
  float red, green, blue, level;  // the object: what its color adds to its grey
  float grey;
  std::array<float, 9> shading;
  std::array<float, 3> paleness;
  float lit, lit_v;
};

struct OutlineFit::Assembly {
  static constexpr int threes = columns / 3;
  Lanes products[threes][threes][9] = {};  // of columns by threes, the upper half
  double residual2 = 0, trusted = 0, edge = 0, seen_edge = 0;
};

OutlineFit::OutlineFit() : near_marks_(largest_box * largest_box) {
  marks_.reserve(4 * most_rows);
}

// The pixels within reach. false: none, or too many.
bool OutlineFit::find_box(const Picture& picture) {
  columns_ = picture.columns, rows_ = picture.rows;
  has_chroma_ = !picture.is_grey;
  const Eigen::Matrix2d px_from_disc = disc_from_px_.inverse();
  const auto bounds = [&](int axis, int limit, int shared, int& low, int& count) {
    const double reach = px_from_disc.row(axis).norm() + reach_px_;
    const double first = std::floor(start_.centre[axis] - reach), last = std::ceil(start_.centre[axis] + reach);
    if (!(first > -1e6 && last < 1e6)) return false;
    low = std::max(0, static_cast<int>(first)) / shared * shared;
    const int high = std::min(limit, (static_cast<int>(last) + shared) / shared * shared);
    count = (high - low) / shared * shared;
    return count > 0 && count <= largest_box;
  };
  if (!bounds(0, picture.width, columns_, u0_, width_) || !bounds(1, picture.height, rows_, v0_, height_)) return false;
  across_ = width_ / columns_, down_ = height_ / rows_;
  return true;
}

// The samples whose centres lie within reach of the edge, and some of those further inside.
void OutlineFit::select(Rows& rows, int shared, int lines) {
  rows.n = 0;
  const auto radius = static_cast<float>(radius_px_), reach = static_cast<float>(reach_px_);
  const float outer = (1 + reach / radius) * (1 + reach / radius);
  const float inner_at = std::max(0.f, 1 - reach / radius), inner = inner_at * inner_at;
  const int every = radius_px_ > 16 ? 11 : radius_px_ > 8 ? 5 : 1;
  const auto m00 = static_cast<float>(disc_from_px_(0, 0)), m01 = static_cast<float>(disc_from_px_(0, 1)),
             m10 = static_cast<float>(disc_from_px_(1, 0)), m11 = static_cast<float>(disc_from_px_(1, 1));
  const float all = std::numbers::pi_v<float> * radius * radius * (outer - inner) / static_cast<float>(shared * lines);
  const double enough = std::clamp(most_of_edge * small_radius_px / radius_px_, least_of_edge, most_of_edge);
  const int some = std::max(1, static_cast<int>(std::ceil(static_cast<double>(all) / enough)));
  int met = 0;
  const int across = width_ / shared, down = height_ / lines;
  const auto u_of = [&](int i) {
    return static_cast<float>(u0_ + i * shared + 0.5 * (shared - 1) - start_.centre.x());
  };
  for (int j = 0; j < down; ++j) {
    const auto v = static_cast<float>(v0_ + j * lines + 0.5 * (lines - 1) - start_.centre.y());
    const auto take = [&](int i) {
      if (rows.n == most_rows || met++ % some != 0) return;
      const int k = rows.n++;
      rows.u[k] = u_of(i), rows.v[k] = v;
      rows.x[k] = m00 * rows.u[k] + m01 * v, rows.y[k] = m10 * rows.u[k] + m11 * v;
      rows.at_u[k] = u0_ / shared + i, rows.at_v[k] = v0_ / lines + j;
      rows.trust[k] = 1;
    };
    // Where this row of samples is within so many squared radii, from the first to beyond the last.
    const auto within = [&](float rho2) {
      const float a = m00 * m00 + m10 * m10, b = (m00 * m01 + m10 * m11) * v, c = (m01 * m01 + m11 * m11) * v * v;
      const float left = b * b - a * (c - rho2);
      if (!(left > 0)) return std::array{0, 0};
      const float half = std::sqrt(left) / a, middle = -b / a, first_u = u_of(0), per = 1 / static_cast<float>(shared);
      const auto at = [&](float u) {
        return static_cast<int>(std::clamp(std::ceil((u - first_u) * per), 0.f, static_cast<float>(across)));
      };
      return std::array{at(middle - half), at(middle + half)};
    };
    const auto [from, to] = within(outer);
    auto [inner_from, inner_to] = every > 1 ? within(inner) : std::array{to, to};
    if (inner_from == inner_to) inner_from = inner_to = to;
    for (int i = from; i < inner_from; ++i) take(i);
    for (int i = inner_from + (every - (inner_from + 3 * j) % every) % every; i < inner_to; i += every) take(i);
    for (int i = inner_to; i < to; ++i) take(i);
  }
}

// What is seen there, and what is behind it. Where that is not known, it is taken for what is seen beyond it at the rim
// of the box, as unsure as that differs all around.
void OutlineFit::read(const Picture& picture, const Background& behind) {
  const double cu = start_.centre.x() - u0_, cv = start_.centre.y() - v0_;
  const Grid pixels{u0_, v0_, width_, height_, cu, cv};
  const Grid samples{u0_ / columns_, v0_ / rows_, across_, down_, cu / columns_, cv / rows_};
  struct Chroma {
    float blue, red;
  };
  const auto light_at = [&](int u, int v) {
    float light = 0;
    read_light(picture, u, v, 1, &light);
    return light;
  };
  const auto chroma_at = [&](int u, int v) {
    Chroma chroma{};
    read_chroma(picture, u, v, 1, &chroma.blue, &chroma.red);
    return chroma;
  };
  // Of what is guessed, when the first guess is made.
  float guessed_light = 0, guessed_chroma = 0;
  const auto know_light = [&](const Places& at, float* light, float* looks) {
    behind.light(at, light, looks);
    for (int k = 0; k < at.n; ++k) {
      if (looks[k] > 0) continue;
      const Eigen::Vector2i rim = pixels.on_rim(at.u[k], at.v[k]);
      light[k] = light_at(rim.x(), rim.y());
      if (guessed_light == 0) guessed_light = pixels.variance(sigma_light_, light_at);
    }
  };
  const auto know_chroma = [&](const Places& at, float* blue, float* red, float* looks) {
    behind.chroma(at, blue, red, looks);
    for (int k = 0; k < at.n; ++k) {
      if (looks[k] > 0) continue;
      const Eigen::Vector2i rim = samples.on_rim(at.u[k], at.v[k]);
      const Chroma there = chroma_at(rim.x(), rim.y());
      blue[k] = there.blue, red[k] = there.red;
      if (guessed_chroma == 0)
        guessed_chroma = std::max(samples.variance(sigma_chroma_, [&](int u, int v) { return chroma_at(u, v).blue; }),
                                  samples.variance(sigma_chroma_, [&](int u, int v) { return chroma_at(u, v).red; }));
    }
  };
  static thread_local std::array<int, most_rows> us, vs;
  static thread_local std::array<float, most_rows> looks, light;
  const auto be_unsure = [&](Rows& rows, float guessed) {
    for (int k = 0; k < rows.n; ++k) {
      const float of = looks[static_cast<std::size_t>(k)];
      rows.unsure[k] = of > 0 ? 1 / of : guessed;
    }
  };

  // Of a pixel the chroma is that of the sample in which it lies.
  const Places of_light{light_.at_u, light_.at_v, light_.n}, around{us.data(), vs.data(), light_.n};
  for (int k = 0; k < light_.n; ++k) {
    const auto i = static_cast<std::size_t>(k);
    us[i] = light_.at_u[k] / columns_, vs[i] = light_.at_v[k] / rows_;
  }
  read_light(picture, of_light, light_.seen.light);
  read_chroma(picture, around, light_.seen.blue, light_.seen.red);
  know_chroma(around, light_.behind.blue, light_.behind.red, looks.data());
  know_light(of_light, light_.behind.light, looks.data());
  be_unsure(light_, guessed_light);

  // Of a sample of chroma the light is the mean of its pixels'.
  const Places of_chroma{chroma_.at_u, chroma_.at_v, chroma_.n}, within{us.data(), vs.data(), chroma_.n};
  std::fill_n(chroma_.behind.light, chroma_.n, 0.f);
  for (int part = 0; part < columns_ * rows_; ++part) {
    for (int k = 0; k < chroma_.n; ++k) {
      const auto i = static_cast<std::size_t>(k);
      us[i] = chroma_.at_u[k] * columns_ + part % columns_, vs[i] = chroma_.at_v[k] * rows_ + part / columns_;
    }
    know_light(within, light.data(), looks.data());
    for (int k = 0; k < chroma_.n; ++k)
      chroma_.behind.light[k] += light[static_cast<std::size_t>(k)] / static_cast<float>(columns_ * rows_);
  }
  read_chroma(picture, of_chroma, chroma_.seen.blue, chroma_.seen.red);
  know_chroma(of_chroma, chroma_.behind.blue, chroma_.behind.red, looks.data());
  be_unsure(chroma_, guessed_chroma);
}

// Its colour: as it was, or the median inside.
bool OutlineFit::know_object(const Look& look) {
  std::array<std::vector<float>, 3> values;
  const auto shrunk = static_cast<float>(std::max(0.3, 1 - 1.2 / radius_px_));
  if (look.object.maxCoeff() > 0) {
    object_ = look.object;
  } else {
    for (int k = 0; k < light_.n; ++k) {
      if (light_.x[k] * light_.x[k] + light_.y[k] * light_.y[k] > shrunk * shrunk) continue;
      values[0].push_back(light_.seen.light[k]);
      values[1].push_back(light_.seen.blue[k]), values[2].push_back(light_.seen.red[k]);
    }
    if (values[0].size() < 3) return false;
    std::array<float, 3> middle{};
    for (std::size_t i = 0; i < 3; ++i) {
      const auto at = values[i].begin() + static_cast<std::ptrdiff_t>(values[i].size() / 2);
      std::ranges::nth_element(values[i], at);
      middle[i] = *at;
    }
    lights_behind(1, &middle[0], &middle[1], &middle[2], &object_.x(), &object_.y(), &object_.z());
  }
  const LightChroma seen =
      ycc(white * grey_of(object_.x()), white * grey_of(object_.y()), white * grey_of(object_.z()));
  object_seen_ = {seen.light, seen.blue, seen.red};
  return true;
}

// What is measured, and what is behind it as linear light.
void OutlineFit::make_rows() {
  // Of chroma the direction in which the object differs most from what is around it.
  float sum_light = 0, sum_blue = 0, sum_red = 0;
  for (int k = 0; k < light_.n; ++k)
    sum_light += light_.behind.light[k], sum_blue += light_.behind.blue[k], sum_red += light_.behind.red[k];
  const auto n = static_cast<float>(std::max(1, light_.n));
  const float off_blue = object_seen_[1] - sum_blue / n, off_red = object_seen_[2] - sum_red / n;
  const float length = std::hypot(off_blue, off_red);
  chroma_blue_ = length > 1 ? off_blue / length : 0.f, chroma_red_ = length > 1 ? off_red / length : 1.f;
  contrast_ = std::hypot(length / sigma_chroma_, (object_seen_[0] - sum_light / n) / sigma_light_);

  GreyValues& shown = shown_behind_;
  const auto show = [&shown](Rows& rows) {
    lights_behind(rows.n, rows.behind.light, rows.behind.blue, rows.behind.red, rows.red, rows.green, rows.blue);
    shown_behind(rows.n, rows.red, rows.green, rows.blue, shown.light, shown.blue, shown.red);
  };
  show(light_);
  for (int k = 0; k < light_.n; ++k) {
    light_.measured[k] = light_.seen.light[k];
    light_.offset[k] = light_.behind.light[k] - shown.light[k];
  }
  show(chroma_);
  for (int k = 0; k < chroma_.n; ++k) {
    chroma_.measured[k] = chroma_blue_ * chroma_.seen.blue[k] + chroma_red_ * chroma_.seen.red[k];
    chroma_.offset[k] =
        chroma_blue_ * (chroma_.behind.blue[k] - shown.blue[k]) + chroma_red_ * (chroma_.behind.red[k] - shown.red[k]);
  }
  find_hidden(light_.n, light_.seen.light, light_.seen.blue, light_.seen.red, light_.behind.light, light_.behind.blue,
              light_.behind.red, object_seen_.data(), 1 / sigma_light_, 1 / sigma_chroma_, light_.hidden);
}

void OutlineFit::begin(const Look& look, const FitOptions& options) {
  x_.setZero();
  information_.setZero();
  const auto know = [&](int i, double value, double sigma) {
    x_[i] = value;
    information_[i] = 1 / (sigma * sigma);
  };
  know(size_, options.log_size.value, options.log_size.sigma);
  know(blur_light_, look.log_blur_light.value, std::hypot(look.log_blur_light.sigma, blur_of_one));
  know(blur_chroma_, look.log_blur_chroma.value, std::hypot(look.log_blur_chroma.sigma, blur_of_one));
  know(exposure_, look.exposure_s.value, look.exposure_s.sigma);
  know(lit_, 0, 0.1), know(lit_ + 1, 0, 0.05);
  know(shading_, 1, 0.5);
  for (int i = 1; i < 3; ++i) know(shading_ + i, 0, 0.7);
  // Light from anywhere on a dull ball is a quadratic polynomial of its surface's direction (Ramamoorthi and Hanrahan
  // 2001). What darkens towards the edge, and more on one side, is hard to tell from an edge that is elsewhere: of a
  // small ball it is taken for the edge's place unless it must be light; a large one has pixels enough to tell.
  for (int i = 3; i < 6; ++i) know(shading_ + i, 0, 0.05);
  know(shading_ + 6, 0, 0.2);
  for (int i = 7; i < 9; ++i) know(shading_ + i, 0, 0.03);
  know(paleness_, 0, 0.2);
  for (int i = 1; i < 3; ++i) know(paleness_ + i, 0, 0.05);
  expected_ = x_;
  for (int i = 0; i < 9; ++i) x_[shading_ + i] = look.shading[i];
  for (int i = 0; i < 3; ++i) x_[paleness_ + i] = look.paleness[i];
}

OutlineFit::Kind OutlineFit::kind_of_light() const {
  Kind k{};
  k.by_red = y_red * white, k.by_green = y_green * white, k.by_blue = y_blue * white;
  k.sigma = sigma_light_;
  const auto blur = static_cast<float>(std::exp(x_[blur_light_]));
  k.blur2 = blur * blur;
  k.more2 = static_cast<float>(std::exp(2 * x_[blur_chroma_]));
  const Eigen::Matrix2f m = (disc_from_px_ * std::exp(-x_[size_])).cast<float>();
  k.cu = static_cast<float>(x_[cu_]), k.cv = static_cast<float>(x_[cv_]);
  k.m00 = m(0, 0), k.m01 = m(0, 1), k.m10 = m(1, 0), k.m11 = m(1, 1);
  k.vx = static_cast<float>(movement_.velocity.x()), k.vy = static_cast<float>(movement_.velocity.y());
  const double exposure = std::clamp(x_[exposure_], 0.0, longest_exposure_s);
  k.exposure = static_cast<float>(exposure);
  // A moment for each blur's width of the way.
  const double way = movement_.velocity.norm() * exposure;
  k.moments = std::clamp(static_cast<int>(std::ceil(way / (2 * static_cast<double>(blur)))), 1, 8);
  for (int i = 0; i < k.moments; ++i)
    k.moment[static_cast<std::size_t>(i)] = (static_cast<float>(i) + 0.5f) / static_cast<float>(k.moments) - 0.5f;
  k.smear2 = 1 / (12 * static_cast<float>(k.moments * k.moments));
  k.grey = grey_red * object_.x() + grey_green * object_.y() + grey_blue * object_.z();
  k.red = object_.x() - k.grey, k.green = object_.y() - k.grey, k.blue = object_.z() - k.grey;
  k.level = object_.maxCoeff();
  for (int i = 0; i < 9; ++i) k.shading[static_cast<std::size_t>(i)] = static_cast<float>(x_[shading_ + i]);
  for (int i = 0; i < 3; ++i) k.paleness[static_cast<std::size_t>(i)] = static_cast<float>(x_[paleness_ + i]);
  k.lit = static_cast<float>(1 + x_[lit_]), k.lit_v = static_cast<float>(x_[lit_ + 1] / radius_px_);
  return k;
}

OutlineFit::Kind OutlineFit::kind_of_chroma() const {
  Kind k = kind_of_light();
  const float b = chroma_blue_ * by_blue * white, r = chroma_red_ * by_red * white;
  k.by_red = r - (b + r) * y_red, k.by_green = -(b + r) * y_green, k.by_blue = b - (b + r) * y_blue;
  k.sigma = sigma_chroma_;
  // The mean over so many pixels; one pixel's own width is in the blur.
  k.extra_u = static_cast<float>(columns_ * columns_ - 1) / 12, k.extra_v = static_cast<float>(rows_ * rows_ - 1) / 12;
  return k;
}

// Some rows on their way into the sums, one step after the other. Each step is a few loops over all of them, which a
// compiler makes vectors of; forced into assemble_rows(), as it must be compiled for the same instructions.
struct OutlineFit::Chunk {
  const Kind& k;
  const Rows& rows;
  const int from, n;
  Chunk(const Kind& kind, const Rows& all, int first)  // nothing else is set: each step sets what it hands on
      : k(kind), rows(all), from(first), n(std::min(chunk, all.n - first)) {}

  // How much of each is covered, and by what that changes.
  struct Covered {
    alignas(64) float a[chunk], by_u[chunk], by_v[chunk], by_size[chunk], by_blur[chunk], by_exposure[chunk];
  };
  Covered light, color;
  alignas(64) float by_more[chunk];
  // Where it is on the ball's surface, where its light is looked up: across, down, towards the camera.
  alignas(64) float x[chunk], y[chunk], z[chunk];
  alignas(64) float object[chunk], pale[chunk], lit[chunk], grey_behind[chunk];
  // What the camera shows of all that, and by what that changes.
  alignas(64) float shown[chunk], of_light[chunk], of_color[chunk], by_shade[chunk], by_pale[chunk], by_lit[chunk];
  // The weight times the residual, and times what `shown` changes by: light and color covered, shading, paleness,
  // light.
  alignas(64) float w[chunk], wo[chunk], wc[chunk], wa[chunk], wp[chunk], wl[chunk];
  alignas(64) float j[columns][chunk];

  // The nearest piece of the outline at one moment of the exposure: its distance and normal, by how much it moves as
  // the outline grows, and the variance by which light is soft there.
  struct Edge {
    alignas(64) float off[chunk], nu[chunk], nv[chunk], grow[chunk], width[chunk];
  };

  [[gnu::always_inline]] void find_edge(float when, Edge& edge) const {
    const float* __restrict u = rows.u + from;
    const float* __restrict v = rows.v + from;
    const float e2 = k.exposure * k.exposure * k.smear2;
    const float cu = k.cu + k.vx * k.exposure * when, cv = k.cv + k.vy * k.exposure * when;
    for (int i = 0; i < n; ++i) {
      const float du = u[i] - cu, dv = v[i] - cv;
      const float at_x = k.m00 * du + k.m01 * dv, at_y = k.m10 * du + k.m11 * dv;
      const float rho = std::sqrt(at_x * at_x + at_y * at_y + 1e-6f), in = 1 / rho;
      const float gu = (k.m00 * at_x + k.m10 * at_y) * in, gv = (k.m01 * at_x + k.m11 * at_y) * in;
      const float per = 1 / std::sqrt(gu * gu + gv * gv + 1e-12f);
      const float nu = gu * per, nv = gv * per;
      const float across = k.vx * nu + k.vy * nv;
      edge.nu[i] = nu, edge.nv[i] = nv, edge.off[i] = (rho - 1) * per, edge.grow[i] = rho * per;
      edge.width[i] = k.blur2 + k.extra_u * nu * nu + k.extra_v * nv * nv + e2 * across * across;
    }
  }

  // What is covered at that moment; more2: by which the edge is softer than that of light.
  [[gnu::always_inline]] void add_covered(const Edge& edge, float more2, float when, Covered& out) const {
    const float share = 1 / static_cast<float>(k.moments);
    for (int i = 0; i < n; ++i) {
      const float nu = edge.nu[i], nv = edge.nv[i], off = edge.off[i];
      const float across = k.vx * nu + k.vy * nv;
      const float inv2 = 1 / (edge.width[i] + more2);
      const float inv = std::sqrt(inv2), t = off * inv;
      float s = t * (1.f / 3);
      s = s < -1 ? -1 : s > 1 ? 1 : s;
      const float s2 = s * s, left = 1 - s2;
      // (1 - s^2)^3 has the normal distribution's shape and ends at three standard deviations.
      const float share_of_it = 0.5f - 1.09375f * s * (1 - s2 * (1 - s2 * (0.6f - s2 * (1.f / 7))));
      const float density = share * (1.09375f / 3) * left * left * left, by_off = density * inv;
      const float wider = density * t * inv2;
      out.a[i] += share * share_of_it;
      out.by_u[i] += by_off * nu, out.by_v[i] += by_off * nv, out.by_size[i] += by_off * edge.grow[i];
      out.by_blur[i] += wider;
      out.by_exposure[i] += by_off * across * when + wider * k.exposure * k.smear2 * across * across;
    }
  }

  [[gnu::always_inline]] void cover() {
    light = {}, color = {};
    Edge edge;
    for (int m = 0; m < k.moments; ++m) {
      const float when = k.moment[static_cast<std::size_t>(m)];
      find_edge(when, edge);
      add_covered(edge, 0, when, light);
      add_covered(edge, k.more2, when, color);
    }
    for (int i = 0; i < n; ++i)
      by_more[i] = color.by_blur[i] * k.more2, light.by_blur[i] *= k.blur2, color.by_blur[i] *= k.blur2;
  }

  [[gnu::always_inline]] void light_up() {
    const float* __restrict u = rows.u + from;
    const float* __restrict v = rows.v + from;
    for (int i = 0; i < n; ++i) {
      const float du = u[i] - k.cu, dv = v[i] - k.cv;
      x[i] = k.m00 * du + k.m01 * dv, y[i] = k.m10 * du + k.m11 * dv;
      const float left = 1 - x[i] * x[i] - y[i] * y[i];
      z[i] = std::sqrt(left < 0 ? 0 : left);
    }
    const float* __restrict red = rows.red + from;
    const float* __restrict green = rows.green + from;
    const float* __restrict blue = rows.blue + from;
    for (int i = 0; i < n; ++i) {
      object[i] = k.shading[0] + k.shading[1] * x[i] + k.shading[2] * y[i] + k.shading[3] * x[i] * x[i] +
                  k.shading[4] * x[i] * y[i] + k.shading[5] * y[i] * y[i] +
                  z[i] * (k.shading[6] + k.shading[7] * x[i] + k.shading[8] * y[i]);
      pale[i] = k.level * (k.paleness[0] + k.paleness[1] * x[i] + k.paleness[2] * y[i]);
      lit[i] = k.lit + k.lit_v * v[i];
      grey_behind[i] = grey_red * red[i] + grey_green * green[i] + grey_blue * blue[i];
    }
  }

  // One of red, green and blue through the camera's curve; own: by how much the object's exceeds its grey, part: of
  // what is shown.
  [[gnu::always_inline]] void show(float own, const float* __restrict behind, float part) {
    for (int i = 0; i < n; ++i) {
      const float front = k.grey * object[i] + pale[i], back = lit[i] * grey_behind[i];
      const float colored = behind[i] - grey_behind[i];
      const float front_color = own * object[i], back_color = lit[i] * colored;
      const float al = light.a[i], ac = color.a[i];
      const float mixed = back + back_color + al * (front - back) + ac * (front_color - back_color);
      const float lights = mixed < darkest ? darkest : mixed;
      const float root = std::sqrt(lights);
      const float first = root * (1.17f - 0.17f * root);
      const float slope = 1 / (curve1 + first * (2 * curve2 + first * 3 * curve3));
      shown[i] += part * (first - (light_of(first) - lights) * slope);
      const float by = mixed < darkest ? 0 : part * slope;
      of_light[i] += by * (front - back);
      of_color[i] += by * (front_color - back_color);
      by_shade[i] += by * (al * k.grey + ac * own);
      by_pale[i] += by * al;
      by_lit[i] += by * ((1 - al) * grey_behind[i] + (1 - ac) * colored);
    }
  }

  [[gnu::always_inline]] void show() {
    for (int i = 0; i < n; ++i) shown[i] = of_light[i] = of_color[i] = by_shade[i] = by_pale[i] = by_lit[i] = 0;
    show(k.red, rows.red + from, k.by_red);
    show(k.green, rows.green + from, k.by_green);
    show(k.blue, rows.blue + from, k.by_blue);
  }

  [[gnu::always_inline]] void weigh(Rows& judged, Assembly& out) {
    const float* __restrict measured = rows.measured + from;
    const float* __restrict offset = rows.offset + from;
    const float* __restrict unsure = rows.unsure + from;
    const float* __restrict trust = rows.trust + from;
    alignas(64) float r2s[chunk], ws[chunk], es[chunk], ss[chunk], off[chunk];
    for (int i = 0; i < n; ++i) {
      const float open = 1 - light.a[i];
      const float residual = measured[i] - shown[i] - open * offset[i];
      const float variance = k.sigma * k.sigma * (1 + open * open * unsure[i]);
      const float r2 = residual * residual / variance;
      const float robust = 1 / (1 + r2 / loss2);
      w[i] = std::sqrt(trust[i] * robust / variance);
      wo[i] = w[i] * (of_light[i] - offset[i]);
      wc[i] = w[i] * of_color[i];
      wa[i] = w[i] * by_shade[i];
      wp[i] = w[i] * by_pale[i] * k.level;
      wl[i] = w[i] * by_lit[i];
      w[i] *= residual;
      off[i] = std::copysign(r2, residual);
      r2s[i] = trust[i] * r2 * robust, ws[i] = trust[i];
      es[i] = light.by_size[i], ss[i] = light.by_size[i] * trust[i] / (1 + 0.1f * unsure[i]);
    }
    for (int i = 0; i < n; ++i) judged.covered[from + i] = color.a[i], judged.off[from + i] = off[i];
    float residual2 = 0, trusted = 0, edge = 0, seen_edge = 0;
    for (int i = 0; i < n; ++i) residual2 += r2s[i], trusted += ws[i], edge += es[i], seen_edge += ss[i];
    out.residual2 += static_cast<double>(residual2), out.trusted += static_cast<double>(trusted);
    out.edge += static_cast<double>(edge), out.seen_edge += static_cast<double>(seen_edge);
  }

  [[gnu::always_inline]] void copy(int c, const float* __restrict value) {
    float* __restrict to = j[c];
    for (int i = 0; i < n; ++i) to[i] = value[i];
  }
  [[gnu::always_inline]] void product(int c, const float* __restrict weight, const float* __restrict by) {
    float* __restrict to = j[c];
    for (int i = 0; i < n; ++i) to[i] = weight[i] * by[i];
  }
  // What moves the edge of light and that of color.
  [[gnu::always_inline]] void both(int c, const float* __restrict of, const float* __restrict with) {
    float* __restrict to = j[c];
    for (int i = 0; i < n; ++i) to[i] = wo[i] * of[i] + wc[i] * with[i];
  }

  // The last of them may not fill the lanes.
  [[gnu::always_inline]] void fill_columns() {
    both(cu_, light.by_u, color.by_u), both(cv_, light.by_v, color.by_v), both(size_, light.by_size, color.by_size);
    both(blur_light_, light.by_blur, color.by_blur), both(exposure_, light.by_exposure, color.by_exposure);
    product(blur_chroma_, wc, by_more);
    copy(shading_, wa), product(shading_ + 1, wa, x), product(shading_ + 2, wa, y);
    product(shading_ + 3, j[shading_ + 1], x), product(shading_ + 4, j[shading_ + 1], y);
    product(shading_ + 5, j[shading_ + 2], y);
    product(shading_ + 6, wa, z), product(shading_ + 7, j[shading_ + 1], z), product(shading_ + 8, j[shading_ + 2], z);
    copy(paleness_, wp), product(paleness_ + 1, wp, x), product(paleness_ + 2, wp, y);
    copy(lit_, wl), product(lit_ + 1, wl, rows.v + from);
    copy(right_, w);
    for (int i = n; i < padded(); ++i)
      for (auto& column : j) column[i] = 0;
  }

  int padded() const { return (n + 7) / 8 * 8; }
  [[gnu::always_inline]] void add_to(Assembly& out) const {
    for (int r = 0; r < Assembly::threes; ++r)
      for (int c = r; c < Assembly::threes; ++c) add_products<chunk>(j[3 * r], j[3 * c], padded(), out.products[r][c]);
  }
};

// Residuals and slopes of some rows, weighted, and the sums of all their products.
HUETRACK_CLONES void OutlineFit::assemble_rows(const Kind& kind, Rows& rows, Assembly& out) {
  for (int from = 0; from < rows.n; from += chunk) {
    Chunk some(kind, rows, from);
    some.cover();
    some.light_up();
    some.show();
    some.weigh(rows, out);
    some.fill_columns();
    some.add_to(out);
  }
}

void OutlineFit::assemble() {
  static thread_local Assembly sums;
  sums = {};
  assemble_rows(kind_of_light(), light_, sums);
  const double edge = sums.edge, seen_edge = sums.seen_edge;
  if (has_chroma_) assemble_rows(kind_of_chroma(), chroma_, sums);
  const auto total = [&](int r, int c) { return sum_of(sums.products[r / 3][c / 3][r % 3 * 3 + c % 3]); };
  for (int r = 0; r < unknowns; ++r) {
    for (int c = r; c < unknowns; ++c) normal_(r, c) = normal_(c, r) = total(r, c);
    gradient_[r] = total(r, right_);
  }
  // lit_v is per radius.
  normal_.row(lit_ + 1) /= radius_px_, normal_.col(lit_ + 1) /= radius_px_, gradient_[lit_ + 1] /= radius_px_;
  misfit_ = sums.trusted > 0 ? sums.residual2 / sums.trusted / usual_loss : 0;
  visible_ = edge > 0 ? seen_edge / edge : 0;
}

void OutlineFit::mark(int u, int v, Strange as) {
  marks_.push_back({u - u0_, v - v0_, as});
}

// What hides the object, and what else is there, does not count, nor do pixels that its edge may have softened; nor do
// glints: what shines on the object is no light on a dull ball. True: other pixels count from now on.
bool OutlineFit::judge_pixels() {
  // Where the object was expected, what hides it is found before the fit has given way to it.
  const bool had_marks = !marks_.empty();
  std::erase_if(marks_, [](const Mark& mark) { return mark.as == Strange::is_else; });
  // The first step does not know the object's light yet.
  const bool is_first = !std::exchange(is_judged_, true);
  if (!is_first && !had_glints_) had_glints_ = find_glints();
  find_strange();
  return (had_marks || !marks_.empty()) && distrust_marked();
}

bool OutlineFit::find_glints() {
  constexpr float within = 0.9f, largest_glint = 0.25f;  // of the disc; of more the light is not known yet
  const auto is_glint = [&](int k) { return light_.covered[k] > within && light_.off[k] > glint_sigmas2; };
  int inner = 0, shining = 0;
  for (int k = 0; k < light_.n; ++k) inner += light_.covered[k] > within, shining += is_glint(k);
  if (shining == 0 || shining >= largest_glint * static_cast<float>(inner)) return false;
  for (int k = 0; k < light_.n; ++k)
    if (is_glint(k)) mark(light_.at_u[k], light_.at_v[k], Strange::shines);
  return true;
}

void OutlineFit::find_strange() {
  constexpr float inside = 0.8f, outside = 0.02f, strange_sigmas2 = 49, one_look = 0.75f;  // of the mean's variance
  for (int k = 0; k < light_.n; ++k) {
    if (light_.unsure[k] > one_look) continue;
    if (light_.covered[k] <= outside) {
      if (std::abs(light_.off[k]) >= strange_sigmas2) mark(light_.at_u[k], light_.at_v[k], Strange::is_else);
    } else if (light_.covered[k] >= inside && light_.hidden[k] > 0) {
      mark(light_.at_u[k], light_.at_v[k], Strange::hides);
    }
  }
  for (int k = 0; k < chroma_.n; ++k) {
    if (chroma_.unsure[k] > one_look || chroma_.covered[k] > outside || std::abs(chroma_.off[k]) < strange_sigmas2)
      continue;
    for (int part = 0; part < columns_ * rows_; ++part)
      mark(chroma_.at_u[k] * columns_ + part % columns_, chroma_.at_v[k] * rows_ + part / columns_, Strange::is_else);
  }
}

// True: other pixels count from now on.
bool OutlineFit::distrust_marked() {
  constexpr int soft_px = 2, soft_glint_px = 1;
  const auto map = std::span(near_marks_).first(static_cast<std::size_t>(width_ * height_));
  std::ranges::fill(map, std::uint8_t{0});
  for (const Mark& mark : marks_) {
    const int reach = mark.as == Strange::shines ? soft_glint_px : soft_px;
    const int first = std::max(0, mark.u - reach), last = std::min(width_ - 1, mark.u + reach);
    for (int v = std::max(0, mark.v - reach); v <= std::min(height_ - 1, mark.v + reach); ++v)
      std::ranges::fill(
          map.subspan(static_cast<std::size_t>(v * width_ + first), static_cast<std::size_t>(last - first + 1)),
          std::uint8_t{1});
  }
  bool has_changed = false;
  const auto judge = [&](Rows& rows, int shared, int lines) {
    for (int k = 0; k < rows.n; ++k) {
      const int u = rows.at_u[k] * shared - u0_, v = rows.at_v[k] * lines - v0_;
      const float trust = map[static_cast<std::size_t>(v * width_ + u)] != 0 ? 0.f : 1.f;
      has_changed = has_changed || trust != rows.trust[k];
      rows.trust[k] = trust;
    }
  };
  judge(light_, 1, 1);
  judge(chroma_, columns_, rows_);
  return has_changed;
}

struct OutlineFit::Solver : Eigen::LDLT<Normal> {};

void OutlineFit::lay_out(const Ellipse& start, const Movement& movement, const Look& look) {
  start_ = start;
  movement_ = movement;
  // A row that is dv below the centre's shows the object where it is dv row_s later.
  Eigen::Matrix2d still_from_seen = Eigen::Matrix2d::Identity();
  still_from_seen.col(1) -= movement.row_s * movement.velocity;
  disc_from_px_ = start.axes.inverse() * still_from_seen;
  radius_px_ = std::sqrt(1 / std::abs(disc_from_px_.determinant()));
  reach_px_ = reach_px + 0.5 * movement.velocity.norm() * std::max(0.0, look.exposure_s.value + look.exposure_s.sigma);
}

// No further than the sums are right for where they were made. Not finite: they do not tell.
OutlineFit::Unknowns OutlineFit::next_step(Solver& solver) {
  covariance_ = normal_;
  covariance_.diagonal() += information_;
  solver.compute(covariance_);
  Unknowns step = solver.solve(gradient_ + information_.cwiseProduct(expected_ - x_));
  if (!step.allFinite()) return step;
  const auto limit = [&](double length, double most) {
    if (length > most) step *= most / length;
  };
  limit(step.head<2>().norm(), 0.4 * radius_px_);
  limit(std::abs(step[size_]), 0.2);
  limit(step.segment<2>(blur_light_).cwiseAbs().maxCoeff(), 0.4);
  return step;
}

bool OutlineFit::is_lost() const {
  return x_.head<2>().norm() > furthest_radii * radius_px_ || std::abs(x_[size_] - expected_[size_]) > largest_growth;
}

// Further steps would move it by less than its noise.
bool OutlineFit::is_settled(const Unknowns& step) const {
  const double moved = step.head<2>().norm() + radius_px_ * std::abs(step[size_]);
  const double noise = std::sqrt(1 / std::max(1e-9, std::min(covariance_(cu_, cu_), covariance_(cv_, cv_))));
  return moved < std::max(0.01, 0.3 * noise);
}

// Of those unknowns that are told or learnt; until then it is the normal matrix.
void OutlineFit::find_covariance(const Solver& solver) {
  constexpr std::array<int, 6> told{cu_, cv_, size_, blur_light_, blur_chroma_, exposure_};
  Eigen::Matrix<double, unknowns, 6> of_told = Eigen::Matrix<double, unknowns, 6>::Zero();
  for (std::size_t i = 0; i < told.size(); ++i) of_told(told[i], static_cast<Eigen::Index>(i)) = 1;
  const Eigen::Matrix<double, unknowns, 6> columns_told = solver.solve(of_told);
  for (std::size_t i = 0; i < told.size(); ++i)
    covariance_.col(told[i]) = columns_told.col(static_cast<Eigen::Index>(i));
}

// What the pixels say of one unknown by themselves, without what was expected of it. nullopt: nothing.
std::optional<Known> OutlineFit::told_by_itself(int i) const {
  const double told = 1 / covariance_(i, i) - information_[i];
  if (!(told > 0)) return std::nullopt;
  return Known{(x_[i] / covariance_(i, i) - information_[i] * expected_[i]) / told, std::sqrt(1 / told)};
}

void OutlineFit::tell(Fit& out) const {
  const double worse = std::max(1.0, misfit_);
  out.centre = start_.centre + x_.head<2>();
  out.covariance = worse * covariance_.topLeftCorner<2, 2>();
  out.bound = normal_.topLeftCorner<2, 2>().inverse();
  if (const auto size = told_by_itself(size_)) {
    out.log_size = {size->value, std::sqrt(worse) * size->sigma};
  } else {
    out.log_size = {x_[size_], 1};
  }
  out.misfit = misfit_;
  out.visible = visible_;
  out.outcome = visible_ < least_visible      ? FitOutcome::unknown
                : misfit_ > worst_misfit      ? FitOutcome::misfit
                : !out.covariance.allFinite() ? FitOutcome::no_contrast
                                              : FitOutcome::fits;
}

Fit OutlineFit::fit(const Picture& picture, const Background& behind, const Ellipse& start, const Movement& movement,
                    const Look& look, const FitOptions& options) {
  Fit out;
  out.centre = start.centre;
  lay_out(start, movement, look);
  out.outcome = FitOutcome::too_small;
  if (!(radius_px_ >= least_radius_px) || !start.centre.allFinite() || !disc_from_px_.allFinite()) return out;
  sigma_light_ = std::hypot(behind.light_noise(), model_light);
  sigma_chroma_ = std::hypot(behind.chroma_noise(), model_chroma);
  if (!find_box(picture)) return out;
  select(light_, 1, 1);
  chroma_.n = 0;
  is_judged_ = had_glints_ = false;
  marks_.clear();
  if (has_chroma_) select(chroma_, columns_, rows_);
  out.pixels = light_.n;
  if (light_.n < least_pixels) return out;
  read(picture, behind);
  if (!know_object(look)) return out;
  make_rows();
  out.outcome = FitOutcome::no_contrast;
  if (contrast_ < least_contrast) return out;
  begin(look, options);
  Solver solver;
  for (out.steps = 1; out.steps <= options.most_steps; ++out.steps) {
    assemble();
    const bool are_others = out.steps <= 3 && judge_pixels();  // those that count from the next step on
    const Unknowns step = next_step(solver);
    if (!step.allFinite()) return out;
    x_ += step;
    x_[exposure_] = std::clamp(x_[exposure_], 0.0, longest_exposure_s);
    if (is_lost()) {
      out.outcome = FitOutcome::lost;
      return out;
    }
    if (out.steps >= 2 && !are_others && is_settled(step)) break;
  }
  find_covariance(solver);
  tell(out);
  return out;
}

void OutlineFit::learn(Look& look) const {
  // What a fit says of them is not independent of what the last one said.
  const auto keep = [&](Known& known, int i, double least_sigma) {
    known.value = x_[i];
    known.sigma = std::max(least_sigma, std::sqrt(std::max(0.0, covariance_(i, i))));
  };
  keep(look.exposure_s, exposure_, 0.0005);
  // Blur is the camera's: many pictures' mean, of what each says by itself.
  const auto average = [&](Known& known, int i) {
    const auto told = told_by_itself(i);
    if (!told) return;
    const double sigma2 = known.sigma * known.sigma;
    const double gain = sigma2 / (sigma2 + told->sigma * told->sigma + blur_of_light * blur_of_light);
    known.value += gain * (told->value - known.value);
    known.sigma = std::max(least_blur_sigma, std::sqrt((1 - gain) * sigma2));
  };
  average(look.log_blur_light, blur_light_);
  average(look.log_blur_chroma, blur_chroma_);
  look.object = object_;
  for (int i = 0; i < 9; ++i) look.shading[i] = x_[shading_ + i];
  for (int i = 0; i < 3; ++i) look.paleness[i] = x_[paleness_ + i];
}

}  // namespace huetrack::outline
