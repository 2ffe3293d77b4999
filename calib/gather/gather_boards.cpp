#include "calib/gather/gather_boards.h"

#include <algorithm>

#include "calib/gather/live_boards.h"
#include "capture/timing/frame_synchronizer.h"

namespace huetrack::gather {
namespace {

std::vector<LiveCameraSource> opened(const std::vector<capture::CameraRequest>& cameras, LiveBoardsOptions& options) {
  std::vector<LiveCameraSource> sources;
  std::vector<capture::Duration> periods;
  for (const capture::CameraRequest& camera : cameras)
    sources.push_back({.name = camera.name, .source = {}, .take_trouble = {}});
  for (const auto& [device, parts] : capture::by_device(cameras)) {
    LiveCameraSource& source = sources[static_cast<std::size_t>(device.camera)];
    auto live = std::make_unique<capture::V4l2Source>(device);
    if (const auto stream = live->health().stream; stream && stream->fps > 0)
      periods.push_back(capture::duration_of(1 / stream->fps));
    source.take_trouble = [camera = live.get()] {
      std::vector<std::string> lines;
      for (const capture::CameraEvent& event : camera->take_events()) {
        if (event.is_problem) lines.push_back(event.message);
      }
      return lines;
    };
    if (parts.empty())
      source.source = std::move(live);
    else
      source.source = std::make_unique<capture::CroppedSource>(std::move(live), parts);
  }
  options.tolerance = capture::suggested_tolerance(periods);
  return sources;
}

}  // namespace

FoundBoards gather_boards(const std::vector<std::string>& inputs, const board::Board& board,
                          const GatherOptions& options, std::stop_token stop) {
  const board::BoardDetector detector(board);
  const auto& only = options.pictures.only;
  std::vector<capture::CameraRequest> devices;
  if (!options.live.file.empty()) {
    devices = live_cameras_in(options.live.file, options.live.settings);
  } else if (are_devices(inputs)) {
    std::vector<std::string> named = inputs;
    if (options.alone && named.size() == 1 && named.front().find('=') == std::string::npos)
      named.front() = only.front() + "=" + named.front();
    devices = live_cameras(named, options.live.settings);
  } else {
    FindBoardsOptions find = options.find;
    find.page = options.live.page;
    const auto source =
        options.alone ? open_pictures_of(only.front(), inputs) : open_pictures(inputs, options.pictures);
    return find_boards(*source, detector, find, std::move(stop));
  }
  for (const std::string& name : only) {
    if (std::ranges::find(devices, name, &capture::CameraRequest::name) == devices.end())
      throw InputError("there is no live camera " + name + " among those given");
  }
  if (!only.empty())
    std::erase_if(devices, [&](const auto& d) { return std::ranges::find(only, d.name) == only.end(); });
  for (std::size_t c = 0; c < devices.size(); ++c) devices[c].camera = static_cast<int>(c);
  LiveBoardsOptions live;
  live.seconds = options.live.seconds;
  live.page = options.live.page;
  live.progress = options.find.progress;
  auto sources = opened(devices, live);
  if (options.pictures.tolerance_s) live.tolerance = capture::duration_of(*options.pictures.tolerance_s);
  return gather_live(std::move(sources), detector, live, std::move(stop));
}

}  // namespace huetrack::gather
