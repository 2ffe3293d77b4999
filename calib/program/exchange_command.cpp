// huetrack-calibrate import, export: calibrations of other tools.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <map>
#include <memory>

#include "calib/exchange/exchange.h"
#include "calib/files/output_file.h"
#include "calib/files/text_file.h"
#include "calib/gather/picture_source.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/commands.h"
#include "calib/program/outcome.h"

namespace huetrack::program {
namespace {

struct ImportCommand {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> cameras;
  std::vector<std::string> keys;
  std::string from, size, unit = "m", distortion_model;
  bool has_inverted_poses = false;
  std::string axes = "opencv";
  bool overwrite = false;
  std::filesystem::path rig;
};

// Notes quote the other tool's file.
void print_notes(const std::vector<std::string>& notes) {
  for (const auto& note : notes) std::printf("note: %s\n", files::printable(note, files::longest_message).c_str());
}

// Of words K=theirs.
std::vector<std::pair<std::string, std::string>> renamings_of(const std::vector<std::string>& words) {
  static const std::map<std::string, std::string> known{
      {"K", "K"}, {"D", "D"}, {"pose", "cam_from_world"}, {"inverse_pose", "world_from_cam"}, {"size", "image_size"}};
  std::vector<std::pair<std::string, std::string>> renamings;
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    const auto ours = known.find(word.substr(0, equals));
    if (equals == std::string::npos || equals + 1 == word.size() || ours == known.end())
      throw gather::InputError("--keys is K=, D=, pose=, inverse_pose= or size= with the file's own key, not " + word);
    renamings.emplace_back(word.substr(equals + 1), ours->second);
  }
  return renamings;
}

ExitStatus import(const ImportCommand& command) {
  exchange::ImportOptions options;
  if (!command.from.empty()) options.format = exchange::exchange_format_of(command.from);
  static const std::map<std::string, double> units{{"m", 1}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}};
  if (const auto unit = units.find(command.unit); unit != units.end()) {
    options.metres_per_unit = unit->second;
  } else {
    char* end = nullptr;  // a number: the board's square, which OpenCV's samples use as unit
    options.metres_per_unit = std::strtod(command.unit.c_str(), &end);
    if (*end != 0 || !(options.metres_per_unit > 0))
      throw gather::InputError("--unit is m, cm, mm, in, or a unit's length in metres, not " + command.unit);
  }
  if (!command.size.empty()) {
    calib::ImageSize size;
    char rest = 0;
    if (std::sscanf(command.size.c_str(), "%dx%d%c", &size.width, &size.height, &rest) != 2 || size.width < 1 ||
        size.height < 1)
      throw gather::InputError("--size is WIDTHxHEIGHT in pixels, as 640x480, not " + command.size);
    options.image_size = size;
  }
  options.cameras = command.cameras;
  options.keys = renamings_of(command.keys);
  options.distortion_model = command.distortion_model;
  options.inverts_poses = command.has_inverted_poses;
  options.has_opengl_axes = command.axes == "opengl";
  const exchange::Imported imported = exchange::import_rig(command.files, options);
  print_notes(imported.notes);
  const report::Verdict verdict = imported.is_doubtful ? report::Verdict::doubtful : report::Verdict::usable;
  const std::filesystem::path written = place_for(verdict, command.rig, command.overwrite);
  calib::write_rig(imported.rig, written);
  std::printf("%s: %zu camera%s\n", written.c_str(), imported.rig.cameras.size(),
              imported.rig.cameras.size() == 1 ? "" : "s");
  if (imported.is_doubtful) std::printf("doubtful: the last note says why\n");
  return status_of(verdict);
}

struct ExportCommand {
  std::filesystem::path rig, folder;
  std::string to, extension = "yml";
  bool stereo = false, force = false;
};

