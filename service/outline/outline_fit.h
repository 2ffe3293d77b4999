// A ball's outline in one picture to some hundredths of a pixel: by how much of each pixel it covers of what is behind
// it.
//
// A pixel is the object's light as far as the ellipse covers it, over the background's, mixed in light as sensors count
// it and given by the camera's curve (sRGB). The edge is as soft as lens and sensor make it, and as motion during the
// exposure smears it; rows are exposed one after the other. The object's light is a quadratic polynomial over the disc,
// its paleness (highlights) a linear one; the background may be lit a little otherwise than when it was learnt. All of
// it is one least-squares fit (Gauss-Newton) with robust weights, to light and to the chroma that separates the two
// best. Where the background shows in the object's place, something that stands still hides the object; what is neither
// the object nor the background is another thing; what is brighter than a dull ball is a glint. None of them counts.
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

// How the outline moves over the rows and during the exposure.
struct Movement {
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  // of its centre, px/s
  double row_s = 0;                                    // between the exposures of two rows; < 0: upwards
};

// With its standard deviation.
struct Known {
  double value = 0, sigma = 0;
};

// What hardly changes from picture to picture of one camera: what the next fit begins with. Learnt by each.
struct Look {
  Known log_blur_light{-0.25, 0.35};                 // of the edge's standard deviation in pixels: the camera's mean
  Known log_blur_chroma{-0.3, 0.6};                  // of what color has on top of it: demosaicing
  Known exposure_s{0.006, 0.004};                    // only told by what moves
  Eigen::Vector3f object = Eigen::Vector3f::Zero();  // its light, linear R G B; 0: not known yet
  struct Light {                                     // over the ball: shading and paleness, as EdgeModel has them
    Eigen::Matrix<double, lights, 1> mean;
    LightMatrix covariance;
  };
  std::optional<Light> light;  // as the last fit that fits has it, by all before
  struct Left {                // by the last fit of all unknowns
    Eigen::Matrix3d open;      // of the place and the logarithm of the size, by what is held when the light is
    double misfit = 1;
  };
  std::optional<Left> left;  // nullopt: it says nothing of the next picture, where all is fitted, too
};

struct FitOptions {
  Known log_size{0, 0.1};        // of the outline over `axes`
  double light_correlation = 0;  // 0..1: how much of what Look::light departs from what is usual is still so
  // The light over the ball as the last fit left it, edges' softness and the exposure as they are known may be held,
  // which is less work. They are fitted, too, where a picture is not as the last one promised.
  bool may_hold_light = false;
  int most_steps = 6;
};

enum class FitOutcome : std::uint8_t {
  fits,
  too_small,    // or too large, or out of the picture
  unknown,      // too little of what is behind the edge is known, or seen
  no_contrast,  // the object does not differ from what is behind it
  lost,         // it went too far away, or changed its size
  misfit,       // this is no ball's outline
};

struct Fit {
  FitOutcome outcome = FitOutcome::unknown;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();          // of the ellipse, in the row where it lies
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  // px^2, by the pixels' noise and what is fitted beside it
  Eigen::Matrix2d bound = Eigen::Matrix2d::Identity();       // px^2, were all but the centre known
  Known log_size;                                            // as found, without what was expected of it
  double misfit = 0;   // mean square of the residuals in their standard deviations
  double visible = 0;  // share of the edge that counted
  bool is_light_held = false;
  int steps = 0, pixels = 0;
};

// Work space for fits, one after the other. thread-compatible.
class OutlineFit {
 public:
  // start: where the outline is expected, to about half its radius. The look is read; learn_look() gives what it is
  // after the fit.
  Fit fit(const Picture& picture, const Background& behind, const Ellipse& start, const Movement& movement,
          const Look& look, const FitOptions& options);
  bool learn(Look& look) const;  // after a fit that fits; whether of its light, too. Nothing, where it was held

 private:
  void lay_out(const Ellipse& start, const Movement& movement, const Look& look);
  bool find_grid(const Picture& picture);
  bool know_object(const Look& look);
  bool sample(const Picture& picture, const Background& behind, const Look& look, Fit& out);
  void make_samples();
  void begin(const Look& look, const FitOptions& options);
  bool step_down(const Look& look, const FitOptions& options, Fit& out);
  bool is_as_promised(const Look& look) const;
  void trust_all();
  bool has_other_size() const;
  EdgeModel model_of_light() const;
  EdgeModel model_of_chroma(const EdgeModel& of_light) const;
  void assemble();
  void renew();
  template <typename Add>
  void add_up(Add&& add);
  bool are_weights_others() const;
  Unknowns next_step() const;
  Unknowns next_held_step(const Unknowns& off) const;
  Unknowns limited(Unknowns step) const;
  bool is_lost() const;
  double product_of(const Unknowns& step, const Unknowns& other) const;
  bool is_far(const Unknowns& step) const;
  std::optional<Known> told_by_itself(int unknown) const;
  HeldNormal held_information() const;
  Eigen::Matrix3d left_open() const;
  void tell(Fit& out) const;

  Ellipse start_;
  Movement movement_;
  EdgeBand band_;  // of size 1, as the rows see it
  PixelGrid grid_;
  PictureNoise noise_;
  bool has_chroma_ = true;
  Eigen::Vector3f object_ = Eigen::Vector3f::Zero();       // linear R G B
  Eigen::Vector3f object_seen_ = Eigen::Vector3f::Zero();  // light, blue, red
  float chroma_blue_ = 1, chroma_red_ = 0;                 // the direction in which chroma tells most
  float contrast_ = 0;
  Unknowns x_, expected_, gradient_;
  Normal information_, normal_;  // beforehand; of the samples
  HeldNormal held_normal_;
  bool is_light_held_ = false;
  NormalEquations<unknowns, told_unknowns> equations_;
  NormalEquations<held_count, placed> held_equations_;
  Eigen::Matrix3d place_covariance_, held_open_;  // of the place and the size; of it what is held leaves open
  double misfit_ = 0, visible_ = 0;
  double assembled_weight_ = 0;  // EdgeSums::edge_weight, when it was assembled
  EdgeSamples light_, chroma_;
  EdgeSums sums_;
  StrangePixels strange_pixels_;
};

}  // namespace huetrack::outline
