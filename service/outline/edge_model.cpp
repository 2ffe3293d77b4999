#include "outline/edge_model.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "outline/camera_curve.h"
#include "particle_filter/vector_clones.h"

namespace huetrack::outline {
namespace {

using Lanes = EdgeSums::Lanes;
constexpr float least_weight = 1e-20f;  // maths: keeps 1 / weight finite

struct EdgeVisibilityTuning {
  float per_variance = 0.1f;  // an edge sample counts as 1 / (1 + this * the background's variance in variances)
};
constexpr EdgeVisibilityTuning edge_visibility{};

// Adds the products of three columns with three others, n of each: as many sums as registers hold.
template <int stride>
inline __attribute__((always_inline)) void add_products(const float* a, const float* b, int n, Lanes* sums) {
  const auto *a0 = reinterpret_cast<const Lanes*>(a), *a1 = reinterpret_cast<const Lanes*>(a + stride),
             *a2 = reinterpret_cast<const Lanes*>(a + 2 * stride);
  const auto *b0 = reinterpret_cast<const Lanes*>(b), *b1 = reinterpret_cast<const Lanes*>(b + stride),
             *b2 = reinterpret_cast<const Lanes*>(b + 2 * stride);
  Lanes s00 = sums[0], s01 = sums[1], s02 = sums[2], s10 = sums[3], s11 = sums[4], s12 = sums[5], s20 = sums[6],
        s21 = sums[7], s22 = sums[8];
  for (int i = 0; i < n / 8; ++i) {
    s00 += a0[i] * b0[i], s01 += a0[i] * b1[i], s02 += a0[i] * b2[i];
    s10 += a1[i] * b0[i], s11 += a1[i] * b1[i], s12 += a1[i] * b2[i];
    s20 += a2[i] * b0[i], s21 += a2[i] * b1[i], s22 += a2[i] * b2[i];
  }
  sums[0] = s00, sums[1] = s01, sums[2] = s02;
  sums[3] = s10, sums[4] = s11, sums[5] = s12;
  sums[6] = s20, sums[7] = s21, sums[8] = s22;
}

// The same of three columns with one.
template <int stride>
inline __attribute__((always_inline)) void add_products_with(const float* a, const float* b, int n, Lanes* sums) {
  const auto *a0 = reinterpret_cast<const Lanes*>(a), *a1 = reinterpret_cast<const Lanes*>(a + stride),
             *a2 = reinterpret_cast<const Lanes*>(a + 2 * stride), *b0 = reinterpret_cast<const Lanes*>(b);
  Lanes s0 = sums[0], s1 = sums[1], s2 = sums[2];
  for (int i = 0; i < n / 8; ++i) s0 += a0[i] * b0[i], s1 += a1[i] * b0[i], s2 += a2[i] * b0[i];
  sums[0] = s0, sums[1] = s1, sums[2] = s2;
}

double sum_of(const Lanes& lanes) {
  using Four = float __attribute__((vector_size(16), may_alias));
  const auto* halves = reinterpret_cast<const Four*>(&lanes);
  const Four four = halves[0] + halves[1];
  const Four two = four + __builtin_shufflevector(four, four, 2, 3, 0, 1);
  return static_cast<double>(two[0] + two[1]);
}

using Block = EdgeSamples::Block;

}  // namespace

InverseRoot::InverseRoot(double least, double most) {
  // maths: interpolation at the Chebyshev nodes of [-1, 1], to which x is mapped.
  constexpr double outer = 0.9238795325112867, inner = 0.3826834323650898;
  const double middle = 0.5 * (most + least), half = std::max(0.5 * (most - least), 1e-6 * middle);
  const auto at = [&](double node) { return 1 / std::sqrt(std::max(middle + half * node, 1e-12)); };
  const double a = at(-outer), b = at(-inner), c = at(inner), d = at(outer);
  const double even_outer = 0.5 * (a + d), odd_outer = 0.5 * (d - a), even_inner = 0.5 * (b + c),
               odd_inner = 0.5 * (c - b);
  constexpr double outer2 = outer * outer, inner2 = inner * inner, per = 1 / (outer2 - inner2);
  constexpr double per_outer = per / outer, per_inner = per / inner;
  c0_ = static_cast<float>((outer2 * even_inner - inner2 * even_outer) * per);
  c2_ = static_cast<float>((even_outer - even_inner) * per);
  c1_ = static_cast<float>(outer2 * odd_inner * per_inner - inner2 * odd_outer * per_outer);
  c3_ = static_cast<float>(odd_outer * per_outer - odd_inner * per_inner);
  per_half_ = static_cast<float>(1 / half), middle_ = static_cast<float>(middle / half);
}

void EdgeModel::finish() {
  // Bounds of the quadratic forms in the edge's normal: |g|^2 of the disc map, and the edge's variance.
  const auto bounds = [](double uu, double uv, double vv, auto&& use) {
    const double mean = 0.5 * (uu + vv), apart = std::hypot(0.5 * (uu - vv), uv);
    use(std::max(mean - apart, 1e-3 * mean), mean + apart);
  };
  const auto d = [](float x) { return static_cast<double>(x); };
  bounds(d(m00) * d(m00) + d(m01) * d(m01), d(m00) * d(m10) + d(m01) * d(m11), d(m10) * d(m10) + d(m11) * d(m11),
         [&](double least, double most) { per_slope = InverseRoot(least, most); });
  const double e2 = d(exposure) * d(exposure) * d(smear2);
  bounds(d(blur2) + d(extra_u) + e2 * d(vx) * d(vx), e2 * d(vx) * d(vy), d(blur2) + d(extra_v) + e2 * d(vy) * d(vy),
         [&](double least, double most) {
           per_width = InverseRoot(least, most);
           per_color_width = InverseRoot(least + d(more2), most + d(more2));
         });
}

// The steps by which a block of samples goes into the sums. Each is a loop that vectorises, and is forced inline,
// because it must be compiled for its caller's instruction set.
struct EdgeSums::Chunk {
  static constexpr int most = EdgeSamples::block;
  const EdgeModel& k;
  Block& of;
  Slopes& slopes;
  const int n;  // a multiple of EdgeSamples::group, so that no loop has a rest
  // All other members are set by the steps.
  Chunk(const EdgeModel& model, EdgeSamples& samples, int b, Slopes& to)
      : k(model),
        of(samples.blocks[b]),
        slopes(to),
        n(samples.filled_in(b) / EdgeSamples::group * EdgeSamples::group) {}

