#include "calib/gather/live_cameras.h"

#include <algorithm>
#include <tuple>

#include "calib/files/number_text.h"
#include "calib/gather/picture_source.h"
#include "calib/yaml/yaml_reader.h"
#include "capture/v4l2/v4l2_device.h"
#include "recordings/recording.h"

namespace huetrack::gather {
namespace {

calib::ImageSize usual_size(const std::filesystem::path& device) {
  const capture::V4l2Device camera(device);
  calib::ImageSize best{};
  for (const capture::OfferedFormat& format : camera.formats()) {
    if (!format.format) continue;
    for (const capture::OfferedSize& size : format.sizes) {
      const bool holds_vga = size.min_width <= 640 && 640 <= size.width && size.min_height <= 480 && 480 <= size.height;
      if (holds_vga && (size.min_width < size.width || size.width == 640)) return {640, 480};
      if (size.width <= 1280 && size.width * size.height > best.width * best.height) best = {size.width, size.height};
    }
  }
  if (best.width == 0) throw InputError(device.string() + ": reports no image sizes: give --size WIDTHxHEIGHT");
  return best;
}

void finish(capture::CameraRequest& options, int number, const LiveSettings& settings) {
  options.camera = number;
  if (settings.size) {
    options.width = settings.size->width;
    options.height = settings.size->height;
  }
  if (settings.fps > 0) options.fps = settings.fps;
  if (options.width == 0) {
    const calib::ImageSize size = usual_size(options.device);
    options.width = size.width;
    options.height = size.height;
  }
}

std::vector<capture::ControlSetting> controls_of(const yaml::YamlReader& camera) {
  std::vector<capture::ControlSetting> settings;
  const auto map = camera.optional_map("controls");
  if (!map) return settings;
  for (const std::string& name : map->keys()) settings.push_back(capture::control_setting(name, map->string(name)));
  return settings;
}

}  // namespace

bool are_devices(std::span<const std::string> inputs) {
  return !inputs.empty() && std::ranges::all_of(inputs, [](const std::string& input) {
    return input.substr(input.find('=') + 1).starts_with("/dev/");
  });
}

std::vector<capture::CameraRequest> live_cameras(std::span<const std::string> devices, const LiveSettings& settings) {
  std::vector<capture::CameraRequest> cameras;
  for (const std::string& input : devices) {
    const auto at = input.find('=');
    if (at == std::string::npos || at == 0) throw InputError(input + ": which camera is this? Give NAME=" + input);
    capture::CameraRequest options;
    options.name = input.substr(0, at);
    std::tie(options.device, options.crop) = recordings::split_crop(input.substr(at + 1), {});
    for (const capture::CameraRequest& other : cameras) {
      if (other.name == options.name) throw InputError("camera " + options.name + " is given twice");
      if (other.device == options.device && !(options.crop && other.crop))
        throw InputError(options.device.string() + " is given for both " + other.name + " and " + options.name +
                         ": a device that is two cameras needs the part of each, " + options.name + "=" +
                         options.device.string() + "@u,v,width,height");
    }
    finish(options, static_cast<int>(cameras.size()), settings);
    cameras.push_back(std::move(options));
    if (const auto problem = capture::problem_of(cameras); !problem.empty()) throw InputError(problem);
  }
  return cameras;
}

std::vector<capture::CameraRequest> live_cameras_in(const std::filesystem::path& file, const LiveSettings& settings) {
  const yaml::YamlReader root = yaml::YamlReader::file(file);
  std::vector<capture::CameraRequest> cameras;
  for (const auto& [name, yaml] : root.named_maps("cameras")) {
    capture::CameraRequest options;
    options.name = name;
    const std::string device = yaml.string("device");
    const bool is_index = device.size() < 4 && std::ranges::all_of(device, files::is_digit);
    options.device = is_index ? "/dev/video" + device : device;
    constexpr std::array<std::string_view, 5> formats{"auto", "yuyv", "nv12", "mjpeg", "grey"};
    options.format = capture::capture_format_of(yaml.choice("format", formats, "auto"));
    if (yaml.has("size") && yaml.is_list("size")) {
      const auto sides = yaml.numbers("size", 2, 2, yaml::Range{.min = 1, .max = 65535});
      options.width = static_cast<int>(sides[0]);
      options.height = static_cast<int>(sides[1]);
    }
    if (yaml.is_list("crop") || yaml.string("crop", "none") != "none") options.crop = recordings::crop_in(yaml, "crop");
    if (yaml.has("fps") && yaml.string("fps") != "auto") options.fps = yaml.number("fps", yaml::positive);
    options.controls = controls_of(yaml);
    options.timing.latency = capture::duration_of(yaml.number("latency_offset_s", yaml::Range{.min = -1, .max = 1}, 0));
    options.restore_controls = yaml.boolean("restore_controls", false);
    yaml.finish();
    finish(options, static_cast<int>(cameras.size()), settings);
    cameras.push_back(std::move(options));
    if (const auto problem = capture::problem_of(cameras); !problem.empty()) yaml.fail("crop", problem);
  }
  if (cameras.empty()) root.fail("cameras", "names no camera");
  return cameras;
}

}  // namespace huetrack::gather
