#include "calib/report/document.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/report/html.h"
#include "drawing/axes.h"

namespace huetrack::report {
namespace {

using drawing::Canvas;
using drawing::Color;

constexpr Color good{26, 127, 75}, doubt{168, 100, 0}, bad{179, 38, 30};

Color color_of(Verdict verdict) {
  return verdict == Verdict::usable ? good : verdict == Verdict::doubtful ? doubt : bad;
}

// ---- HTML

void replace_all(std::string& text, std::string_view what, const std::string& by) {
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
}

// Makes ids unique per figure number: Cairo uses the same ids of glyphs and masks in every SVG, and a browser resolves
// them to the first of the page.
std::string svg_of(const Figure& figure, std::size_t number) {
  Canvas canvas(figure.width, figure.height, drawing::white, Canvas::Kind::svg);
  figure.draw(canvas);
  std::string svg = canvas.svg();
  svg.erase(0, svg.find("<svg"));  // without the declaration of a file
  for (const std::string before : {" id=\"", "href=\"#", "url(#"})
    replace_all(svg, before, fmt::format("{}figure{}-", before, number));
  return svg;
}

std::string html_of(const Table& table) {
  std::string out = "<table><tr>";
  for (std::size_t c = 0; c < table.head.size(); ++c)
    out += (c == 0 ? "<th>" : "<th class=n>") + escaped(table.head[c]) + "</th>";
  out += "</tr>";
  for (const auto& row : table.rows) {
    out += "<tr>";
    for (std::size_t c = 0; c < row.size(); ++c) out += (c == 0 ? "<td>" : "<td class=n>") + escaped(row[c]) + "</td>";
    out += "</tr>";
  }
  return out + "</table>\n";
}

struct Html {
  std::size_t figures = 0;
  std::string operator()(const Heading& h) const { return "<h2>" + escaped(h.text) + "</h2>\n"; }
  std::string operator()(const Paragraph& p) const { return "<p>" + escaped(p.text) + "</p>\n"; }
  std::string operator()(const Banner& b) const {
    return fmt::format("<div class='verdict {}'><b>{}.</b> {}</div>\n", name(b.verdict), escaped(b.word),
                       escaped(b.text));
  }
  std::string operator()(const Table& t) const { return html_of(t); }
  std::string operator()(const Figure& f) {
    return "<figure class=drawn>" + svg_of(f, ++figures) + "<figcaption>" + escaped(f.caption) +
           "</figcaption></figure>\n";
  }
};

// ---- PDF

// Points; A4 upright.
constexpr int page_width = 595, page_height = 842;
constexpr double margin = 48, text_size = 9.5, line_step = 13.5, usable_width = page_width - 2 * margin;

class Paper {
 public:
  explicit Paper(Canvas& canvas) : canvas_(canvas) {}

  // Content of this height stays on one page.
  void need(double height) {
    if (y_ + height <= page_height - margin || y_ == margin) return;
    canvas_.next_page();
    y_ = margin;
  }
  void need_heading_and(const Figure& f) { need(40 + height_of(f)); }
  void lines(const std::string& text, double size, Color color, drawing::Weight weight, double indent = 0) {
    const double step = line_step * size / text_size;
    std::string line;
    const auto put = [&] {
      need(step);
      canvas_.text({margin + indent, y_ + size}, line, size, color, drawing::Align::left, weight);
      y_ += step;
      line.clear();
    };
    for (std::size_t from = 0; from < text.size();) {
      const std::size_t to = std::min(text.find(' ', from), text.size());
      const std::string word = text.substr(from, to - from), longer = line.empty() ? word : line + " " + word;
      if (!line.empty() && canvas_.text_width(longer, size, weight) > usable_width - indent) {
        put();
        line = word;
      } else {
        line = longer;
      }
      from = to + 1;
    }
    if (!line.empty()) put();
  }