  // Covered share and its derivatives by the distance from the edge and by the edge's variance.
  struct Covered {
    alignas(64) float a[most], by_off[most], by_variance[most];
  };
  // Derivatives of the covered share by place, size and exposure, averaged over the exposure.
  struct Smeared {
    alignas(64) float by_u[most], by_v[most], by_size[most], by_exposure[most];
  };
  Covered light, color;
  Smeared smeared_light, smeared_color;
  // The edge's normal, its motion per unit of log size, and its velocity along the normal.
  alignas(64) float nu[most], nv[most], grow[most], across[most];

  // The nearest point of the outline at one moment of the exposure.
  struct Edge {
    float nu, nv, off, grow, across, inv_light, inv_color, off_light, off_color;
  };
  [[gnu::always_inline]] static Edge edge_at(const EdgeModel& m, float cu, float cv, float e2, float u, float v) {
    Edge e;
    const float du = u - cu, dv = v - cv;
    const float at_x = m.m00 * du + m.m01 * dv, at_y = m.m10 * du + m.m11 * dv;
    const float rho = std::sqrt(at_x * at_x + at_y * at_y + 1e-6f), in = 1 / rho;
    const float nx = at_x * in, ny = at_y * in;
    const float gu = m.m00 * nx + m.m10 * ny, gv = m.m01 * nx + m.m11 * ny;
    const float per = m.per_slope(gu * gu + gv * gv);
    e.nu = gu * per, e.nv = gv * per, e.off = (rho - 1) * per, e.grow = rho * per;
    e.across = m.vx * e.nu + m.vy * e.nv;
    const float width = m.blur2 + m.extra_u * e.nu * e.nu + m.extra_v * e.nv * e.nv + e2 * e.across * e.across;
    e.inv_light = m.per_width(width), e.inv_color = m.per_color_width(width + m.more2);
    e.off_light = e.off + m.curve * width, e.off_color = e.off + m.curve * (width + m.more2);
    return e;
  }
  // The edge profile is the integral of (1 - s^2)^3, a normal distribution that ends at three standard deviations.
  static constexpr float peak = 35.f / 32, of_s6 = 0.6f;  // maths: its coefficients
  [[gnu::always_inline]] static float to_three_sigmas(float t) {
    const float s = t * (1.f / 3);
    return s < -1 ? -1 : s > 1 ? 1 : s;
  }
  [[gnu::always_inline]] static float covered(float s, float s2) {
    return 0.5f - peak * s * (1 - s2 * (1 - s2 * (of_s6 - s2 * (1.f / 7))));
  }
  [[gnu::always_inline]] static float density(float s2) {
    const float left = 1 - s2;
    return (peak / 3) * left * left * left;
  }

