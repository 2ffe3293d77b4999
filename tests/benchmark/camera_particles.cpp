// Lee's comparisons on a synthetic scene: accuracy against the number of particles (Fig. 11), the particle filter with
// a UKF per feature beside one monolithic UKF (Tables 3 and 4), and what both cost (Fig. 16).
//   build/release/tests/benchmark/camera_particles [PLOT.svg]
// As the paper does: the motion is one that a hand-held camera made (data/rendered/desk; without it, a made-up one),
// the measurements are exact projections of co-planar points, 4 of them known. Both filters have the same
// constant-position model and variances. Seeds 1 to 5, the mean of them.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "benchmark/camera_sequence.h"
#include "camera_tracking/papers/lee_tracker.h"
#include "camera_tracking/papers/mean_polish.h"
#include "camera_tracking/papers/unscented_kalman.h"

using namespace huetrack;

namespace {

constexpr double rotation_rad = 0.008, position_m = 0.005, pixel_sigma = 0.7;  // both filters'
constexpr int known = 4;
constexpr double first_error = 0.03;  // of the unknown features' first depths: a UKF of many dimensions bears no more

double milliseconds_of(const std::function<void()>& work) {
  timespec from{}, to{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &from);
  work();
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &to);
  return 1e3 * static_cast<double>(to.tv_sec - from.tv_sec) + 1e-6 * static_cast<double>(to.tv_nsec - from.tv_nsec);
}

struct World {
  calib::Camera camera;
  std::vector<calib::Rigid3d> cam_from_world;
  std::vector<Eigen::Vector3d> points;  // co-planar, the first 4 known
  std::vector<double> wrong_by;         // the others' first depths, as a factor
};

World make_world(std::size_t points, std::size_t frames) {
  World w;
  w.camera = {"synthetic", {320, 240}, calib::CameraModel(calib::PinholeRadtan{246, 246, 159.5, 119.5, {}}), {}, {}};
  if (std::filesystem::exists(figures::shared_camera_data() / "rendered/desk")) {
    for (const auto& pose :
         figures::load_camera_sequence(figures::shared_camera_data() / "rendered/desk", "groundtruth.txt", frames)
             .world_from_camera)
      w.cam_from_world.push_back(calib::inverse(*pose));
  } else {
    for (std::size_t i = 0; i < frames; ++i) {
      const double t = static_cast<double>(i) / 30;
      const Eigen::Quaterniond down(Eigen::AngleAxisd(2.4 + 0.05 * std::sin(2 * t), Eigen::Vector3d::UnitX()));
      w.cam_from_world.push_back(calib::inverse(calib::Rigid3d{down, {0.1 * t, -0.4 + 0.03 * std::sin(3 * t), 0.45}}));
    }
  }
  w.points = {{-0.1, 0.075, 0}, {0.1, 0.075, 0}, {0.1, -0.075, 0}, {-0.1, -0.075, 0}};
  for (std::size_t i = known; i < points; ++i) {  // a spiral over the desk
    const double a = 2.4 * static_cast<double>(i),
                 r = 0.05 + 0.20 * std::sqrt(static_cast<double>(i) / static_cast<double>(points));
    w.points.emplace_back(r * std::cos(a), 0.8 * r * std::sin(a), 0);
  }
  for (std::size_t i = 0; i < points; ++i)
    w.wrong_by.push_back(i < known ? 1.0 : 1 + first_error * std::sin(7.0 * static_cast<double>(i)));
  return w;
}

struct Score {
  double position_mse = 0, quaternion_mse = 0;  // m^2; per component, as Table 4
  Eigen::Vector3d t_mse = Eigen::Vector3d::Zero();
  Eigen::Vector4d q_mse = Eigen::Vector4d::Zero();
  std::vector<double> feature_error;  // m, at the end
  double ms = 0;                      // per frame
};
void add(Score& s, const calib::Rigid3d& estimate, const calib::Rigid3d& truth, double share) {
  const Eigen::Vector3d d = calib::inverse(estimate).translation - calib::inverse(truth).translation;
  Eigen::Vector4d q(estimate.rotation.w(), estimate.rotation.x(), estimate.rotation.y(), estimate.rotation.z());
  const Eigen::Vector4d r(truth.rotation.w(), truth.rotation.x(), truth.rotation.y(), truth.rotation.z());
  if (q.dot(r) < 0) q = -q;
  s.t_mse += share * d.cwiseAbs2();
  s.q_mse += share * (q - r).cwiseAbs2();
  s.position_mse = s.t_mse.sum(), s.quaternion_mse = s.q_mse.sum();
}

