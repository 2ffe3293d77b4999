// What a camera tracker knows of the scene: points with their covariance and their looks in stored key frames.
#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <memory>
#include <vector>

#include "calib/model/rigid3.h"
#include "camera_tracking/corners.h"
#include "camera_tracking/grey_image.h"
#include "camera_tracking/swept_pose.h"

namespace huetrack::camera_tracking {

// A view that is kept.
struct Keyframe {
  std::shared_ptr<const Pyramid> pyramid;
  calib::Rigid3d cam_from_world;  // of its middle row
  Sweep sweep = {};

  SweptPose pose() const { return {cam_from_world, sweep}; }
};

// How a point looked in a key frame.
struct PointLook {
  int keyframe = -1;                             // index into SceneMap::keyframes
  int level = 0;                                 // of the pyramid, at which it was found
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw, level 0
  Descriptor descriptor{};
  bool described = false;  // else it was too near to the image's border
};

struct MapPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();    // world, metres
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // m^2
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();      // of its surface, world, unit; zero: towards looks[0]'s camera
  std::array<PointLook, 4> looks;                        // the first one is where it was first seen
  int look_count = 0;
  bool given = false;                              // a start point
  bool alive = true;                               // false: a wrong one that was removed; indices stay
  std::array<std::uint16_t, 2> found_of_sought{};  // how often, lately
};

// Where a key frame saw a point of the map.
struct PointSighting {
  int keyframe = 0;
  int point = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw
  double sigma_px = 1;
};

// A corner of a key frame whose distance is still being found: where it is seen says nothing of a motion towards or
// past it, and all of how the camera turned.
struct PointSeed {
  PointLook look;                                  // not described
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();  // unit, in the frame of its row of the key frame
  double inverse_depth = 1, sigma = 1;             // along the ray, 1/m
  double row_px_per_s = 0;                         // how fast the image moved there and then, times its row's part
};

struct SceneMap {
  std::vector<MapPoint> points;
  std::vector<PointSeed> seeds;  // not stored
  std::vector<Keyframe> keyframes;
  // The world's place is only as sure as the first pose was, however many points agree with each other later: that
  // pose's covariance (as CameraEstimate has it), and the camera's centre to which it refers.
  Eigen::Matrix<double, 6, 6> start_covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Vector3d start_centre = Eigen::Vector3d::Zero();

  int alive_count() const;
};

// A map as a file: little-endian, with a version and a check sum; the points, the key frames' images, poses and sweeps,
// and the sightings. Version 1, which has no sweeps, is read, too.  throws std::runtime_error naming the file and what
// is wrong with it.
struct StoredMap {
  SceneMap map;
  std::vector<PointSighting> sightings;
  Eigen::Vector2i image_size = Eigen::Vector2i::Zero();
};
void write_map(const std::filesystem::path& file, const StoredMap& stored);  // atomic: temporary file, then rename
StoredMap read_map(const std::filesystem::path& file);

}  // namespace huetrack::camera_tracking
