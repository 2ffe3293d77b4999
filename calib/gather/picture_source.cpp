#include "calib/gather/picture_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <deque>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/files/config_error.h"
#include "calib/files/files_beside.h"
#include "calib/files/text_file.h"
#include "calib/gather/image_files.h"
#include "capture/frames/crop.h"
#include "capture/frames/jpeg_decoder.h"
#include "capture/frames/picture_tags.h"
#include "capture/timing/frame_synchronizer.h"
#include "recordings/bags/bag.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::gather {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t largest_image = 256U << 20;  // capacity: bytes of an image file

// Of samples of 16 bits the 8 upper ones that are used: cameras of 12 bits leave the upper four empty, which would be
// black.
cv::Mat with_8_bits(const cv::Mat& grey) {
  if (grey.depth() != CV_16U) return grey;
  double largest = 0;
  cv::minMaxLoc(grey, nullptr, &largest);
  constexpr int upper_bits = 8;
  const int used = std::max(upper_bits, static_cast<int>(std::bit_width(static_cast<unsigned>(largest))));
  cv::Mat result;
  grey.convertTo(result, CV_8U, 1. / (1 << (used - upper_bits)), -0.5);
  return result;
}

// As players show it: turned by its own tag (is_turned, then true). throws files::ConfigError with the file's name,
// which OpenCV's messages lack.
cv::Mat read_grey(const fs::path& file, bool& is_turned) {
  std::string bytes = files::read_text_file(file, largest_image);
  const std::span picture(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  const capture::PictureTags tags = capture::tags_of(picture);
  const auto orientation = tags.orientation.value_or(capture::Orientation{});
  is_turned = is_turned || !orientation.is_upright();
  if (bytes.starts_with(
          "\xFF\xD8")) {  // OpenCV repairs a damaged JPEG, and corners would be detected in invented content
    capture::JpegDecoder decoder;
    const auto jpeg = decoder.decode(picture);
    if (jpeg.image) return board_grey_of(capture::turned(*jpeg.image, orientation)).clone();
    if (!jpeg.is_unsupported) throw files::ConfigError(file, 0, "is a damaged JPEG: " + jpeg.problem);
  }
  if (tags.orientation_at > 0) bytes[tags.orientation_at] = 1;  // OpenCV turns TIFFs, whatever its flags say
  cv::Mat grey;
  try {
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
    if (!bytes.empty()) {
      const int how = cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION;
      grey = with_8_bits(cv::imdecode(encoded, how | cv::IMREAD_ANYDEPTH));
      if (grey.depth() != CV_8U) grey = cv::imdecode(encoded, how);
    }
  } catch (const cv::Exception& error) {  // more pixels than OpenCV takes, for example
    throw files::ConfigError(file, 0,
                             "is not an image that can be read (OpenCV: " + files::printable(error.err, 200) + ")");
  }
  if (grey.empty()) throw files::ConfigError(file, 0, "is not an image that can be read");
  capture::Image stored{.format = capture::PixelFormat::grey,
                        .range = capture::ColorRange::full,
                        .width = grey.cols,
                        .height = grey.rows,
                        .planes = {},
                        .owner = {}};
  stored.planes[0] = {grey.data, static_cast<std::ptrdiff_t>(grey.step[0])};
  return board_grey_of(capture::turned(stored, orientation));
}

cv::Mat cropped(const cv::Mat& grey, const std::optional<capture::Crop>& crop, const fs::path& file) {
  if (!crop) return grey;
  const auto problem = capture::problem_of(*crop, capture::PixelFormat::grey, grey.cols, grey.rows);
  if (!problem.empty()) throw files::ConfigError(file, 0, problem);
  return grey(cv::Rect(crop->u, crop->v, crop->width, crop->height));
}

class ImageFilePictures final : public PictureSource {
 public:
  // crops: per camera
  ImageFilePictures(std::vector<std::string> cameras, const std::vector<std::vector<fs::path>>& files,
                    std::vector<std::optional<capture::Crop>> crops)
      : cameras_(std::move(cameras)), crops_(std::move(crops)), sets_(paired_images(cameras_, files)) {}

  const std::vector<std::string>& cameras() const override { return cameras_; }
  std::optional<int> expected_sets() const override { return static_cast<int>(sets_.size()); }
  bool has_stamps() const override { return false; }
  std::vector<std::string> take_warnings() override { return std::exchange(warnings_, {}); }

  std::optional<PictureSet> next(std::stop_token stop) override {
    if (stop.stop_requested() || at_ == sets_.size()) return std::nullopt;
    PictureSet set;
    set.number = static_cast<int>(at_);
    set.at_s = static_cast<double>(at_);
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const auto& file = sets_[at_].files[c];
      set.pictures.emplace_back();
      if (!file) continue;
      try {
        bool is_turned = false;
        set.pictures.back() = {cropped(read_grey(*file, is_turned), crops_[c], *file), file->filename().string(), {}};
        if (is_turned && !std::exchange(has_noted_turn_, true))
          warnings_.push_back(
              file->string() +
              ": is tagged to be shown turned or mirrored (EXIF): such pictures are, as in every viewer");
      } catch (const files::ConfigError& error) {
        warnings_.push_back(std::string(error.what()) + ": omitted");
      }
    }
    ++at_;
    return set;
  }

 private:
  std::vector<std::string> cameras_;
  std::vector<std::optional<capture::Crop>> crops_;
  std::vector<ImageSet> sets_;
  std::size_t at_ = 0;
  std::vector<std::string> warnings_;
  bool has_noted_turn_ = false;
};

