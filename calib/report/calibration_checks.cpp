#include "calib/report/calibration_checks.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/board/sharpness.h"

namespace huetrack::report {
namespace {

// A figure up to `doubtful` is good, beyond `failed` hopeless.
struct Limits {
  double doubtful, failed;
  Verdict judge(double value) const {
    return !(value <= failed) ? Verdict::failed : value > doubtful ? Verdict::doubtful : Verdict::usable;
  }
};
constexpr double never = 1e300;
// rms of a camera's corners / image width: 0.6 px of 640. A good board gives a quarter of it.
constexpr Limits rms_share{0.001, 0.006};
constexpr Limits focal_share{0.005, 0.03};      // standard deviation / focal length
constexpr Limits centre_share{0.006, 0.05};     // of the principal point / image width
constexpr Limits aspect{0.01, never};           // |fx / fy - 1|
constexpr Limits position_share{0.01, 0.05};    // of a camera / its distance to the boards
constexpr Limits rotation_deg{0.3, 3};          // of a camera
constexpr Limits volume_share{0.01, 0.05};      // 95 % of the volume / distance of the cameras
constexpr double little_volume_share = 0.002;   // limit if it outweighs the noise of the tracked object
constexpr Limits dropped_share{0.2, 0.6};       // views
constexpr Limits behind_share{0.02, 0.5};       // views of the board's back
constexpr Limits not_synchronised{1.6, never};  // noise of all together / of each alone
constexpr Limits fast_share{2, never};          // rms of views that move fast / of slow ones
constexpr double latest_s = 0.1;                // s; delay of a camera beyond which it is frames behind
// Error of a pixel's ray where boards were / image width: 0.3 px of 640.
constexpr Limits ray_share{0.0005, 0.005};
constexpr double contradicted_sigmas = 2;  // these views contradict a given lens
constexpr double unknown_share =
    0.01;  // error / image width beyond which a part of the image without boards is a guess
constexpr Limits edge_left_out{0.1, never};        // share of the corners at the image's edge
constexpr double blurred_views_share = 0.2;        // of all views
constexpr Limits noisier{2, never};                // times the noise of most cameras
constexpr Limits halves_ratio{3, never};           // difference of the halves of the recording / expected
constexpr double least_coverage = 0.4;             // of the image's cells
constexpr int enough_views = 10, least_views = 4;  // distinct ones
constexpr double least_tilt_range_deg = 20, least_depth_ratio = 1.15;
constexpr int enough_shared = 8;  // sets, on the path to every camera
constexpr double pattern_of_noise = 0.6, least_pattern_px = 0.12;

struct Range {
  double low = 0, high = 0;
  explicit Range(const std::vector<double>& values) {
    if (values.empty()) return;
    const auto [a, b] = std::ranges::minmax(values);
    low = a;
    high = b;
  }
};

class Judge {
 public:
  Judge(CalibrationReport& report, const Evidence& evidence) : report_(report), evidence_(evidence) {}

  void run() {
    for (std::size_t c = 0; c < report_.cameras.size(); ++c) {
      fit(report_.cameras[c]);
      corners(report_.cameras[c]);
      sharpness(report_.cameras[c]);
      lens(report_.cameras[c], evidence_.covers_image[c], is_kept(c));
      views(report_.cameras[c]);
      side(report_.cameras[c], evidence_.behind[c]);
      pose(report_.cameras[c]);
    }
    together();
    if (evidence_.extrinsics != nullptr) consistency(*evidence_.extrinsics);
    for (const CameraLeftOut& camera : report_.left_out) {
      add(Verdict::doubtful, "camera " + camera.name, camera.name + " is left out: " + camera.why,
          "correct that, and calibrate again; the rig is valid for the other cameras");
    }
    if (!evidence_.board_doubt.empty())
      add(Verdict::doubtful, "board file", evidence_.board_doubt, "measure the board, and correct its file");
    for (const std::string& warning : evidence_.warnings) {
      add(Verdict::doubtful, "input", warning, "use an undamaged copy, or record it again");
    }
    std::ranges::stable_sort(report_.checks, std::greater<>{}, &Check::verdict);
    report_.verdict = report_.checks.empty() ? Verdict::usable : report_.checks.front().verdict;
  }

