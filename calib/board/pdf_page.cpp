#include "calib/board/pdf_page.h"

#include <fmt/core.h>

#include <string_view>
#include <vector>

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

}  // namespace

PdfPage::PdfPage(double width_mm, double height_mm) : width_mm_(width_mm), height_mm_(height_mm) {
  // Millimetres, y down, as in the board frame.
  content_ = fmt::format("{:.8f} 0 0 {:.8f} 0 {:.6f} cm\n", points_per_mm, -points_per_mm, height_mm * points_per_mm);
}

void PdfPage::rectangle(double x, double y, double width, double height, double grey) {
  content_ += fmt::format("{:.3f} g {:.4f} {:.4f} {:.4f} {:.4f} re f\n", grey, x, y, width, height);
}

void PdfPage::disc(double x, double y, double radius, double grey) {
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

void PdfPage::text(double x, double y, double size_mm, const std::string& line, bool turned) {
  content_ += turned ? fmt::format("0 g BT /F1 {:.3f} Tf 0 -1 -1 0 {:.3f} {:.3f} Tm ", size_mm, x, y)
                     : fmt::format("0 g BT /F1 {:.3f} Tf 1 0 0 -1 {:.3f} {:.3f} Tm ", size_mm, x, y);
  content_ += in_brackets(line) + " Tj ET\n";
}

std::string PdfPage::pdf(const std::string& title) const {
  const std::vector<std::string> objects{
      "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",  // printers must not scale it
                                                                                         // to the page
      "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
      fmt::format(
          "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.6f} {:.6f}] /Contents 4 0 R /Resources << /Font << /F1 5 0 R "
          ">> >> >>",
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

}  // namespace huetrack::board
