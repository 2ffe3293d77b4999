#include "calib/board/chessboard_lattice.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calib/model/median.h"

namespace huetrack::board {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Cell = std::pair<int, int>;

struct Saddle {
  Vector2d px;  // in the scaled image
  Matrix2d hessian;
  double strength = 0;            // -det of the Hessian
  std::array<Vector2d, 2> edges;  // unit; directions of zero curvature
};

constexpr std::size_t max_saddles = 2500;

// The brightness around a chessboard corner is a saddle: bright squares uphill one way, dark ones downhill the other.
std::vector<Saddle> find_saddles(const cv::Mat_<float>& smooth) {
  const int rows = smooth.rows, columns = smooth.cols;
  cv::Mat_<float> response(rows, columns, 0.0F);
  const auto hessian_at = [&](int y, int x) {
    const double c = 2.0 * static_cast<double>(smooth(y, x));
    const double xx = static_cast<double>(smooth(y, x - 1)) + static_cast<double>(smooth(y, x + 1)) - c;
    const double yy = static_cast<double>(smooth(y - 1, x)) + static_cast<double>(smooth(y + 1, x)) - c;
    const double xy = 0.25 * (static_cast<double>(smooth(y + 1, x + 1)) - static_cast<double>(smooth(y + 1, x - 1)) -
                              static_cast<double>(smooth(y - 1, x + 1)) + static_cast<double>(smooth(y - 1, x - 1)));
    return (Matrix2d() << xx, xy, xy, yy).finished();
  };
  for (int y = 1; y + 1 < rows; ++y) {
    for (int x = 1; x + 1 < columns; ++x) {
      response(y, x) = static_cast<float>(std::max(0.0, -hessian_at(y, x).determinant()));
    }
  }
  cv::Mat_<float> highest;
  cv::dilate(response, highest, cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5}));
  double max_response = 0;
  cv::minMaxLoc(response, nullptr, &max_response);
  const auto threshold = static_cast<float>(std::max(1e-4 * max_response, 1e-3));
  std::vector<Saddle> saddles;
  for (int y = 2; y + 2 < rows; ++y) {
    for (int x = 2; x + 2 < columns; ++x) {
      if (response(y, x) < threshold || response(y, x) < highest(y, x)) continue;
      Saddle saddle;
      saddle.strength = static_cast<double>(response(y, x));
      // The response is highest near the saddle point; the point itself is where the gradient is zero.
      int u = x, v = y;
      Vector2d shift;
      for (int step = 0; step < 4; ++step) {
        saddle.hessian = hessian_at(v, u);
        const Vector2d gradient(0.5 * (static_cast<double>(smooth(v, u + 1)) - static_cast<double>(smooth(v, u - 1))),
                                0.5 * (static_cast<double>(smooth(v + 1, u)) - static_cast<double>(smooth(v - 1, u))));
        shift = -saddle.hessian.inverse() * gradient;
        if (!(saddle.hessian.determinant() < 0) || shift.cwiseAbs().maxCoeff() <= 0.6) break;
        u += static_cast<int>(std::clamp(std::round(shift.x()), -1.0, 1.0));
        v += static_cast<int>(std::clamp(std::round(shift.y()), -1.0, 1.0));
        if (u < 1 || v < 1 || u + 1 >= columns || v + 1 >= rows) break;
      }
      if (!(saddle.hessian.determinant() < 0) || !(shift.cwiseAbs().maxCoeff() < 1.5)) continue;
      saddle.px = Vector2d(u, v) + shift;
      const Eigen::SelfAdjointEigenSolver<Matrix2d> eigen(saddle.hessian);
      const double low = -eigen.eigenvalues()(0), high = eigen.eigenvalues()(1);  // both > 0
      const Vector2d along = eigen.eigenvectors().col(1) * std::sqrt(low),
                     across = eigen.eigenvectors().col(0) * std::sqrt(high);
      saddle.edges = {(along + across).normalized(), (along - across).normalized()};
      saddles.push_back(saddle);
    }
  }
  std::ranges::stable_sort(saddles, std::greater{}, &Saddle::strength);
  if (saddles.size() > max_saddles) saddles.resize(max_saddles);
  return saddles;
}

// Distance of a point from a position, in lattice steps.
double steps_off(const Vector2d& offset, const Vector2d& step_i, const Vector2d& step_j) {
  const Matrix2d basis = (Matrix2d() << step_i, step_j).finished();
  if (std::abs(basis.determinant()) < 1e-9) return 1e9;
  return (basis.inverse() * offset).cwiseAbs().maxCoeff();
}

