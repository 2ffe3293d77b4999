#include "calib/board/circle_grid.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/board/markers.h"
#include "calib/model/median.h"

namespace huetrack::board {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

// A dark ellipse. spread: second central moments of its area, px^2; the boundary is at x^T spread^-1 x = 4.
struct Blob {
  Vector2d centre;
  Matrix2d spread;
  double area = 0;  // px^2
  double radius() const { return std::sqrt(area / std::numbers::pi); }
};

// Of a contour; nullopt: not an ellipse.
std::optional<Blob> ellipse_of(const std::vector<cv::Point>& contour) {
  const cv::Moments m = cv::moments(contour);
  constexpr double least_area = 9;  // px^2; a diameter of 3.4 px
  if (m.m00 < least_area) return std::nullopt;
  Blob blob;
  blob.area = m.m00;
  blob.centre = {m.m10 / m.m00, m.m01 / m.m00};
  blob.spread << m.mu20, m.mu11, m.mu11, m.mu02;
  blob.spread /= m.m00;
  const Eigen::LLT<Matrix2d> root(blob.spread);
  if (root.info() != Eigen::Success) return std::nullopt;
  // Contour points of an ellipse are all at distance 2 in units of its spread; those of a square at 1.7 to 2.4.
  double sum = 0, sum2 = 0;
  for (const cv::Point& p : contour) {
    const double r = root.matrixL().solve(Vector2d(p.x, p.y) - blob.centre).norm();
    sum += r;
    sum2 += r * r;
  }
  const auto n = static_cast<double>(contour.size());
  const double mean = sum / n, deviation = std::sqrt(std::max(0.0, sum2 / n - mean * mean));
  const double steps = 0.4 / blob.radius();  // of the pixels
  const double half = blob.spread.trace() / 2, flat = blob.spread.determinant();
  const double widest = half + std::sqrt(std::max(0.0, half * half - flat));  // larger eigenvalue
  constexpr double slimmest = 0.01;  // of the squares of the half axes: seen at 84 degrees
  if (deviation / mean > 0.03 + steps || std::abs(mean / 2 - 1) > 0.1 + steps || flat < slimmest * widest * widest)
    return std::nullopt;
  return blob;
}

// Dark ellipses of all sizes: thresholds against the mean of windows from small to large.
std::vector<Blob> find_blobs(const cv::Mat& image) {
  std::vector<Blob> blobs;
  const int longer = std::max(image.cols, image.rows);
  for (const int parts : {3, 8, 20, 50}) {
    cv::Mat dark;
    constexpr double clearly = 6;  // grey values; noise is less
    const int window = std::max(7, longer / parts) | 1;
    cv::adaptiveThreshold(image, dark, 255, cv::ADAPTIVE_THRESH_MEAN_C, cv::THRESH_BINARY_INV, window, clearly);
    std::vector<std::vector<cv::Point>> contours;
    cv::findContours(dark, contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
    for (const auto& contour : contours) {
      const std::optional<Blob> blob = ellipse_of(contour);
      if (!blob) continue;
      const bool is_known = std::ranges::any_of(blobs, [&](const Blob& b) {
        return (b.centre - blob->centre).norm() < 0.5 * std::max(b.radius(), blob->radius());
      });
      const cv::Point middle(static_cast<int>(std::lround(blob->centre.x())),
                             static_cast<int>(std::lround(blob->centre.y())));
      if (!is_known && dark.at<std::uint8_t>(middle) != 0) blobs.push_back(*blob);
    }
  }
  return blobs;
}

// Those with three neighbours of about their size: a grid's corner has as many within two and a half steps.
std::vector<Blob> in_company(const std::vector<Blob>& blobs) {
  std::vector<Blob> out;
  std::ranges::copy_if(blobs, std::back_inserter(out), [&](const Blob& blob) {
    return 4 <= std::ranges::count_if(blobs, [&](const Blob& other) {
             constexpr double alike = 2.5;
             const double ratio = other.area / blob.area;
             return ratio < alike && alike * ratio > 1 && (other.centre - blob.centre).norm() < 16 * blob.radius();
           });
  });
  return out;
}

// Centre of area from grey values, which blur does not move: the background is a plane through the ring around the
// circle. nullopt: cut by the image's edge, or without contrast.
std::optional<Blob> refined(const cv::Mat& image, const Blob& blob) {
  const Matrix2d inverse = blob.spread.inverse();
  constexpr double ring_from = 1.3, ring_to = 1.65;  // of the half axes; neighbours begin at 1.86 of a radius
  const double soft = 1.5 / blob.radius(), out = ring_to + soft, in = ring_from + soft;
  const int reach_x = static_cast<int>(std::ceil(2 * out * std::sqrt(blob.spread(0, 0)))),
            reach_y = static_cast<int>(std::ceil(2 * out * std::sqrt(blob.spread(1, 1))));
  const int x0 = static_cast<int>(std::floor(blob.centre.x())), y0 = static_cast<int>(std::floor(blob.centre.y()));
  if (x0 - reach_x < 0 || y0 - reach_y < 0 || x0 + reach_x + 1 >= image.cols || y0 + reach_y + 1 >= image.rows)
    return std::nullopt;
  const auto each = [&](const auto& visit) {
    for (int y = y0 - reach_y; y <= y0 + reach_y + 1; ++y) {
      for (int x = x0 - reach_x; x <= x0 + reach_x + 1; ++x) {
        const Vector2d d = Vector2d(x, y) - blob.centre;
        visit(d, std::sqrt(d.dot(inverse * d)) / 2, static_cast<double>(image.at<std::uint8_t>(y, x)));
      }
    }
  };
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  std::vector<double> dark;
  each([&](const Vector2d& d, double r, double grey) {
    if (r < 0.6) dark.push_back(grey);
    if (r < in || r > out) return;
    const Eigen::Vector3d row(1, d.x(), d.y());
    normal += row * row.transpose();
    right += grey * row;
  });
  const Eigen::Vector3d plane = normal.ldlt().solve(right);
  const double contrast = plane[0] - calib::median(std::move(dark), plane[0]);
  constexpr double least_contrast = 10;  // grey values
  if (!(contrast > least_contrast)) return std::nullopt;
  double weight = 0;
  Vector2d moment = Vector2d::Zero();
  each([&](const Vector2d& d, double r, double grey) {
    if (r > (in + out) / 2) return;
    const double w = (plane.dot(Eigen::Vector3d(1, d.x(), d.y())) - grey) / contrast;
    weight += w;
    moment += w * d;
  });
  if (std::abs(weight / blob.area - 1) > 0.6 + 2 * soft) return std::nullopt;
  Blob better = blob;
  better.centre += moment / weight;
  better.area = weight;
  return better;
}

cv::Matx33d homography(const Board& board, const std::vector<int>& ids, const std::vector<cv::Point2d>& px) {
  std::vector<cv::Point2d> on_board;
  for (const int id : ids) on_board.emplace_back(board.point(id).x(), board.point(id).y());
  const cv::Mat h = cv::findHomography(on_board, px);
  return h.empty() ? cv::Matx33d::zeros() : cv::Matx33d(h);
}

Vector2d apply(const cv::Matx33d& h, const Vector2d& p) {
  const cv::Vec3d q = h * cv::Vec3d(p.x(), p.y(), 1);
  return {q[0] / q[2], q[1] / q[2]};
}

Matrix2d jacobian(const cv::Matx33d& h, const Vector2d& p, double step) {
  Matrix2d j;
  for (int axis = 0; axis < 2; ++axis) {
    const Vector2d d = step * Vector2d::Unit(axis);
    j.col(axis) = (apply(h, p + d) - apply(h, p - d)) / (2 * step);
  }
  return j;
}

// Ids of OpenCV's order as the board numbers them: seen from the front, and of these the most upright.
std::vector<int> numbered(const Board& board, const std::vector<cv::Point2d>& px) {
  const int columns = board.columns, rows = board.rows;
  std::vector<int> best;
  double most_upright = -2;
  const auto symmetries = board.symmetries();
  for (const bool mirrored : {false, true}) {
    std::vector<int> ids;
    for (int k = 0; k < columns * rows; ++k) {
      const int column = k % columns, row = k / columns;
      ids.push_back(!mirrored ? k : (rows - 1 - row) * columns + column);
    }
    // Its mirror image is another grid, whose first row is the shifted one.
    if (mirrored && board.type == BoardType::asymmetric_circles && rows % 2 == 0) continue;
    const cv::Matx33d h = homography(board, ids, px);
    if (!(cv::determinant(h) > 0)) continue;
    for (const auto& symmetry : symmetries) {
      std::vector<int> turned;
      for (const int id : ids) turned.push_back(symmetry[static_cast<std::size_t>(id)]);
      const cv::Matx33d pixels = homography(board, turned, px);
      const Vector2d x_way = apply(pixels, {board.pitch.x(), 0}) - apply(pixels, {0, 0});
      if (x_way.x() / x_way.norm() <= most_upright) continue;
      most_upright = x_way.x() / x_way.norm();
      best = std::move(turned);
    }
  }
  return best;
}

// Places of the grid next to the board where there is a circle, too: the board file has too few.
int circles_beside(const Board& board, const cv::Matx33d& pixels, const std::vector<Blob>& blobs, double usual_area) {
  Board larger = board;
  larger.columns += 2;
  larger.rows += 4;  // keeps which rows are shifted
  const Vector2d shift = (board.type == BoardType::circles ? 1 : 2) * board.pitch.cwiseProduct(Vector2d(1, 0)) +
                         2 * board.pitch.cwiseProduct(Vector2d(0, 1));
  int count = 0;
  for (int id = 0; id < larger.point_count(); ++id) {
    const Vector2d p = larger.point(id).head<2>() - shift;
    const bool is_own = [&] {
      for (int own = 0; own < board.point_count(); ++own) {
        if ((board.point(own).head<2>() - p).norm() < 0.1 * board.pitch.minCoeff()) return true;
      }
      return false;
    }();
    if (is_own) continue;
    const Vector2d px = apply(pixels, p);
    const double scale = std::sqrt(std::abs(jacobian(pixels, p, 0.1 * board.pitch.x()).determinant()));
    const double near = 0.3 * scale * board.pitch.minCoeff();
    count += std::ranges::any_of(blobs, [&](const Blob& blob) {
      return (blob.centre - px).squaredNorm() < near * near && blob.area < 2 * usual_area && usual_area < 2 * blob.area;
    });
  }
  return count;
}

}  // namespace

BoardDetection detect_circles(const Board& board, const cv::Mat& given) {
  const cv::Mat image = upright_colours(given, board.inverted);
  const std::vector<Blob> blobs = in_company(find_blobs(image));
  const auto count = static_cast<std::size_t>(board.point_count());
  BoardDetection found;
  found.why_not = "no grid of circles in it";
  constexpr std::size_t most = 600;  // capacity: OpenCV's search is quadratic
  if (blobs.size() < count || blobs.size() > most + count) return found;
  std::vector<cv::Point2f> candidates, centres;
  for (const Blob& blob : blobs) candidates.emplace_back(float(blob.centre.x()), float(blob.centre.y()));
  const bool asymmetric = board.type == BoardType::asymmetric_circles;
  const cv::Size size(board.columns, board.rows);
  const int flags = asymmetric ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID;
  bool is_found = false;
  for (const int how : {0, int(cv::CALIB_CB_CLUSTERING)}) {
    if (!is_found)
      is_found = cv::findCirclesGrid(candidates, size, centres, flags | how, cv::Ptr<cv::FeatureDetector>());
  }
  if (!is_found || centres.size() != count) return found;
  std::vector<cv::Point2d> px;
  std::vector<Blob> circles;
  for (const cv::Point2f& centre : centres) {
    const Vector2d at(static_cast<double>(centre.x), static_cast<double>(centre.y));
    const auto nearest =
        std::ranges::min_element(blobs, {}, [&](const Blob& blob) { return (blob.centre - at).squaredNorm(); });
    const std::optional<Blob> circle = refined(image, *nearest);
    if (!circle) {
      found.why_not = "not all of its circles are sharp and inside the image";
      return found;
    }
    circles.push_back(*circle);
    px.emplace_back(circle->centre.x(), circle->centre.y());
  }
  const std::vector<int> ids = numbered(board, px);
  if (ids.empty()) return found;
  const cv::Matx33d pixels = homography(board, ids, px);
  std::vector<double> diameters, sides_px, areas;
  double worst = 0, step_px = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const Vector2d p = board.point(ids[k]).head<2>();
    const double scale = std::sqrt(std::abs(jacobian(pixels, p, 0.1 * board.pitch.x()).determinant()));
    worst = std::max(worst, (apply(pixels, p) - circles[k].centre).norm() / (scale * board.pitch.minCoeff()));
    step_px = scale;
    diameters.push_back(2 * circles[k].radius() / scale);
    sides_px.push_back(2 * circles[k].radius());
    areas.push_back(circles[k].area);
  }
  constexpr double grossest = 0.35;  // of a pitch; a strong lens bends a grid by less
  if (worst > grossest || !(step_px > 0)) return found;
  if (circles_beside(board, pixels, blobs, calib::median(std::move(areas))) >= 3) {
    found.why_not = "it shows more circles than the board file says";
    return found;
  }
  found.why_not.clear();
  found.ids = ids;
  for (const Blob& circle : circles) found.px.push_back(circle.centre);
  sort_corners(found.ids, found.px);
  found.marker_m = calib::median(std::move(diameters));
  found.marker_px = calib::median(std::move(sides_px));
  return found;
}

}  // namespace huetrack::board