// The paper's system: particles for the camera, one UKF per feature.
Score with_particles(const World& w, std::size_t particles, std::uint64_t seed, bool mapping = true,
                     double cloud_share = papers::LeeTracking::Options{}.cloud_share, bool polish = false) {
  papers::LeeTracking::Options o;
  o.particle_count = particles, o.rotation_rad = rotation_rad, o.position_m = position_m;
  o.cloud_share = cloud_share;
  papers::LeeTracking tracking(w.camera, o, seed);
  tracking.start(w.cam_from_world[0]);
  std::vector<Eigen::Vector3d> points = w.points;
  std::vector<std::optional<papers::FeatureFilter>> filters(points.size());
  const std::size_t first = mapping ? known : points.size();
  for (std::size_t i = first; i < points.size(); ++i) {
    const Eigen::Vector3d cam = w.cam_from_world[0] * w.points[i];
    const double inverse_depth = 1 / (cam.norm() * w.wrong_by[i]);
    filters[i].emplace(w.camera.model, w.cam_from_world[0], 1e-10 * Eigen::Matrix<double, 7, 7>::Identity(),
                       inverse_depth, first_error * inverse_depth, w.camera.model.project(cam)->px,
                       0.01 * Eigen::Matrix2d::Identity());
    points[i] = *filters[i]->position();
  }
  Score out;
  const double share = 1.0 / static_cast<double>(w.cam_from_world.size() - 1);
  std::vector<Eigen::Vector2d> px(points.size());
  for (std::size_t k = 1; k < w.cam_from_world.size(); ++k) {
    for (std::size_t i = 0; i < points.size(); ++i)
      px[i] = w.camera.model.project(w.cam_from_world[k] * w.points[i])->px;
    out.ms += share * milliseconds_of([&] {
                calib::Rigid3d pose = tracking.track_points(points, px);
                if (polish) {  // as the tracker does, where the paper has the mean
                  std::vector<camera_tracking::PoseObservation> seen;
                  for (std::size_t i = 0; i < points.size(); ++i)
                    seen.push_back({points[i], px[i], i < known ? pixel_sigma : 2 * pixel_sigma});
                  if (const auto fit = papers::polish_mean(w.camera.model, tracking.particles(), pose, seen))
                    pose = fit->cam_from_world;
                }
                add(out, pose, w.cam_from_world[k], share);
                for (std::size_t i = first; i < points.size(); ++i) {
                  const Eigen::Matrix2d r =
                      pixel_sigma * pixel_sigma * Eigen::Matrix2d::Identity() + tracking.cloud_of(points[i]).covariance;
                  if (filters[i]->update(pose, px[i], r)) points[i] = *filters[i]->position();
                }
              });
  }
  for (std::size_t i = 0; i < points.size(); ++i) out.feature_error.push_back((points[i] - w.points[i]).norm());
  return out;
}

// One UKF whose state is the camera (centre, quaternion) and all features' positions.
Score monolithic(const World& w) {
  const auto n = static_cast<Eigen::Index>(7 + 3 * w.points.size()), m = static_cast<Eigen::Index>(2 * w.points.size());
  Eigen::VectorXd x(n);
  Eigen::MatrixXd p = 1e-10 * Eigen::MatrixXd::Identity(n, n);
  const calib::Rigid3d back = calib::inverse(w.cam_from_world[0]);
  const Eigen::Quaterniond q0 = w.cam_from_world[0].rotation;
  x.head<7>() << back.translation, q0.w(), q0.x(), q0.y(), q0.z();
  for (std::size_t i = 0; i < w.points.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(7 + 3 * i);
    const Eigen::Vector3d ray = w.points[i] - back.translation;
    x.segment<3>(at) = back.translation + w.wrong_by[i] * ray;
    if (i >= known) p.block<3, 3>(at, at) += first_error * first_error * ray * ray.transpose();
  }
  const auto pose_of = [](const Eigen::VectorXd& s) {
    const Eigen::Quaterniond q = Eigen::Quaterniond(s[3], s[4], s[5], s[6]).normalized();
    return calib::Rigid3d{q, -(q * s.head<3>())};
  };
  const Eigen::MatrixXd r = pixel_sigma * pixel_sigma * Eigen::MatrixXd::Identity(m, m);
  Score out;
  const double share = 1.0 / static_cast<double>(w.cam_from_world.size() - 1);
  Eigen::VectorXd y(m);
  for (std::size_t k = 1; k < w.cam_from_world.size(); ++k) {
    for (std::size_t i = 0; i < w.points.size(); ++i)
      y.segment<2>(static_cast<Eigen::Index>(2 * i)) = w.camera.model.project(w.cam_from_world[k] * w.points[i])->px;
    out.ms += share * milliseconds_of([&] {
                p.diagonal().head<3>().array() += position_m * position_m;
                p.diagonal().segment<4>(3).array() += 0.25 * rotation_rad * rotation_rad;
                papers::unscented_update<Eigen::Dynamic, Eigen::Dynamic>(
                    x, p, y, r, [&](const Eigen::VectorXd& s, Eigen::VectorXd& z) {
                      const calib::Rigid3d pose = pose_of(s);
                      for (std::size_t i = 0; i < w.points.size(); ++i) {
                        const auto px = w.camera.model.project(
                            pose * Eigen::Vector3d(s.segment<3>(static_cast<Eigen::Index>(7 + 3 * i))));
                        if (!px) return false;
                        z.segment<2>(static_cast<Eigen::Index>(2 * i)) = px->px;
                      }
                      return true;
                    });
                x.segment<4>(3).normalize();
              });
    add(out, pose_of(x), w.cam_from_world[k], share);
  }
  for (std::size_t i = 0; i < w.points.size(); ++i)
    out.feature_error.push_back((x.segment<3>(static_cast<Eigen::Index>(7 + 3 * i)) - w.points[i]).norm());
  return out;
}

