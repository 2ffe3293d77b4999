// The map of a camera tracker: points with their covariance and their appearance in stored key frames.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/corners.h"
#include "camera_tracking/grey_image.h"
#include "camera_tracking/swept_pose.h"

namespace huetrack::camera_tracking {

struct Keyframe {
  std::shared_ptr<const Pyramid> pyramid;
  calib::Rigid3d cam_from_world;  // of its middle row
  Sweep sweep = {};

  SweptPose pose() const { return {cam_from_world, sweep}; }
};

// A point's appearance in a key frame.
struct PointView {
  int keyframe = -1;                             // index into SceneMap::keyframes
  int level = 0;                                 // of the pyramid, at which it was found
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw, level 0
  Descriptor descriptor{};
  bool has_descriptor = false;  // false: too near to the image's border
};

struct MapPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();    // world, metres
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // m^2
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();      // of its surface, world, unit; zero: towards views[0]'s camera
  std::array<PointView, 4> views;                        // views[0] is its first sighting
  int view_count = 0;
  bool given = false;                              // a start point
  bool alive = true;                               // false: removed as wrong; indices stay
  std::array<std::uint16_t, 2> found_of_sought{};  // recent counts: found, searched for

  PointView& view(int k) { return views[static_cast<std::size_t>(k)]; }
  const PointView& view(int k) const { return views[static_cast<std::size_t>(k)]; }
};

// A measurement of a map point in a key frame.
struct PointSighting {
  int keyframe = 0;
  int point = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw
  double sigma_px = 1;
};

// A corner of a key frame with a Gaussian inverse depth that is still being estimated (depth filter).
struct PointSeed {
  PointView view;                                  // without a descriptor
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();  // unit, camera frame at the exposure of its row
  double inverse_depth = 1, sigma = 1;             // along the ray, 1/m
  double row_px_per_s = 0;                         // d px / d readout: image speed times Sweep::fraction(row)
};

struct SceneMap {
  std::vector<MapPoint> points;
  std::vector<PointSeed> seeds;  // not stored
  std::vector<Keyframe> keyframes;
  // The first pose's covariance (as CameraEstimate::covariance) and camera centre. Its error is common to all poses, so
  // that no number of points reduces it.
  Eigen::Matrix<double, 6, 6> start_covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Vector3d start_centre = Eigen::Vector3d::Zero();

  int alive_count() const {
    return static_cast<int>(std::ranges::count_if(points, [](const MapPoint& p) { return p.alive; }));
  }
  MapPoint& point(int i) { return points[static_cast<std::size_t>(i)]; }
  const MapPoint& point(int i) const { return points[static_cast<std::size_t>(i)]; }
  Keyframe& keyframe(int i) { return keyframes[static_cast<std::size_t>(i)]; }
  const Keyframe& keyframe(int i) const { return keyframes[static_cast<std::size_t>(i)]; }
};
// Sets the descriptor of a view at view.px and view.level.
void describe(PointView& view, const Pyramid& pyramid);

// The map file: little-endian, with version and check sum; points, key frames (image, pose, sweep), sightings. Version
// 1, without sweeps, can be read.  Throws std::runtime_error naming the file and the problem.
struct StoredMap {
  SceneMap map;
  std::vector<PointSighting> sightings;
  Eigen::Vector2i image_size = Eigen::Vector2i::Zero();
};
void write_map(const std::filesystem::path& file, const StoredMap& stored);  // atomic: temporary file, then rename
StoredMap read_map(const std::filesystem::path& file);
StoredMap read_map(const std::filesystem::path& file, const calib::ImageSize& size);  // throws for another image size

}  // namespace huetrack::camera_tracking
