#include "clients/live_view/events.h"

#include <openssl/evp.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "idl/control_words.h"
#include "idl/names.h"

namespace huetrack::live_view {
namespace {

using Json = nlohmann::json;

double unix_s(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-9;
}

// Any finite value fits a JSON number.
double seconds_between(std::int64_t from, std::int64_t to) {
  return unix_s(static_cast<std::int64_t>(static_cast<std::uint64_t>(to) - static_cast<std::uint64_t>(from)));
}

std::string base64(const std::vector<std::uint8_t>& bytes) {
  std::string out((bytes.size() + 2) / 3 * 4 + 1, '\0');
  ::EVP_EncodeBlock(reinterpret_cast<unsigned char*>(out.data()), bytes.data(), int(bytes.size()));
  out.pop_back();  // the zero that it ends with
  return out;
}

// For drawing: a tenth of a pixel, which is much shorter.
Json tenth(float value) {
  if (!std::isfinite(value)) return nullptr;
  return std::round(static_cast<double>(value) * 10) / 10;
}

Json color_json(const msg::SceneColor& color) {
  return {{"camera", color.camera()},
          {"hue_deg", color.hue_deg()},
          {"saturation", color.saturation()},
          {"intensity", color.intensity()}};
}

// Invalid UTF-8 from other programs is replaced.
std::string text(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

std::string to_json(const msg::ObjectPosition& s) {
  Json views = Json::array();
  for (const auto& v : s.per_view())
    views.push_back({{"camera", v.camera()},
                     {"delivered", v.delivered()},
                     {"seen", v.seen()},
                     {"support", v.support()},
                     {"residual_px", v.residual_px()}});
  return text({{"target", s.target()},
               {"t", unix_s(s.captured_at())},
               {"set", s.set_number()},
               {"state", idl::state_name(s.state())},
               {"position", s.position()},
               {"velocity", s.velocity()},
               {"covariance", s.covariance()},
               {"views", s.views()},
               {"confidence", s.confidence()},
               {"particles", s.particle_count()},
               {"ess", s.effective_sample_size()},
               {"latency", seconds_between(s.captured_at(), s.published_at())},
               {"tracking_latency", seconds_between(s.received_at(), s.published_at())},
               {"per_view", std::move(views)}});
}

std::string to_json(const msg::CameraPose& s) {
  return text({{"camera", s.camera()},
               {"t", unix_s(s.captured_at())},
               {"state", idl::state_name(s.state())},
               {"position", s.position()},
               {"orientation", s.orientation()},
               {"covariance", s.covariance()},
               {"sigma", {std::sqrt(s.covariance()[0]), std::sqrt(s.covariance()[7]), std::sqrt(s.covariance()[14])}},
               {"features_in_view", s.features_in_view()},
               {"features_matched", s.features_matched()},
               {"map_points", s.map_points()},
               {"confidence", s.confidence()},
               {"latency", seconds_between(s.captured_at(), s.published_at())},
               {"tracking_latency", seconds_between(s.received_at(), s.published_at())}});
}

// Flat and rounded, for a thousand points.
std::string to_json(const msg::CameraMap& m) {
  constexpr const char* point_states[] = {"not_sought", "missed", "found"};
  const auto rounded = [](float value, double step) -> Json {
    if (!std::isfinite(value)) return nullptr;
    return std::round(static_cast<double>(value) / step) * step;
  };
  Json points = Json::array();
  for (const auto& p : m.points()) {
    Json position = Json::array(), covariance = Json::array();
    for (const float x : p.position()) position.push_back(rounded(x, 1e-4));
    for (const float x : p.covariance()) covariance.push_back(rounded(x, 1e-9));
    const auto state = static_cast<std::size_t>(p.state());
    points.push_back({{"id", p.id()},
                      {"position", std::move(position)},
                      {"covariance", std::move(covariance)},
                      {"state", state < std::size(point_states) ? point_states[state] : "unknown"},
                      {"given", p.given()}});
  }
  return text({{"camera", m.camera()},
               {"host", m.host()},
               {"pid", m.pid()},
               {"t", unix_s(m.captured_at())},
               {"map_points", m.map_points()},
               {"points", std::move(points)}});
}

std::string to_json(const msg::ServiceStatus& s, double received_at) {
  Json cameras = Json::array();
  for (const auto& c : s.cameras())
    cameras.push_back({{"name", c.name()},
                       {"health", idl::name(c.health())},
                       {"message", c.message()},
                       {"frames", c.frames()},
                       {"dropped", c.dropped()},
                       {"corrupted", c.corrupted()},
                       {"rate_hz", c.rate_hz()},
                       {"age_s", c.age_s()}});
  return text({{"host", s.host()},
               {"pid", s.pid()},
               {"heard", received_at},
               {"version", s.program_version()},
               {"mode", s.mode()},
               {"config_file", s.config_file()},
               {"config_identity", s.config_identity()},
               {"rig_identity", s.rig_identity()},
               {"rig_history", s.rig_history()},
               {"set_rate_hz", s.set_rate_hz()},
               {"sets", s.sets()},
               {"incomplete_sets", s.incomplete_sets()},
               {"late_frames", s.late_frames()},
               {"dropped_sets", s.dropped_sets()},
               {"published", s.published()},
               {"publish_failures", s.publish_failures()},
               {"cameras", std::move(cameras)},
               {"targets", s.targets()},
               {"warnings", s.warnings()}});
}

std::string to_json(const msg::CameraTimes& s) {
  Json cameras = Json::array();
  for (const auto& c : s.cameras())
    cameras.push_back({{"name", c.camera()},
                       {"latency_s", c.latency_s()},
                       {"latency_sigma_s", c.latency_sigma_s()},
                       {"readout_s", c.readout_s()},
                       {"readout_sigma_s", c.readout_sigma_s()}});
  return text({{"host", s.host()}, {"pid", s.pid()}, {"cameras", std::move(cameras)}});
}

std::string to_json(const msg::HostClocks& s) {
  Json clocks = Json::array();
  for (const auto& c : s.clocks())
    clocks.push_back({{"host", c.host()},
                      {"cameras", c.cameras()},
                      {"known", c.is_known()},
                      {"offset_s", c.offset_s()},
                      {"sigma_s", c.offset_sigma_s()},
                      {"drift_ppm", 1e6 * c.drift()},
                      {"round_trip_s", c.round_trip_s()},
                      {"same_machine", c.is_same_machine()},
                      {"kept_s", c.kept_s()},
                      {"contradicted", c.is_contradicted()},
                      {"advice", c.advice()}});
  return text({{"host", s.host()}, {"pid", s.pid()}, {"clocks", std::move(clocks)}});
}

std::string to_json(const msg::Scene& s) {
  Json cameras = Json::array(), targets = Json::array(), ignored = Json::array();
  for (const auto& c : s.cameras())
    cameras.push_back({{"name", c.name()},
                       {"size", {c.width(), c.height()}},
                       {"model", c.model()},
                       {"intrinsics", c.intrinsics()},
                       {"position", c.position()},
                       {"orientation", c.orientation_xyzw()},
                       {"border", c.border()}});
  for (const auto& t : s.targets()) {
    Json colors = Json::array();
    for (const auto& color : t.colors()) colors.push_back(color_json(color));
    targets.push_back({{"name", t.name()}, {"radius", t.radius_m()}, {"rgb", t.rgb()}, {"colors", std::move(colors)}});
  }
  for (const auto& i : s.ignored()) ignored.push_back({{"camera", i.camera()}, {"box", i.box()}});
  return text({{"host", s.host()},
               {"pid", s.pid()},
               {"at", unix_s(s.at())},
               {"rig_identity", s.rig_identity()},
               {"frame_id", s.frame_id()},
               {"volume", {s.volume_min(), s.volume_max()}},
               {"cameras", std::move(cameras)},
               {"targets", std::move(targets)},
               {"ignored", std::move(ignored)},
               {"may_teach", s.may_teach()},
               {"why_not", s.why_not()}});
}

std::string to_json(const msg::Preview& p) {
  Json targets = Json::array();
  constexpr std::uint32_t left_out = 100;  // huetrack_view.idl
  for (const auto& t : p.targets()) {
    Json particles = Json::array();
    for (const float value : t.particles()) particles.push_back(tenth(value));
    targets.push_back({{"target", t.target()},
                       {"state", t.state() == left_out ? "left_out" : idl::state_name(t.state())},
                       {"px", {tenth(t.pixel()[0]), tenth(t.pixel()[1])}},
                       {"radius", tenth(t.radius_px())},
                       {"ellipse", {t.ellipse()[0], t.ellipse()[1], t.ellipse()[2]}},
                       {"particles", std::move(particles)}});
  }
  return text({{"camera", p.camera()},
               {"t", unix_s(p.captured_at())},
               {"set", p.set_number()},
               {"image", {p.image_width(), p.image_height()}},
               {"size", {p.width(), p.height()}},
               {"jpeg", base64(p.jpeg())},
               {"targets", std::move(targets)}});
}

std::string to_json(const msg::TeachReply& r) {
  Json cameras = Json::array();
  for (const auto& c : r.cameras())
    cameras.push_back({{"camera", c.camera()},
                       {"pointed", c.pointed()},
                       {"region", {c.region_pixel()[0], c.region_pixel()[1]}},
                       {"region_radius", c.region_radius_px()},
                       {"color", color_json(c.color())},
                       {"background_share", c.background_share()},
                       {"background_box", c.background_box()},
                       {"verdict", c.verdict()},
                       {"size", {c.width(), c.height()}},
                       {"jpeg", base64(c.jpeg())},
                       {"mask", base64(c.mask())}});
  return text({{"client", r.client()},
               {"number", r.number()},
               {"granted", r.granted()},
               {"reason", r.reason()},
               {"set", r.set_number()},
               {"radius", r.radius_m()},
               {"cameras", std::move(cameras)}});
}

std::string to_json(const msg::ControlReply& r) {
  Json rows = Json::array();
  for (const auto& row : r.rows()) rows.push_back(row.columns());
  return text({{"client", r.client()},
               {"number", r.number()},
               {"granted", r.granted()},
               {"reason", r.reason()},
               {"rows", std::move(rows)}});
}

std::string to_json(const Pulse& p) {
  return text(
      {{"now", p.now}, {"domain", p.domain}, {"bus", p.bus}, {"publishers", p.publishers}, {"trouble", p.trouble}});
}

namespace {

constexpr std::size_t longest_client = 64, longest_name = 256;

// Client and service of a request. Throws Json::exception, std::invalid_argument.
template <typename Request>
Request addressed(const Json& j) {
  Request request;
  request.client(j.at("client").get<std::string>());
  request.number(j.at("number").get<std::uint32_t>());
  if (j.contains("host") || j.contains("pid")) {  // neither: the shown service
    request.host(j.at("host").get<std::string>());
    request.pid(j.at("pid").get<std::uint32_t>());
  }
  if (request.client().size() > longest_client || request.host().size() > longest_name)
    throw std::invalid_argument("a name is too long");
  return request;
}

}  // namespace

msg::TeachRequest teach_request_of(const std::string& json) {
  constexpr std::size_t most = 64;  // points, rectangles
  try {
    const Json j = Json::parse(json);
    auto request = addressed<msg::TeachRequest>(j);
    const auto action = j.at("action").get<std::string>();
    constexpr const char* actions[] = {"freeze", "look", "apply", "ignore", "resume", "undo"};
    std::size_t a = 0;
    while (a < std::size(actions) && action != actions[a]) ++a;
    if (a == std::size(actions))
      throw std::invalid_argument("action must be freeze, look, apply, ignore, resume or undo");
    request.action(static_cast<msg::TeachAction>(a));
    request.target(j.value("target", ""));
    request.wider(j.value("wider", 0));
    const Json points = j.value("points", Json::array()), ignored = j.value("ignored", Json::array());
    if (points.size() > most || ignored.size() > most)
      throw std::invalid_argument("more than " + std::to_string(most) + " points or rectangles");
    for (const Json& p : points) {
      msg::TeachPoint& point = request.points().emplace_back();
      point.camera(p.at("camera").get<std::string>());
      point.pixel(p.at("pixel").get<std::array<double, 2>>());
    }
    for (const Json& i : ignored) {
      msg::SceneIgnore& ignore = request.ignored().emplace_back();
      ignore.camera(i.at("camera").get<std::string>());
      ignore.box(i.at("box").get<std::array<double, 4>>());
    }
    if (request.target().size() > longest_name) throw std::invalid_argument("a name is too long");
    return request;
  } catch (const Json::exception& error) {
    throw std::invalid_argument(error.what());
  }
}

msg::ControlRequest control_request_of(const std::string& json) {
  try {
    const Json j = Json::parse(json);
    auto request = addressed<msg::ControlRequest>(j);
    request.words(j.at("words").get<std::vector<std::string>>());
    if (request.words().size() > idl::most_control_words ||
        std::ranges::any_of(request.words(), [](const std::string& word) {
          return word.size() > idl::longest_control_word || word.find('\0') != std::string::npos;
        }))
      throw std::invalid_argument("more than " + std::to_string(idl::most_control_words) +
                                  " words, or a word is too long");
    return request;
  } catch (const Json::exception& error) {
    throw std::invalid_argument(error.what());
  }
}

}  // namespace huetrack::live_view