double grey_at(const cv::Mat_<float>& image, const Vector2d& p) {
  const double x = std::clamp(p.x(), 0.0, image.cols - 1.001), y = std::clamp(p.y(), 0.0, image.rows - 1.001);
  const int u = static_cast<int>(x), v = static_cast<int>(y);
  const double a = x - u, b = y - v;
  return (1 - b) * ((1 - a) * static_cast<double>(image(v, u)) + a * static_cast<double>(image(v, u + 1))) +
         b * ((1 - a) * static_cast<double>(image(v + 1, u)) + a * static_cast<double>(image(v + 1, u + 1)));
}

// Half the difference between the squares on the (+i, +j) and (-i, -j) sides and the other two; 0 unless the four
// squares around the point have two brightnesses, two squares each (not so at the board's border, line crossings, lone
// squares).
double contrast_at(const cv::Mat_<float>& smooth, const Vector2d& px, const Vector2d& step_i, const Vector2d& step_j) {
  const Vector2d i = 0.2 * step_i, j = 0.2 * step_j;  // squares at a board's edge may be cut
  const double a = grey_at(smooth, px + i + j), b = grey_at(smooth, px - i - j);
  const double c = grey_at(smooth, px + i - j), d = grey_at(smooth, px - i + j);
  const double contrast = (a + b - c - d) / 4;
  return std::max(std::abs(a - b), std::abs(c - d)) < 1.3 * std::abs(contrast) ? contrast : 0;
}

