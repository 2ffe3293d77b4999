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
#include <vector>

#include "outline/background.h"
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
  double paleness[3] = {}, shading[9] = {1};
};

struct FitOptions {
  Known log_size{0, 0.1};  // of the outline over `axes`
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
  int steps = 0, pixels = 0;
};

// Work space for fits, one after the other. thread-compatible.
class OutlineFit {
 public:
  OutlineFit();

  // start: where the outline is expected, to about half its radius. The look is read; learn_look() gives what it is
  // after the fit.
  Fit fit(const Picture& picture, const Background& behind, const Ellipse& start, const Movement& movement,
          const Look& look, const FitOptions& options);
  void learn(Look& look) const;  // after a fit that fits

 private:
  enum : int {
    cu_,
    cv_,
    size_,
    blur_light_,
    blur_chroma_,
    shading_,
    paleness_ = shading_ + 9,
    lit_ = paleness_ + 3,
    exposure_ = lit_ + 2,
    unknowns,
    right_ = unknowns,
    columns
  };
  static_assert(columns % 3 == 0);  // assemble() takes them by threes
  static constexpr int largest_box = 128;
  static constexpr int most_rows = 2048;  // of pixels, or of samples of chroma
  static constexpr int chunk = 64;
  struct GreyValues {
    alignas(64) float light[most_rows], blue[most_rows], red[most_rows];
  };
  // Pixels, or samples of chroma: in columns, so that many of them are done at once.
  struct Rows {
    int n = 0;
    alignas(64) float u[most_rows], v[most_rows];  // from the start's centre, pixels
    alignas(64) float x[most_rows], y[most_rows];  // the same in the disc of the start
    int at_u[most_rows], at_v[most_rows];          // in the picture, or in its chroma
    GreyValues seen, behind;                       // what is behind it, or what that is guessed to be
    alignas(64) float measured[most_rows];         // of what is seen
    alignas(64) float red[most_rows], green[most_rows], blue[most_rows];  // linear light, behind
    alignas(64) float offset[most_rows];  // of what is behind from what the camera's curve makes of that
    alignas(64) float unsure[most_rows];  // its variance, in variances of a picture
    alignas(64) float trust[most_rows];   // 0..1
    alignas(64) float hidden[most_rows];  // 1: were it within the outline, it would show what is behind
    alignas(64) float covered[most_rows],
        off[most_rows];  // when assembled last: the share; the residual's square in variances, with its sign
  };
  enum class Strange : std::uint8_t { is_else, hides, shines };
  struct Mark {
    int u, v;  // in the box
    Strange as;
  };
  struct Kind;
  struct Chunk;
  struct Assembly;
  struct Solver;
  using Unknowns = Eigen::Matrix<double, unknowns, 1>;
  using Normal = Eigen::Matrix<double, unknowns, unknowns>;

  void lay_out(const Ellipse& start, const Movement& movement, const Look& look);
  bool find_box(const Picture& picture);
  void select(Rows& rows, int shared, int lines);
  void read(const Picture& picture, const Background& behind);
  bool know_object(const Look& look);
  void make_rows();
  void begin(const Look& look, const FitOptions& options);
  bool judge_pixels();
  bool find_glints();
  void find_strange();
  bool distrust_marked();
  void mark(int u, int v, Strange as);
  void assemble();
  static void assemble_rows(const Kind& kind, Rows& rows, Assembly& out);
  Kind kind_of_light() const;
  Kind kind_of_chroma() const;
  Unknowns next_step(Solver& solver);
  bool is_lost() const;
  bool is_settled(const Unknowns& step) const;
  void find_covariance(const Solver& solver);
  std::optional<Known> told_by_itself(int unknown) const;
  void tell(Fit& out) const;

  Ellipse start_;
  Movement movement_;
  Eigen::Matrix2d disc_from_px_ = Eigen::Matrix2d::Identity();  // of size 1, as the rows see it
  double radius_px_ = 0, reach_px_ = 0;
  int u0_ = 0, v0_ = 0, width_ = 0, height_ = 0;        // the box, in pixels
  int columns_ = 1, rows_ = 1, across_ = 0, down_ = 0;  // chroma in it
  bool has_chroma_ = true, had_glints_ = false, is_judged_ = false;
  float sigma_light_ = 2, sigma_chroma_ = 2;
  Eigen::Vector3f object_ = Eigen::Vector3f::Zero();       // linear R G B
  Eigen::Vector3f object_seen_ = Eigen::Vector3f::Zero();  // light, blue, red
  float chroma_blue_ = 1, chroma_red_ = 0;                 // the direction in which chroma tells most
  Unknowns x_, expected_, information_, gradient_;
  Normal normal_, covariance_;
  float contrast_ = 0;
  double misfit_ = 0, visible_ = 0;
  Rows light_, chroma_;
  GreyValues shown_behind_;  // what the camera's curve makes of what is behind; by make_rows()
  std::vector<Mark> marks_;
  std::vector<std::uint8_t> near_marks_;  // of the box, row by row
};

}  // namespace huetrack::outline
