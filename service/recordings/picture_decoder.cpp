#include "recordings/picture_decoder.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <string_view>

namespace huetrack::recordings {
namespace {

// Names of kinds differ between programs; the first bytes do not.
AVCodecID codec_of(std::span<const std::uint8_t> bytes) {
  const std::string_view begin(reinterpret_cast<const char*>(bytes.data()), std::min<std::size_t>(bytes.size(), 16));
  if (begin.starts_with("\xff\xd8")) return AV_CODEC_ID_MJPEG;
  if (begin.starts_with("\x89PNG")) return AV_CODEC_ID_PNG;
  if (begin.starts_with("RIFF") && begin.substr(8, 4) == "WEBP") return AV_CODEC_ID_WEBP;
  if (begin.starts_with("II*") || begin.starts_with(std::string_view("MM\0*", 4))) return AV_CODEC_ID_TIFF;
  return AV_CODEC_ID_NONE;
}

}  // namespace

bool is_jpeg(std::span<const std::uint8_t> bytes) {
  return codec_of(bytes) == AV_CODEC_ID_MJPEG;
}

std::optional<capture::Image> tiff_of(std::span<const std::uint8_t> bytes, capture::PictureMaker& pictures) {
  const capture::PictureTags tags = capture::tags_of(bytes);
  pictures.tag(tags);
  cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<std::uint8_t*>(bytes.data()));
  if (tags.orientation_at > 0) {  // OpenCV turns TIFFs, whatever its flags say
    encoded = encoded.clone();
    encoded.at<std::uint8_t>(0, static_cast<int>(tags.orientation_at)) = 1;
  }
  auto decoded = std::make_shared<cv::Mat>();
  try {
    *decoded = cv::imdecode(encoded, cv::IMREAD_ANYCOLOR | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
    if (decoded->depth() == CV_16U) {
      pictures.depth().fit({{{.data = decoded->data,
                              .stride = static_cast<std::ptrdiff_t>(decoded->step[0]),
                              .samples = decoded->total() * static_cast<std::size_t>(decoded->channels()) /
                                         static_cast<std::size_t>(std::max(1, decoded->rows)),
                              .rows = decoded->rows}}});
      constexpr double upper_bits = 1. / 256;
      decoded->convertTo(*decoded, CV_8U, upper_bits, -0.5);  // the upper byte, as OpenCV takes it
    } else if (decoded->depth() != CV_8U) {
      *decoded = cv::imdecode(encoded, cv::IMREAD_ANYCOLOR | cv::IMREAD_IGNORE_ORIENTATION);
    }
  } catch (const cv::Exception&) {  // a damaged header
    return std::nullopt;
  }
  if (decoded->empty()) return std::nullopt;
  capture::Image image{.format = decoded->channels() == 3 ? capture::PixelFormat::bgr : capture::PixelFormat::grey,
                       .range = capture::ColorRange::full,
                       .width = decoded->cols,
                       .height = decoded->rows,
                       .planes = {},
                       .owner = {}};
  image.planes[0] = {decoded->data, static_cast<std::ptrdiff_t>(decoded->step[0])};
  image.owner = std::move(decoded);
  return pictures.upright(image);
}

PictureDecoder::PictureDecoder() {
  capture::take_over_ffmpeg_log();
}

std::optional<capture::Image> PictureDecoder::decode(std::shared_ptr<const std::vector<std::uint8_t>> bytes) {
  take_problem();
  const AVCodecID id = codec_of(*bytes);
  if (id == AV_CODEC_ID_NONE) {
    problem_ = "it is neither JPEG, PNG, WebP nor TIFF";
    return std::nullopt;
  }
  pictures_.tag(capture::tags_of(*bytes));
  if (id == AV_CODEC_ID_MJPEG) {
    auto result = jpeg_.read(bytes);
    problem_ = result.problem;
    if (result.image) return pictures_.upright(*result.image);
    if (!result.is_unsupported) return std::nullopt;
  }
  if (id == AV_CODEC_ID_TIFF) {
    problem_ = "it is no TIFF that OpenCV can decode";
    return tiff_of(*bytes, pictures_);
  }
  return decode_by_ffmpeg(*bytes, id);
}

std::optional<capture::Image> PictureDecoder::decode_by_ffmpeg(std::span<const std::uint8_t> bytes, AVCodecID id) {
  const capture::FfmpegLogScope scope(log_);
  problem_ = std::string("it is no ") + avcodec_get_name(id) + " that FFmpeg can decode";
  capture::StreamDecoder& codec = codecs_[id];
  if (!codec.is_open()) {
    const AVCodec* decoder = avcodec_find_decoder(id);
    if (decoder == nullptr) return std::nullopt;
    if (codec.open(nullptr, *decoder, {.log = &log_}) < 0) {
      codec.close();
      return std::nullopt;
    }
  }
  const capture::PacketPtr packet(capture::not_null(av_packet_alloc()));
  if (av_new_packet(packet.get(), static_cast<int>(bytes.size())) < 0) return std::nullopt;
  std::ranges::copy(bytes, packet->data);
  packet->flags |= AV_PKT_FLAG_KEY;  // FFmpeg's PNG decoder supports predicted pictures
  capture::FramePtr frame(capture::not_null(av_frame_alloc()));
  codec.examine(*packet);
  if (codec.send(packet.get()) < 0 || codec.receive(*frame) < 0) return std::nullopt;
  return pictures_.image_of(std::move(frame), id);
}

}  // namespace huetrack::recordings
