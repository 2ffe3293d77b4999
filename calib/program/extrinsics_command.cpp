#include <algorithm>

#include "calib/board/board_yaml.h"
#include "calib/gather/progress_line.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/calibration_options.h"
#include "calib/program/commands.h"
#include "calib/solver/world_frame.h"

namespace huetrack::program {
namespace {

struct ExtrinsicsOptions : CalibrationOptions {
  std::vector<std::string> cameras, intrinsics;
  solver::RefineLens refine = solver::RefineLens::automatic;
  std::optional<double> tolerance_s;
  std::vector<double> volume;
};

// The lenses and times that were given, for the cameras that were seen.
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
      if (camera.image_size != known->image_size) {
        throw gather::InputError(
            file + ": camera " + camera.name + " was calibrated at " + std::to_string(camera.image_size.width) + "x" +
            std::to_string(camera.image_size.height) + ", its pictures are " + std::to_string(known->image_size.width) +
            "x" + std::to_string(known->image_size.height));
      }
      known->model = camera.model;
      known->timing = camera.timing;
      if (!rig.uncertainty) continue;
      const auto& of = rig.uncertainty->cameras[static_cast<std::size_t>(*rig.index_of(camera.name))];
      known->lens_covariance = rig.uncertainty->covariance().block(of.at, of.at, of.lens_count, of.lens_count);
    }
    if (!any) throw gather::InputError(file + ": has none of the cameras that are calibrated: are the names the same?");
  }
  return cameras;
}

ExitStatus calibrate(const ExtrinsicsOptions& options, const std::stop_token& stop) {
  const board::Board board = board::read_board(options.board);
  gather::GatherOptions gather;
  gather.pictures = {.only = options.cameras, .tolerance_s = options.tolerance_s};
  gather.find = options.find;
  gather.find.progress = !options.quiet;
  gather.live = options.live;
  const gather::FoundBoards found = gather::gather_boards(options.inputs, board, gather, stop);
  if (found.cameras.size() < 2) {
    throw gather::InputError("there is one camera only, " + found.cameras.front().name +
                             ": extrinsics are of two or more; its lens alone: huetrack-calibrate intrinsics");
  }
  const auto cameras = cameras_of(found, options.intrinsics);
  if (std::ranges::any_of(cameras, [](const solver::CameraToCalibrate& camera) { return !camera.model; }))
    gather::require_views(found, solver::IntrinsicsOptions{}.min_views);
  gather::ProgressLine line(!options.quiet);
  solver::ExtrinsicsOptions solve;
  solve.refine_lens = options.refine;
  solve.intrinsics.lens = options.lens;
  solve.progress = line.progress();
  solver::Extrinsics result = solver::calibrate_extrinsics(board, cameras, found.views, solve);
  line.draw("writing the report");
  result.adjustment = solver::in_world(std::move(result.adjustment), solver::upright_guess(result.adjustment));
  report::ReportInput input = report_input(found, options.inputs);
  input.made_of.emplace_back("world", "a guess: z up as the cameras are held, origin amid the board's places");
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
  const auto options = std::make_shared<ExtrinsicsOptions>();
  CLI::App* command =
      app.add_subcommand("extrinsics", "find all cameras in one world, from a board carried through the volume");
  add_calibration_options(*command, *options);
  command->get_option("inputs")->description(
      "a recording, or for each camera NAME=FRAMES (a video or images) or NAME=/dev/... (live)");
  command->add_option("--rig", options->rig, "the rig file to write")->required();
  command
      ->add_option("--cameras", options->cameras,
                   "only these, with commas between them; the first one is the reference")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      ->add_option("--intrinsics", options->intrinsics,
                   "a rig file with lenses, and perhaps timing, that are known already; may come more than once")
      ->allow_extra_args(false);
  const std::map<std::string, solver::RefineLens> refine{
      {"auto", solver::RefineLens::automatic}, {"yes", solver::RefineLens::yes}, {"no", solver::RefineLens::no}};
  command
      ->add_option("--refine-lens", options->refine,
                   "move the lenses too in the joint adjustment; auto (default): those that are not known, and those "
                   "that the views contradict")
      ->transform(CLI::CheckedTransformer(refine).description(""))
      ->type_name("auto|yes|no");
  command
      ->add_option_function<double>(
          "--tolerance", [options](const double& s) { options->tolerance_s = s; },
          "seconds; frames of different cameras this far apart are of one moment")
      ->check(CLI::PositiveNumber);
  command->add_option("--volume", options->volume, "x0 x1 y0 y1 z0 z1, metres: for the expected accuracy")->expected(6);
  command->callback(
      [options, &chosen] { chosen = [options](const std::stop_token& stop) { return calibrate(*options, stop); }; });
}

}  // namespace huetrack::program
