#include "calib/certify/certificate.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "calib/report/certificate_report.h"
#include "certify/covered_by.h"

namespace huetrack::certify {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using testing::HasSubstr;

constexpr double length_m = 0.4;

// A bar that is carried about and turned, its ends measured with this noise; all lengths are `scale` times too long.
struct Carried {
  double noise_m = 0.002, stated_m = 0.002, scale = 1, lag_s = 0, seconds = 90;
  unsigned seed = 1;

  Vector3d end(double t, double sign) const {
    const Vector3d at(0.7 * std::sin(0.6 * t + seed), 0.6 * std::cos(0.5 * t), 1 + 0.5 * std::sin(0.8 * t));
    const double heading = 0.7 * t, rise = 1.2 * std::sin(0.55 * t);
    return at + sign * length_m / 2 *
                    Vector3d(std::cos(heading) * std::cos(rise), std::sin(heading) * std::cos(rise), std::sin(rise));
  }
  std::array<BallTrack, 2> tracks() const {
    std::mt19937 rng(seed);
    std::normal_distribution<double> noise(0, noise_m);
    std::array<BallTrack, 2> out;
    for (int k = 0; k < 30 * seconds; ++k) {
      for (const std::size_t ball : {0U, 1U}) {
        const double t = k / 30.0 + (ball == 1 ? lag_s : 0), sign = ball == 0 ? -1 : 1;
        BallFix fix{.t_s = t, .position = scale * end(t, sign) + Vector3d(noise(rng), noise(rng), noise(rng))};
        fix.velocity = (end(t + 1e-4, sign) - end(t - 1e-4, sign)) / 2e-4;
        fix.covariance = stated_m * stated_m * Matrix3d::Identity();
        out[ball].push_back(fix);
      }
    }
    return out;
  }
  std::vector<MeasuredLength> lengths() const {
    const auto both = tracks();
    return bar_lengths(both[0], both[1], length_m, {});
  }
};

TEST(Certificate, ItsUncertaintyCoversNineteenOfTwentyLengthsThatAreMeasuredLater) {
  for (const double scale : {1.0, 1.01}) {  // without and with a mistake that is in all of them
    const Certificate c = certificate_of(Carried{.scale = scale}.lengths(), 0);
    EXPECT_GT(c.independent, 50u);
    EXPECT_GE(c.directions_measured(), 5u);
    EXPECT_NEAR(c.mean_m, (scale - 1) * length_m, 3e-4);
    const double later = covered_by(c.expanded_m, Carried{.scale = scale, .seed = 2}.lengths());
    EXPECT_GT(later, 0.93);
    EXPECT_LT(later, 0.98);
  }
}

TEST(Certificate, TellsWhetherTheCovariancesWereHonest) {
  const Certificate honest = certificate_of(Carried{}.lengths(), 0);
  EXPECT_NEAR(honest.inside_stated, 0.95, 0.02);
  EXPECT_NEAR(honest.surprise, 1, 0.1);
  EXPECT_NEAR(honest.stated_expanded_m, 1.96 * std::sqrt(2) * 0.002, 1e-5);
  const Certificate sure = certificate_of(Carried{.stated_m = 0.0005}.lengths(), 0);
  EXPECT_NEAR(sure.surprise, 16, 2);
  EXPECT_LT(sure.inside_stated, 0.5);
}

TEST(Certificate, BallsAreComparedAtOneMoment) {
  const Certificate c = certificate_of(Carried{.noise_m = 0, .lag_s = 0.015}.lengths(), 0);
  EXPECT_GT(c.lengths, 2000u);
  EXPECT_LT(c.largest_m, 5e-4);  // the ends move by up to 15 mm in that time
}

TEST(Certificate, WhatIsNotKnownOfTheBarIsInIt) {
  const auto lengths = Carried{.noise_m = 0.0001}.lengths();
  EXPECT_NEAR(certificate_of(lengths, 0.001).expanded_m, 1.96e-3, 1e-4);
}

TEST(Certificate, RestsAtMarkedPlacesGiveLengths) {
  const std::vector<MarkedPlace> places{{"a", {0, 0, 0}}, {"b", {1, 0, 0}}, {"c", {0, 1, 0.5}}};
  BallTrack track;
  std::mt19937 rng(3);
  std::normal_distribution<double> noise(0, 0.001);
  double t = 0;
  for (const std::size_t place : {0U, 1U, 2U, 0U}) {
    for (int k = 0; k < 60; ++k, t += 1.0 / 30) {
      BallFix fix{.t_s = t, .position = 1.02 * places[place].p_world + Vector3d(noise(rng), noise(rng), noise(rng))};
      if (k < 30) fix.velocity = {0.4, 0, 0};  // carried there
      track.push_back(fix);
    }
  }
  const auto rests = rests_of(track);
  ASSERT_EQ(rests.size(), 4u);
  EXPECT_NEAR(rests[1].scatter_m, 0.001 * std::sqrt(3), 4e-4);
  const auto visits = visits_of(rests, places);
  ASSERT_EQ(visits.size(), 4u);
  EXPECT_EQ(visits[3].place, 0u);
  const auto lengths = place_lengths(visits, places, {});
  ASSERT_EQ(lengths.size(), 5u);  // of six pairs one is of the same place
  EXPECT_NEAR(lengths[0].error_m, 0.02, 1e-3);
}

TEST(CertificateReport, PassesFailsOrAsksForMore) {
  const calib::CameraRig rig;
  const auto verdict = [&](const Carried& carried, std::optional<double> limit_m) {
    const auto lengths = carried.lengths();
    return report::report_on(certificate_of(lengths, 3e-4), lengths, rig,
                             {.rig_name = "rig", .what = "a bar", .limit_m = limit_m});
  };
  const report::CertificateReport pass = verdict({}, 0.010);
  EXPECT_EQ(pass.verdict, report::Verdict::usable);
  EXPECT_THAT(report::to_text(pass.document),
              AllOf(HasSubstr("PASS: "), HasSubstr("along z"), HasSubstr("That is honest")));
  EXPECT_THAT(report::to_html(pass.document), AllOf(HasSubstr("<svg"), HasSubstr("<b>PASS.</b>")));
  const std::string pdf = report::to_pdf(pass.document);
  EXPECT_THAT(pdf, testing::StartsWith("%PDF-"));
  EXPECT_EQ(pdf, report::to_pdf(pass.document));
  const report::CertificateReport fail = verdict({}, 0.004);
  EXPECT_EQ(fail.verdict, report::Verdict::failed);
  EXPECT_THAT(report::to_text(fail.document), HasSubstr("FAIL: "));
  const report::CertificateReport little = verdict({.seconds = 8}, 0.010);
  EXPECT_EQ(little.verdict, report::Verdict::doubtful);
  EXPECT_THAT(little.doubts.front(), HasSubstr("carry it on"));
  EXPECT_EQ(verdict({}, std::nullopt).verdict, report::Verdict::doubtful);
}

}  // namespace
}  // namespace huetrack::certify
