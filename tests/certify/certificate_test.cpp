#include "calib/certify/certificate.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>
#include <set>

#include "calib/report/certificate_report.h"
#include "certify/carried_bar.h"
#include "certify/covered_by.h"
#include "drawn.h"

namespace huetrack::certify {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;
using testing::Not;

TEST(Certificate, ExpandedUncertaintyCoversFutureLengths) {
  for (const double scale : {1.0, 1.01}) {  // without and with a mistake that is in all of them
    const Certificate c = certificate_of(CarriedBar{.scale = scale}.lengths(), 0);
    EXPECT_GT(c.independent, 50u);
    EXPECT_GE(c.directions_measured(), 5u);
    EXPECT_NEAR(c.mean_m, (scale - 1) * carried_length_m, 3e-4);
    const double later = covered_by(c.expanded_m, CarriedBar{.scale = scale, .seed = 2}.lengths());
    EXPECT_GT(later, 0.93);
    EXPECT_LT(later, 0.98);
  }
}

TEST(Certificate, ReportsConsistencyOfCovariances) {
  const Certificate honest = certificate_of(CarriedBar{}.lengths(), 0);
  EXPECT_NEAR(honest.inside_stated, 0.95, 0.02);
  EXPECT_NEAR(honest.mean_nes, 1, 0.1);
  EXPECT_NEAR(honest.stated_expanded_m, 1.96 * std::sqrt(2) * 0.002, 1e-5);
  const Certificate sure = certificate_of(CarriedBar{.stated_m = 0.0005}.lengths(), 0);
  EXPECT_NEAR(sure.mean_nes, 16, 2);
  EXPECT_LT(sure.inside_stated, 0.5);
}

TEST(Certificate, ComparesBallsAtOneMoment) {
  const Certificate c = certificate_of(CarriedBar{.noise_m = 0, .lag_s = 0.015}.lengths(), 0);
  EXPECT_GT(c.lengths, 2000u);
  EXPECT_LT(c.largest_m, 5e-4);  // the ends move by up to 15 mm in that time
}

TEST(Certificate, RequiresBothBallsInOneFrameSet) {
  auto both = CarriedBar{.noise_m = 0}.tracks();
  const std::size_t all = both[0].size();
  std::erase_if(both[1], [n = 0](const BallFix&) mutable { return n++ % 3 == 0; });
  EXPECT_EQ(bar_lengths(both[0], both[1], carried_length_m, {}).size(), both[1].size());
  EXPECT_LT(both[1].size(), all);
}

TEST(Certificate, RestingBarIsOneMeasurement) {
  auto both = CarriedBar{.noise_m = 0.001}.tracks();
  for (const std::size_t ball : {0U, 1U})
    for (BallFix& fix : both[ball]) fix.position = CarriedBar{}.end(0, ball == 0 ? -1 : 1) + 0.001 * Vector3d::Random();
  EXPECT_EQ(certificate_of(bar_lengths(both[0], both[1], carried_length_m, {}), 0).independent, 1u);
}

TEST(Certificate, IncludesUncertaintyOfTheBar) {
  const auto lengths = CarriedBar{.noise_m = 0.0001}.lengths();
  EXPECT_NEAR(certificate_of(lengths, 0.001).expanded_m, 1.96e-3, 1e-4);
}

TEST(Certificate, RestsAtMarkedPlacesGiveLengths) {
  const std::vector<MarkedPlace> places{{"a", {0, 0, 0}}, {"b", {1, 0, 0}}, {"c", {0, 1, 0.5}}};
  BallTrack track;
  std::mt19937 rng(3);
  std::normal_distribution<double> noise(0, 0.001);
  double t = 0;
  Vector3d from = places[0].p_world;
  for (const std::size_t place : {0U, 1U, 2U, 0U}) {
    const Vector3d to = places[place].p_world;
    for (int k = 0; k < 60; ++k, t += 1.0 / 30) {
      const double way = std::min(1.0, k / 30.0);  // carried there for a second, and put down
      BallFix fix{.t_s = t, .position = 1.02 * (from + way * (to - from)) + drawn<3>(rng, noise)};
      fix.velocity = (k < 30 ? 1.0 : 0.0) * (to - from) + 50 * drawn<3>(rng, noise);
      track.push_back(fix);
    }
    from = to;
  }
  const auto rests = rests_of(track);
  ASSERT_EQ(rests.size(), 4u);  // published velocities of 0.09 m/s at rest: a ball of a few pixels
  EXPECT_NEAR(rests[1].scatter_m, 0.001 * std::sqrt(3), 4e-4);
  EXPECT_LT((rests[1].position - 1.02 * places[1].p_world).norm(), 1e-3);
  const auto visits = visits_of(rests, places);
  ASSERT_EQ(visits.size(), 4u);
  EXPECT_EQ(visits[3].place, 0u);
  const auto lengths = place_lengths(visits, places, {});
  ASSERT_EQ(lengths.size(), 5u);  // of six pairs one is of the same place
  EXPECT_NEAR(lengths[0].error_m, 0.02, 1e-3);

  for (BallFix& fix : track) fix.position += Vector3d(0.05 * fix.t_s, 0, 0);  // nothing stands still
  EXPECT_TRUE(rests_of(track).empty());
  for (BallFix& fix : track) fix.position = {0.02 * std::sin(25 * fix.t_s), 0, 1};  // held, but shaken
  EXPECT_TRUE(rests_of(track).empty());
}

TEST(CertificateReport, ComparesStatedAndMeasuredErrors) {
  const calib::CameraRig rig;
  const auto text = [&](double stated_m) {
    const auto lengths = CarriedBar{.stated_m = stated_m}.lengths();
    return report::to_text(
        report::report_on(certificate_of(lengths, 3e-4), lengths, rig, {.rig_name = "rig", .what = "a bar"}).document);
  };
  EXPECT_THAT(text(0.002), HasSubstr("The covariances are consistent."));
  EXPECT_THAT(text(0.004),
              AllOf(HasSubstr("conservative: errors are 0.5"), Not(HasSubstr("The covariances are consistent"))));
  EXPECT_THAT(text(0.0014), HasSubstr("somewhat too small"));
  EXPECT_THAT(text(0.0008), HasSubstr("The covariances are too small"));
}

TEST(CertificateReport, PassesFailsOrAsksForMore) {
  const calib::CameraRig rig;
  const auto verdict = [&](const CarriedBar& carried, std::optional<double> limit_m) {
    const auto lengths = carried.lengths();
    return report::report_on(certificate_of(lengths, 3e-4), lengths, rig,
                             {.rig_name = "rig", .what = "a bar", .limit_m = limit_m});
  };
  const report::CertificateReport pass = verdict({}, 0.010);
  EXPECT_EQ(pass.verdict, report::Verdict::usable);
  EXPECT_THAT(report::to_text(pass.document),
              AllOf(HasSubstr("PASS: "), HasSubstr("along z"), HasSubstr("The covariances are consistent.")));
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

// A browser looks a name up in the whole page.
TEST(CertificateReport, FiguresShareNoNames) {
  const auto lengths = CarriedBar{}.lengths();
  const std::string html = report::to_html(
      report::report_on(certificate_of(lengths, 3e-4), lengths, {}, {.rig_name = "rig", .what = "a bar"}).document);
  const auto quoted_after = [&](const std::string& before) {
    std::vector<std::string> out;
    for (std::size_t at = html.find(before); at != std::string::npos; at = html.find(before, at + 1))
      out.push_back(html.substr(at + before.size(), html.find('"', at + before.size()) - at - before.size()));
    return out;
  };
  const std::vector<std::string> given = quoted_after(" id=\"");
  const std::set<std::string> names(given.begin(), given.end());
  EXPECT_GT(given.size(), 20u);
  EXPECT_EQ(names.size(), given.size());
  for (const std::string& used : quoted_after("href=\"#")) EXPECT_TRUE(names.contains(used)) << used;
}

// What the service would have named of the rig is in the certificate: a PASS beside it would be worth nothing.
TEST(CertificateReport, FaultsReportedDuringTrackingAreDoubts) {
  const auto both = CarriedBar{}.tracks();
  const OneColorBar bar = one_color_bar(both, {}, carried_length_m, {});
  report::CertificateInput input{.rig_name = "rig", .what = "a bar", .limit_m = 0.010};
  const auto report = [&] { return report::report_on(certificate_of(bar.lengths, 3e-4), bar.lengths, {}, input); };
  EXPECT_EQ(report().verdict, report::Verdict::usable);
  input.named = {"from 3.0 s on: cam1 looks turned by 1 degree"};
  EXPECT_EQ(report().verdict, report::Verdict::doubtful);
  EXPECT_THAT(report::to_text(report().document),
              AllOf(HasSubstr("DOUBTFUL: "), HasSubstr("during tracking: from 3.0 s on: cam1 looks turned")));
}

TEST(CertificateReport, OneColorBarReportsUnusedSets) {
  const auto both = CarriedBar{}.tracks();
  const OneColorBar bar = one_color_bar(both, {}, carried_length_m, {});
  const auto verdict = [&](const OneColorBar& bar) {
    report::CertificateInput input{.rig_name = "rig", .what = "a bar", .limit_m = 0.010};
    input.one_color = {.bar = bar, .length_m = carried_length_m, .sets = both[0].size() + 30};
    return report::report_on(certificate_of(bar.lengths, 3e-4), bar.lengths, {}, input);
  };
  EXPECT_EQ(verdict(bar).verdict, report::Verdict::usable);
  EXPECT_THAT(report::to_text(verdict(bar).document), HasSubstr("Of 2730 frame sets 2700 gave a length"));

  OneColorBar with_other = bar;
  with_other.others.push_back({.from_s = 3, .to_s = 4, .least_m = 0.8, .most_m = 0.9, .sets = 30});
  EXPECT_EQ(verdict(with_other).verdict, report::Verdict::doubtful);
  EXPECT_THAT(report::to_text(verdict(with_other).document),
              AllOf(HasSubstr("DOUBTFUL: "), HasSubstr("800 to 900 mm apart, but the bar has 400 mm"),
                    HasSubstr("something else")));

  OneColorBar with_third = bar;
  with_third.with_third = 20;
  EXPECT_EQ(verdict(with_third).verdict, report::Verdict::usable);  // for a moment
  with_third.with_third = 400;
  EXPECT_EQ(verdict(with_third).verdict, report::Verdict::doubtful);
}

}  // namespace
}  // namespace huetrack::certify