recordings::Recording with_cameras(recordings::Recording recording, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    if (std::ranges::find(recording.cameras, name, &recordings::RecordedCamera::name) != recording.cameras.end())
      continue;
    std::vector<std::string_view> there;
    for (const auto& camera : recording.cameras) there.emplace_back(camera.name);
    throw InputError(fmt::format("{}: has no camera {}; its cameras are {}", recording.file.string(), name,
                                 fmt::to_string(fmt::join(there, ", "))));
  }
  return recording;
}

class RecordedPictures final : public PictureSource {
 public:
  RecordedPictures(const recordings::Recording& recording, std::vector<std::string> cameras,
                   std::optional<double> tolerance_s)
      : cameras_(std::move(cameras)),
        warnings_(recording.warnings),
        source_(with_cameras(recording, cameras_), cameras_, {.decoder_threads = 2}),
        synchronizer_({.camera_count = static_cast<int>(cameras_.size()),
                       .tolerance = tolerance_s ? capture::duration_of(*tolerance_s) : usual_tolerance(),
                       .ascending_input = true}) {}

  const std::vector<std::string>& cameras() const override { return cameras_; }
  std::optional<int> expected_sets() const override {
    std::int64_t most = 0;
    for (const recordings::ReplayCamera& camera : source_.cameras()) {
      if (!camera.expected_frames) return std::nullopt;
      most = std::max(most, *camera.expected_frames);
    }
    return static_cast<int>(most);
  }
  bool has_stamps() const override { return true; }
  std::vector<std::string> take_warnings() override {
    std::ranges::move(source_.take_warnings(), std::back_inserter(warnings_));
    return std::exchange(warnings_, {});
  }

  std::optional<PictureSet> next(std::stop_token stop) override {
    while (ready_.empty() && !ended_) {
      if (auto frame = source_.next(stop)) {
        for (capture::FrameSet& set : synchronizer_.push(std::move(*frame))) ready_.push_back(std::move(set));
      } else {
        while (auto set = synchronizer_.flush()) ready_.push_back(std::move(*set));
        ended_ = true;
      }
    }
    if (ready_.empty() || stop.stop_requested()) return std::nullopt;
    PictureSet pictures;
    pictures.number = static_cast<int>(ready_.front().number);
    pictures.at_s = capture::seconds(ready_.front().at);
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      pictures.pictures.emplace_back();
      const auto& frame = ready_.front().frames[c];
      if (!frame) continue;
      pictures.pictures.back() = {board_grey_of(frame->pixels),
                                  fmt::format("{} at {:.2f} s", cameras_[c], capture::seconds(frame->captured_at)),
                                  capture::seconds(frame->captured_at + frame->latency)};
    }
    ready_.pop_front();
    return pictures;
  }

 private:
  capture::Duration usual_tolerance() const {
    std::vector<capture::Duration> periods;
    for (const recordings::ReplayCamera& camera : source_.cameras()) periods.push_back(camera.frame_period);
    return capture::suggested_tolerance(periods);
  }

  std::vector<std::string> cameras_;
  std::vector<std::string> warnings_;
  recordings::ReplaySource source_;
  capture::FrameSynchronizer synchronizer_;
  std::deque<capture::FrameSet> ready_;
  bool ended_ = false;
};

