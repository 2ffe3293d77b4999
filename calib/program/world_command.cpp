#include <fmt/core.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>

#include "calib/board/board_yaml.h"
#include "calib/files/document_path.h"
#include "calib/gather/find_boards.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/commands.h"
#include "calib/program/measured_points.h"
#include "calib/program/outcome.h"
#include "calib/program/rig_pictures.h"
#include "calib/solver/extrinsics.h"
#include "calib/solver/world_frame.h"

namespace huetrack::program {
namespace {

struct WorldOptions {
  std::string rig, out, board, points;
  std::vector<std::string> inputs;
  double height_m = 0;
  std::optional<double> at_s;
  bool scale = false, overwrite = false, quiet = false;
};

struct NewWorld {
  calib::CameraRig rig;
  bool is_floor = true;             // z = 0 is the floor
  std::string how;                  // for made_by
  std::vector<std::string> doubts;  // one sentence each, with advice
  std::string details;              // for people
};

constexpr double good_px = 1.5;  // limit of the reprojection error of board or point

NewWorld from_board(const calib::CameraRig& rig, const WorldOptions& options, const std::stop_token& stop) {
  const gather::FoundBoards found = board_views_of(rig, options.rig, board::read_board(options.board), options.inputs,
                                                   {.progress = !options.quiet, .page = {}}, stop);
  const board::Board& board = found.board;
  // The requested time, or the set seen by most cameras.
  std::map<int, int> seen;
  for (const solver::BoardView& view : found.views) ++seen[view.set];
  int set = seen.begin()->first;
  for (const auto& [number, cameras] : seen) {
    const auto away = [&](int n) { return std::abs(found.set_at_s[static_cast<std::size_t>(n)] - *options.at_s); };
    if (options.at_s ? away(number) < away(set) : cameras > seen[set]) set = number;
  }
  std::vector<solver::BoardView> views;
  for (const solver::BoardView& view : found.views) {
    if (view.set == set) views.push_back(view);
  }
  NewWorld world;
  const solver::Adjustment placed =
      solver::adjust(solver::place_boards(board, rig, views), {.find_outliers = false, .with_covariance = false});
  const calib::Rigid3d& world_from_board = placed.world_from_board[static_cast<std::size_t>(set)];
  world.rig = solver::in_world(rig, {solver::floor_from_board(world_from_board, options.height_m), 1});
  world.how = fmt::format("the board on the floor at {:.2f} s, seen by {} cameras, {:.2f} px rms",
                          found.set_at_s[static_cast<std::size_t>(set)], views.size(), placed.rms_px);
  if (board.symmetries().size() > 1) {
    const calib::Camera& camera = rig.cameras[static_cast<std::size_t>(views.front().camera)];
    if (const auto origin = camera.project_world(world_from_board.translation))
      world.details += fmt::format(
          "  The board looks the same from several sides. The origin is the corner at pixel ({:.0f}, {:.0f}) of {}; a "
          "board with markers, or of asymmetric circles, leaves no choice.\n",
          origin->px.x(), origin->px.y(), camera.name);
  }
  if (!found.board_doubt.empty()) world.doubts.push_back(found.board_doubt);
  if (found.set_at_s.size() > 1 && !options.at_s) {
    world.doubts.push_back(
        fmt::format("the board moves in these images: its place at {:.2f} s is used; give --at SECONDS, or images of "
                    "the board at rest",
                    found.set_at_s[static_cast<std::size_t>(set)]));
  }
  if (views.size() == 1) {
    const solver::BoardView& view = views.front();
    const calib::Camera& camera = rig.cameras[static_cast<std::size_t>(view.camera)];
    const auto poses =
        solver::board_poses(board, view, solver::lens_model_of(camera.model), solver::parameters_of(camera.model));
    if (poses.size() > 1 && poses[1].rms_px < 2 * poses[0].rms_px + 0.1) {
      world.doubts.push_back(
          fmt::format("only {} sees the board, at so flat an angle that the mirrored pose fits as well ({:.2f} and "
                      "{:.2f} px): the floor may be tilted the wrong way; lay it where two cameras see it",
                      camera.name, poses[0].rms_px, poses[1].rms_px));
    }
  }
  if (placed.rms_px > good_px) {
    world.doubts.push_back(
        fmt::format("the cameras disagree on the board's place ({:.1f} px rms): does the rig still fit (test it with "
                    "huetrack-calibrate check), and is the board file right?",
                    placed.rms_px));
  }
  return world;
}

NewWorld from_points(const calib::CameraRig& rig, const WorldOptions& options) {
  const auto points = read_points(options.points, rig);
  std::vector<Eigen::Vector3d> from, to;
  for (const PointOfWorld& point : points) {
    from.push_back(point.in_rig);
    if (point.in_world) to.push_back(*point.in_world);
  }
  NewWorld world;
  for (const PointOfWorld& point : points) {
    if (point.rms_px && *point.rms_px > 2 * good_px) {
      world.doubts.push_back(
          fmt::format("the pixels of point {} are inconsistent, by {:.1f} px: are they of the same point?", point.name,
                      *point.rms_px));
    }
  }
  solver::WorldChange change;
  if (to.empty()) {
    change.new_from_old = solver::floor_from_points(from, rig);
    world.how = std::to_string(points.size()) + " points on the floor";
  } else {
    const double scale = solver::align_points(from, to, true).scale;
    change = solver::align_points(from, to, options.scale);
    world.is_floor = false;
    world.how = std::to_string(points.size()) + " measured points";
    if (options.scale) world.how += fmt::format(", scale {:.5f}", change.scale);
    if (!options.scale && std::abs(scale - 1) > 0.01) {
      world.doubts.push_back(
          fmt::format("by these points all lengths of the rig are to be multiplied by {:.4f}: the board's square size "
                      "was probably wrong by that factor; --scale applies it",
                      scale));
    }
  }
  double extent = 0;
  for (const auto& p : to) extent = std::max(extent, (p - to.front()).norm());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Eigen::Vector3d p = change * points[k].in_rig;
    const double off = to.empty() ? std::abs(p.z()) : (p - to[k]).norm();
    world.details += fmt::format("  {:12} at ({:.3f}, {:.3f}, {:.3f}) m, error {:.1f} mm\n", points[k].name, p.x(),
                                 p.y(), p.z(), 1000 * off);
    const double allowed = to.empty() ? 0.02 : std::max(0.01, 0.01 * extent);
    if (off > allowed) {
      world.doubts.push_back(
          fmt::format("point {} has an error of {:.0f} mm: was it measured right, and at the same spot in every image?",
                      points[k].name, 1000 * off));
    }
  }
  world.rig = solver::in_world(rig, change);
  return world;
}

ExitStatus set_world(const WorldOptions& options, const std::stop_token& stop) {
  const calib::CameraRig rig = calib::read_rig(options.rig);
  if (options.board.empty() == options.points.empty())
    throw gather::InputError(
        "nothing defines the world: give --board BOARD.yaml and images of it on the floor, or --points POINTS.yaml");
  NewWorld world = options.points.empty() ? from_board(rig, options, stop) : from_points(rig, options);
  for (const calib::Camera& camera : world.rig.cameras) {
    if (camera.centre().z() > 0) continue;
    const std::string below = fmt::format("camera {} would be {:.2f} m below z = 0", camera.name, -camera.centre().z());
    if (world.is_floor) {
      throw gather::InputError(below +
                               ", under the floor: the points are not on the floor, the board lies face down, or the "
                               "rig is mirrored (are the camera's images?); nothing was written");
    }
    world.doubts.push_back(below + ": does z point up in the measured points?");
  }
  note_in(world.rig, "world", world.how);
  const auto out = place_for(world.doubts.empty() ? report::Verdict::usable : report::Verdict::doubtful,
                             options.out.empty() ? options.rig : options.out, options.overwrite);
  calib::write_rig(world.rig, out);
  if (!options.quiet) {
    std::printf("The world is defined by %s.\n%s", world.how.c_str(), world.details.c_str());
    for (const std::string& doubt : world.doubts) std::printf("  ? %s.\n", doubt.c_str());
    for (const calib::Camera& camera : world.rig.cameras) {
      const Eigen::Vector3d c = camera.centre();
      std::printf("  %-12s at (%.3f, %.3f, %.3f) m\n", camera.name.c_str(), c.x(), c.y(), c.z());
    }
    std::printf("written: %s\n", out.c_str());
  }
  return world.doubts.empty() ? ExitStatus::usable : ExitStatus::doubtful;
}

}  // namespace

void add_world_command(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<WorldOptions>();
  CLI::App* command = app.add_subcommand("world", "set origin, axes and scale of a rig's world");
  command->add_option("rig", options->rig, "the rig file")->required();
  command->add_option("inputs", options->inputs, "images of the board on the floor: a recording, or NAME=FRAMES");
  command->add_option(
      "--board", options->board,
      "the board file; the board lies on the floor, its point 0 becomes the origin, x along its rows, z up");
  command->add_option("--height", options->height_m, "of the board's surface above the floor, metres")
      ->check(CLI::Range(0.0, 1.0));
  command->add_option("--at", options->at_s, "time in the recording, seconds; default: when most cameras see it");
  command->add_option("--points", options->points,
                      "a file of three or more measured points; see " + files::document_path("calib/README.md"));
  command->add_flag("--scale", options->scale, "also take the scale from the points");
  command->add_flag("--overwrite", options->overwrite, "a doubtful result may replace an existing rig");
  command->add_option("--out", options->out, "the rig file to write; default: in place");
  command->add_flag("--quiet", options->quiet, "print nothing but errors");
  command->callback(
      [options, &chosen] { chosen = [options](const std::stop_token& stop) { return set_world(*options, stop); }; });
}

}  // namespace huetrack::program
