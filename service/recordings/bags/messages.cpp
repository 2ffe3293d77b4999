#include "recordings/bags/messages.h"

#include <algorithm>
#include <string_view>
#include <tuple>
#include <utility>

#include "recordings/bags/byte_file.h"

namespace huetrack::bags {
namespace {

constexpr std::int64_t ns_per_s = 1'000'000'000;
constexpr std::uint32_t most_transforms = 10'000;  // capacity

// The fields of a ROS message, in order. ROS 1 differs from CDR in its header, its strings and its alignment.
class Fields {
 public:
  // nullopt: an encoding that is not supported, such as XCDR 2.
  static std::optional<Fields> of(const BagMessage& message) {
    if (message.encoding == "ros1") return Fields(message.data, {}, true);
    constexpr std::size_t encapsulation = 4;  // 0, the endianness, and two bytes of options
    if (message.encoding != "cdr" || message.data.size() < encapsulation || message.data[0] != 0 || message.data[1] > 1)
      return std::nullopt;
    return Fields(message.data.subspan(encapsulation), {.is_big_endian = message.data[1] == 0, .is_aligned = true},
                  false);
  }

  bool ok() const { return in_.ok(); }
  template <typename Number>
  Number number() {
    return in_.number<Number>();
  }
  template <typename Array>
  void numbers(Array& to) {
    for (auto& value : to) value = number<typename Array::value_type>();
  }
  std::string text() {
    std::string_view own = in_.text();
    if (!is_ros1_ && own.ends_with('\0')) own.remove_suffix(1);
    return std::string(own);
  }
  std::span<const std::uint8_t> bytes() { return in_.counted(); }
  std::vector<double> doubles() {
    std::vector<double> values;
    for (auto left = number<std::uint32_t>(); left > 0 && ok(); --left) values.push_back(number<double>());
    return values;
  }
  std::int64_t time() {
    const std::int64_t s = is_ros1_ ? number<std::uint32_t>() : number<std::int32_t>();
    return s * ns_per_s + number<std::uint32_t>();
  }
  // std_msgs/Header
  std::pair<std::int64_t, std::string> header() {
    if (is_ros1_) number<std::uint32_t>();  // seq
    const std::int64_t stamp = time();
    return {stamp, text()};
  }

