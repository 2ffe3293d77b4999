#include "pipeline/live_cameras.h"

#include <algorithm>
#include <future>
#include <iterator>
#include <map>
#include <ranges>
#include <system_error>
#include <utility>

#include "capture/cropped_source.h"
#include "capture/field_source.h"
#include "capture/network_source.h"
#include "hosts/remote_camera.h"

namespace huetrack::pipeline {
namespace {

using namespace std::chrono_literals;

constexpr auto opening_patience = 3s;  // capacity: wait at the start for a camera that does not answer

std::optional<SessionCamera::Pixels> pixels_of(const capture::StreamFormat& stream) {
  switch (stream.format) {
    case capture::CaptureFormat::yuyv:
      return {{capture::PixelFormat::yuyv, stream.range}};
    case capture::CaptureFormat::nv12:
      return {{capture::PixelFormat::nv12, stream.range}};
    case capture::CaptureFormat::mjpeg:  // or i420, which has the same colour table
      return {{capture::PixelFormat::i422, capture::ColorRange::full}};
    case capture::CaptureFormat::grey:
      break;
  }
  return {{capture::PixelFormat::grey, stream.range}};
}

SessionCamera known_of(int camera, double asked_fps, const capture::CameraHealth& health) {
  SessionCamera known{.camera = camera};
  const double fps = health.stream && health.stream->fps > 0 ? health.stream->fps : asked_fps;
  if (fps > 0) known.period = capture::duration_of(1 / fps);
  if (health.stream) known.pixels = pixels_of(*health.stream);
  return known;
}

}  // namespace

std::optional<std::string> one_under_two_names(std::span<const config::LiveCameraConfig> cameras) {
  std::map<std::filesystem::path, const config::LiveCameraConfig*> nodes;
  for (const auto& camera : cameras) {
    if (!camera.host.empty()) continue;
    std::error_code error;
    const auto node = std::filesystem::canonical(camera.device, error);
    if (error) continue;
    const auto [first, is_new] = nodes.emplace(node, &camera);
    const config::LiveCameraConfig& other = *first->second;
    if (is_new || (camera.crop && other.crop && camera.device == other.device)) continue;
    return other.name + " and " + camera.name + " are one camera: " + other.device.string() + " and " +
           camera.device.string() + " are both " + node.string();
  }
  return std::nullopt;
}

namespace {

capture::CameraRequest request_of(const config::LiveCameraConfig& camera, int index, calib::ImageSize size,
                                  const capture::FrameTiming& timing) {
  capture::CameraRequest options;
  options.camera = index;
  options.name = camera.name;
  options.device = camera.device;
  options.format = camera.format;
  options.width = size.width;
  options.height = size.height;
  options.fps = camera.fps.value_or(0);
  options.controls = camera.controls;
  options.restore_controls = camera.restore_controls;
  options.timing = timing;
  options.first_patience = opening_patience;
  options.crop = camera.crop;
  return options;
}

std::vector<LiveCamera> open_here(std::span<const capture::CameraRequest> requests, const std::stop_token& stop) {
  std::vector<capture::SharedDevice> asked = capture::by_device(requests);
  std::vector<std::future<std::unique_ptr<capture::V4l2Source>>> opening;
  for (const auto& [options, parts] : asked)
    opening.push_back(std::async(std::launch::async, [options = options, stop] {
      return std::make_unique<capture::V4l2Source>(options, stop);
    }));
  // A camera that cannot do what is asked (perhaps another model in its port) counts as absent. If that is true of all
  // cameras, the configuration is wrong.
  std::vector<std::unique_ptr<capture::V4l2Source>> sources;
  std::vector<std::size_t> wrong;
  std::exception_ptr first_wrong;
  for (std::size_t c = 0; c < opening.size(); ++c) {
    try {
      sources.push_back(opening[c].get());
    } catch (const capture::CaptureError& error) {
      if (error.code() != std::errc::invalid_argument) throw;
      if (!first_wrong) first_wrong = std::current_exception();
      sources.push_back(nullptr);
      wrong.push_back(c);
    }
  }
  if (wrong.size() == asked.size() && first_wrong) std::rethrow_exception(first_wrong);
  for (const std::size_t c : wrong) {
    asked[c].options.may_be_wrong = true;
    sources[c] = std::make_unique<capture::V4l2Source>(asked[c].options, stop);
  }
  std::vector<LiveCamera> cameras;
  for (std::size_t c = 0; c < sources.size(); ++c) {
    capture::V4l2Source* device = sources[c].get();
    const auto& parts = asked[c].parts;
    cameras.push_back({.camera = asked[c].options.camera,
                       .source = std::move(sources[c]),
                       .health = [device] { return device->health(); },
                       .take_events = [device] { return device->take_events(); },
                       .controls = device->controls()});
    if (parts.empty()) continue;
    LiveCamera& first = cameras.back();  // delivers the others' frames, and reports what happens to the device
    first.source = std::make_unique<capture::CroppedSource>(std::move(first.source), parts);
    for (const capture::CroppedPart& part : parts | std::views::drop(1))
      cameras.push_back({.camera = part.camera,
                         .source = nullptr,
                         .health = [device] { return device->health(); },
                         .take_events = [] { return std::vector<capture::CameraEvent>(); },
                         .controls = device->controls()});
  }
  return cameras;
}

LiveCamera open_network_camera(const config::LiveCameraConfig& camera, int index, calib::ImageSize size,
                               const capture::FrameTiming& timing) {
  auto source = std::make_unique<capture::NetworkSource>(capture::NetworkSourceOptions{.camera = index,
                                                                                       .name = camera.name,
                                                                                       .address = camera.device,
                                                                                       .width = size.width,
                                                                                       .height = size.height,
                                                                                       .timing = timing});
  auto* const asked = source.get();
  return {.camera = index,
          .source = std::move(source),
          .health = [asked] { return asked->health(); },
          .take_events = [asked] { return asked->take_events(); }};
}

void refuse_two_names(const std::filesystem::path& file, std::span<const config::LiveCameraConfig> cameras) {
  if (const auto both = one_under_two_names(cameras))
    throw capture::CaptureError(std::make_error_code(std::errc::invalid_argument),
                                file.string() + ": cameras: " + *both + ": give each its own device");
}

// Each camera with a source, and those after it without one, whose frames it delivers.
void watch_fields_of(std::vector<LiveCamera>& cameras, const config::ServiceConfig& config) {
  std::map<int, capture::FirstField> fields;
  for (const auto& camera : config.cameras)
    if (camera.fields) fields.emplace(config.rig.index_of(camera.name).value(), *camera.fields);
  for (auto camera = cameras.begin(); camera != cameras.end();) {
    const auto next = std::find_if(std::next(camera), cameras.end(), [](const auto& c) { return c.source != nullptr; });
    std::vector<LiveCamera*> others;
    for (auto other = std::next(camera); other != next; ++other) others.push_back(&*other);
    capture::watch_fields(*camera, std::move(others), fields);
    camera = next;
  }
}

}  // namespace

std::vector<LiveCamera> open_cameras(const config::ServiceConfig& config, const std::stop_token& stop) {
  refuse_two_names(config.file, config.cameras);
  const std::vector<capture::FrameTiming> timing = config::frame_timing(config.rig);
  std::vector<capture::CameraRequest> here;
  std::vector<hosts::RemoteCameraOptions> elsewhere;
  std::vector<LiveCamera> on_the_network;
  for (const auto& camera : config.cameras) {
    const int index = config.rig.index_of(camera.name).value();
    const calib::ImageSize size = config.rig.cameras[std::size_t(index)].image_size;
    if (capture::is_network_address(camera.device.native())) {
      on_the_network.push_back(open_network_camera(camera, index, size, timing[std::size_t(index)]));
    } else if (camera.host.empty()) {
      here.push_back(request_of(camera, index, camera.picture_size(size), timing[std::size_t(index)]));
    } else {
      elsewhere.push_back({.camera = index,
                           .name = camera.name,
                           .host = camera.host,
                           .camera_there = camera.name_on_host(),
                           .width = size.width,
                           .height = size.height,
                           .timing = timing[std::size_t(index)],
                           .are_matches = camera.send == config::Sent::matches,
                           .picture_every_s = camera.picture_every_s});
    }
  }
  std::vector<LiveCamera> cameras = open_here(here, stop);
  std::ranges::move(on_the_network, std::back_inserter(cameras));
  if (!elsewhere.empty())
    for (auto& camera :
         hosts::RemoteCameras(config.dds.publisher.transport("huetrackd cameras"), std::move(elsewhere)).live())
      cameras.push_back(std::move(camera));
  watch_fields_of(cameras, config);
  return cameras;
}

std::vector<LiveCamera> open_cameras(const config::CaptureConfig& config, const std::stop_token& stop) {
  refuse_two_names(config.file, config.cameras);
  std::vector<capture::CameraRequest> here;
  std::vector<LiveCamera> on_the_network;
  for (std::size_t c = 0; c < config.cameras.size(); ++c) {
    const config::LiveCameraConfig& camera = config.cameras[c];
    if (capture::is_network_address(camera.device.native()))
      on_the_network.push_back(open_network_camera(camera, int(c), *camera.size, {}));
    else
      here.emplace_back(request_of(camera, int(c), *camera.size, {})).decodes = false;  // the trackers decode
  }
  std::vector<LiveCamera> cameras = open_here(here, stop);
  std::ranges::move(on_the_network, std::back_inserter(cameras));
  std::ranges::sort(cameras, {}, &LiveCamera::camera);
  return cameras;
}

SessionSources sources_of(const config::ServiceConfig& config, std::vector<LiveCamera>& cameras) {
  struct Asked {
    int camera;
    double fps;  // 0: the driver's choice
    std::function<capture::CameraHealth()> health;
  };
  SessionSources sources;
  std::vector<Asked> asked;
  for (auto& camera : cameras) {
    const auto& name = config.rig.cameras[std::size_t(camera.camera)].name;
    const auto options = std::ranges::find(config.cameras, name, &config::LiveCameraConfig::name);
    asked.push_back({camera.camera, options == config.cameras.end() ? 0 : options->fps.value_or(0), camera.health});
    if (camera.source) sources.sources.push_back(std::move(camera.source));
  }
  sources.cameras = [asked = std::move(asked)] {
    std::vector<SessionCamera> known;
    for (const Asked& camera : asked) known.push_back(known_of(camera.camera, camera.fps, camera.health()));
    return known;
  };
  return sources;
}

}  // namespace huetrack::pipeline