  [[gnu::always_inline]] void cover_still() {
    const EdgeModel m = k;
    const float e2 = m.exposure * m.exposure * m.smear2;
    for (int i = 0; i < n; ++i) {
      const Edge e = edge_at(m, m.cu, m.cv, e2, of.u[i], of.v[i]);
      nu[i] = e.nu, nv[i] = e.nv, grow[i] = e.grow, across[i] = e.across;
      const auto cover = [&](float inv, float off, Covered& out) __attribute__((always_inline)) {
        const float t = off * inv, s = to_three_sigmas(t), s2 = s * s, by_off = density(s2) * inv;
        out.a[i] = covered(s, s2), out.by_off[i] = by_off, out.by_variance[i] = by_off * t * inv - 2 * m.curve * by_off;
      };
      cover(e.inv_light, e.off_light, light);
      cover(e.inv_color, e.off_color, color);
    }
  }

  template <bool first>
  [[gnu::always_inline]] void add_covered(float when) {
    const EdgeModel m = k;
    const float e2 = m.exposure * m.exposure * m.smear2, wider = m.exposure * m.smear2;
    const float cu = m.cu + m.vx * m.exposure * when, cv = m.cv + m.vy * m.exposure * when;
    const float share = 1 / static_cast<float>(m.moments);
    for (int i = 0; i < n; ++i) {
      const Edge e = edge_at(m, cu, cv, e2, of.u[i], of.v[i]);
      const auto cover = [&](float inv, float off, Covered& out, Smeared& smeared) __attribute__((always_inline)) {
        const float t = off * inv, s = to_three_sigmas(t), s2 = s * s, by_off = share * density(s2) * inv;
        const float by_variance = by_off * t * inv - 2 * m.curve * by_off;
        const auto add = [&](float& to, float value) __attribute__((always_inline)) {
          if constexpr (first) {
            to = value;
          } else {
            to += value;
          }
        };
        add(out.a[i], share * covered(s, s2)), add(out.by_variance[i], by_variance);
        add(smeared.by_u[i], by_off * e.nu), add(smeared.by_v[i], by_off * e.nv);
        add(smeared.by_size[i], by_off * e.grow);
        add(smeared.by_exposure[i], by_off * e.across * when + by_variance * wider * e.across * e.across);
      };
      cover(e.inv_light, e.off_light, light, smeared_light);
      cover(e.inv_color, e.off_color, color, smeared_color);
    }
  }
  [[gnu::always_inline]] void cover_smeared() {
    add_covered<true>(k.moment[0]);
    for (int m = 1; m < k.moments; ++m) add_covered<false>(k.moment[static_cast<std::size_t>(m)]);
  }

