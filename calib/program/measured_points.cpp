#include "calib/program/measured_points.h"

#include <algorithm>

#include "calib/solver/world_frame.h"
#include "calib/yaml/yaml_reader.h"

namespace huetrack::program {
namespace {

Eigen::Vector3d vector_of(const yaml::YamlReader& reader, std::string_view key) {
  const auto n = reader.numbers(key, 3, 3, {.min = -1000, .max = 1000});
  return {n[0], n[1], n[2]};
}

}  // namespace

std::vector<PointOfWorld> read_points(const std::filesystem::path& file, const calib::CameraRig& rig) {
  const yaml::YamlReader reader = yaml::YamlReader::file(file);
  reader.version(1, 1);
  std::vector<PointOfWorld> points;
  for (const auto& [name, entry] : reader.named_maps("points")) {
    PointOfWorld point;
    point.name = name;
    if (entry.has("world")) point.in_world = vector_of(entry, "world");
    if (entry.has("position") == entry.has("pixels"))
      entry.fail("", "give either position (in the rig's present world) or pixels (of two or more cameras)");
    if (entry.has("position")) {
      point.in_rig = vector_of(entry, "position");
    } else {
      const yaml::YamlReader of_cameras = entry.map("pixels");
      std::vector<std::pair<int, Eigen::Vector2d>> pixels;
      for (const std::string& camera : of_cameras.keys()) {
        const auto index = rig.index_of(camera);
        if (!index) of_cameras.fail(camera, "is no camera of the rig");
        const auto px = of_cameras.numbers(camera, 2, 2, {.min = -0.5, .max = 1e5});
        pixels.emplace_back(*index, Eigen::Vector2d(px[0], px[1]));
      }
      of_cameras.finish();
      if (pixels.size() < 2)
        entry.fail("pixels", "must name at least two cameras: one alone does not determine the distance");
      const solver::MeasuredPoint measured = solver::measure_point(rig, pixels);
      point.in_rig = measured.p_world;
      point.rms_px = measured.rms_px;
    }
    entry.finish();
    points.push_back(std::move(point));
  }
  const auto placed = std::ranges::count_if(points, [](const PointOfWorld& p) { return p.in_world.has_value(); });
  if (placed != 0 && placed != static_cast<std::ptrdiff_t>(points.size()))
    reader.fail("points", "must either all have world, or none (points on the floor)");
  if (points.size() < 3) reader.fail("points", "must be three or more");
  reader.finish();
  return points;
}

std::vector<certify::MarkedPlace> read_places(const std::filesystem::path& file) {
  const yaml::YamlReader reader = yaml::YamlReader::file(file);
  std::vector<certify::MarkedPlace> places;
  const yaml::YamlReader map = reader.map("places");
  for (const std::string& name : map.keys()) {
    const auto p = map.numbers(name, 3, 3, yaml::any_number);
    places.push_back({name, {p[0], p[1], p[2]}});
  }
  map.finish();
  reader.finish();
  if (places.size() < 3) reader.fail("places", "give at least three places: name: [x, y, z], in metres");
  return places;
}

}  // namespace huetrack::program
