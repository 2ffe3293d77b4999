#include "calib/gather/detection_page.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <system_error>

#include "calib/gather/write_file.h"
#include "calib/report/calibration_report.h"
#include "calib/report/html.h"

namespace huetrack::gather {
namespace {

constexpr std::string_view style =
    "body{font:15px system-ui,sans-serif;margin:16px;background:#14181d;color:#e8ecf0}"
    ".row{display:flex;flex-wrap:wrap;gap:16px}figure{margin:0}figcaption{color:#a9b4c0;font-size:13px}"
    "li{margin:4px 0;font-size:18px}svg text{fill:#e8ecf0;font:12px system-ui}";

using report::escaped;

std::string embedded(const cv::Mat& bgr) {
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", bgr, jpeg, {cv::IMWRITE_JPEG_QUALITY, 70});
  return report::data_uri(jpeg);
}

std::string picture(const ShownPicture& shown) {
  if (shown.grey.empty())
    return "<figure><figcaption>" + escaped(shown.camera) + ": no image yet</figcaption></figure>";
  constexpr double width = 420;
  const double scale = width / shown.grey.cols;
  cv::Mat small, bgr;
  cv::resize(shown.grey, small, {}, scale, scale, cv::INTER_AREA);
  cv::cvtColor(small, bgr, cv::COLOR_GRAY2BGR);
  for (const auto& corner : shown.corners) {
    cv::circle(bgr, cv::Point2d(scale * (corner.x() + 0.5), scale * (corner.y() + 0.5)), 3, cv::Scalar(80, 220, 60), 1,
               cv::LINE_AA);
  }
  return "<figure><img src='" + embedded(bgr) + "'><figcaption><b>" + escaped(shown.camera) + "</b> " +
         escaped(shown.caption) + "</figcaption></figure>";
}

std::string map_of(const ViewCoverage::CameraCoverage& camera) {
  constexpr double cell = 24;
  std::string svg =
      fmt::format("<svg width='{:.0f}' height='{:.0f}'>", ViewCoverage::columns * cell, ViewCoverage::rows * cell);
  for (int row = 0; row < ViewCoverage::rows; ++row) {
    for (int column = 0; column < ViewCoverage::columns; ++column) {
      const int n = camera.corners[static_cast<std::size_t>(row * ViewCoverage::columns + column)];
      svg += fmt::format("<rect x='{:.0f}' y='{:.0f}' width='22' height='22' fill='{}'/>", column * cell, row * cell,
                         n == 0   ? "#39424d"
                         : n < 30 ? "#2f7d4f"
                                  : "#3fbf74");
    }
  }
  return svg + "</svg>";
}

}  // namespace

DetectionPage::DetectionPage(std::filesystem::path file) : file_(std::move(file)) {}

bool DetectionPage::due() const {
  return !file_.empty() && std::chrono::steady_clock::now() - last_ >= std::chrono::seconds(1);
}

void DetectionPage::show(const std::vector<ShownPicture>& pictures, const ViewCoverage& coverage,
                         const std::string& status) {
  if (file_.empty()) return;
  std::string body = "<h2>" + escaped(status) + "</h2>";
  const auto needs = coverage.needs();
  if (needs.empty()) body += "<p>Nothing is missing.</p>";
  if (!needs.empty()) {
    body += "<ul>";
    for (std::size_t i = 0; i < std::min<std::size_t>(5, needs.size()); ++i)
      body += "<li>" + escaped(needs[i]) + "</li>";
    body += "</ul>";
  }
  body += "<div class=row>";
  for (std::size_t c = 0; c < pictures.size(); ++c) {
    const auto& of = coverage.cameras()[c];
    body += "<div>" + picture(pictures[c]) + map_of(of) +
            fmt::format("<div>{} of {} views, {:.0f} % of the image ({:.0f} needed), {} of 5 tilts</div></div>",
                        of.views, ViewCoverage::enough_views, 100 * of.image_share(), 100 * ViewCoverage::enough_image,
                        of.tilts_seen());
  }
  body += "</div>";
  if (const std::string lacking = coverage.lacking_pairs(); !lacking.empty())
    body += "<p>Missing shared views: " + escaped(lacking) + "</p>";
  last_body_ = body;
  write(last_body_, true);
  last_ = std::chrono::steady_clock::now();
}

void DetectionPage::close(const std::string& status) {
  if (file_.empty()) return;
  try {
    write("<h2>" + escaped(status) + "</h2>" + last_body_, false);
  } catch (const std::system_error& error) {  // a page that cannot be written must not end the calibration
    std::fprintf(stderr, "huetrack-calibrate: %s\n", error.what());
  }
}

void DetectionPage::write(const std::string& body, bool reload) {
  std::string page = "<!doctype html><html><head><meta charset=utf-8><title>huetrack-calibrate</title>";
  if (reload) page += "<meta http-equiv=refresh content=1>";
  page.append("<style>").append(style).append("</style></head><body>").append(body).append("</body></html>\n");
  write_files({{file_, page}});
}

}  // namespace huetrack::gather
