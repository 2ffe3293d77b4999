// A report as a list of parts, written as self-contained HTML, as PDF (A4) and as text.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "calib/report/calibration_report.h"
#include "drawing/canvas.h"

namespace huetrack::report {

struct Heading {
  std::string text;
};
struct Paragraph {
  std::string text;
};
struct Banner {  // the verdict
  Verdict verdict = Verdict::usable;
  std::string word;  // "PASS"
  std::string text;
};
struct Table {
  std::vector<std::string> head;  // the first column is left-aligned, others right-aligned
  std::vector<std::vector<std::string>> rows;
};
struct Figure {
  int width = 0, height = 0;  // pixels, or points on paper; scaled down to the page
  std::function<void(drawing::Canvas&)> draw;
  std::string caption;
};
using Part = std::variant<Heading, Paragraph, Banner, Table, Figure>;

struct Document {
  std::string title, subtitle;
  std::vector<Part> parts;

  void heading(std::string text) { parts.emplace_back(Heading{std::move(text)}); }
  void paragraph(std::string text) { parts.emplace_back(Paragraph{std::move(text)}); }
  void banner(Verdict verdict, std::string word, std::string text);
  void table(Table table) { parts.emplace_back(std::move(table)); }
  void figure(Figure figure) { parts.emplace_back(std::move(figure)); }
};

std::string to_html(const Document& document);
std::string to_pdf(const Document& document);   // deterministic
std::string to_text(const Document& document);  // without figures

}  // namespace huetrack::report
