#include "color/color_region.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <numeric>
#include <utility>

namespace huetrack::color {

namespace {

struct RegionFinderTuning {
  std::size_t most_regions = 200;  // of one image; with more the colour is everywhere, and the time is bounded
};
constexpr RegionFinderTuning region_finder{};

std::int64_t cross_of(const PixelAt& a, const PixelAt& b, const PixelAt& c) {
  return std::int64_t{b.u - a.u} * (c.v - a.v) - std::int64_t{b.v - a.v} * (c.u - a.u);
}

// One side of the hull, as Andrew's monotone chain (1979) makes it: points in the order of their rows.
void add_to_chain(std::vector<PixelAt>& chain, const PixelAt& p, int side) {
  while (chain.size() >= 2 && side * cross_of(chain[chain.size() - 2], chain.back(), p) <= 0) chain.pop_back();
  chain.push_back(p);
}

// Second central moment of a polygon's area, and that area (Green's theorem).
std::pair<Eigen::Matrix2d, double> polygon_moments(const std::vector<PixelAt>& corners) {
  const Eigen::Vector2d origin(corners.front().u, corners.front().v);
  double area = 0;
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const PixelAt &from = corners[i], &to = corners[(i + 1) % corners.size()];
    const Eigen::Vector2d a = Eigen::Vector2d(from.u, from.v) - origin, b = Eigen::Vector2d(to.u, to.v) - origin;
    const double twice = a.x() * b.y() - b.x() * a.y();  // the triangle with the origin
    area += twice / 2;
    first += twice / 6 * (a + b);
    second += twice / 24 * (a * a.transpose() + b * b.transpose() + (a + b) * (a + b).transpose());
  }
  if (area == 0) return {Eigen::Matrix2d::Zero(), 0};
  const Eigen::Vector2d centre = first / area;
  return {second / area - centre * centre.transpose(), std::abs(area)};
}

}  // namespace

ConvexHull hull_of(MatchBits& view, PixelBox box) {
  constexpr int word = 56;  // layout: row() gives at least 57 pixels
  box = {std::max(box.u_min, 0), std::max(box.v_min, 0), std::min(box.u_max, view.width() - 1),
         std::min(box.v_max, view.height() - 1)};
  if (box.empty()) return {};
  view.look(box);
  std::vector<PixelAt> left, right;
  for (int v = box.v_min; v <= box.v_max; ++v) {
    int first = -1, last = -1;
    for (int u = box.u_min; u <= box.u_max; u += word) {
      const int length = std::min(word, box.u_max - u + 1);
      const std::uint64_t bits = view.row(u, v) & ((std::uint64_t{1} << length) - 1);
      if (bits == 0) continue;
      if (first < 0) first = u + std::countr_zero(bits);
      last = u + 63 - std::countl_zero(bits);
    }
    if (first < 0) continue;
    add_to_chain(left, {first, v}, -1);
    add_to_chain(right, {last, v}, 1);
  }
  if (left.empty()) return {};
  std::vector<PixelAt>& hull = left;
  hull.insert(hull.end(), right.rbegin(), right.rend());
  int border = 0;  // pixels on it
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const PixelAt &a = hull[i], &b = hull[(i + 1) % hull.size()];
    border += std::gcd(std::abs(b.u - a.u), std::abs(b.v - a.v));
  }
  const auto [spread, area] = polygon_moments(hull);
  const double pixels = area + border / 2.0 + 1;
  // The polygon goes through the middles of the outermost pixels.
  return {.area = static_cast<int>(pixels), .spread = area > 0 ? Eigen::Matrix2d(pixels / area * spread) : spread};
}

void RegionFinder::Moments::add(const Moments& o) {
  n += o.n, u += o.u, v += o.v, uu += o.uu, uv += o.uv, vv += o.vv;
  box = {std::min(box.u_min, o.box.u_min), std::min(box.v_min, o.box.v_min), std::max(box.u_max, o.box.u_max),
         std::max(box.v_max, o.box.v_max)};
}

int RegionFinder::root(int label) {
  while (parent_[static_cast<std::size_t>(label)] != label) {
    int& up = parent_[static_cast<std::size_t>(label)];
    up = parent_[static_cast<std::size_t>(up)];
    label = up;
  }
  return label;
}