double cross(const Vector2d& a, const Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Buckets of saddles, to find those near a point.
class SaddleIndex {
 public:
  SaddleIndex(const std::vector<Saddle>& saddles, cv::Size size)
      : columns_(size.width / cell + 1),
        rows_(size.height / cell + 1),
        buckets_(static_cast<std::size_t>(columns_ * rows_)) {
    for (std::size_t i = 0; i < saddles.size(); ++i)
      bucket(column(saddles[i].px.x()), row(saddles[i].px.y())).push_back(static_cast<int>(i));
  }

  template <typename Visit>
  void visit_near(const Vector2d& p, double radius, const Visit& visit) const {
    for (int r = row(p.y() - radius); r <= row(p.y() + radius); ++r) {
      for (int c = column(p.x() - radius); c <= column(p.x() + radius); ++c) {
        for (const int i : buckets_[static_cast<std::size_t>(r * columns_ + c)]) visit(i);
      }
    }
  }

 private:
  static constexpr int cell = 16;
  int column(double x) const { return std::clamp(static_cast<int>(x / cell), 0, columns_ - 1); }
  int row(double y) const { return std::clamp(static_cast<int>(y / cell), 0, rows_ - 1); }
  std::vector<int>& bucket(int c, int r) { return buckets_[static_cast<std::size_t>(r * columns_ + c)]; }

  int columns_, rows_;
  std::vector<std::vector<int>> buckets_;
};

// links[i][2 * line + (backwards ? 1 : 0)]: the next saddle along that edge line; -1: none.
using Links = std::vector<std::array<int, 4>>;

constexpr double cos_of_bend = 0.90;     // an edge leads to the next corner within 26 degrees
constexpr double least_contrast = 0.35;  // of a corner, compared with its neighbours
constexpr double max_step = 90;          // scaled pixels; larger boards are found at a smaller scale

// The nearest saddle that can be the next corner of the board along each edge: the edge goes through it too, and its
// bright and dark sides are swapped.
Links link_neighbours(const std::vector<Saddle>& saddles, const SaddleIndex& index) {
  Links links(saddles.size(), {-1, -1, -1, -1});
  for (std::size_t i = 0; i < saddles.size(); ++i) {
    const Saddle& from = saddles[i];
    std::array<double, 4> nearest;
    nearest.fill(max_step);
    for (double radius = 16; radius < 2 * max_step && std::ranges::count(links[i], -1) > 0; radius *= 2.4) {
      index.visit_near(from.px, std::min(radius, max_step), [&](int j) {
        const Saddle& to = saddles[static_cast<std::size_t>(j)];
        const Vector2d way = to.px - from.px;
        const double distance = way.norm();
        if (distance < 1.5 || to.strength < 0.06 * from.strength || to.strength > 16 * from.strength) return;
        for (std::size_t line = 0; line < 2; ++line) {
          const double along = way.dot(from.edges[line]);
          if (std::abs(along) < cos_of_bend * distance) continue;
          const std::size_t slot = 2 * line + (along < 0 ? 1 : 0);
          if (distance >= nearest[slot]) continue;
          const bool edge_goes_on = std::ranges::any_of(
              to.edges, [&](const Vector2d& edge) { return std::abs(edge.dot(way)) > cos_of_bend * distance; });
          const double swapped = -from.edges[0].dot(to.hessian * from.edges[1]) / to.hessian.norm();
          if (!edge_goes_on || swapped < 0.2) continue;
          nearest[slot] = distance;
          links[i][slot] = j;
        }
      });
    }
  }
  // Keep only mutual links.
  Links mutual = links;
  for (std::size_t i = 0; i < links.size(); ++i) {
    for (std::size_t slot = 0; slot < 4; ++slot) {
      const int j = links[i][slot];
      if (j >= 0 && std::ranges::find(links[static_cast<std::size_t>(j)], static_cast<int>(i)) ==
                        links[static_cast<std::size_t>(j)].end()) {
        mutual[i][slot] = -1;
      }
    }
  }
  return mutual;
}

class Growing {  // one lattice
 public:
  Growing(const cv::Mat_<float>& smooth, const std::vector<Saddle>& saddles, const SaddleIndex& index,
          const Links& links)
      : smooth_(smooth), saddles_(saddles), index_(index), links_(links) {}

  // Starts with four linked corners of a square, the given saddle among them. False: none.
  bool start(int seed) {
    const auto& from = links_[static_cast<std::size_t>(seed)];
    for (std::size_t along : {0U, 1U}) {
      for (std::size_t across : {2U, 3U}) {
        const int a = from[along], b = from[across];
        if (a < 0 || b < 0) continue;
        const Vector2d way_a = at(a).px - at(seed).px, way_b = at(b).px - at(seed).px;
        const int c = towards(a, way_b), d = towards(b, way_a);
        if (c < 0 || c != d || c == seed) continue;
        const bool right_handed = cross(way_a, way_b) > 0;
        cells_ = {{{0, 0}, seed}, {{1, 0}, right_handed ? a : b}, {{0, 1}, right_handed ? b : a}, {{1, 1}, c}};
        const Vector2d step_i = at(cells_[{1, 0}]).px - at(seed).px, step_j = at(cells_[{0, 1}]).px - at(seed).px;
        if (steps_off(at(c).px - at(seed).px - step_i - step_j, step_i, step_j) > 0.35) continue;
        sign_ = contrast_at(smooth_, at(seed).px, step_i, step_j) > 0 ? 1 : -1;
        if (std::ranges::all_of(cells_, [&](const auto& cell) { return contrast_of(cell.first).value_or(0) > 0; }))
          return true;
      }
    }
    return false;
  }

  // Grows outwards: predicts a corner from its neighbours and takes the saddle there.
  void grow() {
    for (bool grown = true; grown;) {
      grown = false;
      std::vector<Cell> border;
      for (const auto& [cell, saddle] : cells_) {
        for (const auto& [di, dj] : around) {
          const Cell next{cell.first + di, cell.second + dj};
          if (!cells_.contains(next)) border.push_back(next);
        }
      }
      std::ranges::sort(border);
      const auto rest = std::ranges::unique(border);
      border.erase(rest.begin(), rest.end());
      std::vector<std::pair<Cell, int>> found;
      for (const Cell& cell : border) {
        if (const auto saddle = saddle_at(cell)) found.emplace_back(cell, *saddle);
      }
      for (const auto& [cell, saddle] : found) {
        const bool used = std::ranges::any_of(cells_, [&](const auto& c) { return c.second == saddle; });
        if (used || cells_.contains(cell)) continue;
        cells_[cell] = saddle;
        grown = true;
      }
      if (cells_.size() > 10000) break;
    }
    drop_misfits();
    keep_connected();
  }

  std::size_t size() const { return cells_.size(); }
  double weight() const {  // many corners of high contrast: a board, not wallpaper
    double sum = 0;
    for (const auto& [cell, saddle] : cells_) sum += std::sqrt(at(saddle).strength);
    return sum;
  }
  const std::map<Cell, int>& cells() const { return cells_; }

  ChessboardLattice result(double scale) const {
    ChessboardLattice lattice;
    for (const auto& [cell, saddle] : cells_) {
      // cv::resize aligns the image's edges: pixel centres shift by half a pixel.
      const Vector2d px = (at(saddle).px.array() + 0.5) / scale - 0.5;
      lattice.nodes[cell] = {px, at(saddle).strength};
    }
    lattice.dark_at_origin = sign_ < 0;
    return lattice;
  }

 private:
  static constexpr std::array<Cell, 4> around{Cell{1, 0}, Cell{-1, 0}, Cell{0, 1}, Cell{0, -1}};
  const Saddle& at(int i) const { return saddles_[static_cast<std::size_t>(i)]; }

  // The saddle linked to this one in about that direction; -1: none.
  int towards(int saddle, const Vector2d& way) const {
    for (const int next : links_[static_cast<std::size_t>(saddle)]) {
      if (next >= 0 && (at(next).px - at(saddle).px).normalized().dot(way.normalized()) > cos_of_bend) return next;
    }
    return -1;
  }

  std::optional<Vector2d> position(int i, int j) const {
    const auto node = cells_.find({i, j});
    if (node == cells_.end()) return std::nullopt;
    return at(node->second).px;
  }

  struct Prediction {
    Vector2d px, step_i, step_j;
    int witnesses = 0;
  };

  // Predicts a cell's corner by continuing lines and parallelograms of its neighbours.
  std::optional<Prediction> predict(const Cell& cell) const {
    const auto [i, j] = cell;
    Prediction p{Vector2d::Zero(), Vector2d::Zero(), Vector2d::Zero(), 0};
    int steps_i = 0, steps_j = 0;
    const auto add = [&](const Vector2d& px) {
      p.px += px;
      ++p.witnesses;
    };
    for (const int s : {-1, 1}) {
      if (const auto a = position(i + s, j), b = position(i + 2 * s, j); a && b) {
        const auto c = position(i + 3 * s, j);
        add(c ? Vector2d(3 * *a - 3 * *b + *c) * 0.5 + Vector2d(2 * *a - *b) * 0.5 : Vector2d(2 * *a - *b));
        p.step_i += s * (*b - *a);
        ++steps_i;
      }
      if (const auto a = position(i, j + s), b = position(i, j + 2 * s); a && b) {
        const auto c = position(i, j + 3 * s);
        add(c ? Vector2d(3 * *a - 3 * *b + *c) * 0.5 + Vector2d(2 * *a - *b) * 0.5 : Vector2d(2 * *a - *b));
        p.step_j += s * (*b - *a);
        ++steps_j;
      }
    }
    for (const int s : {-1, 1}) {
      for (const int t : {-1, 1}) {
        const auto a = position(i + s, j), b = position(i, j + t), c = position(i + s, j + t);
        if (a && c) {
          p.step_j += t * (*c - *a);
          ++steps_j;
        }
        if (b && c) {
          p.step_i += s * (*c - *b);
          ++steps_i;
        }
        if (a && b && c) add(*a + *b - *c);
      }
    }
    if (p.witnesses == 0 || steps_i == 0 || steps_j == 0) return std::nullopt;
    p.px /= p.witnesses;
    p.step_i /= steps_i;
    p.step_j /= steps_j;
    return p;
  }

  // Contrast of a cell's corner; 0 if its squares have the wrong brightness. nullopt: no corner, or no neighbours that
  // give the size of its squares.
  std::optional<double> contrast_of(const Cell& cell) const {
    const auto node = cells_.find(cell);
    if (node == cells_.end()) return std::nullopt;
    const auto [i, j] = cell;
    const auto step = [&](int di, int dj) -> Vector2d {
      const auto before = position(i - di, j - dj), after = position(i + di, j + dj);
      const Vector2d& here = at(node->second).px;
      if (before && after) return (*after - *before) / 2;
      return after ? Vector2d(*after - here) : before ? Vector2d(here - *before) : Vector2d::Zero();
    };
    const Vector2d step_i = step(1, 0), step_j = step(0, 1);
    if (step_i.isZero() || step_j.isZero()) return std::nullopt;
    const double expected = (i + j) % 2 == 0 ? sign_ : -sign_;
    return std::max(0.0, expected * contrast_at(smooth_, at(node->second).px, step_i, step_j));
  }

  std::optional<int> saddle_at(const Cell& cell) const {
    const auto p = predict(cell);
    if (!p) return std::nullopt;
    const double expected = (cell.first + cell.second) % 2 == 0 ? sign_ : -sign_;
    std::optional<int> best;
    double best_score = 0;
    const double reach = 0.4 * (p->step_i.norm() + p->step_j.norm());
    double near_contrast = 0;
    for (const auto& [di, dj] : around) {
      near_contrast = std::max(near_contrast, contrast_of({cell.first + di, cell.second + dj}).value_or(0));
    }
    index_.visit_near(p->px, reach, [&](int s) {
      const Saddle& saddle = at(s);
      const double off = steps_off(saddle.px - p->px, p->step_i, p->step_j);
      if (off > (p->witnesses > 1 ? 0.35 : 0.3)) return;
      if (expected * contrast_at(smooth_, saddle.px, p->step_i, p->step_j) < least_contrast * near_contrast) return;
      const double score = std::sqrt(saddle.strength) * (1 - off);
      if (score > best_score) {
        best_score = score;
        best = s;
      }
    });
    return best;
  }

  // The largest part whose cells touch.
  void keep_connected() {
    std::map<Cell, int> best;
    std::map<Cell, int> rest = cells_;
    while (rest.size() > best.size()) {
      std::map<Cell, int> part;
      std::vector<Cell> open{rest.begin()->first};
      while (!open.empty()) {
        const Cell cell = open.back();
        open.pop_back();
        const auto node = rest.find(cell);
        if (node == rest.end()) continue;
        part.insert(*node);
        rest.erase(node);
        for (const auto& [di, dj] : around) open.emplace_back(cell.first + di, cell.second + dj);
      }
      if (part.size() > best.size()) best = std::move(part);
    }
    cells_ = std::move(best);
  }

  // Removes corners away from their neighbours' prediction, and false ones.
  void drop_misfits() {
    std::vector<std::optional<double>> contrasts;
    std::vector<double> known;
    for (const auto& [cell, saddle] : cells_) {
      contrasts.push_back(contrast_of(cell));
      if (contrasts.back()) known.push_back(*contrasts.back());
    }
    if (known.empty()) return;
    const double usual = std::max(calib::median(std::move(known)), 1e-3);
    auto contrast = contrasts.begin();
    std::erase_if(cells_, [&](const auto&) { return (contrast++)->value_or(usual) < least_contrast * usual; });
    for (bool dropped = true; dropped;) {
      dropped = false;
      double worst = 0.35;
      Cell worst_cell{};
      for (const auto& [cell, saddle] : cells_) {
        const auto p = predict(cell);
        const double off = p ? steps_off(at(saddle).px - p->px, p->step_i, p->step_j) : 0;
        if (off > worst) {
          worst = off;
          worst_cell = cell;
          dropped = true;
        }
      }
      if (dropped) cells_.erase(worst_cell);
    }
  }

  const cv::Mat_<float>& smooth_;
  const std::vector<Saddle>& saddles_;
  const SaddleIndex& index_;
  const Links& links_;
  std::map<Cell, int> cells_;
  double sign_ = 1;  // of u^T H v at cell (0, 0): positive where the (+u, +v) square is bright
};

}  // namespace