 private:
  const std::string all_over_its_image = "show the board all over its image";
  // Of an advice: what names options of the command.
  std::string command(const char* clause) const { return evidence_.reader == Reader::terminal ? clause : ""; }

  void add(Verdict verdict, std::string name, std::string finding, std::string advice) {
    report_.checks.push_back(
        {verdict, std::move(name), std::move(finding), verdict == Verdict::usable ? std::string() : std::move(advice)});
  }

  void fit(const CameraReport& camera) {
    add(rms_share.judge(camera.rms_px / camera.image_size.width), "fit of " + camera.name,
        fmt::format("{}: corners are reprojected to {:.2f} px rms; the worst view, {}, to {:.2f} px", camera.name,
                    camera.rms_px, camera.worst_view, camera.worst_view_rms_px),
        "look at the residuals below: a board that is not flat, a camera that refocuses (switch autofocus off), motion "
        "blur, or cameras that do not expose at the same moment (hold the board still for a second at each place)");
    const bool pattern =
        camera.pattern_px > least_pattern_px && camera.pattern_px > pattern_of_noise * report_.noise_px;
    add(pattern ? Verdict::doubtful : Verdict::usable, "residual pattern of " + camera.name,
        fmt::format("{}: {:.2f} px of the residuals are the same in every view of a part of the image", camera.name,
                    camera.pattern_px),
        "the lens model does not fit this lens" + command(": try --lens with a richer model") +
            "; a board that is not flat has the same effect");
    int dropped = 0;
    for (const DroppedView& view : report_.dropped) {
      dropped += report_.cameras[static_cast<std::size_t>(view.camera)].name == camera.name ? 1 : 0;
    }
    const double share = static_cast<double>(dropped) / std::max(1, dropped + camera.views_used);
    add(dropped_share.judge(share), "outlier views of " + camera.name,
        fmt::format("{}: {} of {} views of the board contradict the others and were dropped", camera.name, dropped,
                    dropped + camera.views_used),
        "see the list of dropped views: if they are all of one time, something moved then: remove that part");
  }

  // Corners that were left out. Those at the image's edge determine the distortion.
  void corners(const CameraReport& camera) {
    int at_edge = camera.left_out_at_edge;
    for (int row = 0; row < ImageGrid::rows; ++row) {
      for (int column = 0; column < ImageGrid::columns; ++column) {
        const bool edge = row == 0 || column == 0 || row + 1 == ImageGrid::rows || column + 1 == ImageGrid::columns;
        if (edge) at_edge += camera.grid.corners[static_cast<std::size_t>(row * ImageGrid::columns + column)];
      }
    }
    const int all = camera.corners_used + camera.corners_left_out;
    constexpr int few = 10;
    const double share = at_edge > few ? static_cast<double>(camera.left_out_at_edge) / at_edge : 0;
    add(edge_left_out.judge(share), "corners left out of " + camera.name,
        fmt::format("{}: {} of {} corners do not fit and were left out, {} of them among the {} at the image's edge",
                    camera.name, camera.corners_left_out, all, camera.left_out_at_edge, at_edge),
        "the lens model does not fit at the image's edge" + command(": omit --lens, so that a better one is chosen") +
            "; or the board is not flat");
  }

  void sharpness(const CameraReport& camera) {
    if (camera.blur_px <= 0) return;
    double sharpest = camera.blur_px;
    for (const CameraReport& other : report_.cameras) {
      if (other.blur_px > 0) sharpest = std::min(sharpest, other.blur_px);
    }
    const bool blurred = board::is_out_of_focus(camera.blur_px, sharpest);
    add(blurred ? Verdict::doubtful : Verdict::usable, "sharpness of " + camera.name,
        fmt::format("{}: its pictures are blurred by {:.1f} px (standard deviation of an edge){}", camera.name,
                    camera.blur_px,
                    report_.cameras.size() > 1 ? fmt::format(", the sharpest camera's by {:.1f} px", sharpest) : ""),
        "focus it, and clean its lens; then calibrate again, because the focus is part of the lens");
    const double share = static_cast<double>(camera.blurred_views) / std::max(1, camera.views_used);
    add(share > blurred_views_share ? Verdict::doubtful : Verdict::usable, "motion blur of " + camera.name,
        fmt::format("{}: {} of its {} views are far more blurred than the others", camera.name, camera.blurred_views,
                    camera.views_used),
        "move the board more slowly or expose more briefly, and switch autofocus off");
  }

