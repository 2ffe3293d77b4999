#include "calib/gather/view_coverage.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "calib/board/sharpness.h"
#include "calib/gather/find_boards.h"
#include "calib/model/index.h"
#include "calib/model/median.h"
#include "calib/model/missing_links.h"

namespace huetrack::gather {
namespace {

using calib::index;

// Assumes a usual lens: accurate enough to distinguish straight from tilted.
ViewCoverage::Tilt tilt_of(const board::Board& board, const solver::BoardView& view, calib::ImageSize size) {
  solver::LensParameters lens = solver::LensParameters::Zero();
  lens.head<4>() << 0.9 * size.width, 0.9 * size.width, (size.width - 1) / 2.0, (size.height - 1) / 2.0;
  const auto poses = solver::board_poses(board, view, solver::LensModel::radtan4, lens);
  if (poses.empty()) return ViewCoverage::straight;
  // The board's z axis points away from the camera; the side that it leans to is nearer.
  const Eigen::Vector3d z = poses.front().cam_from_board.rotation * Eigen::Vector3d::UnitZ();
  constexpr double tilted = 18 * std::numbers::pi / 180;
  const double x = std::atan2(z.x(), std::abs(z.z())), y = std::atan2(z.y(), std::abs(z.z()));
  if (std::hypot(x, y) < tilted) return ViewCoverage::straight;
  if (std::abs(x) > std::abs(y)) return x > 0 ? ViewCoverage::right_nearer : ViewCoverage::left_nearer;
  return y > 0 ? ViewCoverage::bottom_nearer : ViewCoverage::top_nearer;
}

constexpr std::array tilt_needs{"hold it straight to the camera", "tilt it, its left edge nearer",
                                "tilt it, its right edge nearer", "tilt it, its top edge nearer",
                                "tilt it, its bottom edge nearer"};

}  // namespace

double ViewCoverage::CameraCoverage::image_share() const {
  return static_cast<double>(std::ranges::count_if(corners, [](int n) { return n > 0; })) /
         static_cast<double>(corners.size());
}

ViewCoverage::ViewCoverage(board::Board board, std::vector<std::string> cameras, std::vector<calib::ImageSize> sizes)
    : board_(std::move(board)), names_(std::move(cameras)), sizes_(std::move(sizes)), cameras_(names_.size()) {}

bool ViewCoverage::is_new(const std::vector<solver::BoardView>& views) const {
  if (views.empty()) return false;
  constexpr double elsewhere = 0.03;  // of the image's width
  return std::ranges::all_of(kept_, [&](const std::vector<solver::BoardView>& other) {
    return std::ranges::any_of(views, [&](const solver::BoardView& view) {
      const auto same = std::ranges::find(other, view.camera, &solver::BoardView::camera);
      if (same == other.end()) return true;
      const auto moved = moved_px(view, *same);
      return !moved || *moved > elsewhere * sizes_[index(view.camera)].width;
    });
  });
}

void ViewCoverage::add(const std::vector<solver::BoardView>& views) {
  kept_.push_back(views);
  for (const solver::BoardView& view : views) {
    const calib::ImageSize size = sizes_[index(view.camera)];
    CameraCoverage& camera = cameras_[index(view.camera)];
    ++camera.views;
    if (view.blur_px > 0) camera.blurs_px.push_back(view.blur_px);
    ++camera.tilts[static_cast<std::size_t>(tilt_of(board_, view, size))];
    for (const Eigen::Vector2d& px : view.px) {
      const int column = std::clamp(static_cast<int>((px.x() + 0.5) / size.width * columns), 0, columns - 1);
      const int row = std::clamp(static_cast<int>((px.y() + 0.5) / size.height * rows), 0, rows - 1);
      ++camera.corners[index(row * columns + column)];
    }
    for (const solver::BoardView& other : views) {
      if (other.camera > view.camera) ++shared_[{view.camera, other.camera}];
    }
  }
}

int ViewCoverage::shared(int a, int b) const {
  const auto known = shared_.find(std::minmax(a, b));
  return known == shared_.end() ? 0 : known->second;
}

std::vector<std::string> ViewCoverage::needs() const {
  std::vector<std::string> needs;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    if (cameras_[c].views == 0) needs.push_back(names_[c] + " has not seen the board yet");
  }
  // A median of fewer than three may be a single view with motion.
  constexpr std::size_t least_blurs = 3;
  double sharpest_px = std::numeric_limits<double>::infinity();
  for (const CameraCoverage& camera : cameras_) {
    if (camera.blurs_px.size() >= least_blurs) sharpest_px = std::min(sharpest_px, calib::median(camera.blurs_px));
  }
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    if (cameras_[c].blurs_px.size() < least_blurs) continue;
    const double blur_px = calib::median(cameras_[c].blurs_px);
    if (board::is_out_of_focus(blur_px, sharpest_px))
      needs.push_back(fmt::format("{} is out of focus (edges blurred by {:.1f} px{}): focus it, and start anew",
                                  names_[c], blur_px,
                                  cameras_.size() > 1 ? fmt::format(", at best {:.1f}", sharpest_px) : ""));
  }
  const auto shared_of = [this](std::size_t a, std::size_t b) {
    return shared(static_cast<int>(a), static_cast<int>(b));
  };
  for (const calib::CameraLink& link : calib::missing_links(cameras_.size(), shared_of, enough_shared))
    needs.push_back(fmt::format("show it to {} and {} together: {} of {} shared views", names_[link.a], names_[link.b],
                                link.shared, enough_shared));
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const CameraCoverage& camera = cameras_[c];
    if (camera.views == 0) continue;
    if (camera.views < enough_views)
      needs.push_back(fmt::format("{}: {} of {} views at different places", names_[c], camera.views, enough_views));
    if (camera.image_share() < enough_image) {
      // The ninth of the image with the fewest corners.
      std::array<int, 9> missing{};
      for (int row = 0; row < rows; ++row) {
        for (int column = 0; column < columns; ++column) {
          if (camera.corners[index(row * columns + column)] == 0)
            ++missing[index(std::min(2, row * 3 / rows) * 3 + column * 3 / columns)];
        }
      }
      constexpr std::array places{"top left", "top",         "top right", "left",        "middle",
                                  "right",    "bottom left", "bottom",    "bottom right"};
      const auto worst = static_cast<std::size_t>(std::ranges::max_element(missing) - missing.begin());
      needs.push_back(fmt::format("{}: show it in the {} of the image ({:.0f} % of it seen)", names_[c], places[worst],
                                  100 * camera.image_share()));
    }
    for (std::size_t t = 0; t < camera.tilts.size(); ++t) {
      if (camera.tilts[t] == 0) {
        needs.push_back(fmt::format("{}: {}", names_[c], tilt_needs[t]));
        break;
      }
    }
  }
  return needs;
}

