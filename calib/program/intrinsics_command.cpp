#include "calib/board/board_yaml.h"
#include "calib/files/text_file.h"
#include "calib/gather/progress_line.h"
#include "calib/program/calibration_options.h"
#include "calib/program/commands.h"
#include "calib/solver/intrinsics.h"
#include "calib/solver/volume_accuracy.h"

namespace huetrack::program {
namespace {

struct IntrinsicsArguments : CalibrationOptions {
  std::string camera;
};

ExitStatus calibrate(IntrinsicsArguments options, const std::stop_token& stop) {
  if (files::has_control_characters(options.camera))
    throw gather::InputError("--camera \"" + options.camera + "\" has control characters in it");
  if (options.rig.empty()) options.rig = options.camera + ".yaml";
  require_folders(output_files(options));
  const board::Board board = board::read_board(options.board);
  gather::GatherOptions gather;
  gather.pictures.only = {options.camera};
  gather.alone = true;
  gather.find = options.find;
  gather.find.progress = !options.quiet;
  gather.live = options.live;
  const gather::FoundBoards found = gather::gather_boards(options.inputs, board, gather, stop);
  gather::require_views(found, solver::IntrinsicsOptions{}.min_views);
  gather::ProgressLine line(!options.quiet);
  const solver::Intrinsics result =
      solver::calibrate_intrinsics(found.board, options.camera, found.cameras.front().image_size, found.views,
                                   {.lens = options.lens, .progress = line.progress()});
  line.draw("writing the report");
  const report::CalibrationReport report = report::report_on(result, report_input(found, options.inputs));
  line.clear();
  calib::CameraRig rig = solver::rig_of(result.adjustment);
  rig.uncertainty = solver::uncertainty_of(result.adjustment, {});
  return put_out(report, std::move(rig), found, output_files(options));
}

}  // namespace

void add_intrinsics_command(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<IntrinsicsArguments>();
  CLI::App* command = app.add_subcommand("intrinsics", "calibrate the lens of one camera from images of a board");
  add_calibration_options(*command, *options);
  command->get_option("inputs")->description(
      "images, a video, a folder of images, a recording, or a live camera (/dev/...)");
  command->add_option("--camera", options->camera, "the camera's name")->required();
  command->add_option("--rig", options->rig, "the file to write; default: CAMERA.yaml");
  command->callback(
      [options, &chosen] { chosen = [options](const std::stop_token& stop) { return calibrate(*options, stop); }; });
}

}  // namespace huetrack::program