  // Inconsistencies within the adjustment.
  void consistency(const solver::Extrinsics& result) {
    if (result.board_is_warped) {
      const solver::BoardWarp &warp = result.adjustment.warp, &sigma = result.adjustment.warp_sigma;
      const double bend = warp.head<2>().norm(), stretch = std::abs(warp(2));
      // Significant, and large enough to move corners.
      const bool is_stretched = stretch > 4 * sigma(2) && stretch > 0.0005;
      const bool is_bent =
          warp.head<2>().cwiseAbs().cwiseQuotient(sigma.head<2>()).maxCoeff() > 4 && (bend > 0.0005 || !is_stretched);
      if (is_bent) {
        add(Verdict::doubtful, "flatness of the board",
            fmt::format("the board is bent: its middle is raised by {:.1f} mm along x and {:.1f} mm along y (+- {:.1f} "
                        "mm); the calibration accounts for it",
                        1000 * warp(0), 1000 * warp(1), 1000 * sigma.head<2>().maxCoeff()),
            "glue the print onto something flat (glass, aluminium, a table's top), and calibrate again");
      }
      if (is_stretched) {
        add(Verdict::doubtful, "squares of the board",
            fmt::format("the print is stretched: its squares are {:.2f} % (+- {:.2f}) longer along {} than along {}; "
                        "the calibration accounts for it, but no image shows their mean size",
                        100 * stretch, 100 * sigma(2), warp(2) > 0 ? "x" : "y", warp(2) > 0 ? "y" : "x"),
            "measure ten squares along both, and give pitch: [x, y] in the board file");
      }
    }
    if (result.moved_within) {
      const solver::MovedWithin& moved = *result.moved_within;
      const std::string& name = report_.cameras[static_cast<std::size_t>(moved.camera)].name;
      add(Verdict::doubtful, "stability of " + name,
          fmt::format("{} moved during the recording: by {:.1f} mm and {:.2f} degrees, before {}{}", name,
                      1000 * moved.moved_m, moved.turned_rad * 180 / std::numbers::pi, moved.image,
                      moved.is_either_of_two ? " (or the other camera did: with two cameras this is ambiguous)" : ""),
          "fasten it, and record anew; or remove what was recorded before that moment");
    }
    for (const solver::HalvesCheck& half : result.halves) {
      using Split = solver::HalvesCheck::Split;
      const char* what = half.split == Split::in_time    ? "the two halves of the recording"
                         : half.split == Split::in_place ? "boards at the two ends of the volume"
                                                         : "every second piece of the recording and the rest";
      add(halves_ratio.judge(half.ratio()), std::string("agreement of ") + what,
          fmt::format("{} place points {:.2f} mm away from the result of all; {:.2f} mm are expected{}", what,
                      1000 * half.seen_m, 1000 * half.expected_m,
                      half.ratio() > solver::most_halves_ratio ? ": all uncertainties are inflated accordingly" : ""),
          "an assumption of the calibration is wrong: a camera or the focus moved, the board bends or differs from its "
          "file, or the images are not synchronised");
    }
    for (const solver::AdjustedCamera& camera : result.adjustment.cameras) {
      if (result.refinement != solver::LensRefinement::given_refined || !camera.lens_prior) continue;
      const solver::LensParameters &was = camera.lens_prior->mean, &now = camera.parameters;
      add(Verdict::usable, "given lens of " + camera.name,
          fmt::format(
              "{}: the given lens was refined, because the cameras are inconsistent with it: fx {:.1f} px (given: "
              "{:.1f}), fy {:.1f} px (given: {:.1f}), principal point at ({:.1f}, {:.1f}) (given: {:.1f}, {:.1f})",
              camera.name, now(0), was(0), now(1), was(1), now(2), now(3), was(2), was(3)),
          "");
    }
    for (std::size_t c = 0; c < result.contradictions.size(); ++c) {
      const std::string& name = report_.cameras[c].name;
      if (result.contradictions[c]) {
        const double covered = result.contradictions[c]->covered;
        add(covered < least_coverage ? Verdict::doubtful : Verdict::usable, "given lens of " + name,
            fmt::format("{}: the given lens was replaced by one from these views, which cover {:.0f} % of its image",
                        name, 100 * covered),
            command("calibrate the lens alone (intrinsics): ") + all_over_its_image +
                command("; --refine-lens no keeps the given one"));
      }
      if (c < result.given_lens_checks.size() && result.given_lens_checks[c]) {
        const solver::GivenLensCheck& lens = *result.given_lens_checks[c];
        const bool contradicted =
            ray_share.judge(lens.off_px / report_.cameras[c].image_size.width) > Verdict::usable &&
            lens.off_px > contradicted_sigmas * lens.sigma_px;
        add(contradicted ? Verdict::doubtful : Verdict::usable, "given lens of " + name,
            fmt::format(
                "{}: the given lens is kept; these views differ from it by {:.2f} px (+- {:.2f}) where boards were",
                name, lens.off_px, lens.sigma_px),
            command("omit --refine-lens, so that it is refined; or calibrate it alone (intrinsics): ") +
                all_over_its_image);
      }
      if (result.kept_against[c] && result.refinement != solver::LensRefinement::given_refined) {
        add(Verdict::usable, "given lens of " + name,
            fmt::format("{}: the given lens is kept, though another fits these views better: they cover only {:.0f} % "
                        "of its image",
                        name, 100 * result.kept_against[c]->covered),
            "");
      }
    }
  }

