// Which moments of a recording are looked at and kept, for a board that moves.
#include "calib/gather/find_boards.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "board/drawn_board.h"
#include "gather/pictured_rig.h"

namespace huetrack::gather {
namespace {

// A board that goes slowly past one camera, ten sets a second.
class Passing final : public PictureSource {
 public:
  Passing(int sets, bool has_stamps) : sets_(sets), has_stamps_(has_stamps) {}
  const std::vector<std::string>& cameras() const override { return names_; }
  std::optional<int> expected_sets() const override { return sets_; }
  bool has_stamps() const override { return has_stamps_; }
  std::vector<std::string> take_warnings() override { return {}; }
  std::optional<PictureSet> next(std::stop_token) override {
    if (at_ == sets_) return std::nullopt;
    calib::Rigid3d pose = pictured_poses(1)[0];
    pose.translation.y() += 0.3 * at_ / sets_;
    PictureSet set{.number = at_, .at_s = 0.1 * at_, .pictures = {}};
    LabelledPicture picture{picture_of(rig_.cameras[1], pictured_board(), pose, 7), std::to_string(at_), {}};
    if (has_stamps_) picture.stamp_s = 0.1 * at_ + 0.004;
    set.pictures.emplace_back(std::move(picture));
    ++at_;
    return set;
  }

 private:
  int sets_;
  bool has_stamps_;
  int at_ = 0;
  calib::CameraRig rig_ = pictured_rig();
  std::vector<std::string> names_{"cam1"};
};

FoundBoards found(int sets, bool has_stamps, FindBoardsOptions options) {
  Passing source(sets, has_stamps);
  options.progress = false;
  return find_boards(source, board::BoardDetector(pictured_board()), options, {});
}

TEST(FindBoards, KeepsPairsOfSetsWithTimeStamps) {
  const FoundBoards with = found(12, true, {.max_sets = 3});
  ASSERT_EQ(with.set_at_s.size(), 6U);
  for (std::size_t s = 0; s < 6; s += 2) EXPECT_NEAR(with.set_at_s[s + 1] - with.set_at_s[s], 0.1, 1e-9);
  for (const solver::BoardView& view : with.views)
    EXPECT_NEAR(view.stamp_s.value(), with.set_at_s[static_cast<std::size_t>(view.set)] + 0.004, 1e-9);
  EXPECT_EQ(with.thinned, 6);
  const FoundBoards without = found(12, false, {.max_sets = 3});
  EXPECT_EQ(without.set_at_s.size(), 3U);
  for (const solver::BoardView& view : without.views) EXPECT_FALSE(view.stamp_s);
}

TEST(FindBoards, ProcessesPairsOfALongRecording) {
  const FoundBoards pairs = found(12, true, {.look_at = 4});
  EXPECT_EQ(pairs.sets_looked_at, 4);
  for (std::size_t s = 0; s < 4; ++s) EXPECT_NEAR(pairs.set_at_s.at(s), (std::array{0.0, 0.1, 0.6, 0.7}[s]), 1e-9);
  const FoundBoards stills = found(12, false, {.look_at = 4});
  EXPECT_EQ(stills.sets_looked_at, 4);
  EXPECT_NEAR(stills.set_at_s.at(1), 0.3, 1e-9);
  EXPECT_NEAR(found(12, true, {.every = 3}).set_at_s.at(1), 0.3, 1e-9);  // as was asked for
}

// A picture of each of these boards.
class BoardPictures final : public PictureSource {
 public:
  explicit BoardPictures(const std::vector<board::Board>& boards) {
    for (const board::Board& board : boards) {
      const board::DrawnBoard drawn = board::draw_board(board);
      const double w = drawn.image.cols, h = drawn.image.rows;
      pictures_.push_back(
          board::seen_through(drawn.image, {400 / w, 20 / h, 110, 15 / w, 300 / h, 80, 0, 0, 1}, {640, 480}, 2, 1));
    }
  }
  const std::vector<std::string>& cameras() const override { return names_; }
  std::optional<int> expected_sets() const override { return static_cast<int>(pictures_.size()); }
  bool has_stamps() const override { return false; }
  std::vector<std::string> take_warnings() override { return {}; }
  std::optional<PictureSet> next(std::stop_token) override {
    if (at_ == pictures_.size()) return std::nullopt;
    PictureSet set{.number = static_cast<int>(at_), .at_s = 0, .pictures = {}};
    set.pictures.emplace_back(LabelledPicture{pictures_[at_++], "one", {}});
    return set;
  }

