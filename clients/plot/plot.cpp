#include "clients/plot/plot.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <ranges>
#include <stdexcept>
#include <string_view>

#include "calib/files/output_file.h"
#include "clients/plot/track_chart.h"
#include "drawing/markup.h"

namespace huetrack::plot {
namespace {

using drawing::Canvas;
using drawing::escaped;

constexpr truth::Timestamp year_1973{std::chrono::seconds(100'000'000)};

// A wide drawing and a narrow one for phones, selected by the window's width.
std::string html_of(const std::vector<ChartTarget>& targets, const ChartStyle& style) {
  std::string rows;
  for (const ChartTarget& target : targets) rows += "<li>" + escaped(to_text(figures_of(target))) + "</li>\n";
  std::string drawings;
  for (const bool is_wide : {true, false}) {
    ChartStyle bare = style;
    bare.width = is_wide ? 1500 : 460;
    bare.title.clear();
    std::string svg = draw_chart(targets, bare, Canvas::Kind::svg).svg();
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
         "content=\"width=device-width\"><meta name=\"color-scheme\" content=\"light dark\"><title>" +
         escaped(style.title) +
         "</title>\n<style>body{font:15px/1.5 "
         "system-ui,sans-serif;margin:16px;color:#16191d;background:#fff}h1{font-size:20px}ul{padding-left:20px}svg{"
         "width:100%;height:auto;max-width:1500px}svg.narrow{display:none}@media(max-width:800px){svg.wide{display:"
         "none}svg.narrow{display:block}}@media(prefers-color-scheme:dark){body{color:#e8ebef;background:#141414}svg{"
         "filter:invert(.92) hue-rotate(180deg)}}</style></head>\n<body><h1>" +
         escaped(style.title) + "</h1>\n<ul>\n" + rows + "</ul>\n" + drawings + "</body></html>\n";
}

std::string utc(truth::Timestamp at) {
  const auto ms = std::chrono::floor<std::chrono::milliseconds>(at.time_since_epoch());
  return fmt::format("{:%Y-%m-%d %H:%M:%S}.{:03d} UTC",
                     fmt::gmtime(std::chrono::system_clock::to_time_t(std::chrono::floor<std::chrono::seconds>(at))),
                     ms.count() % 1000);
}

[[noreturn]] void fail_without_comparison(const std::vector<ChartTarget>& targets, const truth::Truth& truth,
                                          bool is_shifted) {
  std::vector<truth::Timestamp> times;
  std::vector<std::string> names;
  for (const ChartTarget& target : targets) {
    names.push_back(target.name);
    for (const TrackRow& row : target.rows) times.push_back(row.at);
  }
  const auto [first, last] = std::ranges::minmax(times);
  throw std::runtime_error(truth.apart_text(names, first, last, is_shifted));
}

// The truth of these targets on their clock; reports targets without one.
truth::Truth matched_truth(const PlotOptions& options, const std::map<std::string, std::vector<TrackRow>>& tracks) {
  truth::Truth truth = truth::Truth::read(options.truth);
  truth.shift(std::chrono::round<std::chrono::nanoseconds>(std::chrono::duration<double>(options.clock_offset_s)));
  std::vector<std::string> targets;
  std::map<std::string, std::vector<truth::Truth::Sample>> positions;
  for (const auto& [name, rows] : tracks) {
    targets.push_back(name);
    for (const TrackRow& row : rows)
      if (row.state == "tracking" && row.has_position()) positions[name].push_back({row.at, row.position});
  }
  for (const std::string& sentence : truth.assign(positions)) fmt::print(stderr, "huetrack: {}\n", sentence);
  // A target with several has rows of its own while none of its objects is known.
  std::erase_if(targets, [&](const std::string& target) {
    return std::ranges::any_of(positions, [&](const auto& object) {
      return object.first != target && truth::target_of(object.first) == target &&
             truth.targets().contains(object.first);
    });
  });
  for (const std::string& sentence : truth.match(targets)) fmt::print(stderr, "huetrack: {}\n", sentence);
  if (std::ranges::none_of(targets, [&](const std::string& name) { return truth.targets().contains(name); }))
    throw std::runtime_error(options.truth.string() + ": has none of the targets of " + options.tracks.string() +
                             ", and no ball within 10 cm of an object of one at its time (--clock-offset)");
  return truth;
}

truth::EstimatedSample sample_of(const std::vector<TrackRow>& rows) {
  truth::EstimatedSample sample;
  for (const TrackRow& row : rows)
    if (row.state == "tracking" && row.has_position()) sample.add({row.at, row.position, row.covariance});
  return sample;
}

std::optional<truth::Explanation> explanation_of(const ChartTarget& target) {
  if (target.truth == nullptr) return std::nullopt;
  const truth::EstimatedSample sample = sample_of(target.rows);
  const truth::TargetTrack track{target.name, sample.kept()};
  return truth::explanation(*target.truth, {&track, 1});
}

// All tracks by one transform, which is printed.
void align(std::map<std::string, std::vector<TrackRow>>& tracks, const truth::Truth& truth,
           const PlotOptions& options) {
  if (options.align == truth::Freedom::none && !options.align_time) return;
  std::vector<truth::EstimatedSample> samples;
  for (const auto& [_, rows] : tracks) samples.push_back(sample_of(rows));
  std::vector<truth::TargetTrack> targets;
  for (const auto& [name, _] : tracks) targets.push_back({name, samples[targets.size()].kept()});
  const auto alignment = truth::align(truth, targets, options.align, options.align_time);
  if (!alignment)
    throw std::runtime_error("fewer than 30 positions in state tracking have a truth: nothing can be aligned");
  fmt::print("aligned: {}\n", alignment->text(options.clock_offset_s));
  for (auto& [_, rows] : tracks)
    for (TrackRow& row : rows) {
      const truth::Estimated aligned = alignment->aligned({row.at, row.position, row.covariance});
      row.at = aligned.at;
      row.position = aligned.position;
      row.covariance = aligned.covariance;
    }
}

bool is_begun_drawing(std::string_view text) {
  constexpr std::string_view beginnings[] = {"\x89PNG", "<?xml", "<svg", "<!doctype html"};
  return std::ranges::any_of(beginnings, [&](std::string_view begin) { return text.starts_with(begin); });
}

}  // namespace

void plot(const PlotOptions& options) {
  const std::string kind = options.out.extension().string();
  if (kind != ".png" && kind != ".svg" && kind != ".html")
    throw std::runtime_error(options.out.string() + ": the name must end with .png, .svg or .html");
  files::refuse_other_kind(options.out, {"drawing", is_begun_drawing});
  auto tracks = read_tracks(options.tracks);
  truth::Truth truth;
  if (!options.truth.empty()) {
    truth = matched_truth(options, tracks);
    align(tracks, truth, options);
  }
  std::vector<ChartTarget> targets;
  for (const auto& [name, rows] : tracks) targets.push_back({name, rows, nullptr});
  if (!options.truth.empty()) {
    for (ChartTarget& target : targets)
      if (truth.targets().contains(target.name)) target.truth = &truth;
    if (std::ranges::all_of(targets, [](const ChartTarget& t) { return figures_of(t).in_truth == 0; }))
      fail_without_comparison(targets, truth, options.clock_offset_s != 0);
  }
  ChartStyle style{.title = options.tracks.filename().string()};
  truth::Timestamp first = targets.front().rows.front().at;
  for (const ChartTarget& target : targets) first = std::min(first, target.rows.front().at);
  if (first > year_1973) {  // UNIX time: too many digits for an axis
    style.title += ", from " + utc(first);
    style.time_title = "capture time, s from the start";
    style.zero = first;
  }
  const std::string content = kind == ".png"   ? draw_chart(targets, style, Canvas::Kind::pixels).png()
                              : kind == ".svg" ? draw_chart(targets, style, Canvas::Kind::svg).svg()
                                               : html_of(targets, style);
  files::write_whole_file(options.out, content);
  for (const ChartTarget& target : targets) {
    const ChartFigures figures = figures_of(target);
    fmt::print("{}\n", to_text(figures));
    if (figures.compared > 0 && !figures.is_ever_near)
      fmt::print(stderr,
                 "huetrack: {} is never within 50 mm of the truth while tracking: is it another ball's, or on another "
                 "clock (--clock-offset)?\n",
                 target.name);
    if (const auto explanation = explanation_of(target))
      fmt::print("{}: {}\n", target.name,
                 truth::to_text(*explanation, {options.align, options.align_time, options.clock_offset_s}));
  }
}

}  // namespace huetrack::plot
