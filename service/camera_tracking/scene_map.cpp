#include "camera_tracking/scene_map.h"

#include <cstring>
#include <stdexcept>
#include <string>

#include "calib/files/output_file.h"
#include "calib/files/text_file.h"
#include "camera_tracking/map_file.h"

namespace huetrack::camera_tracking {
namespace {

constexpr std::size_t largest_map = 1U << 30;  // bytes: three thousand key frames of 640x480
static_assert(std::endian::native == std::endian::little, "the map file is little-endian");

std::uint64_t checksum(std::string_view bytes) {  // FNV-1a
  std::uint64_t h = 0xcbf29ce484222325u;
  for (const char c : bytes) h = (h ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return h;
}

class Writer {
 public:
  template <typename T>
  requires std::is_arithmetic_v<T>
  void put(T value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(raw, sizeof value);
  }
  template <typename Derived>
  void put(const Eigen::MatrixBase<Derived>& m) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      for (Eigen::Index i = 0; i < m.rows(); ++i) put(m(i, j));
    }
  }
  void put(const calib::Rigid3d& t) {
    put(t.rotation.coeffs());
    put(t.translation);
  }
  std::string bytes;
};

class Reader {
 public:
  Reader(std::string_view bytes, std::string file) : bytes_(bytes), file_(std::move(file)) {}
  [[noreturn]] void fail(const std::string& what) const { throw std::runtime_error(file_ + ": " + what); }

  template <typename T>
  requires std::is_arithmetic_v<T>
  void get(T& value) {
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    if constexpr (std::is_floating_point_v<T>) {
      if (!(value - value == 0)) fail("a number in it is not finite; it is damaged");
    }
  }
  template <typename Derived>
  void get(Eigen::MatrixBase<Derived>& m) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      for (Eigen::Index i = 0; i < m.rows(); ++i) get(m(i, j));
    }
  }
  void get(calib::Rigid3d& t) {
    get(t.rotation.coeffs());
    get(t.translation);
    if (!(std::abs(t.rotation.norm() - 1) < 1e-6)) fail("a rotation in it is none; it is damaged");
  }
  int index(int below, const char* what) {
    std::int32_t i = 0;
    get(i);
    if (i < 0 || i >= below) fail(std::string(what) + " is out of range; it is damaged");
    return i;
  }
  int count(int most, const char* what) { return index(most + 1, what); }
  std::string_view take(std::size_t n) {
    if (bytes_.size() < n) fail("it ends too early; it is cut off");
    const std::string_view out = bytes_.substr(0, n);
    bytes_.remove_prefix(n);
    return out;
  }
  bool done() const { return bytes_.empty(); }

 private:
  std::string_view bytes_;
  std::string file_;
};

}  // namespace

void describe(PointView& view, const Pyramid& pyramid) {
  const GreyImage& image = pyramid.level(view.level);
  const Eigen::Vector2d px = to_level(view.px, view.level);
  view.has_descriptor = image.contains(px.x(), px.y(), descriptor_margin);
  if (view.has_descriptor) view.descriptor = describe(image, px);
}

void write_map(const std::filesystem::path& file, const StoredMap& stored) {
  Writer w;
  w.put(stored.image_size);
  w.put(stored.map.start_covariance);
  w.put(stored.map.start_centre);
  w.put(static_cast<std::int32_t>(stored.map.keyframes.size()));
  for (const Keyframe& k : stored.map.keyframes) {
    w.put(k.cam_from_world);
    w.put(k.sweep.motion);
    w.put(k.sweep.bend);
    const GreyImage& image = k.pyramid->levels.front();
    for (int v = 0; v < image.height; ++v)
      w.bytes.append(reinterpret_cast<const char*>(image.row(v)), static_cast<std::size_t>(image.width));
  }
  w.put(static_cast<std::int32_t>(stored.map.points.size()));
  for (const MapPoint& p : stored.map.points) {
    w.put(p.position);
    w.put(p.covariance);
    w.put(p.normal);
    w.put(static_cast<std::uint8_t>(p.given));
    w.put(static_cast<std::uint8_t>(p.alive));
    w.put(static_cast<std::int32_t>(p.view_count));
    for (int i = 0; i < p.view_count; ++i) {
      const PointView& l = p.view(i);
      w.put(static_cast<std::int32_t>(l.keyframe));
      w.put(static_cast<std::int32_t>(l.level));
      w.put(l.px);
    }
  }
  w.put(static_cast<std::int32_t>(stored.sightings.size()));
  for (const PointSighting& s : stored.sightings) {
    w.put(static_cast<std::int32_t>(s.keyframe));
    w.put(static_cast<std::int32_t>(s.point));
    w.put(s.px);
    w.put(s.sigma_px);
  }
  const std::uint64_t sum = checksum(w.bytes);
  std::string text(map_magic);
  text.append(reinterpret_cast<const char*>(&sum), sizeof sum);
  text += w.bytes;
  refuse_other_than_map(file);
  files::write_whole_file(file, text);
}