std::pair<Vector2d, Vector2d> ChessboardLattice::steps_at(int i, int j) const {
  const auto step = [&](int di, int dj) -> Vector2d {
    const auto here = nodes.find({i, j}), before = nodes.find({i - di, j - dj}), after = nodes.find({i + di, j + dj});
    const Vector2d b = before != nodes.end() ? before->second.px : here->second.px;
    const Vector2d a = after != nodes.end() ? after->second.px : here->second.px;
    return before != nodes.end() && after != nodes.end() ? Vector2d((a - b) / 2) : Vector2d(a - b);
  };
  return {step(1, 0), step(0, 1)};
}

std::vector<ChessboardLattice> find_chessboard_lattices(const cv::Mat& grey, double scale) {
  cv::Mat_<float> smooth;
  grey.convertTo(smooth, CV_32F);
  if (scale != 1) cv::resize(smooth, smooth, {}, scale, scale, scale > 1 ? cv::INTER_CUBIC : cv::INTER_AREA);
  const double blur = scale > 2 ? 2.0 : 1.4;
  cv::GaussianBlur(smooth, smooth, {}, blur, blur, cv::BORDER_REPLICATE);
  const auto saddles = find_saddles(smooth);
  const SaddleIndex index(saddles, smooth.size());
  const Links links = link_neighbours(saddles, index);

  std::vector<bool> covered(saddles.size(), false);
  std::vector<std::pair<double, ChessboardLattice>> found;                 // with their weights
  for (std::size_t i = 0; i < saddles.size() && found.size() < 40; ++i) {  // strong ones first
    if (covered[i]) continue;
    Growing lattice(smooth, saddles, index, links);
    if (!lattice.start(static_cast<int>(i))) continue;
    lattice.grow();
    if (lattice.size() < 6) continue;
    for (const auto& [cell, saddle] : lattice.cells()) covered[static_cast<std::size_t>(saddle)] = true;
    found.emplace_back(lattice.weight(), lattice.result(scale));
  }
  std::ranges::stable_sort(found, [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<ChessboardLattice> lattices;
  for (auto& [weight, lattice] : found) lattices.push_back(std::move(lattice));
  return lattices;
}

}  // namespace huetrack::board