// Connected components in one pass over runs of matching pixels (He, Chao and Suzuki 2008): a run takes the label of
// the runs that it touches in the row above, and joins them when they are several.
void RegionFinder::label_runs(MatchBits& view, const PixelBox& box, std::span<const PixelAt> probes) {
  constexpr int word = 56;  // layout: row() gives at least 57 pixels
  probed_.assign(probes.size(), -1);
  std::size_t next = 0;  // of the probes
  parent_.clear();
  moments_.clear();
  above_.clear();
  for (int v = box.v_min; v <= box.v_max; ++v) {
    current_.clear();
    // Most of a box is background: words without any match are found for eight rows at once.
    if (v == box.v_min || v % TileAt::size == 0) {
      words_.clear();
      for (int u0 = box.u_min; u0 <= box.u_max; u0 += word)
        if (view.has_any(u0, v)) words_.push_back(u0);
    }
    for (const int u0 : words_) {
      const int length = std::min(word, box.u_max - u0 + 1);
      std::uint64_t bits = view.row(u0, v) & ((std::uint64_t{1} << length) - 1);
      while (bits != 0) {
        const int from = std::countr_zero(bits);
        const int to = from + std::countr_one(bits >> from);  // one past the run
        bits &= ~((std::uint64_t{1} << to) - 1);
        if (!current_.empty() && current_.back().u_max == u0 + from - 1)
          current_.back().u_max = u0 + to - 1;
        else
          current_.push_back({u0 + from, u0 + to - 1, -1});
      }
    }
    std::size_t first_above = 0;
    for (Run& run : current_) {
      while (first_above < above_.size() && above_[first_above].u_max < run.u_min - 1) ++first_above;
      for (std::size_t a = first_above; a < above_.size() && above_[a].u_min <= run.u_max + 1; ++a) {
        const int label = root(above_[a].label);
        if (run.label < 0)
          run.label = label;
        else if (label != run.label) {
          const int keep = std::min(run.label, label), drop = std::max(run.label, label);
          parent_[static_cast<std::size_t>(drop)] = keep;
          run.label = keep;
        }
      }
      if (run.label < 0) {
        run.label = static_cast<int>(parent_.size());
        parent_.push_back(run.label);
        moments_.emplace_back();
      }
      while (next < probes.size() && (probes[next].v < v || (probes[next].v == v && probes[next].u < run.u_min)))
        ++next;
      for (; next < probes.size() && probes[next].v == v && probes[next].u <= run.u_max; ++next)
        probed_[next] = run.label;
      const double n = run.u_max - run.u_min + 1;
      const double sum_u = n * (run.u_min + run.u_max) / 2;
      const double middle = (run.u_min + run.u_max) / 2.0;
      const double sum_uu = n * middle * middle + n * (n * n - 1) / 12;
      Moments of_run{n, sum_u, n * v, sum_uu, sum_u * v, n * v * v, {run.u_min, v, run.u_max, v}};
      moments_[static_cast<std::size_t>(run.label)].add(of_run);
    }
    std::swap(above_, current_);
  }
  for (std::size_t i = 0; i < parent_.size(); ++i) {
    const auto r = static_cast<std::size_t>(root(static_cast<int>(i)));
    if (r == i) continue;
    moments_[r].add(moments_[i]);
    moments_[i].n = 0;
  }
  for (int& label : probed_) {
    if (label >= 0) label = root(label);
  }
}

void RegionFinder::collect(int min_area, double reach_px) {
  // Largest first; ties by place, so that the order never depends on how the labels were given.
  std::ranges::sort(found_, [](const Moments& a, const Moments& b) {
    if (a.n != b.n) return a.n > b.n;
    return std::pair(a.box.v_min, a.box.u_min) < std::pair(b.box.v_min, b.box.u_min);
  });
  const double reach2 = reach_px * reach_px;
  for (std::size_t i = 0; i < found_.size(); ++i) {
    Moments& whole = found_[i];
    if (whole.n == 0) continue;
    const double u = whole.u / whole.n, v = whole.v / whole.n;  // of the largest part
    for (std::size_t j = i + 1; j < found_.size(); ++j) {
      Moments& part = found_[j];
      if (part.n == 0) continue;
      const double du = part.u / part.n - u, dv = part.v / part.n - v;
      if (du * du + dv * dv > reach2) continue;
      whole.add(part);
      part.n = 0;
    }
  }
  regions_.clear();
  for (const Moments& m : found_) {
    if (m.n < min_area || m.n == 0) continue;
    ColorRegion region;
    region.area = static_cast<int>(m.n);
    region.centre = {m.u / m.n, m.v / m.n};
    const double uv = m.uv / m.n - region.centre.x() * region.centre.y();
    region.spread << m.uu / m.n - region.centre.x() * region.centre.x() + 1.0 / 12, uv, uv,
        m.vv / m.n - region.centre.y() * region.centre.y() + 1.0 / 12;
    region.box = m.box;
    regions_.push_back(region);
  }
  std::ranges::stable_sort(regions_, [](const ColorRegion& a, const ColorRegion& b) { return a.area > b.area; });
}

const std::vector<ColorRegion>& RegionFinder::find(MatchBits& view, PixelBox box, int min_area, double reach_px) {
  box = {std::max(box.u_min, 0), std::max(box.v_min, 0), std::min(box.u_max, view.width() - 1),
         std::min(box.v_max, view.height() - 1)};
  found_.clear();
  if (!box.empty()) {
    view.look(box);
    label_runs(view, box, {});
    for (const Moments& m : moments_) {
      if (m.n > 0) found_.push_back(m);
    }
  }
  collect(min_area, reach_px);
  return regions_;
}

