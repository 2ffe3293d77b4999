// A live page of the detection: an HTML file that reloads itself, for a browser.
#pragma once

#include <chrono>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "calib/gather/view_coverage.h"

namespace huetrack::gather {

// The current image of one camera.
struct ShownPicture {
  std::string camera;
  cv::Mat grey;  // empty: none yet
  std::string caption;
  std::vector<Eigen::Vector2d> corners;  // pixels of the image
};

// thread-compatible.
class DetectionPage {
 public:
  explicit DetectionPage(std::filesystem::path file);  // empty: no page; all calls do nothing

  bool due() const;  // once a second: ask before gathering the content
  // throws std::system_error
  void show(const std::vector<ShownPicture>& pictures, const ViewCoverage& coverage, const std::string& status);
  void close(const std::string& status);  // writes a final page that does not reload; does not throw

 private:
  void write(const std::string& body, bool reload);

  std::filesystem::path file_;
  std::string last_body_;
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace huetrack::gather
