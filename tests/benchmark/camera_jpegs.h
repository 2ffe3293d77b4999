// The pictures of a rendered scene as a camera sends them: JPEGs with a sensor's noise.
#pragma once

#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "benchmark/sequence.h"
#include "pictures/pictures.h"

namespace huetrack::figures {

// Each frame has its JPEG (Frame::encoded) instead of its pixels.
inline void compress(Sequence& sequence) {
  constexpr int quality = 90;
  constexpr double noise_luma = 2.2, noise_chroma = 0.6;  // grey values
  for (capture::FrameSet& set : sequence.sets) {
    for (auto& frame : set.frames) {
      cv::Mat ycc, noise(frame->pixels.height, frame->pixels.width, CV_16SC3), bgr;
      cv::cvtColor(pictures::bgr_of(frame->pixels), ycc, cv::COLOR_BGR2YCrCb);
      cv::randn(noise, cv::Scalar::all(0), cv::Scalar(noise_luma, noise_chroma, noise_chroma));
      cv::add(ycc, noise, ycc, cv::noArray(), CV_8UC3);
      cv::cvtColor(ycc, bgr, cv::COLOR_YCrCb2BGR);
      auto jpeg = std::make_shared<std::vector<std::uint8_t>>();
      cv::imencode(".jpg", bgr, *jpeg, {cv::IMWRITE_JPEG_QUALITY, quality});
      frame->encoded = std::move(jpeg);
      frame->pixels = {};
    }
  }
}

}  // namespace huetrack::figures
