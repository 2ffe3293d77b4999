// Exports of motion-capture systems as ground truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/files/config_error.h"
#include "truth/truth_file.h"

namespace huetrack::truth {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class MotionCapture : public TruthFile {
 protected:
  std::string error_of(const std::string& text) {
    try {
      truth(text);
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "";
  }
};

std::string at(const Truth& truth, const std::string& name, std::size_t i) {
  const auto& sample = truth.targets().at(name).at(i);
  const Eigen::Vector3d p = sample.position;
  char text[100];
  std::snprintf(text, sizeof text, "%.4f %.4f %.4f %.4f",
                std::chrono::duration<double>(sample.at.time_since_epoch()).count(), p.x(), p.y(), p.z());
  return text;
}

TEST_F(MotionCapture, OfMotive) {
  const Truth motive = truth(
      "Format Version,1.23,Take Name,Take 1,Capture Frame Rate,100.000000,Length Units,Millimeters,"
      "Coordinate Space,Global\n"
      "\n"
      ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid "
      "Body,Marker,Marker,Marker\n"
      ",Name,ball,ball,ball,ball,ball,ball,ball,ball,M:1,M:1,M:1\n"
      ",ID,\"1\",\"1\",\"1\",\"1\",\"1\",\"1\",\"1\",\"1\",\"2\",\"2\",\"2\"\n"
      ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,Position,Position,Position\n"
      "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z\n"
      "0,0.000000,0,0,0,1,1000,2000,3000,0.1,1,2,3\n"
      "1,0.010000,0,0,0,1,1001,2000,3000,0.1,,,\n"
      "2,0.020000,0,0,0,1,1002,2000,3000,0.1,3,2,1\n");
  EXPECT_EQ(motive.targets().size(), 2u);
  EXPECT_EQ(at(motive, "ball", 1), "0.0100 1.0010 2.0000 3.0000");
  EXPECT_EQ(motive.targets().at("M:1").size(), 2u) << "not seen once";
  EXPECT_EQ(at(motive, "M:1", 1), "0.0200 0.0030 0.0020 0.0010");
}

TEST_F(MotionCapture, OfOlderMotivesWithoutRowLabels) {
  const Truth motive = truth(
      "Format Version,1.2,Take Name,T,Length Units,Meters\n\n"
      ",,Marker,Marker,Marker\n,,ball,ball,ball\n,,1,1,1\n,,Position,Position,Position\n"
      "Frame,Time,X,Y,Z\n0,0,1,2,3\n1,0.5,2,3,4\n");
  EXPECT_EQ(at(motive, "ball", 1), "0.5000 2.0000 3.0000 4.0000");
}

TEST_F(MotionCapture, OfViconNexus) {
  const Truth vicon = truth(
      "Devices\n1000\n,,Force\nFrame,Sub Frame,Fx\n,,N\n1,0,5\n\n"
      "Trajectories\n100\n,,wand:W1,,,ball,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n"
      "1,0,1,2,3,1000,0,500\n2,0,,,,1010,0,500\n");
  EXPECT_EQ(vicon.targets().at("wand:W1").size(), 1u);
  EXPECT_EQ(at(vicon, "ball", 0), "0.0000 1.0000 0.0000 0.5000");
  EXPECT_EQ(at(vicon, "ball", 1), "0.0100 1.0100 0.0000 0.5000");
}

TEST_F(MotionCapture, OfViconTracker) {
  const Truth vicon = truth(
      "Objects\n50\n,,Global Angle ball:ball,,,,,\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ\n,,rad,rad,rad,mm,mm,mm\n"
      "11,0,0,0,0,1000,2000,3000\n");
  EXPECT_EQ(at(vicon, "Global Angle ball:ball", 0), "0.2000 1.0000 2.0000 3.0000");
}

TEST_F(MotionCapture, OfQualisys) {
  const std::string header =
      "NO_OF_FRAMES\t2\nNO_OF_CAMERAS\t8\nNO_OF_MARKERS\t2\nFREQUENCY\t100\nNO_OF_ANALOG\t0\nANALOG_FREQUENCY\t0\n"
      "DESCRIPTION\t--\nTIME_STAMP\t2019-11-28, 13:43:42\nDATA_INCLUDED\t3D\nMARKER_NAMES\tball\tother\n";
  const Truth bare = truth(header + "1000\t2\t3\t5\t6\t7\n1001\t2\t3\t0.000\t0.000\t0.000\n");
  EXPECT_EQ(at(bare, "ball", 1), "0.0100 1.0010 0.0020 0.0030");
  EXPECT_EQ(bare.targets().at("other").size(), 1u) << "zeros: not seen";
  const Truth titled = truth(header +
                             "Frame\tTime\tball X\tball Y\tball Z\tother X\tother Y\tother Z\n"
                             "1\t0.5\t1000\t2\t3\t\t\t\n");
  EXPECT_EQ(at(titled, "ball", 0), "0.5000 1.0000 0.0020 0.0030");
  EXPECT_THAT(error_of("NO_OF_FRAMES\t2\nDATA_INCLUDED\t6D\n"), HasSubstr("export the markers' positions (3D)"));
}

TEST_F(MotionCapture, OfTum) {
  const Truth tum = truth("# timestamp tx ty tz qx qy qz qw\n1.5 1 2 3 0 0 0 1\n1.6 1.1 2 3 0 0 0 1\n");
  EXPECT_EQ(at(tum, "", 1), "1.6000 1.1000 2.0000 3.0000");
}

TEST_F(MotionCapture, MistakesHaveALine) {
  EXPECT_THAT(error_of("Format Version,1.23,Length Units,Furlongs\n"), HasSubstr(":1: the length unit \"Furlongs\""));
  EXPECT_THAT(error_of("Trajectories\nx\n"), HasSubstr(":2: "));
  EXPECT_THAT(error_of("Trajectories\n100\n,,a,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n1,0,1,2,x\n"),
              HasSubstr(":6: \"x\" is not a number"));
  EXPECT_THAT(error_of("Trajectories\n100\n,,a,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n2,0,1,2,3\n2,0,1,2,3\n"),
              HasSubstr("times must grow"));
  EXPECT_THAT(error_of("1 2 3 4 0 0 0 1\n1 2\n"), HasSubstr(":2: a row of TUM has 8 numbers"));
}

}  // namespace
}  // namespace huetrack::truth
