// A page that shows what is being detected, while it is: an HTML file that reloads itself, to be opened in a browser.
#pragma once

#include <chrono>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "calib/gather/view_coverage.h"

namespace huetrack::gather {

// What one camera sees now.
struct ShownPicture {
  std::string camera;
  cv::Mat grey;  // empty: nothing yet
  std::string caption;
  std::vector<Eigen::Vector2d> corners;  // in the picture's pixels
};

// thread-compatible.
class DetectionPage {
 public:
  explicit DetectionPage(std::filesystem::path file);  // empty: there is no page, and nothing happens

  bool due() const;  // it is written once a second: ask before gathering what it shows
  // throws std::system_error
  void show(const std::vector<ShownPicture>& pictures, const ViewCoverage& coverage, const std::string& status);
  void close(const std::string& status);  // a last page that does not reload; does not throw

 private:
  void write(const std::string& body, bool reload);

  std::filesystem::path file_;
  std::string last_body_;
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace huetrack::gather
