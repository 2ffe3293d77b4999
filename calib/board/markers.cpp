#include "calib/board/markers.h"

#include <algorithm>
#include <cmath>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace huetrack::board {
namespace {

int index_of(int id, const Board& board) {
  const int index = id - board.first_marker;
  return index >= 0 && index < board.marker_count() ? index : -1;
}

struct PointPairs {
  std::vector<cv::Point2d> on_board, px;
};

// turn: quarters by which the codes are printed turned against OpenCV's.
PointPairs pairs_of(const Markers& markers, const Board& board, std::size_t turn) {
  PointPairs pairs;
  for (const auto& [id, corners] : markers) {
    const auto on_board = board.marker_corners(index_of(id, board));
    for (std::size_t k = 0; k < 4; ++k) {
      pairs.on_board.emplace_back(on_board[k].x(), on_board[k].y());
      pairs.px.emplace_back(corners[(k + turn) % 4]);
    }
  }
  return pairs;
}

Markers turned_by(const Markers& markers, std::size_t turn) {
  Markers out = markers;
  for (auto& [id, corners] : out)
    std::rotate(corners.begin(), corners.begin() + static_cast<long>(turn), corners.end());
  return out;
}

// Whether a marker lies where the nearest of these predict it: also through a lens that bends the board.
bool is_predicted(int id, const MarkerCorners& corners, const Markers& fitting, const Board& board) {
  const auto middle = [&](int of) {
    const auto on_board = board.marker_corners(index_of(of, board));
    return Eigen::Vector2d((on_board[0] + on_board[2]).head<2>() / 2);
  };
  std::vector<std::pair<double, int>> nearest;
  for (const auto& [other, px] : fitting) nearest.emplace_back((middle(other) - middle(id)).norm(), other);
  std::ranges::sort(nearest);
  constexpr double near = 3;  // pitches
  if (nearest.empty() || nearest.front().first > near * board.pitch.maxCoeff()) return false;
  Markers around;
  for (std::size_t k = 0; k < std::min<std::size_t>(4, nearest.size()); ++k)
    around[nearest[k].second] = fitting.at(nearest[k].second);
  const PointPairs from = pairs_of(around, board, 0), to = pairs_of({{id, corners}}, board, 0);
  const cv::Mat h = cv::findHomography(from.on_board, from.px);
  if (h.empty()) return false;
  std::vector<cv::Point2d> predicted;
  cv::perspectiveTransform(to.on_board, predicted, h);
  double worst = 0;
  for (std::size_t k = 0; k < 4; ++k) worst = std::max(worst, cv::norm(predicted[k] - to.px[k]));
  return worst < 0.25 * cv::norm(corners[0] - corners[2]);
}

// Those that lie where most others predict them; codes that are found by chance do not.
Markers consistent(const Markers& markers, const Board& board, std::size_t turn) {
  double side = 0;
  for (const auto& [id, corners] : markers) side = std::max(side, cv::norm(corners[0] - corners[2]));
  const PointPairs pairs = pairs_of(markers, board, turn);
  constexpr int enough_tries = 500;  // half of the markers are the right ones in one of 16
  std::vector<unsigned char> inlier;
  if (cv::findHomography(pairs.on_board, pairs.px, cv::RANSAC, 0.2 * side, inlier, enough_tries).empty()) return {};
  Markers out = turned_by(markers, turn);
  std::size_t k = 0;
  std::erase_if(out, [&](const auto&) {
    const bool all = inlier[k] && inlier[k + 1] && inlier[k + 2] && inlier[k + 3];
    k += 4;
    return !all;
  });
  Markers left = turned_by(markers, turn);
  for (bool grows = true; grows;) {
    std::erase_if(left, [&](const auto& marker) { return out.contains(marker.first); });
    grows = std::erase_if(left, [&](const auto& marker) {
              const bool fits = is_predicted(marker.first, marker.second, out, board);
              if (fits) out.insert(marker);
              return fits;
            }) > 0;
  }
  return out;
}

// Markers with ids of no marker of the board, at places of its grid beside one that fits.
int strangers_on_grid(const Markers& strangers, const Markers& fitting, const Board& board) {
  if (strangers.empty() || fitting.size() < 2) return 0;
  const PointPairs pairs = pairs_of(fitting, board, 0);
  const cv::Mat onto_board = cv::findHomography(pairs.px, pairs.on_board);
  if (onto_board.empty()) return 0;
  std::vector<Eigen::Vector2d> centres;
  for (const auto& [id, corners] : fitting) {
    const auto on_board = board.marker_corners(index_of(id, board));
    centres.emplace_back((on_board[0] + on_board[2]).head<2>() / 2);
  }
  int count = 0;
  for (const auto& [id, corners] : strangers) {
    std::vector<cv::Point2d> px(corners.begin(), corners.end()), at;
    cv::perspectiveTransform(px, at, onto_board);
    const Eigen::Vector2d centre((at[0].x + at[2].x) / 2, (at[0].y + at[2].y) / 2);
    constexpr double near = 2.3, roughly = 0.2;  // of a pitch: the next markers of a charuco board, too
    const bool is_of_size = std::abs(cv::norm(at[1] - at[0]) / board.marker - 1) < roughly &&
                            std::abs(cv::norm(at[2] - at[1]) / board.marker - 1) < roughly;
    count += is_of_size && std::ranges::any_of(centres, [&](const Eigen::Vector2d& beside) {
               const Eigen::Vector2d steps = (centre - beside).cwiseQuotient(board.pitch);
               return steps.norm() < near && (steps - steps.array().round().matrix()).cwiseAbs().maxCoeff() < roughly;
             });
  }
  return count;
}

}  // namespace

