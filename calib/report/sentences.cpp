#include "calib/report/sentences.h"

#include <fmt/format.h>

#include <algorithm>

namespace huetrack::report {
namespace {

std::string pixels(double px) {
  return px < 10 ? fmt::format("{:.2f} px", px) : fmt::format("{:.0f} px", px);
}

// The origin of lenses that were not given.
std::string estimated_here(const solver::Extrinsics& result) {
  std::vector<std::string> clauses;
  for (std::size_t c = 0; c < result.contradictions.size(); ++c) {
    if (!result.contradictions[c]) continue;
    clauses.push_back(contradiction_text(*result.contradictions[c], result.adjustment.cameras[c].name));
  }
  return clauses.empty() ? "the lenses were estimated from these views" : fmt::to_string(fmt::join(clauses, "; "));
}

// The assumed uncertainty of given lenses without covariance; empty: none.
std::string assumed_text(const solver::Extrinsics& result) {
  const bool any = std::ranges::any_of(result.given_lens_checks, [](const std::optional<solver::GivenLensCheck>& lens) {
    return lens && !lens->has_covariance;
  });
  if (!any) return "";
  return fmt::format(
      "; their files have no uncertainty, so that of usual webcams is assumed ({:.1f} % of the image's width), unless "
      "these views determine them better",
      100 * solver::usual_lens_share);
}

}  // namespace

std::string choice_text(const solver::Intrinsics& lens) {
  const solver::LensTrial& chosen = lens.trials.at(lens.chosen);
  if (lens.trials.size() == 1) return fmt::format("{} was asked for", solver::name(chosen.lens));
  const solver::LensTrial* next = nullptr;
  for (const solver::LensTrial& trial : lens.trials) {
    if (&trial == &chosen || !trial.possible) continue;
    if (next == nullptr || trial.log_evidence > next->log_evidence) next = &trial;
  }
  if (next == nullptr) return fmt::format("{} is the only lens model that fits", solver::name(chosen.lens));
  const double more = chosen.log_evidence - next->log_evidence;
  if (more >= 0)
    return fmt::format("{} explains the views best (log evidence {:.1f} above that of {})", solver::name(chosen.lens),
                       more, solver::name(next->lens));
  return fmt::format(
      "{} is simpler or more usual than {}, which does not explain the views clearly better (log evidence {:.1f} "
      "above)",
      solver::name(chosen.lens), solver::name(next->lens), -more);
}

std::string refinement_text(const solver::Extrinsics& result) {
  switch (result.refinement) {
    case solver::LensRefinement::asked_for:
      break;
    case solver::LensRefinement::kept_as_found:
      return "the lenses stay as estimated for each camera alone";
    case solver::LensRefinement::kept_as_given:
      return "the lenses stay as they were given" + assumed_text(result);
    case solver::LensRefinement::refined:
      return estimated_here(result) + "; the lenses are refined with all cameras' views";
    case solver::LensRefinement::given_refined:
      return fmt::format(
          "the given lenses were refined: unrefined, the cameras agree less well with one another ({:.2f} px) than now "
          "({:.2f} px)",
          result.held_px, result.adjustment.noise_px);
    case solver::LensRefinement::not_synchronised:
      return fmt::format(
          "{}; each is kept as its own camera's views determine it ({:.2f} px), because the cameras agree less well "
          "with one another ({:.2f} px): they are not quite synchronised",
          estimated_here(result), result.alone_px, result.adjustment.noise_px);
  }
  return "refining the lenses was asked for";
}

std::string contradiction_text(const solver::LensContradiction& c, const std::string& camera) {
  if (c.is_by_focal_length)
    return fmt::format("by its views camera {} has a focal length of {:.1f} px (+- {:.1f}), not {:.1f} px as given",
                       camera, c.focal_px, c.focal_sigma_px, c.given_focal_px);
  return fmt::format("the given lens of camera {} leaves a residual of {:.2f} px, one fitted to its views {:.2f} px",
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
  return fmt::format("its corners have an error of {}, those of the other views {}", pixels(misfit.own_px),
                     pixels(misfit.others_px));
}

}  // namespace huetrack::report