std::unique_ptr<PictureSource> open_recording(const fs::path& path, const PictureOptions& options) {
  const recordings::Recording recording = recordings::read_recording(path);
  std::vector<std::string> names = options.only;
  if (names.empty()) {
    for (const auto& camera : recording.cameras) names.push_back(camera.name);
  }
  return std::make_unique<RecordedPictures>(recording, names, options.tolerance_s);
}

// For a message, of a folder in which nothing can be read: what is there instead, such as HEIC; may be empty.
std::string unreadable_pictures(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder, error)) files.push_back(entry.path());
  std::ranges::sort(files);
  for (const fs::path& file : files) {
    const std::string name = "; " + file.filename().string() + " ";
    if (const auto advice = recordings::advice_to_convert(file); !advice.empty()) return name + advice;
    if (is_video_file(file)) return name + "is a film: give it as NAME=FILE; parts of one must be joined first";
  }
  return {};
}

// NAME=FRAMES, in the given order.
using NamedInputs = std::vector<std::pair<std::string, std::vector<std::string>>>;

std::unique_ptr<PictureSource> open_named(const NamedInputs& inputs, const PictureOptions& options) {
  std::vector<std::string> names;
  struct Images {
    std::vector<fs::path> files;
    std::optional<capture::Crop> crop;
  };
  std::vector<Images> images;
  recordings::Recording recording;
  for (const auto& [name, given] : inputs) {
    if (!options.only.empty() && std::ranges::find(options.only, name) == options.only.end()) continue;
    names.push_back(name);
    images.emplace_back();
    for (const std::string& frames : given) {
      std::error_code error;
      const auto [path, crop] = recordings::split_crop(frames, {});
      const auto files = image_files(path);
      if (!files.empty()) {
        if (!images.back().files.empty() && images.back().crop != crop)
          throw InputError(frames + ": the crop of camera " + name + " is not that of its other images");
        std::ranges::copy(files, std::back_inserter(images.back().files));
        images.back().crop = crop;
      } else if (fs::is_regular_file(path, error) || recordings::is_split_film(path) || bags::is_bag(path) ||
                 path.find(":/") != std::string::npos) {
        if (given.size() > 1) throw InputError(frames + ": give one video per camera, or only images");
        recording.file = path;
        recording.cameras.push_back(recordings::recorded_camera(name, frames, path));
      } else if (fs::is_directory(path, error)) {
        throw InputError(frames + ": holds no images" + unreadable_pictures(path));
      } else {
        throw InputError(frames + ": no such file or folder, and no image matches this pattern" +
                         files::files_beside(path));
      }
    }
  }
  for (const std::string& name : options.only) {
    if (std::ranges::find(names, name) == names.end())
      throw InputError("there is no input for camera " + name + ": give " + name + "=FRAMES");
  }
  if (!options.only.empty()) {  // in this order
    std::vector<Images> sorted;
    for (const std::string& name : options.only)
      sorted.push_back(images[static_cast<std::size_t>(std::ranges::find(names, name) - names.begin())]);
    names = options.only;
    images = std::move(sorted);
  }
  if (recording.cameras.empty()) {
    std::vector<std::vector<fs::path>> files;
    std::vector<std::optional<capture::Crop>> crops;
    for (Images& own : images) {
      files.push_back(std::move(own.files));
      crops.push_back(own.crop);
    }
    return std::make_unique<ImageFilePictures>(names, files, std::move(crops));
  }
  if (recording.cameras.size() != names.size())
    throw InputError("some cameras have a video and others images: give all of one kind, or a recording.yaml");
  return std::make_unique<RecordedPictures>(recording, names, options.tolerance_s);
}

// A folder with a sub-folder of images or a video per camera.
NamedInputs inside(const fs::path& folder) {
  std::map<std::string, std::string> folders, videos;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory() && !image_files(entry.path()).empty())
      folders[entry.path().filename().string()] = entry.path().string();
    if (recordings::is_split_film(entry.path())) videos[entry.path().filename().string()] = entry.path().string();
    if (entry.is_regular_file() && is_video_file(entry.path()))
      videos[entry.path().stem().string()] = entry.path().string();
  }
  NamedInputs inputs;
  for (const auto& [name, path] : folders.empty() ? videos : folders) inputs.push_back({name, {path}});
  return inputs;
}