cv::Mat upright_colours(const cv::Mat& image, bool inverted) {
  return inverted ? cv::Mat(255 - image) : image;
}

Markers find_markers(const cv::Mat& given, const Board& board) {
  const cv::Mat image = upright_colours(given, board.inverted);
  Markers found;
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->adaptiveThreshWinSizeMax = 43;
  parameters->minMarkerPerimeterRate = 0.015;
  parameters->markerBorderBits = board.border_bits;
  const auto known = std::ranges::find(marker_dictionaries(), board.dictionary, &MarkerDictionary::name);
  const auto markers = cv::aruco::getPredefinedDictionary(known->opencv_id);
  for (const double scale : {1.0, 2.0}) {  // enlarged: for markers with bits of a few pixels
    if (scale > 1 && static_cast<double>(image.total()) * scale * scale > 4e6) break;
    cv::Mat scaled = image;
    if (scale > 1) cv::resize(image, scaled, {}, scale, scale, cv::INTER_CUBIC);
    std::vector<MarkerCorners> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(scaled, markers, corners, ids, parameters);
    for (std::size_t k = 0; k < ids.size(); ++k) {
      if (found.contains(ids[k])) continue;
      // The window must reach neither the code's cells nor the next marker.
      double side = cv::norm(corners[k][3] - corners[k][0]);
      for (std::size_t c = 0; c < 3; ++c) side = std::min(side, cv::norm(corners[k][c + 1] - corners[k][c]));
      const int window = std::clamp(static_cast<int>(0.09 * side), 1, 6);
      const MarkerCorners rough = corners[k];
      cv::cornerSubPix(scaled, corners[k], {window, window}, {-1, -1},
                       {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 40, 0.005});
      for (std::size_t c = 0; c < 4; ++c) {
        if (cv::norm(corners[k][c] - rough[c]) > window + 1) corners[k][c] = rough[c];
      }
      for (cv::Point2f& p : corners[k]) {
        p.x = static_cast<float>((static_cast<double>(p.x) + 0.5) / scale - 0.5);
        p.y = static_cast<float>((static_cast<double>(p.y) + 0.5) / scale - 0.5);
      }
      found[ids[k]] = corners[k];
    }
  }
  return found;
}

MarkerFit fit_markers(const Markers& found, const Board& board) {
  Markers own, strangers;
  for (const auto& [id, corners] : found) (index_of(id, board) >= 0 ? own : strangers)[id] = corners;
  // A lone AprilTag does not show in which orientation the others are printed.
  const bool is_unclear = board.marker_count() > 1 && board.dictionary.starts_with("DICT_APRILTAG");
  if (own.size() < 2) return {is_unclear ? Markers() : own, 0};
  MarkerFit fit;
  for (std::size_t turn = 0; turn < 4; ++turn) {
    Markers fitting = consistent(own, board, turn);
    if (fitting.size() > fit.fitting.size()) fit.fitting = std::move(fitting);
    if (5 * fit.fitting.size() > 4 * own.size()) break;
  }
  fit.contradicting =
      static_cast<int>(own.size() - fit.fitting.size()) + strangers_on_grid(strangers, fit.fitting, board);
  return fit;
}

}  // namespace huetrack::board
