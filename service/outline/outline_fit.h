// Fits a ball's outline in one picture to some hundredths of a pixel, from the share of each pixel that the ball
// covers.
//
// A pixel is a mixture of the ball's light and the background's in linear light, weighted by the covered share and
// given by the camera's tone curve (sRGB). The edge is softened by lens, sensor and motion during the exposure; rows
// are exposed one after the other. The ball's light is a quadratic polynomial over its surface, its paleness
// (highlights) a linear one; the background's gain may have changed. One robust least-squares fit (Gauss-Newton) of 20
// unknowns to light and to the direction of chroma that separates both best. Occluders, other things and glints are
// left out. Model, priors and approximations: design.md.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "outline/background.h"
#include "outline/edge_model.h"
#include "outline/edge_samples.h"
#include "outline/normal_equations.h"
#include "outline/outlier_pixels.h"
#include "outline/picture.h"

namespace huetrack::outline {

// A point of the outline is centre + axes * (cos, sin), pixels, of an object at rest.
struct Ellipse {
  Eigen::Vector2d centre;
  Eigen::Matrix2d axes;
};

struct Movement {
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  // of the centre, px/s
  double row_s = 0;                                    // between the exposures of two rows; < 0: upwards
};

// Mean and standard deviation of a number.
struct Estimate {
  double value = 0, sigma = 0;
};

// Priors of a camera whose appearance is not known yet.
struct AppearancePriorTuning {
  double log_blur_light = -0.25;       // of pixels, 1 sigma of the edge: 0.78 px; webcams have 0.5 to 1.1 (experiment)
  double log_blur_light_sigma = 0.35;  // natural logarithm
  double log_blur_chroma = -0.3;       // of pixels, what demosaicing adds: 0.74 px
  double log_blur_chroma_sigma = 0.6;  // natural logarithm
  double exposure_s = 0.006;           // seconds, indoors
  double exposure_sigma_s = 0.004;     // seconds
  double log_size_sigma = 0.1;         // of the radius, where the size is not learnt
};
inline constexpr AppearancePriorTuning appearance_prior{};

// Appearance model: what changes little from picture to picture of one camera. Prior of the next fit.
struct AppearanceModel {
  // log of the edge's standard deviation in pixels, the camera's mean; and of what demosaicing adds.
  Estimate log_blur_light{appearance_prior.log_blur_light, appearance_prior.log_blur_light_sigma};
  Estimate log_blur_chroma{appearance_prior.log_blur_chroma, appearance_prior.log_blur_chroma_sigma};
  Estimate exposure_s{appearance_prior.exposure_s, appearance_prior.exposure_sigma_s};  // observable in motion only
  Eigen::Vector3f object = Eigen::Vector3f::Zero();  // its light, linear R G B; 0: unknown
  struct Light {                                     // shading and paleness, as in EdgeModel
    Eigen::Matrix<double, lights, 1> mean;
    LightMatrix covariance;
  };
  std::optional<Light> light;  // filtered over all fits so far
  // By the last fit of all unknowns:
  struct Promise {
    Eigen::Matrix3d open;  // covariance of place and log size that is due to what is held when the light is
    double misfit = 1;
  };
  double usual_misfit = 0;         // of fits in which nothing seems hidden; 0: not known yet
  std::optional<Promise> promise;  // nullopt: the next picture is fitted with all unknowns
};

struct FitOptions {
  Estimate log_size{0, appearance_prior.log_size_sigma};  // prior of the scale over `axes`
  double light_correlation = 0;  // 0..1, of the ball's light with that of the last fit (Gauss-Markov)
  // Shading, blur and exposure may be held at their means, which is less work. They are fitted all the same where the
  // picture does not fit as the last one promised.
  bool may_hold_light = false;
  bool is_edge_curved = false;  // the edge profile is that of a disc instead of a half plane: for measuring the size
  int most_steps = 6;           // Gauss-Newton
};

enum class FitOutcome : std::uint8_t {
  fits,
  too_small,    // or too large, or out of the picture
  unknown,      // too little of the edge, or of the background, is known or visible
  no_contrast,  // the object looks like its background
  lost,         // the fit left the start, or changed the size, too far
  misfit,       // not the outline of a ball
};

struct Fit {
  FitOutcome outcome = FitOutcome::unknown;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();          // of the ellipse, in the row where it lies
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  // px^2, of noise and nuisances
  // px^2, errors alike in many samples, which `covariance` averages: by how much the misfit is above the view's usual.
  Eigen::Matrix2d model_error = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d bound = Eigen::Matrix2d::Identity();  // px^2, if all but the centre were known
  Estimate log_size;                                    // by the pixels alone, without its prior
  // Error of the log size that is alike in many samples: by how much the misfit is above what noise explains.
  double size_model_error = 0;
  double misfit = 0;   // mean squared residual in variances
  double visible = 0;  // share of the edge that counted
  bool is_light_held = false;
  int steps = 0, pixels = 0;
};

// Work space for fits, one after the other. thread-compatible.
class OutlineFit {
 public:
  // start: prediction, right to about half the radius. model: read only; learn() updates it after the fit.
  Fit fit(const Picture& picture, const Background& behind, const Ellipse& start, const Movement& movement,
          const AppearanceModel& model, const FitOptions& options);
  // After a fit with outcome `fits`. Returns whether the ball's light was learnt, too; nothing is where it was held.
  bool learn(AppearanceModel& model) const;

