// ROS bags: the lenses of sensor_msgs/CameraInfo, and the poses that /tf_static has for their frames. An optical frame
// of ROS (REP 103) has our camera's axes.

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <optional>

#include "calib/exchange/exchanged_camera.h"
#include "calib/files/config_error.h"
#include "calib/files/text_file.h"
#include "recordings/bags/bag.h"
#include "recordings/bags/camera_topics.h"
#include "recordings/bags/messages.h"

namespace huetrack::exchange {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t deepest_tree = 100;  // capacity: frames from a camera up to the root; a circle has no root

// What /tf_static says: every frame's parent, and its pose there.
struct StaticFrames {
  std::map<std::string, std::pair<std::string, calib::Rigid3d>> parents;

  // The root of the frame's tree, and the frame's pose in it.
  std::optional<std::pair<std::string, calib::Rigid3d>> in_root(std::string frame) const {
    calib::Rigid3d root_from_camera;
    std::size_t depth = 0;
    for (auto at = parents.find(frame); at != parents.end(); at = parents.find(frame), ++depth) {
      if (depth == deepest_tree) return std::nullopt;
      const auto& [parent, pose] = at->second;
      root_from_camera = pose * root_from_camera;
      frame = parent;
    }
    return std::pair(frame, root_from_camera);
  }
};

StaticFrames static_frames_of(const fs::path& bag, const bags::Contents& contents) {
  StaticFrames frames;
  for (const bags::BagTopic& topic : contents.topics) {
    if (!bags::is_transform(topic) || !topic.name.ends_with("tf_static")) continue;
    bags::TopicReader messages(bag, topic.name);
    while (const auto message = messages.next()) {
      const auto transforms = bags::transforms_of(*message);
      if (!transforms) continue;
      for (const bags::TransformMessage& t : *transforms) {
        const auto& [x, y, z, w] = t.rotation_xyzw;
        const Eigen::Quaterniond rotation(w, x, y, z);
        if (!(std::abs(rotation.norm() - 1) < 1e-3)) continue;
        frames.parents[t.child] = {t.parent, {rotation.normalized(), Eigen::Vector3d(t.translation.data())}};
      }
    }
  }
  return frames;
}

struct BagLens {
  calib::Camera camera;
  std::string frame_id;
};

// nullopt: there is none, for the reason in `notes`.
std::optional<BagLens> lens_in(const fs::path& bag, const bags::CameraTopics& topics, std::vector<std::string>& notes) {
  const auto without = [&](const std::string& why) {
    notes.push_back("camera " + topics.camera + " " + why + ": calibrate its lens with huetrack-calibrate intrinsics");
    return std::nullopt;
  };
  if (topics.lens.empty()) return without("has no CameraInfo beside " + files::printable(topics.picture.name, 80));
  const auto message = bags::TopicReader(bag, topics.lens).next();
  const auto lens = message ? bags::lens_of(*message) : std::nullopt;
  if (!lens) return without("has no CameraInfo that can be read");
  if (lens->k[0] == 0 && lens->k[4] == 0)
    return without("has a CameraInfo of a camera that is not calibrated (K is 0)");
  const Fail fail = [&](std::string_view key, const std::string& problem) {
    throw files::ConfigError(bag, 0, files::printable(topics.lens, 80) + ": " + std::string(key) + " " + problem);
  };
  const bool is_fisheye_lens = lens->distortion_model == "equidistant";
  if (!is_fisheye_lens && lens->distortion_model != "plumb_bob" && lens->distortion_model != "rational_polynomial" &&
      !(lens->distortion_model.empty() && lens->d.empty()))
    fail("distortion_model", "is \"" + files::printable(lens->distortion_model) +
                                 "\"; plumb_bob, rational_polynomial and equidistant can be imported");
  if (lens->binning_x > 1 || lens->binning_y > 1 || std::ranges::any_of(lens->roi, [](auto side) { return side != 0; }))
    fail("binning or roi", "is set: a rig needs the calibration of the image that the camera delivers");
  BagLens out{.camera = {}, .frame_id = lens->frame_id};
  out.camera.name = clean_name(topics.camera);
  out.camera.image_size = {static_cast<int>(std::min<std::uint32_t>(lens->width, 1 << 15)),
                           static_cast<int>(std::min<std::uint32_t>(lens->height, 1 << 15))};
  out.camera.model = opencv_lens(lens->k, "k", lens->d, "d", is_fisheye_lens, fail);
  return out;
}

}  // namespace

Imported import_bag(const fs::path& bag, const ImportOptions& options) {
  const bags::Contents contents = bags::contents_of(bag);
  Imported out{.rig = {}, .notes = contents.warnings};
  std::vector<BagLens> lenses;
  for (const bags::CameraTopics& topics : bags::cameras_of(contents.topics)) {
    if (!options.cameras.empty() && std::ranges::find(options.cameras, topics.camera) == options.cameras.end())
      continue;
    if (auto lens = lens_in(bag, topics, out.notes)) lenses.push_back(std::move(*lens));
  }
  if (lenses.empty())
    throw files::ConfigError(
        bag, 0, "holds no lens of a camera: " + (out.notes.empty() ? "it has no topic of pictures" : out.notes.back()));
  const StaticFrames frames = static_frames_of(bag, contents);
  std::optional<std::string> world;
  bool are_placed = true;
  for (BagLens& lens : lenses) {
    const auto placed = frames.in_root(lens.frame_id);
    are_placed = are_placed && placed && frames.parents.contains(lens.frame_id) &&
                 world.value_or(placed->first) == placed->first;
    if (!are_placed) break;
    world = placed->first;
    lens.camera.cam_from_world = calib::inverse(placed->second);
  }
  if (!are_placed && lenses.size() > 1)
    throw files::ConfigError(
        bag, 0,
        "has lenses, but no poses: /tf_static does not lead from every camera's frame (frame_id) to a common one. "
        "Import each camera into its own file with --cameras NAME, then find the poses with extrinsics or wave");
  out.notes.push_back(are_placed
                          ? "the poses are those of /tf_static; the world is its frame " + files::printable(*world)
                          : "/tf_static has no pose of the camera's frame \"" +
                                files::printable(lenses.front().frame_id) + "\": the world is the camera's own frame");
  for (BagLens& lens : lenses) {
    if (!are_placed) lens.camera.cam_from_world = {};
    out.rig.cameras.push_back(std::move(lens.camera));
  }
  return out;
}

}  // namespace huetrack::exchange
