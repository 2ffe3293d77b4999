#include "clients/plot/plot.h"

#include <cairo/cairo-svg.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "clients/plot/track_chart.h"

namespace huetrack::plot {
namespace {

struct CairoEnd {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
};
using Surface = std::unique_ptr<cairo_surface_t, CairoEnd>;

cairo_status_t append(void* closure, const unsigned char* data, unsigned length) {
  static_cast<std::string*>(closure)->append(data, data + length);
  return CAIRO_STATUS_SUCCESS;
}

std::string svg_of(const std::string& title, const std::vector<ChartTarget>& targets) {
  std::string svg;
  {
    const Surface surface(cairo_svg_surface_create_for_stream(&append, &svg, chart_width, chart_height(targets)));
    const std::unique_ptr<cairo_t, CairoEnd> cairo(cairo_create(surface.get()));
    draw_chart(cairo.get(), title, targets);
    cairo_surface_finish(surface.get());
  }
  return svg;
}

std::string png_of(const std::string& title, const std::vector<ChartTarget>& targets) {
  const Surface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, chart_width, chart_height(targets)));
  const std::unique_ptr<cairo_t, CairoEnd> cairo(cairo_create(surface.get()));
  draw_chart(cairo.get(), title, targets);
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

std::string html_of(const std::string& title, const std::vector<ChartTarget>& targets) {
  std::string rows;
  for (const ChartTarget& target : targets) rows += "<li>" + escaped(to_text(figures_of(target))) + "</li>\n";
  std::string svg = svg_of(title, targets);
  svg.erase(0, svg.find("<svg"));
  svg.insert(4, " role=\"img\" aria-label=\"" + escaped(title) +
                    ": plan, side view, coordinates, uncertainty and states over time\"");
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
         "content=\"width=device-width\">"
         "<title>" +
         escaped(title) +
         "</title>\n<style>body{font:15px/1.5 system-ui,sans-serif;margin:16px;color:#16191d;background:#fff}"
         "svg{width:100%;height:auto;max-width:1500px}</style></head>\n<body><h1>" +
         escaped(title) + "</h1>\n<ul>\n" + rows + "</ul>\n" + svg + "</body></html>\n";
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
    if (it == truths.end() && truths.size() == 1 && tracks.size() == 1)
      it = truths.begin();  // one of each: they belong together
    if (it == truths.end()) continue;
    target.truth = it->second;
    for (TruthPoint& point : target.truth) point.t += options.clock_offset_s;
  }
  if (!truths.empty() && std::ranges::all_of(targets, [](const auto& t) { return t.truth.empty(); }))
    throw std::runtime_error(options.truth.string() + ": has none of the targets of " + options.tracks.string());
  const std::string title = options.tracks.filename().string();
  const std::string content = kind == ".png"   ? png_of(title, targets)
                              : kind == ".svg" ? svg_of(title, targets)
                                               : html_of(title, targets);
  std::ofstream stream(options.out, std::ios::binary);
  stream.write(content.data(), static_cast<std::streamsize>(content.size()));
  stream.close();
  if (!stream) throw std::runtime_error("cannot write " + options.out.string());
  for (const ChartTarget& target : targets) std::printf("%s\n", to_text(figures_of(target)).c_str());
}

}  // namespace huetrack::plot
