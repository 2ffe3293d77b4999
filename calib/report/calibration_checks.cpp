#include "calib/report/calibration_checks.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

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
// rms of a camera's corners, of its image's width: 0.6 px of 640. A board seen well leaves a fourth of it.
constexpr Limits rms_share{0.001, 0.006};
constexpr Limits focal_share{0.005, 0.03};     // standard deviation / focal length
constexpr Limits centre_share{0.006, 0.05};    // of the principal point / image width
constexpr Limits aspect{0.01, never};          // |fx / fy - 1|
constexpr Limits position_share{0.01, 0.05};   // of a camera / its distance to the boards
constexpr Limits rotation_deg{0.3, 3};         // of a camera
constexpr Limits volume_share{0.01, 0.05};     // 95 % of the volume / distance of the cameras; and
constexpr double little_volume_share = 0.002;  // from here on, where it outweighs the noise of what will be tracked
constexpr Limits dropped_share{0.2, 0.6};      // views
constexpr Limits behind_share{0.02, 0.5};      // views that show the board's back
constexpr Limits out_of_step{1.6, never};      // noise of all together / of each alone
constexpr Limits fast_share{2, never};         // rms of views that move fast / of slow ones
constexpr double latest_s = 0.1;               // that a camera stamps later than another: beyond, it is frames behind
constexpr double least_coverage = 0.4;         // of the image's cells
constexpr int enough_views = 10, least_views = 4;  // distinct ones
constexpr double least_tilt_range_deg = 20, least_depth_ratio = 1.15;
constexpr int enough_shared = 8;  // sets, on the way to every camera
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
      lens(report_.cameras[c], evidence_.covers_image[c]);
      views(report_.cameras[c]);
      side(report_.cameras[c], evidence_.behind[c]);
      pose(report_.cameras[c]);
    }
    together();
    for (const std::string& warning : evidence_.warnings) {
      add(Verdict::doubtful, "input", warning, "use an undamaged copy, or record it again");
    }
    std::ranges::stable_sort(report_.checks, std::greater<>{}, &Check::verdict);
    report_.verdict = report_.checks.empty() ? Verdict::usable : report_.checks.front().verdict;
  }

 private:
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
        "the lens model does not follow this lens: try --lens with a richer model; a board that is not flat does it "
        "too");
    int dropped = 0;
    for (const DroppedView& view : report_.dropped) {
      dropped += report_.cameras[static_cast<std::size_t>(view.camera)].name == camera.name ? 1 : 0;
    }
    const double share = static_cast<double>(dropped) / std::max(1, dropped + camera.views_used);
    add(dropped_share.judge(share), "outlier views of " + camera.name,
        fmt::format("{}: {} of {} views of the board contradict the others and were dropped", camera.name, dropped,
                    dropped + camera.views_used),
        "see the list of dropped views: if they are all of one time, something moved then; leave that part out");
  }

  void lens(const CameraReport& camera, bool covers) {
    const solver::LensParameters& l = camera.parameters;
    const double focal = std::max(camera.sigma(0) / l(0), camera.sigma(1) / l(1));
    if (focal > 0) {
      add(focal_share.judge(focal), "focal length of " + camera.name,
          fmt::format("{}: fx {:.1f} +- {:.1f}, fy {:.1f} +- {:.1f} px", camera.name, l(0), camera.sigma(0), l(1),
                      camera.sigma(1)),
          "show the board tilted by 30 to 50 degrees, both ways, and near as well as far: boards that are held flat to "
          "the camera do not tell its focal length");
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
        "that far from the middle is a cropped image or too few tilted views");
    const double ratio = l(0) / l(1);
    add(aspect.judge(std::abs(ratio - 1)), "aspect ratio of " + camera.name,
        fmt::format("{}: fx / fy = {:.4f}", camera.name, ratio),
        "pixels of today's cameras are square: is the video squeezed, or are the board's squares not square (then give "
        "pitch: [x, y] in the board file)? Otherwise these views do not tell the lens: calibrate it by itself "
        "(intrinsics), all over its image, and give it with --intrinsics");
    add(covers ? Verdict::usable : Verdict::doubtful, "reach of the lens model of " + camera.name,
        covers ? camera.name + ": holds out to the image's corners"
               : camera.name + ": turns back on itself before the image's corners",
        "show the board in the corners of the image; or choose another model with --lens");
  }

  void views(const CameraReport& camera) {
    const bool own_lens = camera.lens_was_found;
    add(!own_lens || camera.coverage >= least_coverage ? Verdict::usable : Verdict::doubtful,
        "coverage of " + camera.name,
        fmt::format("{}: the board was in {:.0f} % of the image's parts", camera.name, 100 * camera.coverage),
        "show the board in the parts that the coverage map leaves white, the corners above all: distortion is only "
        "known where a board was");
    const Verdict count = camera.distinct_views < least_views                ? Verdict::failed
                          : own_lens && camera.distinct_views < enough_views ? Verdict::doubtful
                                                                             : Verdict::usable;
    add(count, "views of " + camera.name,
        fmt::format("{}: {} views of the board, {} of them at different places", camera.name, camera.views_used,
                    camera.distinct_views),
        "show the board at some 15 different places; views that show it where it was before count as one");
    if (!own_lens) return;
    const Range tilt(camera.tilt_deg), distance(camera.distance_m);
    const double depth = distance.low > 0 ? distance.high / distance.low : 1;
    add(tilt.high - tilt.low < least_tilt_range_deg ? Verdict::doubtful : Verdict::usable, "tilt of " + camera.name,
        fmt::format("{}: the board was tilted by {:.0f} to {:.0f} degrees against the line of sight", camera.name,
                    tilt.low, tilt.high),
        "tilt the board more differently: some views straight, some by 30 to 50 degrees, about both axes");
    add(depth < least_depth_ratio && tilt.high - tilt.low < 2 * least_tilt_range_deg ? Verdict::doubtful
                                                                                     : Verdict::usable,
        "depth range of " + camera.name,
        fmt::format("{}: the board was {:.2f} to {:.2f} m away", camera.name, distance.low, distance.high),
        "show it nearer and farther too");
  }

  void side(const CameraReport& camera, double behind) {
    add(behind_share.judge(behind), "side of the board of " + camera.name,
        behind > 0 ? fmt::format("{}: stands behind the board in {:.0f} % of its views", camera.name, 100 * behind)
                   : camera.name + ": sees the board's front in all views",
        "the images of this camera are mirrored (left and right swapped), or its board poses are the mirrored twins: "
        "switch mirroring off in the camera or its driver, and show the board nearer and more tilted");
  }

  void pose(const CameraReport& camera) {
    if (!camera.cam_from_world) return;
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
    // Along the strongest pairs every camera is reached; the weakest of those is what everything beyond hangs on.
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
      add(out_of_step.judge(ratio), "agreement between the cameras",
          fmt::format("corners scatter by {:.2f} px for all cameras together, by {:.2f} px for each camera alone",
                      report_.noise_px, evidence_.alone_px),
          "the cameras do not expose at the same moment, or one was moved while recording: hold the board still for a "
          "second at each place (only still moments are then used), or give the cameras' clock offsets in "
          "recording.yaml (offset_s)");
    }
    for (std::size_t c = 0; c < evidence_.late_s.size(); ++c) {
      const double late_s = evidence_.late_s[c];
      if (std::abs(late_s) < latest_s) continue;
      const std::string& name = report_.cameras[c].name;
      add(Verdict::doubtful, "time of " + name,
          fmt::format("{}: its pictures are {:.0f} ms {} those of the others, by how the board moves", name,
                      1000 * std::abs(late_s), late_s > 0 ? "behind" : "ahead of"),
          "that is more than a camera's own latency: a frame was probably lost or counted twice at the start, or a "
          "picture waited in a buffer; mend the recording (offset_s in recording.yaml), or record it anew");
    }
    if (evidence_.stamps_s > solver::worst_stamps_of_camera_s) {
      add(Verdict::usable, "time stamps",
          fmt::format("the time stamps scatter by {:.0f} ms, as those of a program that fetched pictures do: neither "
                      "latency nor readout is taken from them",
                      1000 * evidence_.stamps_s),
          "");
    }
    if (evidence_.slow_px > 0) {
      add(fast_share.judge(evidence_.fast_px / evidence_.slow_px), "views of the board in motion",
          fmt::format("corners fit to {:.2f} px where the board moves fast, to {:.2f} px where it moves slowly",
                      evidence_.fast_px, evidence_.slow_px),
          "the times of the pictures do not explain how the board moves: motion blur (expose more briefly), or stamps "
          "that do not tell when a picture was taken; move the board more slowly, or hold it still at each place");
    }
    if (report_.volume) {
      const solver::VolumeAccuracy& volume = *report_.volume;
      double distance = 0;
      for (const CameraReport& camera : report_.cameras) {
        distance += (camera.centre - (volume.box.low + volume.box.high) / 2).norm() /
                    static_cast<double>(report_.cameras.size());
      }
      const double share = volume.p95_by_calibration_m / distance;
      // The noise's own part of the total.
      const bool outweighs = volume.p95_by_calibration_m * std::numbers::sqrt2 > volume.p95_total_m;
      Verdict verdict = volume.covered > 0 ? volume_share.judge(share) : Verdict::failed;
      if (verdict == Verdict::usable && outweighs && share > little_volume_share) verdict = Verdict::doubtful;
      add(verdict, "expected accuracy",
          fmt::format(
              "the calibration misplaces points of the volume by {:.1f} mm (median), {:.1f} mm (95 %); two or more "
              "cameras see {:.0f} % of it",
              1000 * volume.median_by_calibration_m, 1000 * volume.p95_by_calibration_m, 100 * volume.covered),
          "carry the board through the parts of the volume that the slices below show dark, seen by several cameras");
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
