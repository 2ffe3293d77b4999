#include "calib/board/board_pdf.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/aruco.hpp>

#include "calib/files/nearest_word.h"
#include "calib/files/number_text.h"

namespace huetrack::board {
namespace {

constexpr double points_per_mm = 72 / 25.4;

std::string in_brackets(std::string_view text) {
  std::string out = "(";
  for (const char c : text) {
    if (c < 0x20 || c > 0x7E) continue;
    if (c == '(' || c == ')' || c == '\\') out += '\\';
    out += c;
  }
  return out + ")";
}

// One page of PDF 1.4 with filled rectangles, discs and lines of text: exact to the micrometre. Millimetres from the
// page's top left corner, x right, y down. grey: 0 black, 1 white.
class PdfPage {
 public:
  PdfPage(double width_mm, double height_mm) : width_mm_(width_mm), height_mm_(height_mm) {
    // Millimetres, y down, as in the board frame.
    content_ = fmt::format("{:.8f} 0 0 {:.8f} 0 {:.6f} cm\n", points_per_mm, -points_per_mm, height_mm * points_per_mm);
  }

  void rectangle(double x, double y, double width, double height, double grey) {
    content_ += fmt::format("{:.3f} g {:.4f} {:.4f} {:.4f} {:.4f} re f\n", grey, x, y, width, height);
  }

  // x, y: its centre
  void disc(double x, double y, double radius, double grey) {
    const double r = radius, k = 0.551915 * radius;  // of four Bezier curves, which are a circle to 2e-4 of its radius
    content_ += fmt::format("{:.3f} g {:.4f} {:.4f} m", grey, x + r, y);
    const auto curve = [&](double x1, double y1, double x2, double y2, double x3, double y3) {
      content_ +=
          fmt::format(" {:.4f} {:.4f} {:.4f} {:.4f} {:.4f} {:.4f} c", x + x1, y + y1, x + x2, y + y2, x + x3, y + y3);
    };
    curve(r, k, k, r, 0, r);
    curve(-k, r, -r, k, -r, 0);
    curve(-r, -k, -k, -r, 0, -r);
    curve(k, -r, r, -k, r, 0);
    content_ += " f\n";
  }

  // Helvetica, baseline at y; only printable ASCII is kept. turned: reads upwards.
  void text(double x, double y, double size_mm, const std::string& line, bool turned = false) {
    content_ += turned ? fmt::format("0 g BT /F1 {:.3f} Tf 0 -1 -1 0 {:.3f} {:.3f} Tm ", size_mm, x, y)
                       : fmt::format("0 g BT /F1 {:.3f} Tf 1 0 0 -1 {:.3f} {:.3f} Tm ", size_mm, x, y);
    content_ += in_brackets(line) + " Tj ET\n";
  }

  // The file, deterministic.
  std::string pdf(const std::string& title) const {
    const std::vector<std::string> objects{
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",  // printers must not scale it
                                                                                           // to the page
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.6f} {:.6f}] /Contents 4 0 R /Resources << /Font << "
                    "/F1 5 0 R >> >> >>",
                    width_mm_ * points_per_mm, height_mm_ * points_per_mm),
        "<< /Length " + std::to_string(content_.size()) + " >>\nstream\n" + content_ + "endstream",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
        "<< /Title " + in_brackets(title) + " /Producer (huetrack-calibrate) >>"};
    std::string out = "%PDF-1.4\n";
    std::string table = "xref\n0 " + std::to_string(objects.size() + 1) + "\n0000000000 65535 f \n";
    for (std::size_t i = 0; i < objects.size(); ++i) {
      table += fmt::format("{:010} 00000 n \n", out.size());
      out += std::to_string(i + 1) + " 0 obj\n" + objects[i] + "\nendobj\n";
    }
    const std::size_t start = out.size();
    return out + table + "trailer\n<< /Size " + std::to_string(objects.size() + 1) +
           " /Root 1 0 R /Info 6 0 R >>\nstartxref\n" + std::to_string(start) + "\n%%EOF\n";
  }

 private:
  double width_mm_, height_mm_;
  std::string content_;
};

constexpr double edge_mm = 5;  // layout: margin that printers cannot print
constexpr double ruler_mm = 100;
constexpr double foot_mm = 17;  // layout: for the text and the ruler