  // The covered share without derivatives.
  [[gnu::always_inline]] void cover_only() {
    const EdgeModel m = k;
    const float e2 = m.exposure * m.exposure * m.smear2;
    const float share = 1 / static_cast<float>(m.moments);
    for (int moment = 0; moment < m.moments; ++moment) {
      const float when = m.moment[static_cast<std::size_t>(moment)], kept = moment == 0 ? 0.f : 1.f;
      const float cu = m.cu + m.vx * m.exposure * when, cv = m.cv + m.vy * m.exposure * when;
      if (moment == 0) std::fill_n(light.a, n, 0.f), std::fill_n(color.a, n, 0.f);
      for (int i = 0; i < n; ++i) {
        const Edge e = edge_at(m, cu, cv, e2, of.u[i], of.v[i]);
        const float sl = to_three_sigmas(e.off_light * e.inv_light), sc = to_three_sigmas(e.off_color * e.inv_color);
        light.a[i] = kept * light.a[i] + share * covered(sl, sl * sl);
        color.a[i] = kept * color.a[i] + share * covered(sc, sc * sc);
      }
    }
  }

  // Direction of the ball's surface (x right, y down, z towards the camera), and the light there.
  struct Lights {
    float x, y, z, object, front, lit, grey_behind, back;
  };
  [[gnu::always_inline]] Lights lights_at(const EdgeModel& m, int i) const {
    Lights l;
    const float du = of.u[i] - m.cu, dv = of.v[i] - m.cv;
    l.x = m.m00 * du + m.m01 * dv, l.y = m.m10 * du + m.m11 * dv;
    const float beyond = 1 - l.x * l.x - l.y * l.y;
    l.z = std::sqrt(beyond < 0 ? 0 : beyond);
    l.object = m.shading[0] + l.x * (m.shading[1] + m.shading[3] * l.x + m.shading[4] * l.y) +
               l.y * (m.shading[2] + m.shading[5] * l.y) +
               l.z * (m.shading[6] + m.shading[7] * l.x + m.shading[8] * l.y);
    const float pale = m.level * (m.paleness[0] + m.paleness[1] * l.x + m.paleness[2] * l.y);
    l.lit = m.lit + m.lit_v * of.v[i];
    l.grey_behind = grey_red * of.red[i] + grey_green * of.green[i] + grey_blue * of.blue[i];
    l.front = m.grey * l.object + pale, l.back = l.lit * l.grey_behind;
    return l;
  }
  // One colour mixed and prepared for the tone curve. own: the object's colour less its grey.
  struct Mixed {
    float colored, front_color, back_color, lights, is_lit, first, curve;
  };
  [[gnu::always_inline]] static Mixed mixed(const Lights& l, float al, float ac, float own, float behind) {
    Mixed c;
    c.colored = behind - l.grey_behind;
    c.front_color = own * l.object, c.back_color = l.lit * c.colored;
    const float all = l.back + c.back_color + al * (l.front - l.back) + ac * (c.front_color - c.back_color);
    c.is_lit = all < darkest ? 0.f : 1.f;
    c.lights = all < darkest ? darkest : all;
    const float root = std::sqrt(c.lights);
    c.first = root * (root1 + root2 * root);
    c.curve = curve1 + c.first * (2 * curve2 + c.first * 3 * curve3);
    return c;
  }
  struct Slope {
    float red, green, blue;
  };
  // Derivatives of the inverse curve, with one division.
  [[gnu::always_inline]] static Slope slopes_of(const Mixed& red, const Mixed& green, const Mixed& blue) {
    const float red_green = red.curve * green.curve, per_all = 1 / (red_green * blue.curve);
    const float per_two = per_all * blue.curve;
    return {per_two * green.curve, per_two * red.curve, per_all * red_green};
  }
  [[gnu::always_inline]] static float shown(const Mixed& c, float slope) {
    return c.first - (light_of(c.first) - c.lights) * slope;
  }