// Names sub-folders without images, for a message; may be empty.
std::string folders_without_pictures(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.is_directory(error)) names.push_back(entry.path().filename().string());
  }
  std::ranges::sort(names);
  return names.empty() ? "" : fmt::format(" (no images are in {})", fmt::join(names, ", "));
}

bool is_recording(const fs::path& path) {
  std::error_code error;
  if (bags::is_bag(path)) return true;
  return fs::exists(path / "recording.yaml", error) || path.extension() == ".yaml" || path.extension() == ".yml";
}

// nullopt: not NAME=FRAMES.
std::optional<std::pair<std::string, std::string>> named(const std::string& input) {
  const auto at = input.find('=');
  std::error_code error;
  if (at == std::string::npos || at == 0 || at + 1 == input.size() || fs::exists(input, error)) return std::nullopt;
  const std::string name = input.substr(0, at);
  if (!std::ranges::all_of(name, [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-' || c == '.'; }))
    return std::nullopt;
  return std::pair(name, input.substr(at + 1));
}

}  // namespace

cv::Mat board_grey_of(const capture::Image& image) {
  capture::require_all(image);
  auto* bytes = const_cast<std::uint8_t*>(image.planes[0].data);  // cv::Mat is never read-only
  const auto stride = static_cast<std::size_t>(image.planes[0].stride);
  cv::Mat grey;
  if (image.format == capture::PixelFormat::yuyv) {
    cv::extractChannel(cv::Mat(image.height, image.width, CV_8UC2, bytes, stride), grey, 0);
  } else if (image.format == capture::PixelFormat::bgr) {
    cv::cvtColor(cv::Mat(image.height, image.width, CV_8UC3, bytes, stride), grey, cv::COLOR_BGR2GRAY);
  } else {
    grey = cv::Mat(image.height, image.width, CV_8UC1, bytes, stride).clone();
  }
  return grey;
}

std::unique_ptr<PictureSource> open_pictures(std::span<const std::string> inputs, const PictureOptions& options) {
  if (inputs.empty()) throw InputError("no input: give a recording, or NAME=FRAMES for each camera");
  NamedInputs all;
  for (const std::string& input : inputs) {
    if (const auto pair = named(input)) {
      auto known = std::ranges::find(all, pair->first, &NamedInputs::value_type::first);
      if (known == all.end()) known = all.insert(all.end(), {pair->first, {}});
      known->second.push_back(pair->second);
      continue;
    }
    std::error_code error;
    if (!fs::exists(input, error)) {
      throw InputError(input + ": no such file or folder; give a recording, or NAME=FRAMES for each camera" +
                       files::files_beside(input));
    }
    if (inputs.size() > 1)
      throw InputError(input + ": which camera is this? Give NAME=" + input + ", or a recording alone");
    if (is_recording(input)) return open_recording(input, options);
    if (const auto advice = recordings::advice_to_convert(input); !advice.empty())
      throw InputError(input + " " + advice);
    if (fs::is_directory(input, error) && fs::is_empty(input, error)) throw InputError(input + ": the folder is empty");
    all = fs::is_directory(input, error) ? inside(input) : NamedInputs{};
    if (all.empty()) {
      throw InputError(
          input + ": is not a recording: it has no recording.yaml, nor a sub-folder of images or a video per camera" +
          folders_without_pictures(input) + "; or give NAME=FRAMES for each camera");
    }
  }
  return open_named(all, options);
}

std::unique_ptr<PictureSource> open_pictures_of(const std::string& name, std::span<const std::string> inputs) {
  if (inputs.empty()) throw InputError("no input: give images, a video or a recording");
  if (inputs.size() == 1 && !named(inputs[0])) {
    if (is_recording(inputs[0])) return open_recording(inputs[0], {.only = {name}, .tolerance_s = {}});
    std::error_code error;
    if (fs::is_directory(inputs[0], error) && image_files(inputs[0]).empty()) {
      const NamedInputs cameras = inside(inputs[0]);
      if (!cameras.empty()) return open_named(cameras, {.only = {name}, .tolerance_s = {}});
    }
  }
  NamedInputs own{{name, {}}};
  for (const std::string& input : inputs) {
    const auto pair = named(input);
    if (pair && pair->first != name)
      throw InputError(input + ": only camera " + name + " is calibrated here: give only its inputs");
    own.front().second.push_back(pair ? pair->second : input);
  }
  return open_named(own, {});
}

}  // namespace huetrack::gather
