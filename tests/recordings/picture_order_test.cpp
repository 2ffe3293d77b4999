// Packets and shown pictures in every order: which stamp each picture gets.
#include "recordings/picture_order.h"

#include <gmock/gmock.h>

namespace huetrack::recordings {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using Stamp = std::optional<std::int64_t>;

// A frame that remembers its number.
capture::FramePtr frame(int number) {
  capture::FramePtr made(av_frame_alloc());
  made->width = number;
  return made;
}

// (stamp, number of the frame; 0: lost), and forgets them.
std::vector<std::pair<Stamp, int>> taken(PictureOrder& order) {
  std::vector<std::pair<Stamp, int>> pictures;
  while (auto picture = order.next()) pictures.emplace_back(picture->stamp, picture->frame ? picture->frame->width : 0);
  return pictures;
}

TEST(PictureOrder, APictureHasItsPacketsStamp) {  // I P B B
  PictureOrder order;
  order.sent(0), order.sent(3);
  order.shown(0, frame(1));
  order.sent(1), order.shown(1, frame(2));
  order.sent(2), order.shown(2, frame(3));
  EXPECT_THAT(taken(order), ElementsAre(std::pair(0, 1), std::pair(1, 2), std::pair(2, 3)));
  order.shown(3, frame(4));
  order.end();
  EXPECT_THAT(taken(order), ElementsAre(std::pair(3, 4)));
  EXPECT_FALSE(order.had_stamps_of_decoding());
}

TEST(PictureOrder, ALostPictureIsGivenInItsPlace) {
  PictureOrder order;
  for (int k = 0; k < 30; ++k) {
    order.sent(k);
    if (k != 4) order.shown(k, frame(k + 1));
  }
  const auto pictures = taken(order);
  ASSERT_EQ(pictures.size(), 30u);
  for (int k = 0; k < 30; ++k) EXPECT_EQ(pictures[std::size_t(k)], std::pair(Stamp(k), k == 4 ? 0 : k + 1));
}

TEST(PictureOrder, ALostLastPictureIsGivenAtTheEnd) {
  PictureOrder order;
  order.sent(0), order.sent(1), order.shown(0, frame(1)), order.end();
  EXPECT_THAT(taken(order), ElementsAre(std::pair(0, 1), std::pair(1, 0)));
}

TEST(PictureOrder, StampsInTheOrderOfDecodingAreGivenInTheOrderShown) {  // I P B B P B B with 0 1 2 3 4 5 6
  PictureOrder order;
  order.sent(0), order.sent(1), order.sent(2);
  order.shown(0, frame(1)), order.shown(2, frame(2));
  order.sent(3), order.shown(3, frame(3));
  order.sent(4), order.shown(1, frame(4));
  order.sent(5), order.shown(5, frame(5));
  order.sent(6), order.shown(6, frame(6));
  order.shown(4, frame(7));
  order.end();
  EXPECT_THAT(taken(order), ElementsAre(std::pair(0, 1), std::pair(1, 2), std::pair(2, 3), std::pair(3, 4),
                                        std::pair(4, 5), std::pair(5, 6), std::pair(6, 7)));
  EXPECT_TRUE(order.had_stamps_of_decoding());
}

// XviD: I P B, from packets 0, 2, 3; later I P B B, which keeps back one more: a gap of as many packets. From there on
// the stamp of a picture comes two earlier.
TEST(PictureOrder, GapsOfAnEncoderThatWaitsAreNoDroppedFrames) {
  for (const bool are_counted : {true, false})
    for (const int dropped : {0, 5}) {
      PictureOrder order;
      if (are_counted) order.take_times_of_decoding(0);
      const std::vector<int> shown{0, 2, 1, 4, 3, 7, 5, 6, 10, 8, 9, 13, 11, 12};  // as they are coded
      std::int64_t stamp = 0;
      std::optional<std::pair<Stamp, int>> reference;
      for (const int picture : shown) {
        order.sent(stamp);
        const bool is_reference = picture != 1 && picture != 3 && picture != 5 && picture != 6 && picture != 8 &&
                                  picture != 9 && picture != 11 && picture != 12;
        if (is_reference && reference) order.shown(reference->first, frame(reference->second + 1));
        if (is_reference)
          reference = std::pair(Stamp(stamp), picture);
        else
          order.shown(stamp, frame(picture + 1));
        stamp += picture == 0 || picture == 3 ? 2 : 1;
        if (picture == 9) stamp += dropped;
      }
      order.shown(reference->first, frame(reference->second + 1));
      order.end();
      const auto pictures = taken(order);
      ASSERT_EQ(pictures.size(), shown.size());
      for (int k = 0; k < int(pictures.size()); ++k)
        EXPECT_EQ(pictures[std::size_t(k)], std::pair(Stamp(k + (k > 12 ? dropped : 0)), k + 1)) << are_counted;
      EXPECT_EQ(order.gaps().count, dropped > 0 ? 1 : 0);
      EXPECT_EQ(order.gaps().first_after, dropped > 0 ? 13 : 0);
      EXPECT_EQ(order.taken_out(), 2);
    }
}

// I P B twice, each from packets 0, 2, 3 of its encoder, which has kept a last picture.
TEST(PictureOrder, AnotherEncoderWaitsAnew) {
  for (const int delay : {0, 1}) {
    PictureOrder order;
    order.take_times_of_decoding(delay);
    for (const int first : {0, 4}) {
      order.sent(first, false, true), order.sent(first + 2), order.shown(first, frame(first + 1));
      order.sent(first + 3), order.shown(first + 3, frame(first + 2));
      order.shown(first + 2, frame(first + 3));
      order.end();
      order.begin_anew();
    }
    EXPECT_THAT(taken(order), ElementsAre(std::pair(0, 1), std::pair(1, 2), std::pair(2, 3), std::pair(4, 5),
                                          std::pair(5, 6), std::pair(6, 7)));
    EXPECT_EQ(order.gaps().count, 0);
  }
}

// I P B B twice in an ASF of FFmpeg: between them its times of decoding leave out the delay.
TEST(PictureOrder, TheDelayIsTakenOutWhereFilmsWereJoined) {
  for (const int missing : {1, 4}) {  // 4: the camera dropped frames there
    PictureOrder order;
    order.take_times_of_decoding(1);
    for (const int first : {0, 4}) {
      const std::int64_t stamp = first > 0 ? first + missing : 0;
      order.sent(stamp, false, true), order.sent(stamp + 1), order.shown(stamp, frame(first + 1));
      order.sent(stamp + 2), order.shown(stamp + 2, frame(first + 2));
      order.sent(stamp + 3), order.shown(stamp + 3, frame(first + 3));
      order.shown(stamp + 1, frame(first + 4));
      order.end();
      order.begin_anew();
    }
    const auto pictures = taken(order);
    ASSERT_EQ(pictures.size(), 8u);
    for (int k = 0; k < 8; ++k)
      EXPECT_EQ(pictures[std::size_t(k)], std::pair(Stamp(k < 4 || missing == 1 ? k : k + missing), k + 1));
    EXPECT_EQ(order.joints().taken_out, missing == 1 ? 1 : 0);
  }
}

// I P B B in an AVI of FFmpeg: a stamp is that of the picture shown as many before as the decoder's delay. The last
// ones are in no file.
TEST(PictureOrder, TimesOfDecodingAreThoseOfPicturesShownBefore) {
  for (const int delay : {1, 2})
    for (const int first_dropped : {2, 3, 6, 9}) {
      const auto time = [&](int shown) { return std::int64_t(shown + (shown >= first_dropped ? 5 : 0)); };
      PictureOrder order;
      order.take_times_of_decoding(delay);
      const std::vector<int> coded{0, 3, 1, 2, 6, 4, 5, 9, 7, 8, 12, 10, 11};
      const auto stamp = [&](int k) { return k < delay ? time(k) : time(delay) + time(k - delay); };
      for (int k = 0; k < int(coded.size()); ++k) {
        order.sent(stamp(k));
        if (k == 1) order.shown(stamp(0), frame(1));
        if (k >= 2 && coded[std::size_t(k)] % 3 != 0) order.shown(stamp(k), frame(coded[std::size_t(k)] + 1));
        if (k >= 4 && k % 3 == 1) order.shown(stamp(k - 3), frame(coded[std::size_t(k - 3)] + 1));
      }
      order.shown(stamp(10), frame(13));
      order.end();
      const auto pictures = taken(order);
      ASSERT_EQ(pictures.size(), coded.size());
      for (int k = 0; k < int(pictures.size()); ++k)
        EXPECT_EQ(pictures[std::size_t(k)], std::pair(Stamp(time(k)), k + 1)) << delay << first_dropped;
      EXPECT_EQ(order.gaps().count, 1);
      EXPECT_EQ(order.gaps().first_after, first_dropped);
    }
}

// An edit list for B frames, made from stamps of decoding, trims pictures of the film.
TEST(PictureOrder, StampsOfDecodingTrimNothing) {
  PictureOrder order;
  order.sent(-2, true), order.sent(-1, true), order.sent(0), order.sent(1);
  order.shown(-2, frame(1)), order.shown(0, frame(2)), order.shown(1, frame(3));
  order.sent(2), order.shown(-1, frame(4));
  order.shown(2, frame(5));
  order.end();
  EXPECT_THAT(taken(order),
              ElementsAre(std::pair(0, 1), std::pair(1, 2), std::pair(2, 3), std::pair(3, 4), std::pair(4, 5)));
}

TEST(PictureOrder, TrimmedPicturesAreLeftOut) {
  PictureOrder order;
  for (int k = -40; k < 3; ++k) order.sent(k, k < 0), order.shown(k, frame(k + 100));
  order.end();
  EXPECT_THAT(taken(order), ElementsAre(std::pair(0, 100), std::pair(1, 101), std::pair(2, 102)));
}

TEST(PictureOrder, CountedPacketsGiveTheEarliestStamp) {  // I P B B in AVI
  PictureOrder order;
  order.take_times_of_decoding(0);
  order.sent(0), order.sent(1), order.shown(std::nullopt, frame(1));
  order.sent(2), order.shown(2, frame(2));
  order.sent(3), order.failed();
  order.sent(4), order.shown(std::nullopt, frame(3));
  order.end();
  EXPECT_THAT(taken(order),
              ElementsAre(std::pair(0, 1), std::pair(1, 2), std::pair(2, 0), std::pair(3, 3), std::pair(4, 0)));
}

TEST(PictureOrder, StampsThatJumpBackStay) {  // where files were joined
  PictureOrder order;
  order.sent(98), order.sent(99), order.sent(0);
  order.shown(98, frame(1)), order.shown(99, frame(2)), order.shown(0, frame(3));
  order.end();
  EXPECT_THAT(taken(order), ElementsAre(std::pair(98, 1), std::pair(99, 2), std::pair(0, 3)));
  EXPECT_FALSE(order.had_stamps_of_decoding());
}

// I P B B I P B B with 0 3 1 2 from 10 * joint on: what was sent before a key picture is shown before it.
TEST(PictureOrder, StampsThatJumpBackAtAKeyPictureLoseNothing) {
  PictureOrder order;
  order.sent(10, false, true), order.sent(13), order.shown(10, frame(1));
  order.sent(11), order.shown(11, frame(2)), order.sent(12), order.shown(12, frame(3));
  order.sent(0, false, true), order.sent(3), order.shown(13, frame(4));
  order.sent(1), order.shown(0, frame(5)), order.shown(1, frame(6));
  order.sent(2), order.shown(2, frame(7)), order.shown(3, frame(8));
  order.end();
  EXPECT_THAT(taken(order), ElementsAre(std::pair(10, 1), std::pair(11, 2), std::pair(12, 3), std::pair(13, 4),
                                        std::pair(0, 5), std::pair(1, 6), std::pair(2, 7), std::pair(3, 8)));
  EXPECT_FALSE(order.had_stamps_of_decoding());
}

// As long as the delay, and nowhere else: taken out before a key picture, and only there.
TEST(PictureOrder, GapsWhereFilmsWereJoinedAreTakenOut) {
  struct Case {
    int at, missing, taken_out, left;
  };
  for (const Case& c : {Case{10, 2, 2, 0}, {10, 1, 0, 1}, {10, 7, 0, 1}, {11, 2, 0, 0}, {20, 2, 2, 0}}) {
    PictureOrder order;
    order.expect_delay(2);
    for (int k = 0; k < 30; ++k) {
      const int stamp = k + (k >= c.at ? c.missing : 0);
      order.sent(stamp, false, k % 10 == 0), order.shown(stamp, frame(k + 1));
    }
    order.end();
    const auto pictures = taken(order);
    ASSERT_EQ(pictures.size(), 30u);
    EXPECT_EQ(pictures.back(), std::pair(Stamp(29 + c.missing - c.taken_out), 30)) << c.at << c.missing;
    EXPECT_EQ(order.joints().taken_out, c.taken_out > 0 ? 1 : 0) << c.at << c.missing;
    EXPECT_EQ(order.joints().left, c.left) << c.at << c.missing;
    if (c.taken_out > 0) {
      EXPECT_EQ(order.joints().first, c.at);
    }
  }
}

// I P B -, P B -: packed B frames that were split, and their placeholders (-), which show nothing.
TEST(PictureOrder, RepeatedStampsAreThoseOfTheirPlaceholders) {
  PictureOrder order;
  order.sent(0, false, true), order.sent(2), order.shown(0, frame(1));
  order.sent(1), order.shown(1, frame(2));
  order.sent(3);  // -
  order.sent(4), order.shown(2, frame(3));
  order.stamps_repeat(), order.shown(4, frame(4));
  order.sent(5);  // -
  order.shown(4, frame(5));
  order.end();
  EXPECT_THAT(taken(order),
              ElementsAre(std::pair(0, 1), std::pair(1, 2), std::pair(2, 3), std::pair(3, 4), std::pair(4, 5)));
}

TEST(PictureOrder, PicturesWithoutStampsAreCounted) {
  PictureOrder order;
  order.sent(std::nullopt), order.sent(std::nullopt), order.sent(std::nullopt);
  order.shown(std::nullopt, frame(1)), order.shown(std::nullopt, frame(2));
  EXPECT_THAT(taken(order), ElementsAre(std::pair(Stamp(), 1), std::pair(Stamp(), 2)));
  order.end();
  EXPECT_THAT(taken(order), ElementsAre(std::pair(Stamp(), 0)));
  EXPECT_THAT(taken(order), IsEmpty());
}

}  // namespace
}  // namespace huetrack::recordings