  // A given lens that is kept: its uncertainty from these views does not matter.
  bool is_kept(std::size_t c) const {
    const solver::Extrinsics* result = evidence_.extrinsics;
    return result != nullptr && c < result->given_lens_checks.size() && result->given_lens_checks[c].has_value();
  }

  void lens(const CameraReport& camera, bool covers, bool kept) {
    const solver::LensParameters& l = camera.parameters;
    const double focal = std::max(camera.sigma(0) / l(0), camera.sigma(1) / l(1));
    const double rays_px = camera.rays.covered_px;
    if (focal > 0 && !kept) {
      const bool far = camera.rays.image_px > unknown_share * camera.image_size.width;
      add(ray_share.judge(rays_px / camera.image_size.width), "rays of " + camera.name,
          fmt::format("{}: the direction of a pixel is known to {:.2f} px (95 %) where boards were, to {:.2g} px over "
                      "the whole image{}",
                      camera.name, rays_px, camera.rays.image_px, far ? ": without boards it is a guess" : ""),
          "show the board in all parts of the image, tilted, near and far");
    }
    // Not for the stereographic lens, whose parameters are strongly correlated.
    if (focal > 0 && !kept && camera.lens != solver::LensModel::stereographic) {
      add(focal_share.judge(focal), "focal length of " + camera.name,
          fmt::format("{}: fx {:.1f} +- {:.1f}, fy {:.1f} +- {:.1f} px", camera.name, l(0), camera.sigma(0), l(1),
                      camera.sigma(1)),
          "show the board tilted by 30 to 50 degrees, both ways, and near as well as far: boards parallel to the image "
          "do not determine the focal length");
      const double centre = std::max(camera.sigma(2), camera.sigma(3)) / camera.image_size.width;
      add(centre_share.judge(centre), "principal point of " + camera.name,
          fmt::format("{}: cx {:.1f} +- {:.1f}, cy {:.1f} +- {:.1f} px", camera.name, l(2), camera.sigma(2), l(3),
                      camera.sigma(3)),
          "show the board tilted, and turned by 90 degrees in its plane");
    }
    const bool off =
        std::abs(l(2) / camera.image_size.width - 0.5) > 0.15 || std::abs(l(3) / camera.image_size.height - 0.5) > 0.15;
    add(off ? Verdict::doubtful : Verdict::usable, "place of the principal point of " + camera.name,
        fmt::format("{}: at ({:.0f}, {:.0f}) of {}x{}", camera.name, l(2), l(3), camera.image_size.width,
                    camera.image_size.height),
        "so far from the centre it indicates a cropped image or too few tilted views");
    const double ratio = l(0) / l(1);
    add(aspect.judge(std::abs(ratio - 1)), "aspect ratio of " + camera.name,
        fmt::format("{}: fx / fy = {:.4f}", camera.name, ratio),
        "pixels of today's cameras are square: is the video squeezed, or are the board's squares not square (then give "
        "pitch: [x, y] in the board file)? Otherwise these views do not determine the lens: " +
            command("calibrate it alone (intrinsics), and give it with --intrinsics: ") + all_over_its_image);
    add(covers ? Verdict::usable : Verdict::doubtful, "reach of the lens model of " + camera.name,
        covers ? camera.name + ": valid out to the image's corners"
               : camera.name + ": folds back before the image's corners",
        "show the board in the corners of the image" + command("; or choose another model with --lens"));
  }

