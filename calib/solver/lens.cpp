#include "calib/solver/lens.h"

#include <algorithm>
#include <array>

namespace huetrack::solver {
namespace {

constexpr std::array<std::string_view, 12> radtan_names{"fx", "fy", "cx", "cy", "k1", "k2",
                                                        "p1", "p2", "k3", "k4", "k5", "k6"};
constexpr std::array<std::string_view, 8> fisheye_names{"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
constexpr std::array<std::string_view, 12> stereographic_names{"fx", "fy", "cx", "cy", "k1", "k2",
                                                               "p1", "p2", "k3", "k4", "s1", "s2"};

}  // namespace

std::string_view name(LensModel lens) {
  constexpr std::array<std::string_view, 5> names{"radtan4", "radtan5", "radtan8", "fisheye", "stereographic"};
  return names[static_cast<std::size_t>(lens)];
}

int parameter_count(LensModel lens) {
  constexpr std::array<int, 5> counts{8, 9, 12, 8, 12};
  return counts[static_cast<std::size_t>(lens)];
}

std::string_view parameter_name(LensModel lens, int index) {
  const auto i = static_cast<std::size_t>(index);
  return lens == LensModel::fisheye         ? fisheye_names[i]
         : lens == LensModel::stereographic ? stereographic_names[i]
                                            : radtan_names[i];
}

calib::CameraModel camera_model(LensModel lens, const LensParameters& l) {
  if (lens == LensModel::fisheye)
    return calib::CameraModel(calib::FisheyeKannalaBrandt{l(0), l(1), l(2), l(3), {l(4), l(5), l(6), l(7)}});
  if (lens == LensModel::stereographic) {
    calib::Stereographic stereographic{l(0), l(1), l(2), l(3), {}};
    std::copy_n(l.data() + 4, 8, stereographic.distortion.begin());
    return calib::CameraModel(stereographic);
  }
  calib::PinholeRadtan pinhole{l(0), l(1), l(2), l(3), {}};
  std::copy_n(l.data() + 4, parameter_count(lens) - 4, pinhole.distortion.begin());
  return calib::CameraModel(pinhole);
}

LensModel lens_model_of(const calib::CameraModel& model) {
  if (std::holds_alternative<calib::FisheyeKannalaBrandt>(model.lens())) return LensModel::fisheye;
  if (std::holds_alternative<calib::Stereographic>(model.lens())) return LensModel::stereographic;
  const LensParameters l = parameters_of(model);
  if (!l.tail<3>().isZero(0)) return LensModel::radtan8;
  return l(8) != 0 ? LensModel::radtan5 : LensModel::radtan4;
}

bool project(LensModel lens, const LensParameters& parameters, const Eigen::Vector3d& p_cam, Eigen::Vector2d& px,
             PixelByPoint* by_point, PixelByLens* by_lens) {
  if (lens == LensModel::fisheye) return calib::project_fisheye(parameters, p_cam, px, by_point, by_lens);
  if (lens == LensModel::stereographic) return calib::project_stereographic(parameters, p_cam, px, by_point, by_lens);
  return calib::project_radtan(parameters, p_cam, px, by_point, by_lens);
}

}  // namespace huetrack::solver
