#include "calib/report/certificate_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/report/volume_pictures.h"
#include "drawing/axes.h"

namespace huetrack::report {
namespace {

using certify::Certificate;

// Minimum of a length test: of 39 measurements the 95 % quantile is the 38th error, not the largest. Lengths must cover
// all directions and the volume.
constexpr std::size_t least_independent = 39, least_directions = 4, least_cells = 12;
// A third object of the colour may be a momentary reflection; its frame sets are left out.
constexpr double most_with_third_percent = 5;
// Of the mean NIS. With 39 independent, consistent errors one in 200 samples has half of it.
constexpr double honest_surprise = 4, small_surprise = 1.5, cautious_surprise = 0.5;

std::string in_mm(double metres) {
  return fmt::format("{:.2f}", 1e3 * metres);
}

std::vector<std::string> doubts_of(const Certificate& c, bool is_of_places) {
  std::vector<std::string> doubts;
  if (c.independent < least_independent)
    doubts.push_back(is_of_places ? fmt::format("only {} independent visits of marked places, {} are needed: put it on "
                                                "each of them again, or mark more",
                                                c.independent, least_independent)
                                  : fmt::format("only {} independent lengths were measured, {} are needed: carry it "
                                                "on, to other places and in other directions",
                                                c.independent, least_independent));
  if (c.directions_measured() < least_directions)
    doubts.push_back(
        fmt::format("lengths lie in only {} of seven directions: {}", c.directions_measured(),
                    is_of_places ? "mark places above one another, too" : "turn it, upright and slanting too"));
  if (c.cells_measured() < least_cells)
    doubts.push_back(fmt::format("only {} of {} parts of the volume were visited: {}", c.cells_measured(),
                                 c.cells.size(),
                                 is_of_places ? "mark places all over it" : "carry it through all of it"));
  return doubts;
}

std::size_t sets_of_others(const certify::OneColorBar& bar) {
  std::size_t sets = 0;
  for (const auto& other : bar.others) sets += other.sets;
  return sets;
}

// Frame sets in which a tracked object may not have been a ball of the bar.
std::vector<std::string> doubts_of(const OneColorTally& tally) {
  std::vector<std::string> doubts;
  const auto share = [&](std::size_t sets) {
    return 100.0 * static_cast<double>(sets) / static_cast<double>(std::max<std::size_t>(1, tally.sets));
  };
  if (const auto& others = tally.bar.others; !others.empty()) {
    const auto& longest = *std::ranges::max_element(others, {}, &certify::OneColorBar::Other::sets);
    doubts.push_back(
        fmt::format("in {:.1f} % of the frame sets, the first {:.1f} s after the beginning, the two tracked objects "
                    "were {:.0f} to {:.0f} mm apart, but the bar has {:.0f} mm. These sets are excluded: something "
                    "else has the colour (remove it and record anew), or --length-mm is wrong, or the rig is far wrong",
                    share(sets_of_others(tally.bar)), longest.from_s - tally.began_s, 1e3 * longest.least_m,
                    1e3 * longest.most_m, 1e3 * tally.length_m));
  }
  if (share(tally.bar.with_third) > most_with_third_percent)
    doubts.push_back(
        fmt::format("in {:.1f} % of the frame sets there was a third object of the colour; they are excluded: remove "
                    "it and record anew",
                    share(tally.bar.with_third)));
  return doubts;
}

std::string consistency_text(const Certificate& c) {
  std::string out = fmt::format(
      "The positions' covariances predict {} mm for a length (95 %); of the errors {:.0f} % lie within that (95 % "
      "would be consistent), and their mean normalised square is {:.2f} (1 would be consistent).",
      in_mm(c.stated_expanded_m), 100 * c.inside_stated, c.mean_nes);
  if (c.mean_nes > honest_surprise)
    out +=
        " The covariances are too small: the rig has changed or its uncertainty is too small, or the cameras' timing "
        "is wrong. huetrack-calibrate check tests the first.";
  else if (c.mean_nes > small_surprise)
    out += fmt::format(" The covariances are somewhat too small: errors are {:.1f} times as large as predicted.",
                       std::sqrt(c.mean_nes));
  else if (c.mean_nes < cautious_surprise)
    out += fmt::format(" The covariances are conservative: errors are {:.2f} times as large as predicted.",
                       std::sqrt(c.mean_nes));
  else
    out += " The covariances are consistent.";
  return out;
}

Table by_direction(const Certificate& c) {
  Table table{.head = {"direction", "lengths", "measurements", "mean error mm", "rms mm"}, .rows = {}};
  for (std::size_t k = 0; k < certify::direction_count; ++k) {
    const Certificate::Part& part = c.by_direction[k];
    table.rows.push_back({std::string(certify::direction_name(k)), std::to_string(part.lengths),
                          std::to_string(part.independent),
                          part.lengths > 0 ? fmt::format("{:+.2f}", 1e3 * part.mean_m) : "-",
                          part.lengths > 0 ? in_mm(part.rms_m) : "-"});
  }
  return table;
}

// The errors over time, with limit and uncertainty.
Figure errors_figure(const Certificate& c, const std::vector<certify::MeasuredLength>& lengths,
                     const std::optional<double>& limit_m) {
  Figure figure;
  figure.width = 640, figure.height = 230;
  figure.caption = "Error of every length over time. Blue: the expanded uncertainty" +
                   std::string(limit_m ? "; red: the limit." : ".");
  figure.draw = [=](drawing::Canvas& canvas) {
    drawing::Axes axes{.box = {60, 26, 560, 160}, .x = {}, .y = {}};
    for (const certify::MeasuredLength& length : lengths) {
      axes.x.add(length.t_s);
      axes.y.add(1e3 * length.error_m);
    }
    for (const double line : {c.expanded_m, limit_m.value_or(0)}) axes.y.add(1e3 * line), axes.y.add(-1e3 * line);
    axes.x.pad(0.01, 1);
    axes.y.pad(0.05, 1);
    drawing::draw_axes(canvas, axes, {.title = "error of the length, mm", .has_x_labels = true, .x_title = "time, s"});
    std::vector<drawing::Point> points;
    for (const certify::MeasuredLength& length : lengths) points.push_back(axes(length.t_s, 1e3 * length.error_m));
    canvas.discs(points, 1.2, drawing::Color{60, 70, 84, 0.7});
    const auto band = [&](double metres, drawing::Color color) {
      for (const double sign : {-1.0, 1.0})
        canvas.dashed(axes(axes.x.low, sign * 1e3 * metres), axes(axes.x.high, sign * 1e3 * metres), color, 1);
    };
    band(c.expanded_m, {37, 99, 168});
    if (limit_m) band(*limit_m, {179, 38, 30});
  };
  return figure;
}

void add_one_color(Document& document, const OneColorTally& tally) {
  const certify::OneColorBar& bar = tally.bar;
  const std::size_t others = sets_of_others(bar);
  const std::size_t seen = bar.lengths.size() + bar.only_one + bar.with_third + others;
  document.paragraph(fmt::format(
      "Of {} frame sets {} gave a length. Of the others, in {} only one ball was tracked (the other was hidden, or one "
      "lay over the other in the pictures), and in {} neither was; in {} there was a third object of the colour; in {} "
      "the distance of the two was not that of the bar's balls.",
      tally.sets, bar.lengths.size(), bar.only_one, tally.sets - std::min(tally.sets, seen), bar.with_third, others));
}

void add_targets(Document& document, const CertificateInput& input) {
  document.heading("Repeatability, dropouts, times");
  Table table{.head = {"target", "tracked", "gaps", "longest gap s", "rests", "scatter at rest mm"}, .rows = {}};
  for (const TargetTally& target : input.targets) {
    table.rows.push_back({target.name,
                          fmt::format("{:.1f} % of {}",
                                      100.0 * static_cast<double>(target.tracking) /
                                          static_cast<double>(std::max<std::size_t>(1, target.sets)),
                                      target.sets),
                          std::to_string(target.gaps), fmt::format("{:.2f}", target.longest_gap_s),
                          std::to_string(target.rests), target.rests > 0 ? in_mm(target.rest_scatter_m) : "-"});
  }
  document.table(table);
  if (input.one_color) add_one_color(document, *input.one_color);
  if (input.has_incomplete_sets)
    document.paragraph(
        fmt::format("In {:.1f} % of the frame sets a camera's frame was missing.", 100 * input.incomplete_share));
  for (const auto& [camera, time] : input.cameras) document.paragraph(camera + ": " + time + ".");
  if (input.set_ms)
    document.paragraph(fmt::format("Tracking took {:.2f} ms per frame set on this computer.", *input.set_ms));
}

}  // namespace

CertificateReport report_on(const Certificate& c, const std::vector<certify::MeasuredLength>& lengths,
                            const calib::CameraRig& rig, const CertificateInput& input) {
  CertificateReport report;
  report.doubts = doubts_of(c, input.is_of_places);
  const bool is_too_little = !report.doubts.empty();
  if (input.one_color) {
    const auto doubts = doubts_of(*input.one_color);
    report.doubts.insert(report.doubts.end(), doubts.begin(), doubts.end());
  }
  for (const std::string& sentence : input.named) report.doubts.push_back("during tracking: " + sentence);
  const bool is_above = input.limit_m && c.expanded_m > *input.limit_m;
  report.verdict = is_above                                   ? Verdict::failed
                   : !report.doubts.empty() || !input.limit_m ? Verdict::doubtful
                                                              : Verdict::usable;
  Document& document = report.document;
  document.title = "Certificate of lengths: " + input.rig_name;
  document.subtitle = fmt::format("{}; {} lengths, {} independent measurements, through {:.2f} x {:.2f} x {:.2f} m",
                                  input.what, c.lengths, c.independent, c.box.high.x() - c.box.low.x(),
                                  c.box.high.y() - c.box.low.y(), c.box.high.z() - c.box.low.z());
  std::string text = fmt::format("The expanded uncertainty of a length is {} mm (95 %)", in_mm(c.expanded_m));
  text += input.limit_m ? fmt::format(", the limit {} mm.", in_mm(*input.limit_m)) : "; no limit was given.";
  const char* word = is_above                            ? "FAIL"
                     : report.verdict == Verdict::usable ? "PASS"
                     : is_too_little                     ? "TOO LITTLE MEASURED"
                     : !report.doubts.empty()            ? "DOUBTFUL"
                                                         : "MEASURED";
  document.banner(report.verdict, word, text);
  for (const std::string& doubt : report.doubts) document.paragraph("? " + doubt + ".");
  document.heading("Errors of the length");
  document.paragraph(
      fmt::format("Mean {:+.2f} mm, rms {} mm, largest {} mm. The true length is known to {} mm (standard deviation), "
                  "which is part of the uncertainty.",
                  1e3 * c.mean_m, in_mm(c.rms_m), in_mm(c.largest_m), in_mm(c.true_length_sigma_m)));
  document.paragraph(consistency_text(c));
  if (!rig.uncertainty)
    document.paragraph("The rig file has no uncertainty: the covariances lack the error of the calibration.");
  if (!lengths.empty()) {
    document.figure(errors_figure(c, lengths, input.limit_m));
    document.table(by_direction(c));
    if (c.slow.lengths > 0 && c.fast.lengths > 0)
      document.paragraph(
          fmt::format("Slow (below 0.3 m/s) the rms is {} mm, fast (above 1 m/s) {} mm{}.", in_mm(c.slow.rms_m),
                      in_mm(c.fast.rms_m),
                      c.fast.rms_m > 2 * c.slow.rms_m
                          ? ": the cameras' timing is not known well enough, or the images have motion blur"
                          : ""));
    document.heading("Errors over the volume");
    VolumeValues values{.box = c.box, .steps = c.steps, .values = {}, .are_cells = true};
    std::vector<PlaceOnPlan> places;
    for (const Certificate::Part& cell : c.cells)
      values.values.push_back(cell.lengths > 0 ? 1e3 * cell.rms_m : VolumeValues::none);
    int last = -1;
    for (const certify::MeasuredLength& length : lengths) {
      if (length.measurement != last) places.push_back({"", length.middle});
      last = length.measurement;
    }
    document.figure(
        slices_figure(values, "not visited", 0,
                      "Slices from above, x to the right and y up: rms error of the lengths centred there."));
    document.figure(
        plan_figure(rig, c.box, places, "From above: cameras and what they see, and the centres of the lengths."));
  }
  add_targets(document, input);
  document.heading("How it was made");
  Table made{.head = {"what", ""}, .rows = {}};
  for (const auto& [key, value] : input.made_of) made.rows.push_back({key, value});
  document.table(made);
  return report;
}

}  // namespace huetrack::report
