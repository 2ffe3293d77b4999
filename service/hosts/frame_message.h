// Frames as DDS messages and back: the camera's own bytes. Pure functions; any thread.
#pragma once

#include "capture/frames/frame.h"
#include "capture/jpeg/jpeg_reader.h"
#include "idl/camera_host.h"

namespace huetrack::hosts {

// Sets all but `run`.
void to_message(const capture::Frame& frame, msg::CameraFrame& out);

// Sets status, pixels and encoded; times, number and camera are the caller's. Status is corrupted when the bytes do not
// fit the stated size, or do not decode. Moves the message's bytes into the frame.
capture::Frame from_message(msg::CameraFrame&& message, capture::JpegReader& reader);

// The same for a frame of matches. latest, width, height: decode_matches().
capture::Frame from_message(msg::CameraMatches&& message, capture::JpegReader& reader, capture::Image& latest,
                            int width = 0, int height = 0);

}  // namespace huetrack::hosts
