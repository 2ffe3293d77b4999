#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "calib/board/board_yaml.h"
#include "calib/gather/progress_line.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/calibration_options.h"
#include "calib/program/commands.h"
#include "calib/program/rig_pictures.h"
#include "calib/report/advice.h"
#include "calib/solver/world_frame.h"

namespace huetrack::program {
namespace {

struct ExtrinsicsArguments : CalibrationOptions {
  std::vector<std::string> cameras, intrinsics;
  solver::RefineLens refine = solver::RefineLens::automatic;
  std::optional<double> tolerance_s;
  std::vector<double> volume;
  std::string world_of;  // the rig whose world is kept; empty: the replaced one
  bool new_world = false;
};

// The rig whose world is kept: the replaced one, or --world-of. nullopt: none, or --new-world.
std::optional<calib::CameraRig> rig_before(const ExtrinsicsArguments& options) {
  std::error_code error;
  if (!options.new_world && !options.world_of.empty()) return calib::read_rig(options.world_of);
  if (options.new_world || !std::filesystem::exists(options.rig, error)) return std::nullopt;
  try {
    return calib::read_rig(options.rig);
  } catch (const std::runtime_error& wrong) {
    throw gather::InputError(std::string(wrong.what()) + "; it exists, and its world would be kept: give " +
                             "another --rig, or --new-world to replace it");
  }
}

// Keeps the old rig's world by the cameras that did not move; otherwise guesses one.
void choose_world(solver::Extrinsics& result, const ExtrinsicsArguments& options,
                  const std::optional<calib::CameraRig>& before, report::ReportInput& input) {
  const calib::Rigid3d guess = solver::upright_guess(result.adjustment);
  if (before) {
    const auto kept = solver::world_of(*before, result.adjustment);
    // The same images give the same file, bit by bit.
    constexpr double same = 1e-7;
    const bool is_guess = kept && calib::log(kept->new_from_old * calib::inverse(guess)).norm() < same;
    if (kept && !is_guess) {
      result.adjustment = solver::in_world(std::move(result.adjustment), kept->new_from_old);
      const auto was = std::ranges::find(before->made_by, "world", &std::pair<std::string, std::string>::first);
      input.made_of.emplace_back("world", was == before->made_by.end() ? "that of the previous rig" : was->second);
      std::string by = "that of the previous rig, by " + fmt::to_string(fmt::join(kept->by, ", "));
      if (!kept->moved.empty()) by += "; moved since: " + fmt::to_string(fmt::join(kept->moved, ", "));
      input.made_of.emplace_back("world_kept", by);
      if (!options.quiet) std::printf("The world: %s (--new-world starts another one).\n", by.c_str());
      return;
    }
    if (!kept) {
      std::fprintf(stderr,
                   "huetrack-calibrate: no two cameras have the same relative pose as in %s: its world is not kept; "
                   "set it anew (huetrack-calibrate world)\n",
                   (options.world_of.empty() ? options.rig : options.world_of).c_str());
    }
  }
  result.adjustment = solver::in_world(std::move(result.adjustment), guess);
  input.made_of.emplace_back("world", "a guess: z up as the cameras are held, origin amid the board's places");
}

// Removes the cameras that were left out.
gather::FoundBoards kept_of(gather::FoundBoards found, const solver::Extrinsics& result) {
  std::vector<gather::PictureTally> cameras;
  std::vector<int> place(found.cameras.size(), -1);
  for (const int camera : result.kept) {
    place[static_cast<std::size_t>(camera)] = static_cast<int>(cameras.size());
    cameras.push_back(found.cameras[static_cast<std::size_t>(camera)]);
  }
  found.cameras = std::move(cameras);
  auto views = std::exchange(found.views, {});
  auto thumbnails = std::exchange(found.thumbnails, {});
  for (std::size_t v = 0; v < views.size(); ++v) {
    const int to = place[static_cast<std::size_t>(views[v].camera)];
    if (to < 0) continue;
    found.views.push_back(std::move(views[v]));
    found.views.back().camera = to;
    if (v < thumbnails.size()) found.thumbnails.push_back(std::move(thumbnails[v]));
  }
  return found;
}

std::vector<report::CameraLeftOut> left_out_of(const gather::FoundBoards& found, const solver::Extrinsics& result) {
  std::vector<report::CameraLeftOut> out;
  for (const solver::LeftOutCamera& camera : result.left_out) {
    const std::string& name = found.cameras[static_cast<std::size_t>(camera.camera)].name;
    const auto unseen = std::ranges::find(found.without_boards, name, &std::pair<std::string, std::string>::first);
    out.push_back({name, unseen == found.without_boards.end() ? report::with_advice(camera.why) : unseen->second});
  }
  return out;
}

// Applies given lenses and timing to the cameras.
std::vector<solver::CameraToCalibrate> cameras_of(const gather::FoundBoards& found,
                                                  const std::vector<std::string>& files) {
  std::vector<solver::CameraToCalibrate> cameras;
  for (const gather::PictureTally& seen : found.cameras) cameras.push_back({seen.name, seen.image_size, {}, {}});
  for (const std::string& file : files) {
    const calib::CameraRig rig = calib::read_rig(file);
    bool any = false;
    for (const calib::Camera& camera : rig.cameras) {
      const auto known = std::ranges::find(cameras, camera.name, &solver::CameraToCalibrate::name);
      if (known == cameras.end()) continue;
      any = true;
      require_size(camera, known->image_size, file);
      known->model = camera.model;
      known->timing = camera.timing;
      if (!rig.uncertainty) continue;
      const auto& of = rig.uncertainty->cameras[static_cast<std::size_t>(*rig.index_of(camera.name))];
      known->lens_covariance = rig.uncertainty->covariance().block(of.at, of.at, of.lens_count, of.lens_count);
    }
    if (!any) throw gather::InputError(file + ": has none of the calibrated cameras: are the names the same?");
  }
  return cameras;
}

void refuse_repeated(const std::vector<std::string>& cameras) {
  for (auto camera = cameras.begin(); camera != cameras.end(); ++camera) {
    if (std::find(cameras.begin(), camera, *camera) != camera)
      throw gather::InputError("--cameras: " + *camera + " is given twice");
  }
}

// An error names what the images say against the board file, too.
solver::Extrinsics calibrated(const gather::FoundBoards& all, const std::vector<solver::CameraToCalibrate>& cameras,
                              const solver::ExtrinsicsOptions& solve) {
  try {
    return solver::calibrate_extrinsics(all.board, cameras, all.views, solve);
  } catch (const solver::CalibrationError& error) {
    if (all.board_doubt.empty()) throw;
    throw gather::InputError(report::with_advice(error) + "; " + all.board_doubt);
  }
}

ExitStatus calibrate(const ExtrinsicsArguments& options, const std::stop_token& stop) {
  require_folders(output_files(options));
  refuse_repeated(options.cameras);
  const std::optional<calib::CameraRig> before = rig_before(options);
  const board::Board board = board::read_board(options.board);
  gather::GatherOptions gather;
  gather.pictures = {.only = options.cameras, .tolerance_s = options.tolerance_s};
  gather.find = options.find;
  gather.find.progress = !options.quiet;
  gather.find.least_cameras = 2;
  gather.live = options.live;
  gather::FoundBoards all = gather::gather_boards(options.inputs, board, gather, stop);
  if (all.cameras.size() < 2) {
    throw gather::InputError("there is only one camera, " + all.cameras.front().name +
                             ": extrinsics needs two or more; for its lens use huetrack-calibrate intrinsics");
  }
  const auto cameras = cameras_of(all, options.intrinsics);
  gather::ProgressLine line(!options.quiet);
  solver::ExtrinsicsOptions solve;
  solve.refine_lens = options.refine;
  solve.intrinsics.lens = options.lens;
  solve.leave_out = true;
  solve.progress = line.progress();
  solver::Extrinsics result = calibrated(all, cameras, solve);
  line.draw("writing the report");
  const std::vector<report::CameraLeftOut> left_out = left_out_of(all, result);
  const gather::FoundBoards found = kept_of(std::move(all), result);
  report::ReportInput input = report_input(found, options.inputs);
  input.left_out = left_out;
  line.clear();
  choose_world(result, options, before, input);
  if (!options.volume.empty()) {
    const auto& v = options.volume;
    input.volume = solver::WorldBox{{v[0], v[2], v[4]}, {v[1], v[3], v[5]}};
  }
  const report::CalibrationReport report = report::report_on(result, input);
  line.clear();
  calib::CameraRig rig = solver::rig_of(result.adjustment);
  if (report.volume) rig.uncertainty = solver::uncertainty_of(result.adjustment, *report.volume);
  return put_out(report, std::move(rig), found, output_files(options));
}

}  // namespace

void add_extrinsics_command(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<ExtrinsicsArguments>();
  CLI::App* command =
      app.add_subcommand("extrinsics", "calibrate all cameras in one world, from a board carried through the volume");
  add_calibration_options(*command, *options);
  command->get_option("inputs")->description(
      "a recording, or for each camera NAME=FRAMES (a video or images) or NAME=/dev/... (live)");
  command->add_option("--rig", options->rig, "the rig file to write")->required();
  command->add_option("--cameras", options->cameras, "only these, separated by commas; the first one is the reference")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      ->add_option("--intrinsics", options->intrinsics,
                   "a rig file with known lenses, and perhaps timing; may be repeated")
      ->allow_extra_args(false);
  const std::map<std::string, solver::RefineLens> refine{
      {"auto", solver::RefineLens::automatic}, {"yes", solver::RefineLens::yes}, {"no", solver::RefineLens::no}};
  command
      ->add_option("--refine-lens", options->refine,
                   "refine the lenses in the joint adjustment; auto (default): unknown ones, and those that the views "
                   "contradict")
      ->transform(CLI::CheckedTransformer(refine).description(""))
      ->type_name("auto|yes|no");
  command->add_option("--tolerance", options->tolerance_s, "seconds; maximum time difference within a frame set")
      ->check(CLI::PositiveNumber);
  command->add_option("--world-of", options->world_of, "keep the world of this rig, instead of that of --rig");
  command->add_flag("--new-world", options->new_world,
                    "start a new world; default: that of the replaced rig, if its cameras did not move");
  command->add_option("--volume", options->volume, "x0 x1 y0 y1 z0 z1, metres: volume of the expected accuracy")
      ->expected(6);
  command->callback(
      [options, &chosen] { chosen = [options](const std::stop_token& stop) { return calibrate(*options, stop); }; });
}

}  // namespace huetrack::program