std::string ViewCoverage::lines() const {
  std::size_t longest = 0;
  for (const std::string& name : names_) longest = std::max(longest, name.size());
  std::string lines;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const CameraCoverage& camera = cameras_[c];
    const auto bar = [](double share) {
      constexpr std::size_t cells = 10;
      const auto full = std::min(cells, static_cast<std::size_t>(share * cells));
      std::string text(1, '[');
      return text.append(full, '#').append(cells - full, '-') + ']';
    };
    const double views = static_cast<double>(camera.views) / enough_views, image = camera.image_share() / enough_image;
    lines += fmt::format("  {:{}}  views {} {:2}/{}  image {} {:3.0f} %  tilts {}/5\n", names_[c], longest, bar(views),
                         camera.views, enough_views, bar(image), 100 * camera.image_share(), camera.tilts_seen());
  }
  const std::string lacking = lacking_pairs();
  return lines + (cameras_.size() < 2 ? ""
                  : lacking.empty()   ? "  every pair has enough shared views"
                                      : "  shared views: " + lacking);
}

std::string ViewCoverage::lacking_pairs() const {
  std::vector<std::string> pairs;
  for (std::size_t a = 0; a < cameras_.size(); ++a) {
    for (std::size_t b = a + 1; b < cameras_.size(); ++b) {
      const int n = shared(static_cast<int>(a), static_cast<int>(b));
      if (n < enough_shared) pairs.push_back(fmt::format("{} + {} {}/{}", names_[a], names_[b], n, enough_shared));
    }
  }
  return fmt::to_string(fmt::join(pairs, ", "));
}

}  // namespace huetrack::gather