  struct Weighed {
    float residual, variance, weight, r2;  // r2: after the robust loss
  };
  [[gnu::always_inline]] Weighed weighed(const EdgeModel& m, int i, float al, float value) const {
    Weighed out;
    const float open = 1 - al;
    out.residual = of.measured[i] - value - open * of.offset[i];
    out.variance = m.sigma * m.sigma * (1 + open * open * of.unsure[i]);
    const float square = out.residual * out.residual;
    out.weight = 1 / (out.variance + square * (1 / outlier.loss2));
    out.r2 = square * out.weight;
    return out;
  }
  // Summed over samples beside the products.
  struct Sums {
    alignas(64) float r2[most], weight[most], seen[most], candidate[most];
  };
  [[gnu::always_inline]] void judge(const EdgeModel& m, int i, float ac, float edge, const Weighed& w, Sums& sums) {
    const float trust = of.trust[i], hidden = of.hidden[i], off = std::copysign(w.r2, w.residual);
    of.covered[i] = ac, of.off[i] = off;
    sums.r2[i] = trust * w.r2, sums.weight[i] = edge * trust * w.weight * w.variance;
    sums.seen[i] = edge * trust / (1 + edge_visibility.per_variance * of.unsure[i]);
    // Confirmed by OutlierPixels.
    const float beside = ac <= outlier.outside && w.r2 >= robust(outlier.other_sigmas2) ? 1.f : 0.f;
    const float inner = ac >= outlier.inside ? hidden : 0.f;
    const float glint = ac > outlier.well_inside && off > robust(outlier.glint_sigmas2) ? m.counts_glints : 0.f;
    sums.candidate[i] = beside + inner + glint;
  }
  [[gnu::always_inline]] void sum_up(const Sums& sums, const float* edge, EdgeSums& out) const {
    Lanes of_all[6] = {};
    const auto add_up = [&](const float* values, Lanes& sum) __attribute__((always_inline)) {
      const auto* lanes = reinterpret_cast<const Lanes*>(values);
      for (int i = 0; i < n / 8; ++i) sum += lanes[i];
    };
    add_up(sums.r2, of_all[0]), add_up(of.trust, of_all[1]), add_up(edge, of_all[2]), add_up(sums.seen, of_all[3]);
    add_up(sums.candidate, of_all[4]), add_up(sums.weight, of_all[5]);
    out.residual2 += sum_of(of_all[0]), out.trusted += sum_of(of_all[1]), out.edge += sum_of(of_all[2]);
    out.seen_edge += sum_of(of_all[3]), out.outlier_candidates += sum_of(of_all[4]),
        out.edge_weight += sum_of(of_all[5]);
  }

  // Columns: the derivatives of the predicted value and the residual, times the root of the weight.
  template <bool is_smeared, bool is_light_held>
  [[gnu::always_inline]] void show_and_weigh(EdgeSums& out) {
    const EdgeModel m = k;
    float(*j)[most] = slopes.of;
    Sums sums;
    [[maybe_unused]] const float wider = m.exposure * m.smear2, when = m.moment[0];
    HUETRACK_INDEPENDENT  // a block and its slopes share nothing
        for (int i = 0; i < n; ++i) {
      const Lights l = lights_at(m, i);
      const float al = light.a[i], ac = color.a[i];
      const Mixed red = mixed(l, al, ac, m.red, of.red[i]), green = mixed(l, al, ac, m.green, of.green[i]),
                  blue = mixed(l, al, ac, m.blue, of.blue[i]);
      const Slope slope = slopes_of(red, green, blue);
      float value = 0, by_light = 0, of_color = 0, shade_color = 0, lit_color = 0;
      const auto show = [&](const Mixed& c, float own, float by, float part) __attribute__((always_inline)) {
        value += part * shown(c, by);
        const float changes = part * by * c.is_lit;
        by_light += changes;
        of_color += changes * (c.front_color - c.back_color);
        shade_color += changes * own, lit_color += changes * c.colored;
      };
      show(red, m.red, slope.red, m.by_red);
      show(green, m.green, slope.green, m.by_green);
      show(blue, m.blue, slope.blue, m.by_blue);
      const Weighed weigh = weighed(m, i, al, value);
      const float w2 = of.trust[i] * weigh.weight, w = std::sqrt(w2);
      slopes.per_root[i] = w / (w2 + least_weight);
      const float wo = w * (by_light * (l.front - l.back) - of.offset[i]), wc = w * of_color;
      const float wa = w * (al * m.grey * by_light + ac * shade_color), wp = w * al * by_light * m.level;
      const float wl = w * ((1 - al) * l.grey_behind * by_light + (1 - ac) * lit_color);
      float edge = 0, by_off = 0;
      if constexpr (is_smeared) {
        edge = smeared_light.by_size[i];
        j[cu_][i] = wo * smeared_light.by_u[i] + wc * smeared_color.by_u[i];
        j[cv_][i] = wo * smeared_light.by_v[i] + wc * smeared_color.by_v[i];
        j[size_][i] = wo * edge + wc * smeared_color.by_size[i];
      } else {
        edge = light.by_off[i] * grow[i];
        by_off = wo * light.by_off[i] + wc * color.by_off[i];
        j[cu_][i] = by_off * nu[i], j[cv_][i] = by_off * nv[i], j[size_][i] = by_off * grow[i];
      }
      slopes.edge[i] = edge;
      if constexpr (is_light_held) {
        j[placed][i] = wa, j[placed + 1][i] = wl, j[placed + 2][i] = wl * of.v[i];
      } else {
        const float by_variance = wo * light.by_variance[i] + wc * color.by_variance[i];
        j[blur_light_][i] = m.blur2 * by_variance;
        j[blur_chroma_][i] = m.more2 * wc * color.by_variance[i];
        if constexpr (is_smeared)
          j[exposure_][i] = wo * smeared_light.by_exposure[i] + wc * smeared_color.by_exposure[i];
        else
          j[exposure_][i] = (by_off * when + by_variance * wider * across[i]) * across[i];
        const float wax = wa * l.x, way = wa * l.y, waz = wa * l.z;
        j[shading_][i] = wa, j[shading_ + 1][i] = wax, j[shading_ + 2][i] = way;
        j[shading_ + 3][i] = wax * l.x, j[shading_ + 4][i] = wax * l.y, j[shading_ + 5][i] = way * l.y;
        j[shading_ + 6][i] = waz, j[shading_ + 7][i] = waz * l.x, j[shading_ + 8][i] = waz * l.y;
        j[paleness_][i] = wp, j[paleness_ + 1][i] = wp * l.x, j[paleness_ + 2][i] = wp * l.y;
        j[lit_][i] = wl, j[lit_ + 1][i] = wl * of.v[i];
      }
      j[unknowns][i] = w * weigh.residual;
      judge(m, i, ac, edge, weigh, sums);
    }
    sum_up(sums, slopes.edge, out);
  }

