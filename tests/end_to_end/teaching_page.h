// A client of the service that teaches it colours over DDS, as the page of `huetrack view` does.
#pragma once

#include <algorithm>
#include <chrono>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "capture/frames/jpeg_decoder.h"
#include "end_to_end/process.h"
#include "idl/dds_participant.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/topics.h"

namespace huetrack::end_to_end {

namespace dds = eprosima::fastdds::dds;

// What the bridge does for a page on which a colour is taught.
class TeachingPage {
 public:
  explicit TeachingPage(int domain)
      : participant_({.name = "test page", .domain = domain, .interfaces = {"lo"}}),
        request_(participant_.create_writer<msg::TeachRequestPubSubType>(idl::teach_request_topic,
                                                                         idl::teach_writer_qos(), "")),
        reply_(participant_.create_reader<msg::TeachReplyPubSubType>(idl::teach_reply_topic, idl::teach_reader_qos())),
        scene_(participant_.create_reader<msg::ScenePubSubType>(idl::scene_topic, idl::status_reader_qos())),
        position_(participant_.create_reader<msg::ObjectPositionPubSubType>(idl::object_position_topic,
                                                                            idl::object_position_reader_qos())) {}

  // Everything that has come.
  void listen() {
    take<msg::Scene>(scene_, [&](const auto& s) { scene = s; });
    take<msg::ObjectPosition>(position_, [&](const auto& s) { positions.push_back(s); });
    take<msg::TeachReply>(reply_, [&](const auto& s) {
      if (s.client() == "test") replies.push_back(s);
    });
  }

  msg::TeachReply ask(msg::TeachAction action, const std::vector<msg::TeachPoint>& points = {}) {
    last_ = {};
    last_.client("test");
    last_.number(++number_);
    last_.host(scene->host());
    last_.pid(scene->pid());
    last_.action(action);
    last_.target("lime");
    last_.points(points);
    return ask_again();
  }

  msg::TeachReply ask_again() {
    replies.clear();
    bool has_come = false;
    for (int attempt = 0; attempt < 3 && !has_come; ++attempt) {  // as the page: the first may be before they have met
      request_.write(&last_);
      has_come = comes_true(
          [&] {
            listen();
            return !replies.empty() && replies.back().number() == number_;
          },
          std::chrono::seconds(7));
    }
    if (!has_come) throw std::runtime_error("no reply to the request");
    return replies.back();
  }

  std::optional<msg::Scene> scene;
  std::vector<msg::ObjectPosition> positions;
  std::vector<msg::TeachReply> replies;

 private:
  template <typename Sample>
  static void take(dds::DataReader& reader, const std::function<void(const Sample&)>& use) {
    Sample sample;
    dds::SampleInfo info;
    while (reader.take_next_sample(&sample, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK)
      if (info.valid_data) use(sample);
  }

  idl::DdsParticipant participant_;
  dds::DataWriter& request_;
  dds::DataReader &reply_, &scene_, &position_;
  std::uint32_t number_ = 0;
  msg::TeachRequest last_;
};

inline msg::TeachPoint point(const std::string& camera, double u, double v) {
  msg::TeachPoint p;
  p.camera(camera);
  p.pixel({u, v});
  return p;
}

// Where a user would click: in the middle of what is greenest, the least blue and red.
inline msg::TeachPoint lime_in(const msg::TeachCamera& camera) {
  const std::vector<std::uint8_t> jpeg(camera.jpeg().begin(), camera.jpeg().end());
  const auto decoded = capture::JpegDecoder().decode(jpeg);
  if (!decoded.image) throw std::runtime_error(decoded.problem);
  const capture::Plane &blue = decoded.image->planes[1], &red = decoded.image->planes[2];
  const int width = decoded.image->width / 2, height = decoded.image->height / 2;  // of chroma
  const auto at = [&](int u, int v) { return blue.data[v * blue.stride + u] + red.data[v * red.stride + u]; };
  int best_u = 0, best_v = 0;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      if (at(u, v) < at(best_u, best_v)) best_u = u, best_v = v;
  double sum_u = 0, sum_v = 0, count = 0;
  for (int v = std::max(0, best_v - 10); v < std::min(height, best_v + 10); ++v)
    for (int u = std::max(0, best_u - 10); u < std::min(width, best_u + 10); ++u)
      if (at(u, v) < at(best_u, best_v) + 20) sum_u += u, sum_v += v, ++count;
  return point(camera.camera(), 2 * sum_u / count + 0.5, 2 * sum_v / count + 0.5);
}

}  // namespace huetrack::end_to_end
