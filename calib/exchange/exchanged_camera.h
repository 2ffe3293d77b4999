// Shared by all formats. Private to this module.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "calib/exchange/exchange.h"
#include "calib/files/joined.h"
#include "calib/files/text_file.h"
#include "calib/model/camera_rig.h"

namespace huetrack::exchange {

// Throws a files::ConfigError at the key's line.
using Fail = std::function<void(std::string_view key, const std::string& message)>;

// The lens of OpenCV's parameters. intrinsics: K row by row. coefficients: k1 k2 p1 p2 [k3 [k4 k5 k6]], or the
// fisheye's four; empty: no distortion. Further coefficients that are 0 are none.
calib::CameraModel opencv_lens(std::span<const double> intrinsics, std::string_view intrinsics_key,
                               std::span<const double> coefficients, std::string_view coefficients_key, bool fisheye,
                               const Fail& fail);

// m: row by row, a rotation to within 1e-4.
Eigen::Quaterniond rotation_of(std::span<const double> m, std::string_view key, const Fail& fail);
Eigen::Quaterniond rotation_of_vector(std::span<const double> v);
Eigen::Vector3d vector_of(const Eigen::Quaterniond& rotation);

std::vector<double> intrinsics_of(const calib::CameraModel& model);  // K row by row
// OpenCV's order; radtan: 5, rational: 8, fisheye: 4.
std::vector<double> coefficients_of(const calib::CameraModel& model);
bool is_fisheye(const calib::CameraModel& model);

std::string exact(double value);                         // the shortest text that parses to the same double
std::string exact_list(std::span<const double> values);  // "[1, 2.5]"
std::string clean_name(std::string name);                // replaces characters that a camera name must not have by _
using files::joined;

// throws files::ConfigError: a camera is invalid, or two have the same name.
void require_valid(const calib::CameraRig& rig, const std::filesystem::path& file);

// What is in the files, before the unit and the checks of import_rig().
Imported imported_from(std::span<const std::filesystem::path> files, const ImportOptions& options);
Imported import_bag(const std::filesystem::path& bag, const ImportOptions& options);

// The whole file, limited in size and nesting. throws files::ConfigError
std::string text_of(const std::filesystem::path& file, files::Keys keys = files::Keys::plain);

}  // namespace huetrack::exchange