const std::array<Paper, 8> papers{{{"A4", 210, 297},
                                   {"A3", 297, 420},
                                   {"A2", 420, 594},
                                   {"A1", 594, 841},
                                   {"A0", 841, 1189},
                                   {"letter", 215.9, 279.4},
                                   {"legal", 215.9, 355.6},
                                   {"tabloid", 279.4, 431.8}}};

// Black squares: 1, with the border.
cv::Mat marker_bits(const Board& board, int index) {
  const auto& known = marker_dictionaries();
  const auto dictionary = std::ranges::find(known, board.dictionary, &MarkerDictionary::name);
  const cv::Ptr<cv::aruco::Dictionary> d = cv::aruco::getPredefinedDictionary(dictionary->opencv_id);
  const int side = d->markerSize + 2 * board.border_bits;
  cv::Mat image;
  d->drawMarker(board.first_marker + index, side, image, board.border_bits);
  return image == 0;
}

// The black areas, in millimetres from the board's outer top left corner.
struct Shapes {
  std::vector<std::array<double, 4>> black;    // left, top, width, height
  std::vector<std::array<double, 3>> circles;  // centre, radius
  Eigen::Vector2d size;
  Eigen::Vector2d origin;  // of the board's own frame
};

void add_marker(const Board& board, int index, double x, double y, double side, Shapes& shapes) {
  const cv::Mat bits = marker_bits(board, index);
  const double cell = side / bits.cols;
  for (int row = 0; row < bits.rows; ++row) {
    for (int column = 0; column < bits.cols;) {
      const bool black = bits.at<std::uint8_t>(row, column) != 0;
      int end = column;
      while (end < bits.cols && (bits.at<std::uint8_t>(row, end) != 0) == black) ++end;
      if (black) shapes.black.push_back({x + column * cell, y + row * cell, (end - column) * cell, cell});
      column = end;
    }
  }
}

Shapes shapes_of(const Board& board) {
  Shapes shapes;
  const double px = 1e3 * board.pitch.x(), py = 1e3 * board.pitch.y(), marker = 1e3 * board.marker;
  if (board.type == BoardType::aruco_grid) {
    shapes.size = {px * (board.columns - 1) + marker, py * (board.rows - 1) + marker};
    shapes.origin = {0, board.from_bottom ? shapes.size.y() : 0};
    for (int i = 0; i < board.columns * board.rows; ++i) {
      const Eigen::Vector2d corner = 1e3 * board.marker_corners(i)[0].head<2>() + shapes.origin;
      add_marker(board, i, corner.x(), corner.y(), marker, shapes);
    }
    return shapes;
  }
  if (board.has_circles()) {
    const double radius = 1e3 * board.diameter / 2;
    shapes.origin.setConstant(radius);
    shapes.size.setZero();
    for (int id = 0; id < board.point_count(); ++id) {
      const Eigen::Vector2d centre = 1e3 * board.point(id).head<2>() + shapes.origin;
      shapes.circles.push_back({centre.x(), centre.y(), radius});
      shapes.size = shapes.size.cwiseMax(centre + shapes.origin);
    }
    return shapes;
  }
  const bool charuco = board.type == BoardType::charuco;
  const int columns = charuco ? board.columns : board.columns + 1, rows = charuco ? board.rows : board.rows + 1;
  shapes.size = {px * columns, py * rows};
  shapes.origin = {px, py};
  int next = 0;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double x = px * column, y = py * row;
      const bool white = charuco ? board.is_marker_square(column, row) : (column + row) % 2 == 1;
      if (!white)
        shapes.black.push_back({x, y, px, py});
      else if (charuco)
        add_marker(board, next++, x + (px - marker) / 2, y + (py - marker) / 2, marker, shapes);
    }
  }
  return shapes;
}

}  // namespace

std::optional<Paper> paper_of(std::string_view text) {
  for (const Paper& paper : papers) {
    if (files::to_lower_ascii(paper.name) == files::to_lower_ascii(text)) return paper;
  }
  const auto x = text.find('x');
  if (x == std::string_view::npos) return std::nullopt;
  Paper paper{std::string(text) + " mm", 0, 0};
  const auto number = [](std::string_view part, double& value) {
    value = files::number_of<double>(part).value_or(0);
    return value >= 20 && value <= 5000;
  };
  if (!number(text.substr(0, x), paper.width_mm) || !number(text.substr(x + 1), paper.height_mm)) return std::nullopt;
  return paper;
}

