#include "calib/exchange/exchange.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "calib/exchange/exchanged_camera.h"
#include "calib/files/config_error.h"
#include "recordings/bags/bag.h"

namespace huetrack::exchange {

namespace {

// The point nearest to all optical axes, as the cameras see it; lens distortion aside.
struct Middle {
  bool is_in_all_pictures = false;
  double distance = 0;  // mean depth
  double widest = 0;    // between two cameras
};

Middle middle_of(const std::vector<calib::Camera>& cameras) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  Middle middle{.is_in_all_pictures = cameras.size() > 1};
  for (const calib::Camera& camera : cameras) {
    const Eigen::Vector3d axis = camera.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    normal += across;
    right += across * camera.centre();
    for (const calib::Camera& other : cameras)
      middle.widest = std::max(middle.widest, (camera.centre() - other.centre()).norm());
  }
  const Eigen::Vector3d point = normal.ldlt().solve(right);
  for (const calib::Camera& camera : cameras) {
    const Eigen::Vector3d p = camera.cam_from_world * point;
    const double u = camera.model.fx() * p.x() / p.z() + camera.model.cx();
    const double v = camera.model.fy() * p.y() / p.z() + camera.model.cy();
    middle.is_in_all_pictures = middle.is_in_all_pictures && p.z() > 0 && u >= 0 && v >= 0 &&
                                u < camera.image_size.width && v < camera.image_size.height;
    middle.distance += p.z() / double(cameras.size());
  }
  return middle;
}

// What a file may mean by its poses instead of cam_from_world in our axes.
void invert_poses(std::vector<calib::Camera>& cameras) {
  for (calib::Camera& camera : cameras) camera.cam_from_world = calib::inverse(camera.cam_from_world);
}

void turn_opengl_axes(std::vector<calib::Camera>& cameras) {
  const calib::Rigid3d about_x{Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero()};
  for (calib::Camera& camera : cameras) camera.cam_from_world = about_x * camera.cam_from_world;
}

// Whether there is a place that all cameras see, however far away; lens distortion aside.
bool see_a_place(const std::vector<calib::Camera>& cameras, double widest) {
  constexpr int steps = 8;  // layout: places across the first camera's picture; distances, each twice the last
  const calib::Camera& first = cameras.front();
  const calib::Rigid3d world_from_first = calib::inverse(first.cam_from_world);
  const auto is_seen_by = [](const calib::Camera& camera, const Eigen::Vector3d& place) {
    const Eigen::Vector3d p = camera.cam_from_world * place;
    const double u = camera.model.fx() * p.x() / p.z() + camera.model.cx();
    const double v = camera.model.fy() * p.y() / p.z() + camera.model.cy();
    return p.z() > 0 && u >= 0 && v >= 0 && u < camera.image_size.width && v < camera.image_size.height;
  };
  for (int i = 0; i < steps * steps * steps; ++i) {
    const double u = (i % steps + 0.5) / steps * first.image_size.width;
    const double v = (i / steps % steps + 0.5) / steps * first.image_size.height;
    const double far = widest / 4 * std::exp2(i / (steps * steps));
    const Eigen::Vector3d place =
        world_from_first * Eigen::Vector3d(far * (u - first.model.cx()) / first.model.fx(),
                                           far * (v - first.model.cy()) / first.model.fy(), far);
    if (std::ranges::all_of(cameras, [&](const calib::Camera& camera) { return is_seen_by(camera, place); }))
      return true;
  }
  return false;
}

// Cameras that see no place in common, but do with OpenGL's axes, perhaps of inverted poses: the file is of that kind.
void check_axes(const std::vector<calib::Camera>& cameras, const ImportOptions& options, Imported& out) {
  if (options.has_opengl_axes || see_a_place(cameras, middle_of(cameras).widest)) return;
  for (const bool inverts : {false, true}) {
    std::vector<calib::Camera> other = cameras;
    if (inverts) invert_poses(other);
    turn_opengl_axes(other);
    const Middle middle = middle_of(other);
    if (!middle.is_in_all_pictures || (inverts && options.inverts_poses)) continue;
    out.is_doubtful = true;
    out.notes.push_back(
        fmt::format("the cameras see no place in common; with the axes of OpenGL, Blender or NeRF (y up, z backwards; "
                    "--camera-axes opengl{}) they are up to {:.3f} m apart and look at a place {:.2f} m away: the file "
                    "is probably of that kind",
                    inverts ? " --inverted-poses" : "", middle.widest, middle.distance));
    return;
  }
}

// Where the cameras are, for a person to recognise a wrong unit and inverted poses: world_from_cam where cam_from_world
// is expected, the commonest mistake. Neither can be known from the poses alone, since the world's origin may be
// anywhere.
void check_placement(const std::vector<calib::Camera>& cameras, bool is_inverted, Imported& out) {
  const Middle as_it_is = middle_of(cameras);
  std::string note = fmt::format("the cameras are up to {:.3f} m apart", as_it_is.widest);
  if (as_it_is.is_in_all_pictures) note += fmt::format(" and look at a place {:.2f} m away", as_it_is.distance);
  note += ": if that is wrong, give --unit";
  std::vector<calib::Camera> inverted = cameras;
  invert_poses(inverted);
  const Middle other = middle_of(inverted);
  // With inverted poses, cameras around a place seem to be near one point.
  const bool may_be_inverted = other.is_in_all_pictures && other.widest > as_it_is.widest && !is_inverted;
  if (may_be_inverted) {
    const std::string what = fmt::format(
        "the poses inverted (world_from_cam; --inverted-poses), they are up to {:.3f} m apart and look at a place "
        "{:.2f} m away",
        other.widest, other.distance);
    out.is_doubtful = !as_it_is.is_in_all_pictures;
    note += out.is_doubtful ? ". They do not look at one place; with " + what + ": the file is probably of that kind"
                            : "; with " + what;
  }
  out.notes.push_back(std::move(note));
}

}  // namespace

Imported import_rig(std::span<const std::filesystem::path> files, const ImportOptions& options) {
  if (files.empty()) throw ExchangeError("no file to import");
  const std::filesystem::path& file = files.front();
  if (const std::string problem = bags::problem_of_beginning(file); !problem.empty())
    throw files::ConfigError(file, 0, problem);
  Imported out = files.size() == 1 && bags::is_bag(file) ? import_bag(file, options) : imported_from(files, options);
  for (calib::Camera& camera : out.rig.cameras) camera.cam_from_world.translation *= options.metres_per_unit;
  if (options.inverts_poses) invert_poses(out.rig.cameras);
  if (options.has_opengl_axes) turn_opengl_axes(out.rig.cameras);
  const double widest = middle_of(out.rig.cameras).widest;
  constexpr double widest_rig_m = 50;  // a wider rig is probably in millimetres
  if (widest > widest_rig_m) {
    throw files::ConfigError(file, 0,
                             fmt::format("the cameras are up to {:.0f} m apart: if the file is in centimetres ({:.3g} "
                                         "m), give --unit cm, if in millimetres ({:.3g} m), --unit mm",
                                         widest, widest / 100, widest / 1000));
  }
  if (out.rig.cameras.size() > 1) check_placement(out.rig.cameras, options.inverts_poses, out);
  if (out.rig.cameras.size() > 1 && !out.is_doubtful) check_axes(out.rig.cameras, options, out);
  require_valid(out.rig, file);
  return out;
}

}  // namespace huetrack::exchange
