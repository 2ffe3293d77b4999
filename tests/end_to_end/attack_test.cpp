// What a stranger on the network can do to the service and to the page's bridge, each in a process of its own: huge and
// countless samples on the bus, connections that say nothing. Their memory stays, every good request is answered within
// a second, and not one frame set is lost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <functional>
#include <memory>

#include "end_to_end/http.h"
#include "end_to_end/process.h"
#include "idl/arrivals.h"
#include "idl/dds_participant.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/topics.h"
#include "publish/test_domain.h"
#include "slow_motion.h"
#include "soak/films.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
namespace dds = eprosima::fastdds::dds;
using namespace std::chrono_literals;
using namespace testing;
using Clock = std::chrono::steady_clock;

constexpr double most_growth_mb = 20;
constexpr auto longest_answer = 1s * slow_motion;

double resident_mb(pid_t pid) {
  std::istringstream text(contents("/proc/" + std::to_string(pid) + "/status"));
  for (std::string line; std::getline(text, line);)
    if (line.starts_with("VmRSS:")) return std::stod(line.substr(6)) / 1024;
  return 0;
}

// Whether a reader takes what is written there: before that a flood goes nowhere.
bool is_heard(dds::DataWriter& writer) {
  dds::PublicationMatchedStatus readers;
  writer.get_publication_matched_status(readers);
  return readers.current_count > 0;
}

// Who asks the service in words, as a page does.
class GoodClient {
 public:
  GoodClient(int domain, pid_t service)
      : participant_({.name = "good client", .domain = domain, .interfaces = {"lo"}}),
        writer_(participant_.create_writer<msg::ControlRequestPubSubType>(idl::control_request_topic,
                                                                          idl::teach_writer_qos(), "")),
        reader_(participant_.create_reader<msg::ControlReplyPubSubType>(idl::control_reply_topic,
                                                                        idl::teach_reader_qos())) {
    request_.client("good");
    request_.host(idl::PublisherIdentity::of_this_process({}).host);
    request_.pid(static_cast<std::uint32_t>(service));
  }

  bool has_met_the_service() {
    dds::SubscriptionMatchedStatus writers;
    reader_.get_subscription_matched_status(writers);
    return is_heard(writer_) && writers.current_count > 0;
  }

  // How long the reply took. nullopt: there was none for that long, or it was a refusal.
  std::optional<std::chrono::milliseconds> ask(std::vector<std::string> words) {
    request_.number(request_.number() + 1);
    request_.words(std::move(words));
    const auto asked = Clock::now();
    writer_.write(&request_);
    bool is_granted = false;
    comes_true([&] { return has_reply(is_granted); }, 5 * longest_answer);
    if (!is_granted) return std::nullopt;
    return std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - asked);
  }

 private:
  bool has_reply(bool& is_granted) {
    msg::ControlReply reply;
    while (idl::take_next(reader_, reply)) {
      if (reply.client() != request_.client() || reply.number() != request_.number()) continue;
      is_granted = reply.granted();
      return true;
    }
    return false;
  }

  idl::DdsParticipant participant_;
  dds::DataWriter& writer_;
  dds::DataReader& reader_;
  msg::ControlRequest request_;
};

// Anybody on the domain.
class Stranger {
 public:
  explicit Stranger(int domain) : participant_({.name = "stranger", .domain = domain, .interfaces = {"lo"}}) {}

  template <typename PubSubType>
  dds::DataWriter& writer(const char* topic, dds::DataWriterQos qos, int instances = 5) {
    qos.resource_limits().max_instances = instances;  // the stranger's own memory
    // Fast DDS 2.9 looks through the whole history for each heartbeat. With thousands of names that takes longer than
    // our period, and a thread that deletes the writer waited for its mutex for minutes.
    qos.reliable_writer_qos().times.heartbeatPeriod = eprosima::fastrtps::Duration_t(3, 0);
    return participant_.create_writer<PubSubType>(topic, std::move(qos), "");
  }

 private:
  idl::DdsParticipant participant_;
};

