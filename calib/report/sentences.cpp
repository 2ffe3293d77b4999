#include "calib/report/sentences.h"

#include <fmt/format.h>

#include <algorithm>

namespace huetrack::report {
namespace {

std::string pixels(double px) {
  return px < 10 ? fmt::format("{:.2f} px", px) : fmt::format("{:.0f} px", px);
}

// Where the lenses that are not given came from.
std::string found_here(const solver::Extrinsics& result) {
  std::vector<std::string> clauses;
  for (std::size_t c = 0; c < result.contradictions.size(); ++c) {
    if (!result.contradictions[c]) continue;
    clauses.push_back(contradiction_text(*result.contradictions[c], result.adjustment.cameras[c].name));
  }
  return clauses.empty() ? "the lenses were found from these views" : fmt::to_string(fmt::join(clauses, "; "));
}

// What is believed of lenses whose files do not say how well they are known; empty: none is.
std::string believed_text(const solver::Extrinsics& result) {
  const bool any = std::ranges::any_of(result.given_lens_checks, [](const std::optional<solver::GivenLensCheck>& lens) {
    return lens && !lens->has_covariance;
  });
  if (!any) return "";
  return fmt::format(
      "; how well they are known their files do not say: what is stated allows for what usual webcams' are wrong by "
      "({:.1f} % of the image's width), as far as these views do not tell better",
      100 * solver::usual_lens_share);
}

}  // namespace

std::string choice_text(const solver::Intrinsics& lens) {
  const solver::LensTrial &chosen = lens.trials.at(lens.chosen), &best = lens.trials.at(lens.best);
  switch (lens.choice) {
    case solver::LensChoice::asked_for:
      break;
    case solver::LensChoice::too_few_views:
      return fmt::format("{} views are too few to tell lens models apart: the simplest one", lens.compared_views);
    case solver::LensChoice::best:
      return fmt::format("{} predicts views that it was not fitted to best ({:.3f} px)", solver::name(chosen.lens),
                         chosen.held_out_px);
    case solver::LensChoice::closer:
      return fmt::format(
          "{} predicts views that it was not fitted to as well ({:.3f} px) as {} ({:.3f} px), and fits all corners "
          "better",
          solver::name(chosen.lens), chosen.held_out_px, solver::name(best.lens), best.held_out_px);
    case solver::LensChoice::simpler:
      return fmt::format(
          "{} predicts views that it was not fitted to as well ({:.3f} px) as {} ({:.3f} px), and is simpler",
          solver::name(chosen.lens), chosen.held_out_px, solver::name(best.lens), best.held_out_px);
    case solver::LensChoice::together:
      return fmt::format("{} fits what all cameras saw better than {}, which this camera's own views spoke for",
                         solver::name(chosen.lens), solver::name(lens.trials.at(lens.alone).lens));
  }
  return fmt::format("{} was asked for", solver::name(chosen.lens));
}

std::string refinement_text(const solver::Extrinsics& result) {
  switch (result.refinement) {
    case solver::LensRefinement::asked_for:
      break;
    case solver::LensRefinement::kept_as_found:
      return "the lenses stay as found camera by camera";
    case solver::LensRefinement::kept_as_given:
      return "the lenses stay as they were given" + believed_text(result);
    case solver::LensRefinement::refined:
      return found_here(result) + ", and are refined with all cameras' views";
    case solver::LensRefinement::given_refined:
      return fmt::format(
          "the lenses that were given were refined: as they were, the cameras agree less well with one another "
          "({:.2f} px) than now ({:.2f} px)",
          result.held_px, result.adjustment.noise_px);
    case solver::LensRefinement::not_synchronised:
      return fmt::format(
          "{}, and stay as each camera's own views say ({:.2f} px), because the cameras agree less well with one "
          "another ({:.2f} px): they are not quite in step",
          found_here(result), result.alone_px, result.adjustment.noise_px);
  }
  return "refining the lenses was asked for";
}

std::string contradiction_text(const solver::LensContradiction& c, const std::string& camera) {
  if (c.is_by_focal_length)
    return fmt::format(
        "the views of camera {} say that its focal length is {:.1f} px (+- {:.1f}), not {:.1f} px as given", camera,
        c.focal_px, c.focal_sigma_px, c.given_focal_px);
  return fmt::format("the lens that was given for camera {} leaves {:.2f} px, one fitted to its views {:.2f} px",
                     camera, c.given_px, c.refined_px);
}

std::string timing_text(const solver::Adjustment& adjustment, const solver::AdjustedCamera& camera) {
  std::vector<std::string> clauses;
  for (const auto& [what, time] : {std::pair("latency", &camera.latency), std::pair("readout", &camera.readout)}) {
    if (!solver::is_determined(adjustment, *time)) continue;
    clauses.push_back(fmt::format("{} {:.1f} +- {:.1f} ms", what, 1000 * time->value_s, 1000 * time->sigma_s));
  }
  return fmt::to_string(fmt::join(clauses, ", "));
}

std::string dropped_text(const solver::ViewMisfit& misfit) {
  return fmt::format("its corners are off by {}, those of the other views by {}", pixels(misfit.own_px),
                     pixels(misfit.others_px));
}

}  // namespace huetrack::report