StoredMap read_map(const std::filesystem::path& file) {
  const std::string all = files::read_text_file(file, largest_map);
  Reader r(all, file.string());
  const std::string_view version = all.size() < map_magic.size() ? std::string_view{} : r.take(map_magic.size());
  if (version != map_magic && version != map_magic_1) r.fail("is not a camera map of this version of huetrack");
  std::uint64_t sum = 0;
  r.get(sum);
  if (sum != checksum(std::string_view(all).substr(map_magic.size() + sizeof sum)))
    r.fail("is damaged or cut off (its check sum is wrong)");
  StoredMap out;
  r.get(out.image_size);
  if (out.image_size.minCoeff() < 1 || out.image_size.maxCoeff() > 1 << 15)
    r.fail("its image size is impossible; it is damaged");
  r.get(out.map.start_covariance);
  r.get(out.map.start_centre);
  constexpr int most = 10'000'000;
  const int keyframes = r.count(most, "the number of key frames");
  for (int i = 0; i < keyframes; ++i) {
    Keyframe k;
    r.get(k.cam_from_world);
    k.sweep.last_row = out.image_size.y() - 1;
    if (version == map_magic) {
      r.get(k.sweep.motion);
      r.get(k.sweep.bend);
    }
    // Checked before the allocation: a damaged file may claim more than there is memory.
    const auto bytes =
        r.take(static_cast<std::size_t>(out.image_size.x()) * static_cast<std::size_t>(out.image_size.y()));
    std::uint8_t* pixels = nullptr;
    GreyImage image = make_grey(out.image_size.x(), out.image_size.y(), pixels);
    std::memcpy(pixels, bytes.data(), bytes.size());
    k.pyramid = std::make_shared<const Pyramid>(make_pyramid(std::move(image)));
    out.map.keyframes.push_back(std::move(k));
  }
  const int points = r.count(most, "the number of points");
  for (int i = 0; i < points; ++i) {
    MapPoint p;
    std::uint8_t given = 0, alive = 0;
    r.get(p.position);
    r.get(p.covariance);
    r.get(p.normal);
    r.get(given);
    r.get(alive);
    p.given = given != 0, p.alive = alive != 0;
    p.view_count = r.count(static_cast<int>(p.views.size()), "the number of a point's views");
    for (int k = 0; k < p.view_count; ++k) {
      PointView& l = p.view(k);
      l.keyframe = r.index(keyframes, "a key frame");
      const Pyramid& pyramid = *out.map.keyframe(l.keyframe).pyramid;
      l.level = r.index(pyramid.count(), "a level");
      r.get(l.px);
      describe(l, pyramid);
    }
    out.map.points.push_back(p);
  }
  const int sightings = r.count(most, "the number of sightings");
  for (int i = 0; i < sightings; ++i) {
    PointSighting s;
    s.keyframe = r.index(keyframes, "a key frame");
    s.point = r.index(points, "a point");
    r.get(s.px);
    r.get(s.sigma_px);
    if (!(s.sigma_px > 0)) r.fail("a pixel's deviation is impossible; it is damaged");
    out.sightings.push_back(s);
  }
  if (!r.done()) r.fail("has more in it than it should; it is damaged");
  return out;
}

StoredMap read_map(const std::filesystem::path& file, const calib::ImageSize& size) {
  StoredMap out = read_map(file);
  if (out.image_size != Eigen::Vector2i(size.width, size.height))
    throw std::runtime_error(file.string() + ": is a map of images of " + std::to_string(out.image_size.x()) + "x" +
                             std::to_string(out.image_size.y()) + ", the camera's are " + std::to_string(size.width) +
                             "x" + std::to_string(size.height));
  return out;
}

}  // namespace huetrack::camera_tracking