BoardPdf board_pdf(const Board& board, const Paper& given) {
  for (const auto& problem : board.problems()) throw std::invalid_argument(problem);
  if (board.has_circles() && !(board.diameter > 0)) throw std::invalid_argument("a print needs the circles' diameter");
  const Shapes shapes = shapes_of(board);
  const double square = 1e3 * std::min(board.pitch.x(), board.pitch.y());
  const double margin = std::max(2.0, square / 4);
  const Eigen::Vector2d needed =
      shapes.size + Eigen::Vector2d(2 * (margin + edge_mm), 2 * edge_mm + 2 * margin + foot_mm);
  const auto fits = [&](double width, double height) { return needed.x() <= width && needed.y() <= height; };
  Paper paper = given;
  if (!fits(paper.width_mm, paper.height_mm)) std::swap(paper.width_mm, paper.height_mm);
  if (!fits(paper.width_mm, paper.height_mm)) {
    // The unprinted border hardly grows with the board.
    const auto scale = [&](double width, double height) {
      return std::min((width - 2 * edge_mm) / (shapes.size.x() + 2 * margin),
                      (height - 2 * edge_mm - foot_mm) / (shapes.size.y() + 2 * margin));
    };
    const double largest =
        std::max(scale(given.width_mm, given.height_mm), scale(given.height_mm, given.width_mm)) * square;
    std::string larger;
    for (const Paper& other : papers) {
      if (other.name[0] == 'A' && (fits(other.width_mm, other.height_mm) || fits(other.height_mm, other.width_mm))) {
        larger = other.name;
        break;
      }
    }
    const double step = largest >= 5 ? 1 : 0.1;
    throw DoesNotFit(
        fmt::format(
            "{} does not fit on {}: with its margin, the ruler and the printer's edge it needs {:.0f} x {:.0f} mm.",
            board.description(), given.name, needed.x(), needed.y()) +
        (larger.empty() ? std::string() : " It fits on " + larger + ".") +
        (largest >= 1 ? fmt::format(" On {} the {} can be {:g} mm.", given.name,
                                    board.type == BoardType::aruco_grid ? "marker and gap together"
                                    : board.has_circles()               ? "distance of the rows"
                                                                        : "squares",
                                    std::floor(largest / step) * step)
                      : std::string()));
  }

  BoardPdf out;
  out.paper = paper;
  out.size_mm = shapes.size;
  const double left = (paper.width_mm - shapes.size.x()) / 2;
  const double top = edge_mm + margin + (paper.height_mm - needed.y()) / 2;
  out.origin_mm = Eigen::Vector2d(left, top) + shapes.origin;

  PdfPage page(paper.width_mm, paper.height_mm);
  if (board.inverted) {
    page.rectangle(left - margin, top - margin, shapes.size.x() + 2 * margin, shapes.size.y() + 2 * margin, 0);
  }
  for (const auto& [x, y, width, height] : shapes.black)
    page.rectangle(left + x, top + y, width, height, board.inverted ? 1 : 0);
  for (const auto& [x, y, radius] : shapes.circles) page.disc(left + x, top + y, radius, board.inverted ? 1 : 0);

  // The ruler: 100 mm, or as many tens as fit.
  const double foot = top + shapes.size.y() + margin;
  const double length = std::min(ruler_mm, std::floor((paper.width_mm - 2 * edge_mm - 20) / 10) * 10);
  const double x0 = edge_mm + 8, y0 = foot + 7;
  for (int mm = 0; mm <= static_cast<int>(length); ++mm) {
    const double height = mm % 10 == 0 ? 4 : mm % 5 == 0 ? 3 : 2;
    page.rectangle(x0 + mm - 0.05, y0 - height, 0.1, height, 0);
  }
  page.rectangle(x0 - 0.05, y0, length + 0.1, 0.1, 0);
  page.text(x0 - 0.7, y0 + 3, 2.6, "0");
  page.text(x0 + length - 2.5, y0 + 3, 2.6, fmt::format("{:.0f} mm", length));
  page.text(x0 + length + 6, y0 - 3.2, 2.6, fmt::format("The ruler must be {:.0f} mm.", length));
  page.text(x0 + length + 6, y0 - 0.2, 2.6, "Print at 100 %, not fitted to the page.");
  page.text(x0, y0 + 7.2, 3, "huetrack: " + board.description() + fmt::format(", on {}", given.name));
  out.pdf = page.pdf("huetrack: " + board.description());
  return out;
}

}  // namespace huetrack::board