 private:
  Fields(std::span<const std::uint8_t> bytes, CursorOptions options, bool is_ros1)
      : in_(bytes, options), is_ros1_(is_ros1) {}
  Cursor in_;
  bool is_ros1_;
};

void read_compressed_image(Fields& in, PictureMessage& out) {
  std::tie(out.stamp_ns, out.frame_id) = in.header();
  out.encoding = in.text();
  out.data = in.bytes();
}

void read_image(Fields& in, PictureMessage& out) {
  std::tie(out.stamp_ns, out.frame_id) = in.header();
  out.height = in.number<std::uint32_t>();
  out.width = in.number<std::uint32_t>();
  out.encoding = in.text();
  out.is_big_endian = in.number<std::uint8_t>() != 0;
  out.step = in.number<std::uint32_t>();
  out.data = in.bytes();
}

void read_foxglove_compressed(Fields& in, PictureMessage& out) {
  out.stamp_ns = in.time();
  out.frame_id = in.text();
  out.data = in.bytes();
  out.encoding = in.text();
}

void read_foxglove_raw(Fields& in, PictureMessage& out) {
  out.stamp_ns = in.time();
  out.frame_id = in.text();
  out.width = in.number<std::uint32_t>();
  out.height = in.number<std::uint32_t>();
  out.encoding = in.text();
  out.step = in.number<std::uint32_t>();
  out.data = in.bytes();
}

struct PictureType {
  std::string_view name;
  bool is_compressed;
  void (*read)(Fields&, PictureMessage&);
};
constexpr std::array<PictureType, 4> ros_pictures{{{"sensor_msgs/CompressedImage", true, read_compressed_image},
                                                   {"sensor_msgs/Image", false, read_image},
                                                   {"foxglove_msgs/CompressedImage", true, read_foxglove_compressed},
                                                   {"foxglove_msgs/RawImage", false, read_foxglove_raw}}};

// ---- Protobuf (https://protobuf.dev/programming-guides/encoding)

std::uint64_t varint(Cursor& in) {
  std::uint64_t value = 0;
  for (int shift = 0; shift < 64; shift += 7) {
    const auto byte = in.number<std::uint8_t>();
    value |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
    if (byte < 0x80) break;
  }
  return value;
}

// Calls field(number, value, bytes) for every field: one of value and bytes is its content. False: damaged.
template <typename Field>
bool for_each_field(std::span<const std::uint8_t> message, const Field& field) {
  Cursor in(message);
  while (in.ok() && !in.at_end()) {
    const auto key = varint(in);
    const auto number = key >> 3;
    switch (key & 7) {
      case 0:
        field(number, varint(in), std::span<const std::uint8_t>());
        break;
      case 1:
        field(number, in.number<std::uint64_t>(), std::span<const std::uint8_t>());
        break;
      case 2:
        field(number, std::uint64_t{0}, in.bytes(varint(in)));
        break;
      case 5:
        field(number, std::uint64_t{in.number<std::uint32_t>()}, std::span<const std::uint8_t>());
        break;
      default:
        return false;
    }
  }
  return in.ok();
}

// The numbers of the fields of Foxglove's schemas.
struct ProtobufPicture {
  std::string_view name;
  bool is_compressed;
  unsigned frame_id, width, height, encoding, step, data;  // 0: has none
};
constexpr std::array<ProtobufPicture, 2> protobuf_pictures{
    {{"foxglove.CompressedImage", true, 4, 0, 0, 3, 0, 2}, {"foxglove.RawImage", false, 7, 2, 3, 4, 5, 6}}};

std::optional<PictureMessage> protobuf_picture(const ProtobufPicture& type, const BagMessage& message) {
  PictureMessage out;
  out.is_compressed = type.is_compressed;
  const auto text_of = [](std::span<const std::uint8_t> bytes) { return std::string(bytes.begin(), bytes.end()); };
  bool is_timed = true;
  const bool is_whole =
      for_each_field(message.data, [&](std::uint64_t number, std::uint64_t value, std::span<const std::uint8_t> bytes) {
        if (number == 1)
          is_timed = for_each_field(bytes, [&](std::uint64_t part, std::uint64_t count, std::span<const std::uint8_t>) {
            out.stamp_ns += static_cast<std::int64_t>(count) * (part == 1 ? ns_per_s : 1);
          });
        else if (number == type.frame_id)
          out.frame_id = text_of(bytes);
        else if (number == type.encoding)
          out.encoding = text_of(bytes);
        else if (number == type.data)
          out.data = bytes;
        else if (number == type.width)
          out.width = static_cast<std::uint32_t>(value);
        else if (number == type.height)
          out.height = static_cast<std::uint32_t>(value);
        else if (number == type.step)
          out.step = static_cast<std::uint32_t>(value);
      });
  return is_whole && is_timed ? std::optional(out) : std::nullopt;
}

}  // namespace

bool is_picture(const BagTopic& topic) {
  if (topic.encoding == "protobuf")
    return std::ranges::find(protobuf_pictures, topic.type, &ProtobufPicture::name) != protobuf_pictures.end();
  return (topic.encoding == "cdr" || topic.encoding == "ros1") &&
         std::ranges::find(ros_pictures, topic.type, &PictureType::name) != ros_pictures.end();
}

bool is_lens(const BagTopic& topic) {
  return topic.type == "sensor_msgs/CameraInfo" && (topic.encoding == "cdr" || topic.encoding == "ros1");
}

bool is_transform(const BagTopic& topic) {
  return topic.type == "tf2_msgs/TFMessage" && (topic.encoding == "cdr" || topic.encoding == "ros1");
}

std::optional<PictureMessage> picture_of(const BagMessage& message) {
  if (message.encoding == "protobuf") {
    const auto type = std::ranges::find(protobuf_pictures, message.type, &ProtobufPicture::name);
    return type == protobuf_pictures.end() ? std::nullopt : protobuf_picture(*type, message);
  }
  const auto type = std::ranges::find(ros_pictures, message.type, &PictureType::name);
  auto in = Fields::of(message);
  if (type == ros_pictures.end() || !in) return std::nullopt;
  PictureMessage out;
  out.is_compressed = type->is_compressed;
  type->read(*in, out);
  return in->ok() ? std::optional(out) : std::nullopt;
}

std::optional<LensMessage> lens_of(const BagMessage& message) {
  auto in = Fields::of(message);
  if (!in) return std::nullopt;
  LensMessage out;
  out.frame_id = in->header().second;
  out.height = in->number<std::uint32_t>();
  out.width = in->number<std::uint32_t>();
  out.distortion_model = in->text();
  out.d = in->doubles();
  in->numbers(out.k);
  std::array<double, 9 + 12> of_rectified{};  // R, P: of an image that huetrack does not use
  in->numbers(of_rectified);
  out.binning_x = in->number<std::uint32_t>();
  out.binning_y = in->number<std::uint32_t>();
  in->numbers(out.roi);
  return in->ok() ? std::optional(out) : std::nullopt;
}

std::optional<std::vector<TransformMessage>> transforms_of(const BagMessage& message) {
  auto in = Fields::of(message);
  if (!in) return std::nullopt;
  std::vector<TransformMessage> out(std::min(in->number<std::uint32_t>(), most_transforms));
  for (TransformMessage& transform : out) {
    transform.parent = in->header().second;
    transform.child = in->text();
    in->numbers(transform.translation);
    in->numbers(transform.rotation_xyzw);
  }
  return in->ok() ? std::optional(out) : std::nullopt;
}

}  // namespace huetrack::bags