// Any bytes, under the name of a type of ours: the first four say how the rest is encoded, and nobody knows that code.
class Garbage : public dds::TopicDataType {
 public:
  explicit Garbage(const char* type) {
    setName(type);
    m_typeSize = 1000;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void*, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    for (payload->length = 0; payload->length < 400; ++payload->length)
      payload->data[payload->length] = static_cast<unsigned char>(++last_ * 151 + 96);
    return true;
  }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t*, void*) override { return false; }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return 400U; };
  }
  void* createData() override { return &last_; }
  void deleteData(void*) override {}
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }

 private:
  unsigned last_ = 0;
};

class Attack : public Test {
 protected:
  Attack() { soak::make_films(folder_, 2, 160, 120); }
  ~Attack() override { fs::remove_all(folder_); }
  std::map<std::string, double> metrics() const { return prometheus_samples(http_get(port_, "/metrics").value_or("")); }
  Process bridge() const {
    return Process(
        {HUETRACK, "view", "--port", std::to_string(port_), "--domain", std::to_string(domain_), "--interface", "lo"},
        folder_ / "out", folder_ / "err");
  }
  const int domain_ = publish::test_domain(), port_ = 20000 + ::getpid() % 10000;
  const fs::path folder_ = fs::path(TempDir()) / ("attack_" + std::to_string(::getpid()));
};