  void operator()(const Heading& h) {
    y_ += 10;
    need(60);  // no heading at the end of a page
    lines(h.text, 13, drawing::ink, drawing::Weight::bold);
    y_ += 2;
  }
  void operator()(const Paragraph& p) {
    lines(p.text, text_size, drawing::ink, drawing::Weight::normal);
    y_ += 4;
  }
  void operator()(const Banner& b) {
    need(50);
    const double top = y_;
    y_ += 4;
    lines(b.word, 15, color_of(b.verdict), drawing::Weight::bold, 12);
    lines(b.text, text_size, drawing::ink, drawing::Weight::normal, 12);
    canvas_.rectangle({margin, top, 4, y_ - top}, color_of(b.verdict));
    y_ += 8;
  }
  void operator()(const Table& t) {
    std::vector<double> widths(t.head.size(), 0);
    const auto widen = [&](const std::vector<std::string>& row) {
      for (std::size_t c = 0; c < std::min(row.size(), widths.size()); ++c)
        widths[c] = std::max(widths[c], canvas_.text_width(row[c], text_size, drawing::Weight::bold) + 12);
    };
    widen(t.head);
    for (const auto& row : t.rows) widen(row);
    const auto put = [&](const std::vector<std::string>& row, Color color, drawing::Weight weight) {
      need(line_step);
      double x = margin;
      for (std::size_t c = 0; c < std::min(row.size(), widths.size()); ++c) {
        x += widths[c];
        const bool is_first = c == 0;
        canvas_.text({is_first ? margin : x - 6, y_ + text_size}, row[c], text_size, color,
                     is_first ? drawing::Align::left : drawing::Align::right, weight);
      }
      canvas_.line({margin, y_ + line_step - 0.5}, {x, y_ + line_step - 0.5}, drawing::grid, 0.5);
      y_ += line_step;
    };
    put(t.head, drawing::muted, drawing::Weight::bold);
    for (const auto& row : t.rows) put(row, drawing::ink, drawing::Weight::normal);
    y_ += 6;
  }
  void operator()(const Figure& f) {
    const double scale = scale_of(f);
    need(height_of(f));
    {
      const Canvas::Placed placed(canvas_, {margin, y_}, scale);
      f.draw(canvas_);
    }
    y_ += scale * f.height + 4;
    lines(f.caption, 8, drawing::muted, drawing::Weight::normal);
    y_ += 6;
  }

 private:
  static double scale_of(const Figure& f) { return std::min(1.0, usable_width / f.width); }
  static double height_of(const Figure& f) { return scale_of(f) * f.height + 2 * line_step; }  // with its caption

  Canvas& canvas_;
  double y_ = margin;
};

// ---- Text

struct Text {
  std::string operator()(const Heading& h) const { return "\n" + h.text + "\n"; }
  std::string operator()(const Paragraph& p) const { return "  " + p.text + "\n"; }
  std::string operator()(const Banner& b) const { return b.word + ": " + b.text + "\n"; }
  std::string operator()(const Table& t) const {
    std::vector<std::size_t> widths;
    for (const auto& cell : t.head) widths.push_back(cell.size());
    for (const auto& row : t.rows) {
      for (std::size_t c = 0; c < std::min(row.size(), widths.size()); ++c)
        widths[c] = std::max(widths[c], row[c].size());
    }
    const auto line = [&](const std::vector<std::string>& row) {
      std::string out = " ";
      for (std::size_t c = 0; c < std::min(row.size(), widths.size()); ++c)
        out += c == 0 ? fmt::format(" {:<{}}", row[c], widths[c]) : fmt::format("  {:>{}}", row[c], widths[c]);
      return out + "\n";
    };
    std::string out = line(t.head);
    for (const auto& row : t.rows) out += line(row);
    return out;
  }
  std::string operator()(const Figure& /*f*/) const { return {}; }
};

}  // namespace

void Document::banner(Verdict verdict, std::string word, std::string text) {
  parts.emplace_back(Banner{verdict, std::move(word), std::move(text)});
}
std::string to_html(const Document& document) {
  std::string out = html_head(document.title) + "<h1>" + escaped(document.title) + "</h1><p class=soft>" +
                    escaped(document.subtitle) + "</p>\n";
  Html html;
  for (const Part& part : document.parts) out += std::visit(html, part);
  return out + "</body></html>\n";
}

std::string to_pdf(const Document& document) {
  Canvas canvas(page_width, page_height, drawing::white, Canvas::Kind::pdf);
  Paper paper(canvas);
  paper.lines(document.title, 18, drawing::ink, drawing::Weight::bold);
  paper.lines(document.subtitle, text_size, drawing::muted, drawing::Weight::normal);
  for (std::size_t k = 0; k < document.parts.size(); ++k) {
    const auto* next = k + 1 < document.parts.size() ? std::get_if<Figure>(&document.parts[k + 1]) : nullptr;
    if (next != nullptr && std::holds_alternative<Heading>(document.parts[k])) paper.need_heading_and(*next);
    std::visit(paper, document.parts[k]);
  }
  return canvas.pdf();
}

std::string to_text(const Document& document) {
  std::string out = document.title + "\n" + document.subtitle + "\n";
  for (const Part& part : document.parts) out += std::visit(Text{}, part);
  return out;
}

}  // namespace huetrack::report