Score mean_over_seeds(const World& w, std::size_t particles, bool mapping,
                      double cloud_share = papers::LeeTracking::Options{}.cloud_share, bool polish = false) {
  Score mean;
  mean.feature_error.assign(w.points.size(), 0.0);
  constexpr int seeds = 5;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const Score s = with_particles(w, particles, seed, mapping, cloud_share, polish);
    mean.t_mse += s.t_mse / seeds, mean.q_mse += s.q_mse / seeds, mean.ms += s.ms / seeds;
    for (std::size_t i = 0; i < w.points.size(); ++i) mean.feature_error[i] += s.feature_error[i] / seeds;
  }
  mean.position_mse = mean.t_mse.sum(), mean.quaternion_mse = mean.q_mse.sum();
  return mean;
}

// Curves over a common x in one panel; the y axis is logarithmic.
struct Curve {
  std::string name, color;
  std::vector<double> x, y;
};
std::string panel(double left, const std::string& title, const std::string& x_name, const std::vector<Curve>& curves) {
  double x1 = 0, y0 = 1e9, y1 = 0;
  for (const Curve& c : curves) {
    x1 = std::max(x1, *std::ranges::max_element(c.x));
    y0 = std::min(y0, *std::ranges::min_element(c.y)), y1 = std::max(y1, *std::ranges::max_element(c.y));
  }
  const double low = std::floor(std::log10(y0)), high = std::max(low + 1, std::ceil(std::log10(y1)));
  const auto at_x = [&](double x) { return left + 60 + 300 * x / x1; };
  const auto at_y = [&](double y) { return 290 - 230 * (std::log10(y) - low) / (high - low); };
  char text[400];
  std::string out;
  const auto put = [&](const char* format, auto... args) {
    std::snprintf(text, sizeof text, format, args...);
    out += text;
  };
  put("<text x='%.0f' y='30' font-weight='bold'>%s</text><text x='%.0f' y='330'>%s</text>\n", left + 60, title.c_str(),
      left + 170, x_name.c_str());
  for (double d = low; d <= high; ++d)
    put("<line x1='%.0f' x2='%.0f' y1='%.1f' y2='%.1f' stroke='#ddd'/><text x='%.0f' y='%.1f' "
        "text-anchor='end'>%g</text>\n",
        left + 60, left + 360, at_y(std::pow(10, d)), at_y(std::pow(10, d)), left + 55, at_y(std::pow(10, d)) + 4,
        std::pow(10, d));
  for (int i = 0; i <= 4; ++i)
    put("<text x='%.0f' y='310' text-anchor='middle'>%.0f</text>\n", at_x(x1 * i / 4), x1 * i / 4);
  double row = 55;
  for (const Curve& c : curves) {
    out += "<polyline fill='none' stroke-width='2' stroke='" + c.color + "' points='";
    for (std::size_t i = 0; i < c.x.size(); ++i) put("%.1f,%.1f ", at_x(c.x[i]), at_y(c.y[i]));
    out += "'/>\n";
    put("<text x='%.0f' y='%.0f' fill='%s'>%s</text>\n", left + 220, row, c.color.c_str(), c.name.c_str());
    row += 16;
  }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  const World ten = make_world(10, 45);
  std::puts("Lee, Fig. 11: accuracy against the number of particles (10 known points, 45 frames of hand-held motion)");
  std::printf("  particles   C of eq. (4) is %.1f of the cloud's (default)      C is the cloud's, as printed\n",
              papers::LeeTracking::Options{}.cloud_share);
  Curve position{"position rms, mm", "#1f77b4", {}, {}}, rotation{"quaternion rms, 1e-3", "#d62728", {}, {}};
  for (const std::size_t n : {50u, 100u, 200u, 350u, 500u, 1000u, 2000u, 4000u}) {
    const Score s = mean_over_seeds(ten, n, false), printed = mean_over_seeds(ten, n, false, 1);
    std::printf("  %9zu   %6.2f mm, quaternion %.5f, %.3f ms     %6.2f mm, quaternion %.5f\n", n,
                1e3 * std::sqrt(s.position_mse), std::sqrt(s.quaternion_mse), s.ms,
                1e3 * std::sqrt(printed.position_mse), std::sqrt(printed.quaternion_mse));
    position.x.push_back(static_cast<double>(n)), position.y.push_back(1e3 * std::sqrt(s.position_mse));
    rotation.x.push_back(static_cast<double>(n)), rotation.y.push_back(1e3 * std::sqrt(s.quaternion_mse));
  }
  const Score pf = mean_over_seeds(ten, 350, true), ukf = monolithic(ten),
              polished = mean_over_seeds(ten, 350, true, papers::LeeTracking::Options{}.cloud_share, true);
  std::puts("\nTable 3: error of each feature at the end, mm (the first 4 are known)");
  std::printf("  350 particles, a UKF each ");
  for (const double e : pf.feature_error) std::printf(" %5.2f", 1e3 * e);
  std::printf("\n  the same, mean polished   ");
  for (const double e : polished.feature_error) std::printf(" %5.2f", 1e3 * e);
  std::printf("\n  monolithic UKF            ");
  for (const double e : ukf.feature_error) std::printf(" %5.2f", 1e3 * e);
  std::puts("\n\nTable 4: mean squared error of the camera's parameters, m^2");
  std::puts("                   tx        ty        tz        q0        qx        qy        qz");
  for (const auto& [name, s] : {std::pair{"PF ", &pf}, {"  polished", &polished}, {"UKF", &ukf}})
    std::printf("  %-10s %9.2e %9.2e %9.2e %9.2e %9.2e %9.2e %9.2e\n", name, s->t_mse[0], s->t_mse[1], s->t_mse[2],
                s->q_mse[0], s->q_mse[1], s->q_mse[2], s->q_mse[3]);
  std::puts(
      "  The paper gives no unit (its MSE of q, PF then UKF: 5e-4 3e-3 2e-3 6e-2; 6e-5 1e-4 8e-5 8e-6). What the "
      "particles'\n"
      "  mean adds is theirs, not the UKFs': the polished mean has the same particles and the same UKFs.");
  std::puts("\nFig. 16: ms per frame against the number of features (filtering alone, no image)");
  std::puts("  features   350 particles, a UKF each   monolithic UKF");
  Curve ours{"particles, a UKF each", "#2ca02c", {}, {}}, theirs{"monolithic UKF", "#ff7f0e", {}, {}};
  for (const std::size_t n : {10u, 20u, 30u, 45u, 60u, 90u}) {
    const World w = make_world(n, n > 40 ? 5 : 12);
    const double a = with_particles(w, 350, 1).ms, b = monolithic(w).ms;
    std::printf("  %8zu %27.2f %16.2f\n", n, a, b);
    ours.x.push_back(static_cast<double>(n)), ours.y.push_back(a);
    theirs.x.push_back(static_cast<double>(n)), theirs.y.push_back(b);
  }
  if (argc > 1) {
    std::FILE* file = std::fopen(argv[1], "w");
    if (!file) {
      std::fprintf(stderr, "camera_particles: %s cannot be written\n", argv[1]);
      return 1;
    }
    std::fprintf(file,
                 "<svg xmlns='http://www.w3.org/2000/svg' width='800' height='350' font-family='sans-serif' "
                 "font-size='12'><rect width='800' height='350' fill='white'/>\n%s%s</svg>\n",
                 panel(0, "Accuracy (Lee, Fig. 11)", "particles", {position, rotation}).c_str(),
                 panel(400, "ms per frame (Lee, Fig. 16)", "features", {ours, theirs}).c_str());
    std::fclose(file);
    std::printf("\n%s is drawn\n", argv[1]);
  }
  return 0;
}