  [[gnu::always_inline]] void show_only(EdgeSums& out) {
    const EdgeModel m = k;
    Sums sums;
    float* const right = slopes.of[unknowns];
    HUETRACK_INDEPENDENT  // a block and its slopes share nothing
        for (int i = 0; i < n; ++i) {
      const Lights l = lights_at(m, i);
      const float al = light.a[i], ac = color.a[i];
      const Mixed red = mixed(l, al, ac, m.red, of.red[i]), green = mixed(l, al, ac, m.green, of.green[i]),
                  blue = mixed(l, al, ac, m.blue, of.blue[i]);
      const Slope slope = slopes_of(red, green, blue);
      const float value = m.by_red * shown(red, slope.red) + m.by_green * shown(green, slope.green) +
                          m.by_blue * shown(blue, slope.blue);
      const Weighed weigh = weighed(m, i, al, value);
      right[i] = of.trust[i] * weigh.weight * weigh.residual * slopes.per_root[i];
      judge(m, i, ac, slopes.edge[i], weigh, sums);
    }
    sum_up(sums, slopes.edge, out);
  }

  // Of the first 3 * count columns.
  template <int count>
  [[gnu::always_inline]] void add_products_to(EdgeSums& out) const {
    int pair = 0;
    for (int r = 0; r < count; ++r)
      for (int c = r; c < count; ++c) add_products<most>(slopes.of[3 * r], slopes.of[3 * c], n, out.of_threes_[pair++]);
  }
  [[gnu::always_inline]] void add_residuals_to(int count, EdgeSums& out) const {
    for (int r = 0; r < count; ++r)
      add_products_with<most>(slopes.of[3 * r], slopes.of[unknowns], n, out.of_residuals_ + 3 * r);
  }