 private:
  std::vector<cv::Mat> pictures_;
  std::size_t at_ = 0;
  std::vector<std::string> names_{"cam1"};
};

TEST(FindBoards, ReportsWrongMarkerSizes) {
  const board::Board real{.type = board::BoardType::charuco, .columns = 7, .rows = 5, .marker = 0.0225};
  board::Board wrong = real;
  wrong.marker = 0.02;
  const auto doubt = [&](const board::Board& in_file) {
    BoardPictures source({real});
    return find_boards(source, board::BoardDetector(in_file), {.progress = false, .page = {}}, {}).board_doubt;
  };
  EXPECT_EQ(doubt(real), "");
  EXPECT_THAT(doubt(wrong),
              testing::AllOf(testing::HasSubstr("one of the two lengths is wrong"),
                             testing::HasSubstr("markers are 0.74"), testing::HasSubstr("rather than 0.667")));
}

// As Kalibr's tagSpacing, which is measured with a ruler. Corners of soft edges are detected inside the marker.
TEST(FindBoards, ReportsWrongGapsOfAGrid) {
  const board::Board real{.type = board::BoardType::aruco_grid, .columns = 5, .rows = 4, .marker = 0.024};
  const auto doubt = [&](double pitch) {
    board::Board in_file = real;
    in_file.pitch.setConstant(pitch);
    BoardPictures source({real});
    return find_boards(source, board::BoardDetector(in_file), {.progress = false, .page = {}}, {}).board_doubt;
  };
  EXPECT_EQ(doubt(real.pitch.x()), "");
  for (const double wrong : {0.029, 0.0315})
    EXPECT_THAT(doubt(wrong), testing::AllOf(testing::HasSubstr("gaps are 0.26"), testing::HasSubstr("gap: 0.006"),
                                             testing::HasSubstr("tagSpacing: 0.26")));
}

// In some pictures so little is seen of the board that it is found all the same.
TEST(FindBoards, ReportsSwappedColumnsAndRows) {
  const board::Board in_file{.type = board::BoardType::charuco, .columns = 7, .rows = 5, .marker = 0.0225};
  board::Board real = in_file;
  std::swap(real.columns, real.rows);
  const auto look = [&](const std::vector<board::Board>& boards) {
    BoardPictures source(boards);
    return find_boards(source, board::BoardDetector(in_file), {.progress = false, .page = {}}, {}).cameras[0].boards;
  };
  try {
    look({in_file, real, real, real});
    FAIL() << "it was taken";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("in 3 of 4 images"),
                                             testing::HasSubstr("they fit with squares: [5, 7] in the board file")));
  }
  EXPECT_EQ(look({in_file, in_file, real}), 2);
}

// Most pictures show a larger board; in few of them so little is seen of it that the file's board is found.
TEST(FindBoards, AWrongNumberOfCornersIsNamedWhereTheBoardWasFoundInAFewPictures) {
  const board::Board real{.type = board::BoardType::chessboard, .columns = 9, .rows = 6};
  board::Board in_file = real;
  in_file.columns = 7;
  BoardPictures source({in_file, real, real, real, real});
  const FoundBoards found = find_boards(source, board::BoardDetector(in_file), {.progress = false, .page = {}}, {});
  EXPECT_EQ(found.cameras[0].boards, 1);
  EXPECT_THAT(found.board_doubt, testing::AllOf(testing::HasSubstr("is in only 1 of its 5 images"),
                                                testing::HasSubstr("a chessboard of 9x6 inner corners is in them")));
  try {
    require_views(found, 4);
    FAIL() << "they were enough";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("is inner_corners right?"));
  }
}

// Half of the markers of such a board lie as the file says, one square beside their places.
TEST(FindBoards, RefusesABoardFileThatExplainsHalfOfTheMarkers) {
  const board::Board in_file{.type = board::BoardType::charuco, .columns = 6, .rows = 8, .marker = 0.0225};
  board::Board real = in_file;
  real.legacy = true;
  BoardPictures source({real, real, real});
  try {
    find_boards(source, board::BoardDetector(in_file), {.progress = false, .page = {}}, {});
    FAIL() << "it was taken";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("in 3 of 3 images"),
                                             testing::HasSubstr("they fit with legacy: true in the board file")));
  }
}

TEST(FindBoards, MeasuresTheCirclesDiameterIfTheFileHasNone) {
  const board::Board real{.type = board::BoardType::circles, .columns = 7, .rows = 5, .diameter = 0.016};
  board::Board without = real, wrong = real;
  without.diameter = 0;
  wrong.diameter = 0.01;
  const auto found = [&](const board::Board& in_file) {
    BoardPictures source({real, real});
    return find_boards(source, board::BoardDetector(in_file), {.progress = false, .page = {}}, {});
  };
  EXPECT_NEAR(found(without).board.diameter, 0.016, 0.0005);
  EXPECT_EQ(found(without).board_doubt, "");
  EXPECT_EQ(found(real).board.diameter, 0.016);
  EXPECT_THAT(found(wrong).board_doubt, testing::HasSubstr("one of the two lengths is wrong"));
}