TEST_F(Attack, TheServiceKeepsItsMemoryItsSetsAndItsAnswers) {
  std::ofstream(folder_ / "c.yaml") << soak::film_config(folder_, 100,
                                                         "dds: {domain: " + std::to_string(domain_) +
                                                             ", interfaces: [lo]}\ncontrol: {allow_teach: true}\n" +
                                                             "metrics: {port: " + std::to_string(port_) + "}\n");
  const Process service({FILM_SERVICE, folder_ / "c.yaml", folder_}, folder_ / "out", folder_ / "err");
  ASSERT_TRUE(comes_true([&] { return metrics()["huetrack_sets_total"] > 60; })) << service.err();
  const double before_mb = resident_mb(service.pid());
  double most_mb = before_mb;

  Stranger stranger(domain_);
  auto& teach = stranger.writer<msg::TeachRequestPubSubType>(idl::teach_request_topic, idl::teach_writer_qos());
  auto& status = stranger.writer<msg::ServiceStatusPubSubType>(idl::status_topic, idl::status_writer_qos());
  idl::DdsParticipant another({.name = "stranger", .domain = domain_, .interfaces = {"lo"}});
  auto& control = stranger.writer<msg::ControlRequestPubSubType>(idl::control_request_topic, idl::teach_writer_qos());
  auto& garbage =
      another.create_writer(idl::teach_request_topic, dds::TypeSupport(new Garbage("huetrack::msg::TeachRequest")),
                            idl::teach_writer_qos(), "");
  auto& control_garbage =
      another.create_writer(idl::control_request_topic, dds::TypeSupport(new Garbage("huetrack::msg::ControlRequest")),
                            idl::teach_writer_qos(), "");
  GoodClient client(domain_, service.pid());
  // Nobody has to take a status there: a service reads none.
  ASSERT_TRUE(comes_true([&] {
    return is_heard(teach) && is_heard(control) && is_heard(garbage) && is_heard(control_garbage) &&
           client.has_met_the_service();
  })) << service.err();
  for (int i = 0; i < 300; ++i) {
    int anything = 0;
    garbage.write(&anything);
    control_garbage.write(&anything);
  }
  auto slowest = 0ms, slowest_reply = 0ms;
  const std::string host = idl::PublisherIdentity::of_this_process({}).host;
  std::vector<std::unique_ptr<Connection>> silent;
  for (int i = 0; i < 25; ++i) {
    msg::TeachRequest request;
    request.client(std::string(10'000'000, 'c'));
    request.target(std::string(10'000'000, 't'));
    request.action(msg::TEACH_ACTION_LOOK);
    request.host(host);
    request.pid(static_cast<std::uint32_t>(service.pid()));
    teach.write(&request);
    msg::ControlRequest command;  // one huge word, or more words than anybody says
    command.client(std::string(i % 2 ? 5'000'000 : 8, 'c'));
    command.host(host);
    command.pid(static_cast<std::uint32_t>(service.pid()));
    command.words(i % 2 ? std::vector{std::string("record"), std::string(5'000'000, 'w')}
                        : std::vector<std::string>(500'000, "record"));
    control.write(&command);
    msg::ServiceStatus flood;
    flood.pid(static_cast<std::uint32_t>(i));
    flood.config_file(std::string(1'000'000, 'f'));
    status.write(&flood);
    for (int k = 0; k < 20; ++k) silent.push_back(std::make_unique<Connection>(port_));
    const auto asked = Clock::now();
    EXPECT_THAT(http_get(port_, "/metrics").value_or(""), HasSubstr("huetrack_sets_total"));
    slowest = std::max(slowest, std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - asked));
    const auto reply = client.ask({"target", "list"});
    ASSERT_TRUE(reply) << "the request of another was not answered in round " << i << "\n" << service.err();
    slowest_reply = std::max(slowest_reply, *reply);
    most_mb = std::max(most_mb, resident_mb(service.pid()));
  }
  silent.clear();
  std::this_thread::sleep_for(500ms);
  auto after = metrics();
  RecordProperty("growth_mb", std::to_string(most_mb - before_mb));
  std::printf(
      "the service: %.1f MB before, at most %.1f; the slowest answer took %lld ms, on the bus %lld; %.0f sets\n",
      before_mb, most_mb, static_cast<long long>(slowest.count()), static_cast<long long>(slowest_reply.count()),
      after["huetrack_sets_total"]);
  EXPECT_LT(most_mb - before_mb, most_growth_mb);
  EXPECT_LT(resident_mb(service.pid()) - before_mb, most_growth_mb);
  EXPECT_LT(slowest, longest_answer);
  EXPECT_LT(slowest_reply, longest_answer);
  EXPECT_EQ(after["huetrack_dropped_sets_total"], 0);
}

TEST_F(Attack, ThePagesBridgeKeepsItsMemoryAndItsAnswers) {
  const Process view = bridge();
  ASSERT_TRUE(comes_true([&] { return http_get(port_, "/").has_value(); })) << view.err();
  const Connection page(port_);  // with one, the bridge takes previews
  page.send("GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n");
  Stranger stranger(domain_);
  dds::DataWriterQos reliable = idl::teach_writer_qos();
  auto& preview = stranger.writer<msg::PreviewPubSubType>(idl::preview_topic, idl::preview_writer_qos());
  auto& status = stranger.writer<msg::ServiceStatusPubSubType>(idl::status_topic, idl::status_writer_qos());
  auto& scene = stranger.writer<msg::ScenePubSubType>(idl::scene_topic, idl::status_writer_qos());
  auto& reply = stranger.writer<msg::TeachReplyPubSubType>(idl::teach_reply_topic, reliable);
  ASSERT_TRUE(comes_true([&] { return is_heard(preview) && is_heard(status) && is_heard(scene) && is_heard(reply); }))
      << view.err();
  const double before_mb = resident_mb(view.pid());
  double most_mb = before_mb;
  auto slowest = 0ms;
  for (int i = 0; i < 3000; ++i) {
    msg::Preview picture;
    picture.camera("cam" + std::to_string(i));
    picture.jpeg(std::vector<std::uint8_t>(60'000, 'x'));
    preview.write(&picture);
    preview.unregister_instance(&picture, dds::HANDLE_NIL);
    if (i % 10 == 0) {
      msg::ServiceStatus flood;
      flood.pid(static_cast<std::uint32_t>(i));
      flood.config_file(std::string(100'000, 'f'));
      status.write(&flood);
      msg::Scene place;
      place.pid(static_cast<std::uint32_t>(i));
      place.why_not(std::string(100'000, 'w'));
      scene.write(&place);
      msg::TeachReply answer;
      answer.client("c" + std::to_string(i));
      answer.reason(std::string(100'000, 'r'));
      reply.write(&answer);
    }
    if (i % 100 != 0) continue;
    std::this_thread::sleep_for(20ms);
    const auto asked = Clock::now();
    EXPECT_THAT(http_get(port_, "/").value_or(""), HasSubstr("200 OK"));
    slowest = std::max(slowest, std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - asked));
    most_mb = std::max(most_mb, resident_mb(view.pid()));
  }
  const bool is_back = comes_true([&] { return resident_mb(view.pid()) - before_mb < most_growth_mb / 2; });
  std::printf("the bridge: %.1f MB before, at most %.1f, %.1f after; the slowest answer took %lld ms\n", before_mb,
              most_mb, resident_mb(view.pid()), static_cast<long long>(slowest.count()));
  EXPECT_LT(most_mb - before_mb, most_growth_mb);
  EXPECT_TRUE(is_back);
  EXPECT_LT(slowest, longest_answer);
}

// As fast as they can be sent, under a new name each, while no page is open and the bridge looks now and then.
TEST_F(Attack, ThePagesBridgeKeepsItsMemoryUnderNewNames) {
  const Process view = bridge();
  ASSERT_TRUE(comes_true([&] { return http_get(port_, "/").has_value(); })) << view.err();
  Stranger stranger(domain_);
  constexpr int names = 3000;
  auto& status = stranger.writer<msg::ServiceStatusPubSubType>(idl::status_topic, idl::status_writer_qos(), names);
  auto& scene = stranger.writer<msg::ScenePubSubType>(idl::scene_topic, idl::status_writer_qos(), names);
  auto& map = stranger.writer<msg::CameraMapPubSubType>(idl::camera_map_topic, idl::status_writer_qos(), names);
  ASSERT_TRUE(comes_true([&] { return is_heard(status) && is_heard(scene) && is_heard(map); })) << view.err();
  const double before_mb = resident_mb(view.pid());
  double most_mb = before_mb;
  const std::string much(55'000, 'x');
  const auto flood = [&](dds::DataWriter& writer, auto sample, auto&& rename) {
    for (std::uint32_t i = 0; i < names; ++i) {
      rename(sample, i);
      writer.write(&sample);
      if (i % 100 == 0) most_mb = std::max(most_mb, resident_mb(view.pid()));
    }
    most_mb = std::max(most_mb, resident_mb(view.pid()));
  };
  msg::ServiceStatus of_status;
  of_status.config_file(much);
  flood(status, of_status, [](auto& sample, std::uint32_t i) { sample.pid(i); });
  msg::Scene of_scene;
  of_scene.why_not(much);
  flood(scene, of_scene, [](auto& sample, std::uint32_t i) { sample.pid(i); });
  msg::CameraMap of_map;
  of_map.host(much);
  flood(map, of_map, [](auto& sample, std::uint32_t i) { sample.camera("cam" + std::to_string(i)); });
  EXPECT_THAT(http_get(port_, "/").value_or(""), HasSubstr("200 OK"));
  std::printf("the bridge: %.1f MB before, at most %.1f, %.1f after\n", before_mb, most_mb, resident_mb(view.pid()));
  EXPECT_LT(most_mb - before_mb, most_growth_mb);
}

// A service that goes on after a silence, as after a laptop's sleep, publishes its scene only when that changes.
TEST_F(Attack, ThePagesBridgeRemembersAServiceThatGoesOn) {
  const Process view = bridge();
  ASSERT_TRUE(comes_true([&] { return http_get(port_, "/").has_value(); })) << view.err();
  Stranger stranger(domain_);
  auto& status = stranger.writer<msg::ServiceStatusPubSubType>(idl::status_topic, idl::status_writer_qos());
  auto& scene = stranger.writer<msg::ScenePubSubType>(idl::scene_topic, idl::status_writer_qos());
  const auto is_shown = [&](const std::string& event) {
    const Connection page(port_);
    page.send("GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n");
    std::string shown;
    while (shown.find("event: pulse") == std::string::npos) shown += page.receive_some();
    return shown.find("event: " + event) != std::string::npos;
  };
  msg::ServiceStatus service;
  msg::Scene room;
  ASSERT_TRUE(comes_true([&] { return is_heard(status) && is_heard(scene); })) << view.err();
  scene.write(&room);
  const auto speaks = [&] { return status.write(&service), is_shown("status"); };
  ASSERT_TRUE(comes_true(speaks)) << view.err();
  EXPECT_TRUE(comes_true([&] { return is_shown("scene"); }));
  ASSERT_TRUE(comes_true([&] { return !is_shown("scene"); }));  // silent
  ASSERT_TRUE(comes_true(speaks));
  EXPECT_TRUE(is_shown("scene"));
}

// Pictures are kept for pages that come late: of a false service with more cameras than anybody has, too.
TEST_F(Attack, ThePagesBridgeForgetsAFalseService) {
  const Process view = bridge();
  ASSERT_TRUE(comes_true([&] { return http_get(port_, "/").has_value(); })) << view.err();
  const Connection page(port_);
  page.send("GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n");
  Stranger stranger(domain_);
  auto& preview = stranger.writer<msg::PreviewPubSubType>(idl::preview_topic, idl::preview_writer_qos());
  auto& status = stranger.writer<msg::ServiceStatusPubSubType>(idl::status_topic, idl::status_writer_qos());
  ASSERT_TRUE(comes_true([&] { return is_heard(preview) && is_heard(status); })) << view.err();
  const double before_mb = resident_mb(view.pid());
  double most_mb = before_mb;
  msg::ServiceStatus service;
  for (int i = 0; i < 250; ++i) service.cameras().emplace_back().name("cam" + std::to_string(i));
  std::string shown;
  for (const auto end = Clock::now() + 3s * slow_motion; Clock::now() < end;) {
    status.write(&service);
    for (const auto& camera : service.cameras()) {
      msg::Preview picture;
      picture.camera(camera.name());
      picture.jpeg(std::vector<std::uint8_t>(60'000, 'x'));
      preview.write(&picture);
      preview.unregister_instance(&picture, dds::HANDLE_NIL);
    }
    if (shown.find("event: preview") == std::string::npos) shown += page.receive_some();
    most_mb = std::max(most_mb, resident_mb(view.pid()));
  }
  EXPECT_THAT(shown, HasSubstr("event: preview"));
  const bool is_back = comes_true([&] { return resident_mb(view.pid()) - before_mb < most_growth_mb / 2; });
  std::printf("the bridge: %.1f MB before, at most %.1f, %.1f when the false service is forgotten\n", before_mb,
              most_mb, resident_mb(view.pid()));
  EXPECT_LT(most_mb - before_mb, most_growth_mb);
  EXPECT_TRUE(is_back);
}

// All that a host may open at once, none of it read: the room is limited, and given back.
TEST_F(Attack, ThePagesBridgeGivesBackWhatConnectionsTook) {
  const Process view = bridge();
  ASSERT_TRUE(comes_true([&] { return http_get(port_, "/").has_value(); })) << view.err();
  const double before_mb = resident_mb(view.pid());
  std::vector<std::unique_ptr<Connection>> many;
  for (int i = 0; i < 1000; ++i) many.push_back(std::make_unique<Connection>(port_));  // silent
  for (int i = 0; i < 450; ++i) {
    many.push_back(std::make_unique<Connection>(port_));
    many.back()->send("GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }
  for (int i = 0; i < 450; ++i) {
    many.push_back(std::make_unique<Connection>(port_));
    many.back()->send("POST /api/teach HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n");
    many.back()->send("4000\r\n" + std::string(0x4000, 'x'));
  }
  EXPECT_THAT(http_get(port_, "/").value_or(""), HasSubstr("200 OK"));
  const double most_mb = resident_mb(view.pid());
  many.clear();
  const bool is_back = comes_true([&] { return resident_mb(view.pid()) - before_mb < most_growth_mb / 3; });
  std::printf("the bridge: %.1f MB before, %.1f with all connections, %.1f without\n", before_mb, most_mb,
              resident_mb(view.pid()));
  EXPECT_LT(most_mb - before_mb, most_growth_mb);
  EXPECT_TRUE(is_back);
}

}  // namespace
}  // namespace huetrack::end_to_end
