// A file with a truth in it, for the tests of what reads it and of what is held to it.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "truth/truth.h"

namespace huetrack::truth {

class TruthFile : public testing::Test {
 protected:
  TruthFile()
      : file_(std::filesystem::path(testing::TempDir()) /
              ("truth_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".csv")) {}
  ~TruthFile() override { std::filesystem::remove(file_); }
  Truth truth(const std::string& text) const {
    std::ofstream(file_) << text;
    return Truth::read(file_);
  }
  std::filesystem::path file_;
};

// A ball that goes along x at 1 m/s, 10 samples a second.
inline const std::string along_x = [] {
  std::string text = "frame,t,ball,x,y,z,more\n";
  for (int i = 0; i <= 20; ++i) {
    text += fmt::format("{},{:.6f},ball,{:.6f},2,3,1\n", i, 0.1 * i, 0.1 * i);
  }
  return text;
}();

}  // namespace huetrack::truth