// A chessboard carried past a camera before a room with things in it; some pictures are spoilt.
class Carried final : public PictureSource {
 public:
  static constexpr int pictures = 15;
  using Spoilt = std::function<cv::Mat(const cv::Mat& with_board, const cv::Mat& room, int at)>;
  explicit Carried(Spoilt spoilt) : spoilt_(std::move(spoilt)) {}
  const std::vector<std::string>& cameras() const override { return names_; }
  std::optional<int> expected_sets() const override { return pictures; }
  bool has_stamps() const override { return false; }
  std::vector<std::string> take_warnings() override { return {}; }
  std::optional<PictureSet> next(std::stop_token) override {
    if (at_ == pictures) return std::nullopt;
    const board::DrawnBoard drawn = board::draw_board(pictured_board());
    const double w = drawn.image.cols, h = drawn.image.rows, x = 60 + 7 * at_, y = 60 + 4 * at_;
    const cv::Matx33d place(220 / w, 20 / h, x, -15 / w, 165 / h, y, 0, 0, 1);
    const cv::Mat room = room_of();
    cv::Mat picture = room.clone(), covered, mask;
    cv::warpPerspective(drawn.image, covered, place, room.size(), cv::INTER_AREA);
    cv::warpPerspective(cv::Mat(drawn.image.size(), CV_8UC1, cv::Scalar(255)), mask, place, room.size());
    covered.copyTo(picture, mask > 128);
    picture = spoilt_(picture, room, at_);
    cv::GaussianBlur(picture, picture, {}, 0.8);
    cv::Mat noise(picture.size(), CV_16SC1);
    cv::RNG(static_cast<std::uint64_t>(at_ + 1)).fill(noise, cv::RNG::NORMAL, 0, 3);
    cv::add(picture, noise, picture, cv::noArray(), CV_8U);
    PictureSet set{.number = at_, .at_s = 0.1 * at_, .pictures = {}};
    set.pictures.emplace_back(LabelledPicture{picture, std::to_string(at_), {}});
    ++at_;
    return set;
  }

 private:
  // Grey walls, a dark door frame, shelves.
  static cv::Mat room_of() {
    cv::Mat room(480, 640, CV_8UC1);
    for (int column = 0; column < room.cols; ++column) room.col(column) = 120 + column / 10;
    cv::rectangle(room, cv::Rect(250, 0, 60, 480), 30, cv::FILLED);
    for (int shelf = 0; shelf < 6; ++shelf) cv::rectangle(room, cv::Rect(400, 80 * shelf, 240, 12), 60, cv::FILLED);
    return room;
  }
  Spoilt spoilt_;
  int at_ = 0;
  std::vector<std::string> names_{"cam1"};
};

PictureTally tally_of(Carried::Spoilt spoilt) {
  Carried source(std::move(spoilt));
  return find_boards(source, board::BoardDetector(pictured_board()), {.progress = false, .page = {}}, {}).cameras[0];
}

TEST(FindBoards, CountsMotionBlur) {
  int missed = 0;
  for (const auto& [px, degrees] : {std::pair(15.0, 45.0), {20.0, 0.0}, {25.0, 30.0}, {25.0, 100.0}}) {
    const PictureTally camera = tally_of([&](const cv::Mat& picture, const cv::Mat&, int at) {
      return at % 3 == 1 ? smeared(picture, px, degrees) : picture;
    });
    EXPECT_GE(camera.motion_blurred(), 0.9 * (camera.pictures - camera.boards))
        << px << " px, " << degrees << " degrees";
    missed += camera.pictures - camera.boards;
  }
  EXPECT_GE(missed, 10);  // or this shows nothing
}

TEST(FindBoards, AnAbsentOrHiddenBoardIsNotMotionBlur) {
  using Picture = const cv::Mat&;
  const auto blurred_in = [](const Carried::Spoilt& picture) {
    const PictureTally camera = tally_of([&](Picture with_board, Picture room, int at) {
      return at >= 3 && at < 9 ? picture(with_board, room, at) : with_board;
    });
    EXPECT_EQ(camera.boards, camera.pictures - 6);
    return camera.motion_blurred();
  };
  EXPECT_EQ(blurred_in([](Picture, Picture room, int) { return room; }), 0) << "gone";
  EXPECT_EQ(blurred_in([](Picture, Picture room, int) { return smeared(room, 20, 30); }), 0) << "a soft room";
  const auto covered = [](Picture picture, Picture, int at) {
    cv::Mat hidden = picture.clone();
    cv::line(hidden, {60 + 7 * at, 100 + 4 * at}, {400 + 7 * at, 250 + 4 * at}, 70, 90);
    return at % 2 == 1 ? hidden : cv::Mat(picture.size(), CV_8UC1, cv::Scalar(90));
  };
  EXPECT_EQ(blurred_in(covered), 0) << "covered";
}

}  // namespace
}  // namespace huetrack::gather
