#include "clients/plot/plot.h"

#include <cairo/cairo-svg.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <limits>
#include <memory>
#include <stdexcept>

#include "clients/plot/track_chart.h"

namespace huetrack::plot {
namespace {

struct CairoEnd {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
};
constexpr double since_1973 = 1e8;  // s

using Surface = std::unique_ptr<cairo_surface_t, CairoEnd>;

cairo_status_t append(void* closure, const unsigned char* data, unsigned length) {
  static_cast<std::string*>(closure)->append(data, data + length);
  return CAIRO_STATUS_SUCCESS;
}

std::string svg_of(const std::vector<ChartTarget>& targets, const ChartStyle& style) {
  std::string svg;
  {
    const Surface surface(
        cairo_svg_surface_create_for_stream(&append, &svg, style.width, chart_height(targets, style)));
    const std::unique_ptr<cairo_t, CairoEnd> cairo(cairo_create(surface.get()));
    draw_chart(cairo.get(), targets, style);
    cairo_surface_finish(surface.get());
  }
  return svg;
}

std::string png_of(const std::vector<ChartTarget>& targets, const ChartStyle& style) {
  const Surface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, style.width, chart_height(targets, style)));
  const std::unique_ptr<cairo_t, CairoEnd> cairo(cairo_create(surface.get()));
  draw_chart(cairo.get(), targets, style);
  std::string png;
  if (cairo_surface_write_to_png_stream(surface.get(), &append, &png) != CAIRO_STATUS_SUCCESS)
    throw std::runtime_error("the picture cannot be made");
  return png;
}

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

// Two drawings, of which the window's width chooses one: on a phone the wide one could not be read.
std::string html_of(const std::vector<ChartTarget>& targets, const ChartStyle& style) {
  std::string rows;
  for (const ChartTarget& target : targets) rows += "<li>" + escaped(to_text(figures_of(target))) + "</li>\n";
  std::string drawings;
  for (const bool is_wide : {true, false}) {
    std::string svg = svg_of(targets, {.width = is_wide ? 1500 : 460, .title = "", .time_title = style.time_title});
    svg.erase(0, svg.find("<svg"));
    svg.insert(4, std::string(" class=\"") + (is_wide ? "wide" : "narrow") + "\" role=\"img\" aria-label=\"" +
                      escaped(style.title) + ": plan, side view, coordinates, uncertainty and states over time\"");
    // Cairo numbers its glyphs and clips the same way in every drawing.
    const std::string mark = is_wide ? "w-" : "n-";
    for (const std::string where : {"id=\"", "href=\"#", "url(#"})
      for (auto at = svg.find(where); at != std::string::npos; at = svg.find(where, at + where.size()))
        svg.insert(at + where.size(), mark);
    drawings += svg;
  }
  // Dark: the drawing turned over, hues kept.
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
         "content=\"width=device-width\"><meta name=\"color-scheme\" content=\"light dark\">"
         "<title>" +
         escaped(style.title) +
         "</title>\n<style>body{font:15px/1.5 system-ui,sans-serif;margin:16px;color:#16191d;background:#fff}"
         "h1{font-size:20px}ul{padding-left:20px}svg{width:100%;height:auto;max-width:1500px}svg.narrow{display:none}"
         "@media(max-width:800px){svg.wide{display:none}svg.narrow{display:block}}"
         "@media(prefers-color-scheme:dark){body{color:#e8ebef;background:#141414}"
         "svg{filter:invert(.92) hue-rotate(180deg)}}</style></head>\n<body><h1>" +
         escaped(style.title) + "</h1>\n<ul>\n" + rows + "</ul>\n" + drawings + "</body></html>\n";
}

std::string utc(double unix_s) {
  const auto whole = static_cast<std::time_t>(std::floor(unix_s));
  std::tm parts{};
  ::gmtime_r(&whole, &parts);
  char day[32], text[48];
  std::strftime(day, sizeof day, "%Y-%m-%d %H:%M:%S", &parts);
  std::snprintf(text, sizeof text, "%s.%03d UTC", day, static_cast<int>(1000 * (unix_s - std::floor(unix_s))));
  return text;
}