ExitStatus export_files(const ExportCommand& command) {
  const exchange::ExportOptions options{
      .format = *exchange::exchange_format_of(command.to), .extension = command.extension, .stereo = command.stereo};
  exchange::Exported exported;
  try {
    exported = exchange::export_rig(calib::read_rig(command.rig), options);
  } catch (const exchange::ExchangeError& error) {
    throw gather::InputError(command.rig.string() + ": " + error.what());
  }
  for (const auto& [name, text] : exported.files) {
    const std::filesystem::path file = command.folder / name;
    std::error_code not_there;
    if (std::filesystem::equivalent(file, command.rig, not_there))
      throw gather::InputError(file.string() + " is the rig that is read: give another --out");
    if (!command.force && std::filesystem::exists(file))
      throw gather::InputError(file.string() + " exists: give another --out, or --force");
  }
  std::filesystem::create_directories(command.folder);
  for (const auto& [name, text] : exported.files) {
    const std::filesystem::path file = command.folder / name;
    files::write_whole_file(file, text);
    std::printf("%s\n", file.c_str());
  }
  print_notes(exported.notes);
  return ExitStatus::usable;
}

}  // namespace

void add_exchange_commands(CLI::App& app, Command& chosen) {
  const auto in = std::make_shared<ImportCommand>();
  CLI::App* import_command = app.add_subcommand("import", "convert another tool's calibration to a rig file");
  import_command->add_option("files", in->files, "the other tool's file, those that belong together, or a ROS bag")
      ->required();
  import_command->add_option("--from", in->from, "the tool; default: recognised by its keys")
      ->check(CLI::IsMember(exchange::exchange_format_names(false)));
  import_command->add_option("--rig", in->rig, "the rig file to write")->required();
  import_command->add_option("--size", in->size, "WIDTHxHEIGHT of the images, for files without it");
  import_command->add_option("--cameras", in->cameras, "only these, separated by commas")
      ->delimiter(',')
      ->allow_extra_args(false);
  import_command->add_option("--unit", in->unit,
                             "of the file's lengths: m (default), cm, mm, in, or its length in metres");
  import_command
      ->add_option("--keys", in->keys,
                   "the file's own keys, separated by commas: K=my_matrix,D=my_coefficients,pose=my_4x4 "
                   "(cam_from_world; inverse_pose=: world_from_cam),size=my_size")
      ->delimiter(',')
      ->allow_extra_args(false);
  import_command->add_option(
      "--distortion-model", in->distortion_model,
      "instead of the file's: plumb_bob, radtan, rational_polynomial, equidistant, fisheye, none");
  import_command->add_flag("--inverted-poses", in->has_inverted_poses,
                           "the file's poses are world_from_cam, not cam_from_world");
  import_command
      ->add_option("--camera-axes", in->axes,
                   "of the file's cameras: opencv (default: y down, z forwards) or opengl (y up, z backwards)")
      ->check(CLI::IsMember({"opencv", "opengl"}));
  import_command->add_flag("--overwrite", in->overwrite, "a doubtful result may replace an existing rig");
  import_command->callback([in, &chosen] { chosen = [in](const std::stop_token&) { return import(*in); }; });

  const auto out = std::make_shared<ExportCommand>();
  CLI::App* export_command = app.add_subcommand("export", "convert a rig to another tool's files");
  export_command->add_option("rig", out->rig, "the rig file")->required();
  export_command->add_option("--to", out->to, "the tool")
      ->required()
      ->check(CLI::IsMember(exchange::exchange_format_names(true)));
  export_command->add_option("--out", out->folder, "the folder to write to")->required();
  export_command->add_option("--extension", out->extension, "opencv: yml (default), xml or json");
  export_command->add_flag("--stereo", out->stereo, "opencv: two cameras in one file (M1 D1 M2 D2 R T)");
  export_command->add_flag("--force", out->force, "overwrite existing files");
  export_command->callback([out, &chosen] { chosen = [out](const std::stop_token&) { return export_files(*out); }; });
}

}  // namespace huetrack::program
