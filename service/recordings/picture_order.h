// Which time stamp a picture has. Decoders return pictures in the order in which they are shown; packets come in the
// order of decoding, some with wrong time stamps. In a sound file a picture's own stamp is the earliest of those sent
// and not shown yet. A later one means that pictures were lost, or that the stamps are in the order of decoding; that
// is known once an earlier one is shown or enough pictures have passed. Such stamps are those of showing, in ascending
// order, at other pictures:
// - Times of decoding (FFmpeg's AVI and ASF): a stamp is that of the picture shown as many before as decoding delays.
// - Times at which the encoder was called (XviD, Video for Windows): it waits for the pictures that B frames need, so
//   there is a gap wherever more pictures in a row than before are shown before the one that was coded first. It is no
//   time, and from there on a stamp is that of the picture shown as many later as the encoder has waited for.
// Before the key picture where films were joined the delay comes again; it is taken out. Where another encoder's
// pictures begin, it waits anew. Private to this module.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "capture/ffmpeg/ffmpeg_objects.h"

namespace huetrack::recordings {

// thread-compatible.
class PictureOrder {
 public:
  struct Picture {
    std::optional<std::int64_t> stamp;
    capture::FramePtr frame;  // null: it was sent, and never shown
  };

  // Before the first packet: the container (AVI, ASF) has no times of showing. delay: pictures, of its decoder.
  void take_times_of_decoding(int delay) {
    takes_earliest_ = true;
    decoder_delay_ = delay;
    is_unsettled_ = delay > 0;
  }

  // Two packets have the same stamp, which is that of one of them: each picture gets the earliest, from here on.
  void stamps_repeat() {
    if (!takes_earliest_) take_decoding_order();
    repeats_ = true;
  }

  // Pictures that an encoder of this stream keeps back, by its header.
  void expect_delay(int pictures) { delay_ = pictures; }

  // A packet that begins a picture goes to the decoder. is_trimmed: an edit list leaves it out. is_key: what was sent
  // before it is shown before it and all that follow.
  void sent(std::optional<std::int64_t> stamp, bool is_trimmed = false, bool is_key = false);
  void failed();  // the packet sent last does not decode
  // stamp: the packet's, as the decoder returned it.
  void shown(std::optional<std::int64_t> stamp, capture::FramePtr frame);
  void end();  // the decoder has no more pictures
  // After end(): those of another encoder follow, which waits anew.
  void begin_anew();

  std::optional<Picture> next();  // decided ones; nullopt: none now

  // Of such stamps, gaps that no encoder explains: how many, and how many pictures came before the first one. 0: there
  // are no B frames.
  struct Gaps {
    std::int64_t count = 0, first_after = 0;
  };
  Gaps gaps() const { return has_b_frames_ ? gaps_ : Gaps{}; }

  // Gaps before key pictures, as where films were joined.
  struct Joints {
    std::int64_t taken_out = 0;              // as long as the delay
    std::int64_t left = 0;                   // others; 0 if there are gaps elsewhere, too
    std::int64_t first = 0, first_left = 0;  // the pictures before them
    std::int64_t longest_left = 0;           // of the stamps
  };
  Joints joints() const;

  // How much shorter the film became without the gaps that encoders explain.
  std::int64_t taken_out() const { return taken_out_; }

  // Stamps are in the order of decoding, though pictures are shown in another one: each got the earliest stamp.
  bool had_stamps_of_decoding() const { return is_decoding_order_; }

 private:
  struct Sent {
    std::int64_t stamp;
    std::int64_t number;  // of the packet
    bool is_trimmed, is_key;
    std::int64_t key;                                                             // number of the key packets up to it
    std::pair<std::int64_t, std::int64_t> place() const { return {key, stamp}; }  // in the order shown
  };
  struct Held {
    Sent sent;
    capture::FramePtr frame;
  };
  struct Ordered {  // in the order shown, with a stamp that may be another picture's
    std::optional<std::int64_t> stamp;
    capture::FramePtr frame;
    std::int64_t waits = 0;  // pictures for which the encoder waited before it
  };
  void show_earliest(std::optional<std::int64_t> stamp, capture::FramePtr frame);
  void give_waiting();
  std::int64_t waits_before(std::size_t ahead);
  void place(Ordered picture);
  void settle();
  void assign(Ordered picture);
  void add_time(std::int64_t time);
  void give_timed();
  void end_earliest();
  void judge_joint(const Sent& picture);
  void give_lost_before(const Sent& picture);
  void decide();
  void take_decoding_order();

  std::vector<Sent> pending_;  // ascending places: sent, not shown
  std::deque<Held> held_;      // shown, undecided: pending_ has earlier stamps, or they are trimmed
  std::deque<Picture> decided_;
  std::int64_t packets_ = 0, key_packets_ = 0;
  int unstamped_ = 0;  // sent without a stamp, not shown
  bool takes_earliest_ = false;
  bool is_decoding_order_ = false;
  bool repeats_ = false;
  bool has_given_ = false;              // a picture that is not trimmed
  std::optional<std::int64_t> last_;    // stamp used, before the shift
  std::optional<std::int64_t> step_;    // between two
  std::int64_t shift_ = 0, given_ = 0;  // pictures
  std::int64_t taken_out_ = 0;          // of gaps
  int delay_ = 0;
  Joints joints_;
  Gaps gaps_;
  // Of stamps in the order of decoding:
  int decoder_delay_ = 0;
  bool is_anew_ = false;       // begin_anew(), and no time since
  bool is_unsettled_ = false;  // times of decoding, or of the encoder's calls
  std::deque<Ordered> unsettled_;
  std::int64_t ordered_ = 0, lead_ = 0;  // stamps; the pictures by which theirs is shown later
  std::optional<std::int64_t> first_;    // stamp
  std::int64_t offset_ = 0;              // of times of decoding
  std::deque<Ordered> untimed_;          // with a stamp, or none
  std::deque<std::int64_t> times_;       // of the first ones of untimed_
  std::int64_t timed_ = 0;               // pictures
  std::optional<std::int64_t> last_time_;
  std::deque<capture::FramePtr> waiting_;  // shown, undecided: one that was sent before them is not
  std::optional<std::int64_t> latest_;     // of their own stamps
  std::size_t longest_run_ = 0;            // of pictures shown before one that was sent before them
  bool has_b_frames_ = false;
};

}  // namespace huetrack::recordings
