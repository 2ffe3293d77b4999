// A frame as it goes over the bus and back: the camera's own bytes. Pure functions; any thread.
#pragma once

#include "capture/frames/frame.h"
#include "capture/frames/jpeg_decoder.h"
#include "idl/camera_host.h"

namespace huetrack::hosts {

// All but `run`.
void to_message(const capture::Frame& frame, msg::CameraFrame& out);

// Of the frame: status, pixels, encoded; times, number and camera are the caller's. What does not fit its own sizes, or
// does not decode, is corrupted. The message's bytes are moved into the frame.
capture::Frame from_message(msg::CameraFrame&& message, capture::JpegDecoder& decoder);

// As much of a frame that says which pixels match. latest, width, height: decode_matches().
capture::Frame from_message(msg::CameraMatches&& message, capture::JpegDecoder& decoder, capture::Image& latest,
                            int width = 0, int height = 0);

}  // namespace huetrack::hosts