  void views(const CameraReport& camera) {
    const bool own_lens = camera.lens_was_found;
    add(!own_lens || camera.coverage >= least_coverage ? Verdict::usable : Verdict::doubtful,
        "coverage of " + camera.name,
        fmt::format("{}: the board was in {:.0f} % of the image's parts", camera.name, 100 * camera.coverage),
        "show the board in the parts that are white in the coverage map, above all the corners: distortion is known "
        "only where a board was");
    const Verdict count = camera.distinct_views < least_views                ? Verdict::failed
                          : own_lens && camera.distinct_views < enough_views ? Verdict::doubtful
                                                                             : Verdict::usable;
    add(count, "views of " + camera.name,
        fmt::format("{}: {} views of the board, {} of them at different places", camera.name, camera.views_used,
                    camera.distinct_views),
        "show the board at some 15 different places; views at the same place count as one");
    if (!own_lens) return;
    const Range tilt(camera.tilt_deg), distance(camera.distance_m);
    const double depth = distance.low > 0 ? distance.high / distance.low : 1;
    add(tilt.high - tilt.low < least_tilt_range_deg ? Verdict::doubtful : Verdict::usable, "tilt of " + camera.name,
        fmt::format("{}: the board was tilted by {:.0f} to {:.0f} degrees against the line of sight", camera.name,
                    tilt.low, tilt.high),
        "vary the tilt: some views straight, some by 30 to 50 degrees, about both axes");
    add(depth < least_depth_ratio && tilt.high - tilt.low < 2 * least_tilt_range_deg ? Verdict::doubtful
                                                                                     : Verdict::usable,
        "depth range of " + camera.name,
        fmt::format("{}: the board was {:.2f} to {:.2f} m away", camera.name, distance.low, distance.high),
        "show it nearer and farther away");
  }

  void side(const CameraReport& camera, double behind) {
    add(behind_share.judge(behind), "side of the board of " + camera.name,
        behind > 0 ? fmt::format("{}: is behind the board in {:.0f} % of its views", camera.name, 100 * behind)
                   : camera.name + ": the board faces it in all views",
        "the images of this camera are mirrored (left and right swapped), or its board poses are the mirrored twins: "
        "switch mirroring off in the camera or its driver, and show the board nearer and more tilted");
  }

  void pose(const CameraReport& camera) {
    if (!camera.cam_from_world) return;
    if (camera.relative_noise > 1) {
      add(noisier.judge(camera.relative_noise), "noise of " + camera.name,
          fmt::format("{}: its corners scatter {:.1f} times as much as those of most cameras, and have less weight",
                      camera.name, camera.relative_noise),
          "check that its images are sharp, and that it is synchronised with the others (time stamps, exposure)");
    }
    const Range distance(camera.distance_m);
    const double middle = std::max(1e-9, (distance.low + distance.high) / 2);
    const double turn_deg = camera.rotation_sigma_rad * 180 / std::numbers::pi;
    add(std::max(position_share.judge(camera.centre_sigma_m / middle), rotation_deg.judge(turn_deg)),
        "pose of " + camera.name,
        fmt::format("{}: position +- {:.1f} mm, rotation +- {:.3f} degrees", camera.name, 1000 * camera.centre_sigma_m,
                    turn_deg),
        "show the board to this camera and its neighbours together at more places, near and far, tilted");
  }