const std::vector<ColorRegion>& RegionFinder::components(MatchBits& view, int step_px, std::span<const PixelAt> also,
                                                         int extent_px, int largest_px, int min_area) {
  found_.clear();
  view.grid(step_px, hits_);
  for (const PixelAt p : also) {
    if (p.u >= 0 && p.v >= 0 && p.u < view.width() && p.v < view.height() && view.at(p.u, p.v)) hits_.push_back(p);
  }
  if (!also.empty()) std::ranges::sort(hits_, {}, [](const PixelAt& p) { return std::pair(p.v, p.u); });
  is_taken_.assign(hits_.size(), 0);
  for (std::size_t i = 0; i < hits_.size() && found_.size() < region_finder.most_regions; ++i) {
    if (is_taken_[i] != 0) continue;
    const auto [u, v] = hits_[i];
    PixelBox box{u - extent_px, v - extent_px, u + extent_px, v + extent_px};
    for (;;) {
      box = {std::max(box.u_min, 0), std::max(box.v_min, 0), std::min(box.u_max, view.width() - 1),
             std::min(box.v_max, view.height() - 1)};
      view.look(box);
      probes_.clear();
      probes_of_.clear();
      for (std::size_t j = i; j < hits_.size() && hits_[j].v <= box.v_max; ++j) {
        if (is_taken_[j] != 0 || hits_[j].u < box.u_min || hits_[j].u > box.u_max) continue;
        probes_.push_back(hits_[j]);
        probes_of_.push_back(j);
      }
      label_runs(view, box, probes_);
      const int label = probed_.front();
      if (label < 0) break;
      const Moments& m = moments_[static_cast<std::size_t>(label)];
      const bool is_large = m.box.u_max - m.box.u_min >= largest_px || m.box.v_max - m.box.v_min >= largest_px;
      PixelBox wider = box;
      if (m.box.u_min == box.u_min) wider.u_min = std::max(0, wider.u_min - extent_px);
      if (m.box.v_min == box.v_min) wider.v_min = std::max(0, wider.v_min - extent_px);
      if (m.box.u_max == box.u_max) wider.u_max = std::min(view.width() - 1, wider.u_max + extent_px);
      if (m.box.v_max == box.v_max) wider.v_max = std::min(view.height() - 1, wider.v_max + extent_px);
      if (!is_large && wider != box) {  // it may go on beyond the box
        box = wider;
        continue;
      }
      for (std::size_t j = 0; j < probes_.size(); ++j) {
        if (probed_[j] == label) is_taken_[probes_of_[j]] = 1;
      }
      if (!is_large) found_.push_back(m);
      break;
    }
    is_taken_[i] = 1;
  }
  collect(min_area, 0);
  return regions_;
}

const std::vector<ColorRegion>& RegionFinder::search(MatchBits& view, int step_px, int max_extent_px, int min_area,
                                                     double reach_px) {
  found_.clear();
  const auto covered = [this](int u, int v) {
    return std::ranges::any_of(found_, [&](const Moments& m) {
      return u >= m.box.u_min && u <= m.box.u_max && v >= m.box.v_min && v <= m.box.v_max;
    });
  };
  view.grid(step_px, hits_);
  for (const auto [u, v] : hits_) {
    if (covered(u, v)) continue;
    if (found_.size() >= region_finder.most_regions) break;
    const PixelBox box{std::max(u - max_extent_px, 0), std::max(v - max_extent_px, 0),
                       std::min(u + max_extent_px, view.width() - 1), std::min(v + max_extent_px, view.height() - 1)};
    view.look(box);
    const PixelAt probe{u, v};
    label_runs(view, box, {&probe, 1});
    if (probed_.front() >= 0) found_.push_back(moments_[static_cast<std::size_t>(probed_.front())]);
  }
  std::erase_if(found_, [&](const Moments& m) {
    return m.box.u_max - m.box.u_min >= max_extent_px || m.box.v_max - m.box.v_min >= max_extent_px;
  });
  // Neighbouring boxes can report one component twice, cut differently: keep the larger.
  std::ranges::stable_sort(found_, [](const Moments& a, const Moments& b) { return a.n > b.n; });
  std::vector<Moments> kept;
  for (const Moments& m : found_) {
    const double u = m.u / m.n, v = m.v / m.n;
    const bool again = std::ranges::any_of(kept, [&](const Moments& k) {
      return u >= k.box.u_min && u <= k.box.u_max && v >= k.box.v_min && v <= k.box.v_max;
    });
    if (!again) kept.push_back(m);
  }
  found_ = std::move(kept);
  collect(min_area, reach_px);
  return regions_;
}

}  // namespace huetrack::color