 private:
  void lay_out(const Ellipse& start, const Movement& movement, const AppearanceModel& model);
  bool find_grid(const Picture& picture);
  bool find_object_color(const AppearanceModel& model);
  bool sample(const Picture& picture, const Background& behind, const AppearanceModel& model, Fit& out);
  void make_samples();
  void begin(const AppearanceModel& model, const FitOptions& options);
  bool iterate(const AppearanceModel& model, const FitOptions& options, Fit& out);
  bool is_as_promised(const AppearanceModel& model) const;
  void trust_all();
  bool has_other_size() const;
  EdgeModel model_of_light() const;
  EdgeModel model_of_chroma(const EdgeModel& of_light) const;
  void assemble();
  void renew();
  template <typename Add>
  void add_up(Add&& add);
  bool have_weights_changed() const;
  Unknowns next_step() const;
  Unknowns next_held_step(const Unknowns& off) const;
  Unknowns limited(Unknowns step) const;
  bool is_lost() const;
  double product_of(const Unknowns& step, const Unknowns& other) const;
  bool is_far(const Unknowns& step) const;
  std::optional<Estimate> without_prior(int unknown) const;
  HeldNormal held_information() const;
  Eigen::Matrix3d left_open() const;
  double misfit_by_chance() const;
  void learn_usual_misfit(AppearanceModel& model) const;
  void report(const AppearanceModel& model, Fit& out) const;

  Ellipse start_;
  Movement movement_;
  EdgeBand band_;  // of scale 1, sheared by the rolling shutter
  PixelGrid grid_;
  PictureNoise noise_;
  bool has_chroma_ = true;
  Eigen::Vector3f object_ = Eigen::Vector3f::Zero();       // linear R G B
  Eigen::Vector3f object_seen_ = Eigen::Vector3f::Zero();  // light, blue, red
  float chroma_blue_ = 1, chroma_red_ = 0;                 // direction of chroma with most contrast
  float contrast_ = 0;
  Unknowns x_, expected_, gradient_;
  Normal information_, normal_;  // of the prior; of the samples
  HeldNormal held_normal_;
  bool is_light_held_ = false, is_edge_curved_ = false;
  NormalEquations<unknowns, reported_unknowns> equations_;
  NormalEquations<held_count, placed> held_equations_;
  Eigen::Matrix3d place_covariance_, held_open_;  // of place and log size; its part due to what is held
  double misfit_ = 0, visible_ = 0;
  double assembled_weight_ = 0;  // EdgeSums::edge_weight at assembly
  EdgeSamples light_, chroma_;
  EdgeSums sums_;
  OutlierPixels outliers_;
};

}  // namespace huetrack::outline