std::string span_of(const std::vector<ChartTarget>& targets, bool of_truth) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const ChartTarget& target : targets) {
    for (const TrackRow& row : target.rows)
      if (!of_truth) low = std::min(low, row.t), high = std::max(high, row.t);
    for (const TruthPoint& point : target.truth)
      if (of_truth) low = std::min(low, point.t), high = std::max(high, point.t);
  }
  char text[80];
  std::snprintf(text, sizeof text, "%.3f to %.3f s", low, high);
  return text;
}

}  // namespace

void plot(const PlotOptions& options) {
  const std::string kind = options.out.extension().string();
  if (kind != ".png" && kind != ".svg" && kind != ".html")
    throw std::runtime_error(options.out.string() + ": the name must end with .png, .svg or .html");
  auto tracks = read_tracks(options.tracks);
  std::map<std::string, std::vector<TruthPoint>> truths;
  if (!options.truth.empty()) truths = read_truth(options.truth);
  std::vector<ChartTarget> targets;
  for (auto& [name, rows] : tracks) {
    ChartTarget& target = targets.emplace_back(ChartTarget{name, std::move(rows), {}});
    auto it = truths.find(name);
    if (it == truths.end() && truths.size() == 1 && tracks.size() == 1) {
      it = truths.begin();  // one of each: they belong together
      if (!it->first.empty())
        std::fprintf(stderr, "huetrack: the truth is of a ball named %s, the only one, and is compared with %s\n",
                     it->first.c_str(), name.c_str());
    }
    if (it == truths.end()) {
      if (!truths.empty())
        std::fprintf(stderr, "huetrack: the truth has no ball named %s, which is not compared\n", name.c_str());
      continue;
    }
    target.truth = it->second;
    for (TruthPoint& point : target.truth) point.t += options.clock_offset_s;
  }
  if (!truths.empty() && std::ranges::all_of(targets, [](const auto& t) { return t.truth.empty(); }))
    throw std::runtime_error(options.truth.string() + ": has none of the targets of " + options.tracks.string());
  if (!truths.empty() && std::ranges::all_of(targets, [](const auto& t) { return figures_of(t).in_truth == 0; }))
    throw std::runtime_error("nothing can be compared: the tracks are at " + span_of(targets, false) +
                             ", the truth at " + span_of(targets, true) +
                             (options.clock_offset_s != 0 ? " with this --clock-offset" : "") +
                             "; --clock-offset says how many seconds the tracks' clock is ahead of the truth's");
  ChartStyle style{.title = options.tracks.filename().string()};
  double first = std::numeric_limits<double>::infinity();
  for (const ChartTarget& target : targets) first = std::min(first, target.rows.front().t);
  if (first > since_1973) {  // no recording's clock: UNIX time, of which nobody reads ten digits off an axis
    style.title += ", from " + utc(first);
    style.time_title = "capture time, s from the start";
    for (ChartTarget& target : targets) {
      for (TrackRow& row : target.rows) row.t -= first;
      for (TruthPoint& point : target.truth) point.t -= first;
    }
  }
  const std::string content = kind == ".png"   ? png_of(targets, style)
                              : kind == ".svg" ? svg_of(targets, style)
                                               : html_of(targets, style);
  std::ofstream stream(options.out, std::ios::binary);
  stream.write(content.data(), static_cast<std::streamsize>(content.size()));
  stream.close();
  if (!stream) throw std::runtime_error("cannot write " + options.out.string());
  for (const ChartTarget& target : targets) {
    const TargetFigures figures = figures_of(target);
    std::printf("%s\n", to_text(figures).c_str());
    if (figures.compared > 0 && !figures.is_ever_near)
      std::fprintf(
          stderr,
          "huetrack: %s is never within 50 mm of the truth while tracking: is it another ball's, or on another "
          "clock (--clock-offset)?\n",
          target.name.c_str());
  }
}

}  // namespace huetrack::plot
