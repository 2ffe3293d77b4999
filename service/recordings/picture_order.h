// Which time stamp a picture has. Decoders return pictures in the order in which they are shown; packets come in the
// order of decoding, some with wrong time stamps. In a sound file a picture's own stamp is the earliest of those sent
// and not shown yet. A later one means that pictures were lost, or that the stamps are in the order of decoding; that
// is known once an earlier one is shown or enough pictures have passed. Private to this module.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
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

  // Before the first packet: the container (AVI) has no times of showing, its stamps count packets.
  void count_packets() { takes_earliest_ = true; }

  // A packet that begins a picture goes to the decoder. is_trimmed: an edit list leaves it out.
  void sent(std::optional<std::int64_t> stamp, bool is_trimmed = false);
  void failed();  // the packet sent last does not decode
  // stamp: the packet's, as the decoder returned it.
  void shown(std::optional<std::int64_t> stamp, capture::FramePtr frame);
  void end();  // the decoder has no more pictures

  std::optional<Picture> next();  // decided ones; nullopt: none now

  // Stamps are in the order of decoding, though pictures are shown in another one: each got the earliest stamp.
  bool had_stamps_of_decoding() const { return is_decoding_order_; }

 private:
  struct Sent {
    std::int64_t stamp;
    std::int64_t number;  // of the packet
    bool is_trimmed;
  };
  struct Held {
    Sent sent;
    capture::FramePtr frame;
  };
  void give_lost_before(std::int64_t stamp);
  void decide();
  void take_decoding_order();

  std::vector<Sent> pending_;  // ascending stamps: sent, not shown
  std::deque<Held> held_;      // shown, undecided: pending_ has earlier stamps, or they are trimmed
  std::deque<Picture> decided_;
  std::int64_t packets_ = 0;
  int unstamped_ = 0;  // sent without a stamp, not shown
  bool takes_earliest_ = false;
  bool is_decoding_order_ = false;
  bool has_given_ = false;  // a picture that is not trimmed
  std::int64_t shift_ = 0;  // of stamps in the order of decoding
};

}  // namespace huetrack::recordings