  void together() {
    if (report_.pairs.empty()) return;
    // The maximum spanning tree of pairs: its weakest links limit the poses of the cameras behind them.
    std::vector<PairReport> pairs = report_.pairs;
    std::ranges::stable_sort(pairs, std::greater<>{}, &PairReport::shared_sets);
    std::vector<std::size_t> group(report_.cameras.size());
    for (std::size_t c = 0; c < group.size(); ++c) group[c] = c;
    for (const PairReport& pair : pairs) {
      const std::size_t a = group[static_cast<std::size_t>(pair.a)], b = group[static_cast<std::size_t>(pair.b)];
      if (a == b) continue;
      for (std::size_t& g : group) g = g == b ? a : g;
      const std::string &left = report_.cameras[static_cast<std::size_t>(pair.a)].name,
                        &right = report_.cameras[static_cast<std::size_t>(pair.b)].name;
      add(pair.shared_sets < enough_shared ? Verdict::doubtful : Verdict::usable,
          std::string("overlap of ").append(left).append(" and ").append(right),
          fmt::format("{} and {} saw the board together {} times", left, right, pair.shared_sets),
          "no other cameras link these two groups better: show the board to both together, 10 times or more");
    }
    if (evidence_.alone_px > 0) {
      const double ratio = report_.noise_px / evidence_.alone_px;
      const CameraReport& worst = *std::ranges::max_element(report_.cameras, {}, &CameraReport::rms_px);
      // A camera that moved explains it.
      const bool explained = evidence_.extrinsics != nullptr && evidence_.extrinsics->moved_within.has_value();
      add(explained ? Verdict::usable : not_synchronised.judge(ratio), "agreement between the cameras",
          fmt::format(
              "corners scatter by {:.2f} px for all cameras together, by {:.2f} px for each camera alone, most in {}",
              report_.noise_px, evidence_.alone_px, worst.name),
          "the cameras do not expose at the same moment, or one was moved while recording: hold the board still for a "
          "second at each place (only still moments are then used), or give the cameras' clock offsets in "
          "recording.yaml (offset_s)");
    }
    for (std::size_t c = 0; c < evidence_.late_s.size(); ++c) {
      const double late_s = evidence_.late_s[c];
      if (std::abs(late_s) < latest_s) continue;
      const std::string& name = report_.cameras[c].name;
      add(Verdict::doubtful, "time of " + name,
          fmt::format("{}: by the board's motion its images are {:.0f} ms {} those of the others", name,
                      1000 * std::abs(late_s), late_s > 0 ? "behind" : "ahead of"),
          "that is more than a camera's own latency: a frame was probably lost or counted twice at the start, or a "
          "frame waited in a buffer; correct the recording (offset_s in recording.yaml), or record it anew");
    }
    if (evidence_.stamps_s > solver::worst_stamps_of_camera_s) {
      add(Verdict::usable, "time stamps",
          fmt::format("the time stamps scatter by {:.0f} ms, as if taken when a program fetched the images: latency "
                      "and readout are not estimated",
                      1000 * evidence_.stamps_s),
          "");
    }
    if (evidence_.slow_px > 0) {
      add(fast_share.judge(evidence_.fast_px / evidence_.slow_px), "views of the board in motion",
          fmt::format("corners fit to {:.2f} px where the board moves fast, to {:.2f} px where it moves slowly",
                      evidence_.fast_px, evidence_.slow_px),
          "the images' times do not fit the board's motion: motion blur (expose more briefly), or time stamps "
          "unrelated to the exposure; move the board more slowly, or hold it still at each place");
    }
    if (report_.volume) {
      const solver::VolumeAccuracy& volume = *report_.volume;
      double distance = 0;
      for (const CameraReport& camera : report_.cameras) {
        distance += (camera.centre - (volume.box.low + volume.box.high) / 2).norm() /
                    static_cast<double>(report_.cameras.size());
      }
      const double share = volume.p95_by_calibration_m / distance;
      // Compared with the noise's part of the total.
      const bool outweighs = volume.p95_by_calibration_m * std::numbers::sqrt2 > volume.p95_total_m;
      Verdict verdict = volume.covered > 0 ? volume_share.judge(share) : Verdict::failed;
      if (verdict == Verdict::usable && outweighs && share > little_volume_share) verdict = Verdict::doubtful;
      add(verdict, "expected accuracy",
          fmt::format("the calibration misplaces points of the volume by {:.1f} mm (median), {:.1f} mm (95 %); two or "
                      "more cameras see {:.0f} % of it",
                      1000 * volume.median_by_calibration_m, 1000 * volume.p95_by_calibration_m, 100 * volume.covered),
          "carry the board through the parts of the volume that are dark in the slices below, in view of several "
          "cameras");
    }
  }

  CalibrationReport& report_;
  const Evidence& evidence_;
};

}  // namespace

void judge(CalibrationReport& report, const Evidence& evidence) {
  Judge(report, evidence).run();
}

}  // namespace huetrack::report
