// huetrack-calibrate map: the expected error over the volume.
#include <CLI/CLI.hpp>
#include <Eigen/LU>
#include <algorithm>
#include <cstdio>
#include <memory>

#include "calib/files/text_file.h"
#include "calib/gather/write_file.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/commands.h"
#include "calib/program/outcome.h"
#include "calib/report/map_report.h"
#include "calib/yaml/yaml_reader.h"
#include "config/service_config.h"

namespace huetrack::program {
namespace {

struct MapOptions {
  std::string file, report;
  std::vector<double> volume;
  double noise_px = 0.5;
  int next = 3;
};

// A volume around the point nearest to the cameras' axes.
solver::WorldBox volume_before(const calib::CameraRig& rig) {
  Eigen::Matrix3d sum = 1e-6 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const calib::Camera& camera : rig.cameras) {
    const Eigen::Vector3d axis = camera.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    sum += across;
    right += across * camera.centre();
  }
  const Eigen::Vector3d middle = sum.inverse() * right;
  double nearest = 1e9;
  for (const calib::Camera& camera : rig.cameras) nearest = std::min(nearest, (camera.centre() - middle).norm());
  constexpr double share = 0.4;  // of the distance to the nearest camera
  return {middle - Eigen::Vector3d::Constant(share * nearest), middle + Eigen::Vector3d::Constant(share * nearest)};
}

void require_two(const calib::CameraRig& rig, const std::string& file) {
  if (rig.cameras.size() < 2)
    throw gather::InputError(file +
                             ": one camera: a map is of the positions that two or more see. With one, a ball's "
                             "distance follows from its size: a tenth of a pixel of a radius of 7 px is 1.4 % of it");
}

ExitStatus map(const MapOptions& o) {
  calib::CameraRig rig;
  solver::WorldBox box;
  report::MapInput input{.rig_name = files::printable(std::filesystem::path(o.file).filename().string()),
                         .volume_is_from = {}};
  if (yaml::YamlReader::file(o.file).has("rig")) {
    const config::ServiceConfig config = config::load_service_config(o.file);
    config::require_rig(config);
    rig = config.rig;
    require_two(rig, o.file);
    box = {config.object_tracking.volume.min, config.object_tracking.volume.max};
    input.volume_is_from = "the volume of the configuration";
  } else {
    rig = calib::read_rig(o.file);
    require_two(rig, o.file);
    box = volume_before(rig);
    input.volume_is_from = "around the centre of the cameras' views (set it with --volume)";
  }
  if (!o.volume.empty()) {
    box = {{o.volume[0], o.volume[2], o.volume[4]}, {o.volume[1], o.volume[3], o.volume[5]}};
    input.volume_is_from = "from --volume";
    if (!(box.low.array() < box.high.array()).all())
      throw gather::InputError("--volume: x0 x1 y0 y1 z0 z1, each first number less than its second");
  }
  constexpr std::array<int, 3> steps{17, 17, 9};
  const solver::VolumeAccuracy accuracy = solver::predict_accuracy(rig, box, steps, o.noise_px);
  const auto next = solver::next_camera_places(rig, accuracy, static_cast<std::size_t>(o.next));
  const report::MapReport report = report::map_report(rig, accuracy, next, input);
  std::fputs(report::to_text(report.document).c_str(), stdout);
  if (!o.report.empty()) write_document(report.document, o.report);
  return status_of(report.verdict);
}

}  // namespace

void add_map_command(CLI::App& app, Command& chosen) {
  const auto o = std::make_shared<MapOptions>();
  CLI::App* command = app.add_subcommand("map", "the expected error over the volume, and where another camera helps");
  command->add_option("file", o->file, "a rig file, or huetrackd.yaml with its volume")->required();
  command->add_option("--volume", o->volume, "x0 x1 y0 y1 z0 z1, metres")->expected(6);
  command->add_option("--noise-px", o->noise_px, "standard deviation of the object's centre in an image (default 0.5)")
      ->check(CLI::PositiveNumber);
  command->add_option("--next", o->next, "number of places to suggest for another camera (default 3)")
      ->check(CLI::Range(0, 9));
  command->add_option("--report", o->report, "write the report: NAME.html and NAME.pdf");
  command->callback([o, &chosen] { chosen = [o](const std::stop_token&) { return map(*o); }; });
}

}  // namespace huetrack::program