  template <bool is_smeared, bool is_light_held>
  [[gnu::always_inline]] static void assemble(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out) {
    for (int b = 0; b < samples.block_count(); ++b) {
      Chunk some(model, samples, b, out.slopes_[out.blocks_++]);
      if constexpr (is_smeared)
        some.cover_smeared();
      else
        some.cover_still();
      some.show_and_weigh<is_smeared, is_light_held>(out);
      if constexpr (is_light_held) {
        some.add_products_to<held_threes>(out);
        some.add_residuals_to(held_threes, out);
      } else {
        some.add_products_to<threes>(out);  // the last column is the residual's
      }
    }
  }
};

HUETRACK_CLONES void EdgeSums::assemble_still(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out) {
  Chunk::assemble<false, false>(model, samples, out);
}

HUETRACK_CLONES void EdgeSums::assemble_smeared(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out) {
  Chunk::assemble<true, false>(model, samples, out);
}

HUETRACK_CLONES void EdgeSums::assemble_still_held(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out) {
  Chunk::assemble<false, true>(model, samples, out);
}

HUETRACK_CLONES void EdgeSums::assemble_smeared_held(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out) {
  Chunk::assemble<true, true>(model, samples, out);
}

HUETRACK_CLONES void EdgeSums::renew_blocks(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out) {
  for (int b = 0; b < samples.block_count(); ++b) {
    Chunk some(model, samples, b, out.slopes_[out.blocks_++]);
    some.cover_only();
    some.show_only(out);
    some.add_residuals_to(out.is_light_held_ ? held_threes : threes, out);
  }
}

void EdgeSums::begin() {
  residual2 = trusted = edge_weight = edge = seen_edge = outlier_candidates = 0;
  blocks_ = 0;
}

void EdgeSums::begin_assembling(bool is_light_held) {
  begin();
  is_assembled_ = true;
  is_light_held_ = is_light_held;
  for (auto& three : std::span(of_threes_).first(is_light_held_ ? held_pairs : pairs))
    for (Lanes& sum : three) sum = Lanes{};
  if (is_light_held_)
    for (Lanes& sum : of_residuals_) sum = Lanes{};
}

void EdgeSums::begin_renewing() {
  begin();
  is_assembled_ = false;
  for (Lanes& sum : of_residuals_) sum = Lanes{};
}

void EdgeSums::assemble(const EdgeModel& model, EdgeSamples& samples) {
  if (model.moments > 1)
    is_light_held_ ? assemble_smeared_held(model, samples, *this) : assemble_smeared(model, samples, *this);
  else
    is_light_held_ ? assemble_still_held(model, samples, *this) : assemble_still(model, samples, *this);
}

void EdgeSums::renew_residuals(const EdgeModel& model, EdgeSamples& samples) {
  renew_blocks(model, samples, *this);
}

// From the products of columns by threes.
template <int size>
void EdgeSums::normal_of(Eigen::Matrix<double, size, size>& out) const {
  double* const to = out.data();
  int pair = 0;
  for (int r = 0; r < size; r += 3) {
    for (int c = r; c < size; c += 3, ++pair) {
      const Lanes* sums = of_threes_[pair];
      const int of_c = std::min(3, size - c);  // a column beyond is the residual's
      for (int i = 0; i < std::min(3, size - r); ++i)
        for (int k = 0; k < of_c; ++k)
          to[(r + i) * size + c + k] = to[(c + k) * size + r + i] = sum_of(sums[3 * i + k]);
    }
  }
}

void EdgeSums::normal(Normal& out) const {
  normal_of(out);
}

void EdgeSums::normal(HeldNormal& out) const {
  normal_of(out);
}

void EdgeSums::gradient(Unknowns& out) const {
  if (is_light_held_) {
    out.setZero();
    for (std::size_t r = 0; r < held_unknowns.size(); ++r) out[held_unknowns[r]] = sum_of(of_residuals_[r]);
    return;
  }
  if (!is_assembled_) {
    for (int r = 0; r < unknowns; ++r) out[r] = sum_of(of_residuals_[r]);
    return;
  }
  int pair = 0;
  for (int r = 0; r < threes; ++r) {
    pair += threes - r;  // the last one of this row
    for (int i = 0; i < 3; ++i)
      if (3 * r + i < unknowns) out[3 * r + i] = sum_of(of_threes_[pair - 1][3 * i + unknowns % 3]);
  }
}

}  // namespace huetrack::outline
