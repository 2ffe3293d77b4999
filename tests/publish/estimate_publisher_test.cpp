#include "publish/estimate_publisher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>

#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <cmath>
#include <cstdlib>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <map>
#include <thread>

#include "idl/dds_participant.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/object_setPubSubTypes.h"
#include "idl/ros2_messagesPubSubTypes.h"
#include "idl/topics.h"
#include "publish/child_process.h"
#include "publish/known_samples.h"

namespace huetrack::publish {
namespace {

namespace dds = eprosima::fastdds::dds;
using eprosima::fastrtps::types::ReturnCode_t;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace testing;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

template <typename Sample>
std::vector<Sample> take_all(dds::DataReader& reader) {
  std::vector<Sample> samples;
  Sample sample;
  dds::SampleInfo info;
  while (reader.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK)
    if (info.valid_data) samples.push_back(sample);
  return samples;
}

bool publish_known(EstimatePublisher& publisher, object_tracking::TrackState state, std::size_t target = 0) {
  return publisher.publish(target, known_estimate(state), captured_at(state), received_at(state));
}

class Bus : public ::testing::Test {
 protected:
  Bus() {
    // Within one process Fast DDS would hand the sample over without putting it on the wire.
    eprosima::fastrtps::LibrarySettingsAttributes settings;
    settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
    eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
    participant_.emplace(idl::ParticipantOptions{.domain = test_domain()});
  }

  template <typename PubSubType>
  dds::DataReader& reader(const std::string& topic, dds::DataReaderQos qos) {
    return participant_->create_reader<PubSubType>(topic, qos);
  }
  dds::DataReader& position_reader() {
    return reader<msg::ObjectPositionPubSubType>(idl::object_position_topic, idl::object_position_reader_qos());
  }

  static bool matched(dds::DataReader& reader, int publishers = 1) {
    return ChildProcess::wait(
        [&] {
          dds::SubscriptionMatchedStatus status;
          reader.get_subscription_matched_status(status);
          return status.current_count == publishers;
        },
        5s);
  }

  std::optional<idl::DdsParticipant> participant_;
};

// Samples that were written before the publisher had matched the reader are not delivered, and only the publisher knows
// when it has: write until one arrives.
template <typename Sample, typename Write>
std::optional<Sample> first_after(dds::DataReader& reader, Write write) {
  std::vector<Sample> got;
  ChildProcess::wait(
      [&] {
        write();
        std::this_thread::sleep_for(20ms);
        got = take_all<Sample>(reader);
        return !got.empty();
      },
      5s);
  return got.empty() ? std::nullopt : std::optional(got.back());
}

TEST_F(Bus, ObjectsOfATargetHaveInstancesAndOneSampleTogether) {
  dds::DataReader& positions = position_reader();
  dds::DataReader& sets = reader<msg::ObjectSetPubSubType>(idl::object_set_topic, idl::object_position_reader_qos());
  dds::DataReader& poses = reader<geometry_msgs::msg::dds_::PoseArray_PubSubType>(idl::ros2_poses_topic("ball"), {});
  EstimatePublisherOptions options = known_options(test_domain());
  options.counts = {3};
  EstimatePublisher publisher(options);
  constexpr auto state = object_tracking::TrackState::tracking;
  std::vector<object_tracking::ObjectEstimate> estimates(2, known_estimate(state));
  estimates[0].object = 1, estimates[1].object = 4;
  estimates[1].is_birth = true;
  estimates[1].position.x() += 0.5;
  const auto write = [&] {
    for (const auto& e : estimates) EXPECT_TRUE(publisher.publish(0, e, captured_at(state), received_at(state)));
    EXPECT_TRUE(publisher.publish_set(0, estimates, captured_at(state), received_at(state)));
  };
  const auto set = first_after<msg::ObjectSet>(sets, write);
  ASSERT_TRUE(set);
  EXPECT_EQ(set->target(), "ball");
  EXPECT_EQ(set->most(), 3U);
  EXPECT_EQ(set->set_number(), estimates[0].set_number);
  ASSERT_EQ(set->objects().size(), 2U);
  EXPECT_EQ(set->objects()[0].name(), "ball_1");
  EXPECT_EQ(set->objects()[1].name(), "ball_4");
  EXPECT_EQ(set->objects()[1].number(), 4U);
  EXPECT_TRUE(set->objects()[1].is_birth());
  EXPECT_EQ(set->objects()[1].position()[0], estimates[1].position.x());
  const auto array = first_after<geometry_msgs::msg::dds_::PoseArray_>(poses, write);
  ASSERT_TRUE(array);
  ASSERT_EQ(array->poses().size(), 2U);
  EXPECT_EQ(array->poses()[1].position().x(), estimates[1].position.x());

  take_all<msg::ObjectPosition>(positions);
  estimates[1].state = object_tracking::TrackState::lost;
  estimates[1].is_end = true;
  write();
  std::map<std::string, msg::TrackState> states;
  int ended = 0;
  ChildProcess::wait(
      [&] {
        msg::ObjectPosition sample;
        dds::SampleInfo info;
        while (positions.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
          if (info.valid_data) states[sample.target()] = sample.state();
          if (info.instance_state != dds::ALIVE_INSTANCE_STATE) ++ended;
        }
        return ended > 0 && states.size() == 2;
      },
      5s);
  EXPECT_EQ(states["ball_1"], msg::TRACK_STATE_TRACKING);
  EXPECT_EQ(states["ball_4"], msg::TRACK_STATE_LOST);
  EXPECT_GT(ended, 0);
  EXPECT_EQ(publisher.counters().failures, 0U);
}

TEST_F(Bus, PositionRoundTripOfEveryField) {
  dds::DataReader& reader = position_reader();
  EstimatePublisher publisher(known_options(test_domain()));
  const auto before = std::chrono::system_clock::now().time_since_epoch();
  const auto sample = first_after<msg::ObjectPosition>(
      reader, [&] { EXPECT_TRUE(publish_known(publisher, object_tracking::TrackState::tracking)); });
  ASSERT_TRUE(sample);
  const object_tracking::ObjectEstimate e = known_estimate(object_tracking::TrackState::tracking);
  EXPECT_EQ(sample->target(), "ball");
  EXPECT_EQ(sample->captured_at(), captured_at(object_tracking::TrackState::tracking).time_since_epoch().count());
  EXPECT_EQ(sample->received_at(), received_at(object_tracking::TrackState::tracking).time_since_epoch().count());
  EXPECT_GE(sample->published_at(), std::chrono::nanoseconds(before).count());
  EXPECT_LE(sample->published_at(),
            std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count());
  EXPECT_EQ(sample->set_number(), 1001U);
  EXPECT_EQ(sample->state(), msg::TRACK_STATE_TRACKING);
  EXPECT_THAT(sample->position(), ElementsAre(e.position.x(), e.position.y(), e.position.z()));
  EXPECT_THAT(sample->velocity(), ElementsAre(e.velocity.x(), e.velocity.y(), e.velocity.z()));
  EXPECT_THAT(sample->covariance(), ElementsAre(1e-6, 2e-7, 3e-7, 2e-7, 4e-6, 5e-7, 3e-7, 5e-7, 9e-6));
  EXPECT_THAT(sample->map_position(), ElementsAre(0.126, -1.51, 2.11));
  EXPECT_EQ(sample->views(), 2U);
  EXPECT_EQ(sample->confidence(), 0.875);
  EXPECT_EQ(sample->particle_count(), 201U);
  EXPECT_EQ(sample->effective_sample_size(), 123.5);
  ASSERT_EQ(sample->per_view().size(), 2U);
  const msg::ViewSupport& left = sample->per_view()[0];
  EXPECT_EQ(left.camera(), "left");
  EXPECT_TRUE(left.delivered() && left.in_view() && left.seen());
  EXPECT_THAT(left.pixel(), ElementsAre(100.25F, 50.5F));
  EXPECT_EQ(left.radius_px(), 12.5F);
  EXPECT_EQ(left.support(), 0.75F);
  EXPECT_EQ(left.residual_px(), 0.375F);
  const msg::ViewSupport& right = sample->per_view()[1];
  EXPECT_EQ(right.camera(), "rechts_\xC3\xBC");
  EXPECT_TRUE(right.delivered() && !right.in_view() && !right.seen());
}

TEST_F(Bus, WithoutAPositionItIsNanWhateverTheEstimateHolds) {
  dds::DataReader& reader = position_reader();
  EstimatePublisher publisher(known_options(test_domain()));
  for (const object_tracking::TrackState state :
       {object_tracking::TrackState::searching, object_tracking::TrackState::lost}) {
    const auto sample = first_after<msg::ObjectPosition>(reader, [&] { publish_known(publisher, state); });
    ASSERT_TRUE(sample);
    EXPECT_EQ(sample->state(), static_cast<msg::TrackState>(state));
    for (const double value : sample->position()) EXPECT_TRUE(std::isnan(value));
    for (const double value : sample->velocity()) EXPECT_TRUE(std::isnan(value));
    for (const double value : sample->covariance()) EXPECT_TRUE(std::isnan(value));
    for (const double value : sample->map_position()) EXPECT_TRUE(std::isnan(value));
    take_all<msg::ObjectPosition>(reader);
  }
}

TEST_F(Bus, AViewThatSaysNothingDoesNotRepeatTheLastOne) {
  dds::DataReader& reader = position_reader();
  EstimatePublisher publisher(known_options(test_domain()));
  ASSERT_TRUE(first_after<msg::ObjectPosition>(
      reader, [&] { publish_known(publisher, object_tracking::TrackState::tracking); }));
  object_tracking::ObjectEstimate bare = known_estimate(object_tracking::TrackState::lost);
  bare.per_view.clear();
  publisher.publish(0, bare, captured_at(object_tracking::TrackState::lost),
                    received_at(object_tracking::TrackState::lost));
  ASSERT_TRUE(ChildProcess::wait(
      [&] {
        for (const auto& sample : take_all<msg::ObjectPosition>(reader))
          if (sample.state() == msg::TRACK_STATE_LOST) {
            EXPECT_FALSE(sample.per_view().at(0).delivered());
            EXPECT_TRUE(std::isnan(sample.per_view().at(0).pixel()[0]));
            return true;
          }
        return false;
      },
      2s));
}

TEST_F(Bus, EveryTargetIsAnInstanceOfItsOwnWithItsOwnHistory) {
  dds::DataReader& reader = position_reader();
  EstimatePublisherOptions options = known_options(test_domain());
  options.targets.clear();
  for (int i = 0; i < 30; ++i) options.targets.push_back("target" + std::to_string(i));
  EstimatePublisher publisher(options);
  ASSERT_TRUE(first_after<msg::ObjectPosition>(
      reader, [&] { publish_known(publisher, object_tracking::TrackState::tracking); }));
  std::this_thread::sleep_for(50ms);
  take_all<msg::ObjectPosition>(reader);
  for (int repeat = 0; repeat < 10; ++repeat)
    for (std::size_t i = 0; i < options.targets.size(); ++i)
      EXPECT_TRUE(publish_known(publisher, object_tracking::TrackState::tracking, i));
  std::map<std::string, int> count;
  ChildProcess::wait(
      [&] {
        for (const auto& sample : take_all<msg::ObjectPosition>(reader)) ++count[sample.target()];
        int total = 0;
        for (const auto& [target, n] : count) total += n;
        return total == 300;
      },
      3s);
  ASSERT_EQ(count.size(), 30U);
  for (const auto& [target, n] : count) EXPECT_EQ(n, 10) << target;
  EXPECT_EQ(publisher.counters().failures, 0U);
}

TEST_F(Bus, StatusIsThereForWhoComesLate) {
  EstimatePublisher publisher(known_options(test_domain()));
  publish_known(publisher, object_tracking::TrackState::tracking);
  ASSERT_TRUE(publisher.publish_status(known_status()));
  std::this_thread::sleep_for(300ms);
  dds::DataReader& reader = this->reader<msg::ServiceStatusPubSubType>(idl::status_topic, idl::status_reader_qos());
  std::vector<msg::ServiceStatus> got;
  ASSERT_TRUE(ChildProcess::wait([&] { return !(got = take_all<msg::ServiceStatus>(reader)).empty(); }, 2s));
  const msg::ServiceStatus& s = got.back();
  const ServiceStatus known = known_status();
  EXPECT_FALSE(s.host().empty());
  EXPECT_EQ(s.pid(), static_cast<std::uint32_t>(::getpid()));
  EXPECT_EQ(s.at(), known.at.time_since_epoch().count());
  EXPECT_EQ(s.program_version(), known.program_version);
  EXPECT_EQ(s.mode(), known.mode);
  EXPECT_EQ(s.frame_id(), "world");
  EXPECT_EQ(s.config_file(), known.config_file);
  EXPECT_EQ(s.config_identity(), known.config_identity);
  EXPECT_EQ(s.rig_identity(), known.rig_identity);
  EXPECT_EQ(s.rig_history(), known.rig_history);
  EXPECT_EQ(s.clock_offset_s(), known.clock_offset_s);
  EXPECT_EQ(s.set_rate_hz(), known.set_rate_hz);
  EXPECT_EQ(s.sets(), known.sets);
  EXPECT_EQ(s.incomplete_sets(), known.incomplete_sets);
  EXPECT_EQ(s.late_frames(), known.late_frames);
  EXPECT_EQ(s.dropped_sets(), known.dropped_sets);
  EXPECT_EQ(s.published(), 1U);
  EXPECT_EQ(s.publish_failures(), 0U);
  ASSERT_EQ(s.cameras().size(), 2U);
  const msg::CameraStatus& camera = s.cameras()[1];
  EXPECT_EQ(camera.name(), known.cameras[1].name);
  EXPECT_EQ(camera.health(), msg::CAMERA_HEALTH_ABSENT);
  EXPECT_EQ(camera.message(), known.cameras[1].message);
  EXPECT_EQ(camera.frames(), 301U);
  EXPECT_EQ(camera.dropped(), 302U);
  EXPECT_EQ(camera.corrupted(), 303U);
  EXPECT_EQ(camera.rate_hz(), 0.5);
  EXPECT_EQ(camera.age_s(), 17.25);
  EXPECT_EQ(s.targets(), known.targets);
  EXPECT_EQ(s.warnings(), known.warnings);
}

TEST_F(Bus, RosTopicsOnlyWhileThereIsAPosition) {
  dds::DataReaderQos ros;  // what a ROS 2 node asks for
  ros.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  ros.history().depth = 50;
  dds::DataReader& pose_reader =
      reader<geometry_msgs::msg::dds_::PoseWithCovarianceStamped_PubSubType>(idl::ros2_pose_topic("wand"), ros);
  dds::DataReader& tf_reader = reader<tf2_msgs::msg::dds_::TFMessage_PubSubType>(idl::ros2_tf_topic, ros);
  EstimatePublisher publisher(known_options(test_domain()));
  ASSERT_TRUE(matched(pose_reader) && matched(tf_reader));
  std::this_thread::sleep_for(200ms);
  for (int repeat = 0; repeat < 3; ++repeat)
    for (const object_tracking::TrackState state : states) EXPECT_TRUE(publish_known(publisher, state, 1));
  std::this_thread::sleep_for(300ms);
  const auto got_poses = take_all<geometry_msgs::msg::dds_::PoseWithCovarianceStamped_>(pose_reader);
  const auto got_tfs = take_all<tf2_msgs::msg::dds_::TFMessage_>(tf_reader);
  EXPECT_EQ(got_poses.size(), 6U);
  EXPECT_EQ(got_tfs.size(), 6U);
  for (const auto& pose : got_poses)
    EXPECT_THAT(pose.header().stamp().nanosec(), ::testing::AnyOf(223'456'789U, 323'456'789U));
  for (const auto& tf : got_tfs) EXPECT_EQ(tf.transforms().at(0).child_frame_id(), "wand");
}

TEST_F(Bus, WithoutRosThereAreNoRosTopics) {
  dds::DataReaderQos ros;
  dds::DataReader& tf_reader = reader<tf2_msgs::msg::dds_::TFMessage_PubSubType>(idl::ros2_tf_topic, ros);
  dds::DataReader& native = position_reader();
  EstimatePublisherOptions options = known_options(test_domain());
  options.ros2 = false;
  EstimatePublisher publisher(options);
  ASSERT_TRUE(first_after<msg::ObjectPosition>(
      native, [&] { publish_known(publisher, object_tracking::TrackState::tracking); }));
  EXPECT_TRUE(matched(tf_reader, 0));
  EXPECT_TRUE(take_all<tf2_msgs::msg::dds_::TFMessage_>(tf_reader).empty());
}

int alive(dds::DataReader& reader) {
  dds::LivelinessChangedStatus status;
  reader.get_liveliness_changed_status(status);
  return status.alive_count;
}

TEST_F(Bus, AKilledPublisherIsMissedWithinOneAndAHalfSeconds) {
  dds::DataReader& reader = position_reader();
  ChildProcess publisher({HUETRACK_TEST_PUBLISHER, std::to_string(test_domain())});
  ASSERT_TRUE(ChildProcess::wait([&] { return alive(reader) == 1; }, 5s));
  const auto killed = Clock::now();
  publisher.send(SIGKILL);
  ASSERT_TRUE(ChildProcess::wait([&] { return alive(reader) == 0; }, 5s));
  const double took_s = std::chrono::duration<double>(Clock::now() - killed).count();
  RecordProperty("seconds", std::to_string(took_s));
  EXPECT_LT(took_s, 1.5);
}

TEST_F(Bus, WhoWaitsForItsSubscriberAndLeavesAtOnceLosesNothing) {
  dds::DataReader& reader = position_reader();
  auto publisher = std::make_unique<EstimatePublisher>(known_options(test_domain()));
  ASSERT_TRUE(ChildProcess::wait([&] { return publisher->subscribers() == 1; }, 5s));
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(publish_known(*publisher, object_tracking::TrackState::tracking));
  publisher.reset();
  EXPECT_EQ(take_all<msg::ObjectPosition>(reader).size(), 10U);
}

TEST_F(Bus, APublisherThatLeavesIsMissedAtOnce) {
  dds::DataReader& reader = position_reader();
  auto publisher = std::make_unique<EstimatePublisher>(known_options(test_domain()));
  ASSERT_TRUE(matched(reader));
  publisher.reset();
  const auto left = Clock::now();
  ASSERT_TRUE(matched(reader, 0));
  EXPECT_LT(Clock::now() - left, 200ms);
}

TEST_F(Bus, ASecondPublisherOfTheSameTargetIsWarnedOf) {
  EstimatePublisherOptions options = known_options(test_domain());
  options.targets = {"wand", "cup"};
  EstimatePublisher publisher(options);
  options.targets = {"cube"};
  ChildProcess rival({HUETRACK_TEST_PUBLISHER, std::to_string(test_domain())});  // publishes ball and wand
  ASSERT_TRUE(ChildProcess::wait([&] { return publisher.warnings().size() == 1; }, 3s));
  EXPECT_THAT(publisher.warnings()[0],
              AllOf(HasSubstr("target wand"), HasSubstr("process " + std::to_string(rival.pid()))));
  const EstimatePublisher harmless(options);
  std::this_thread::sleep_for(300ms);
  EXPECT_THAT(harmless.warnings(), ElementsAre());
  rival.send(SIGTERM);
  EXPECT_TRUE(ChildProcess::wait([&] { return publisher.warnings().empty(); }, 3s));
}

// A network of our own, where interfaces come and go. Needs root (or unprivileged namespaces) and iproute2.
bool in_own_network() {
  return ::unshare(CLONE_NEWNET) == 0 &&
         std::system("ip link set lo up && ip link add va type veth peer name vb && ip link set vb up") == 0;
}
// The kernel takes a moment to report the carrier.
bool has_carrier(const std::string& address) {
  return ChildProcess::wait([&] { return idl::describe(idl::network_interfaces()).find(address) != std::string::npos; },
                            5s);
}
bool interface_comes_up() {
  return std::system("ip link set va up && ip addr add 10.99.0.1/24 dev va") == 0 && has_carrier("10.99.0.1");
}

TEST(Network, AnInterfaceThatComesUpLaterIsUsed) {
  if (!in_own_network()) GTEST_SKIP() << "needs the right to make a network namespace, and iproute2 (ip)";
  // The publisher is another host: a network namespace with loopback only, until a cable is plugged in.
  ChildProcess publisher({"/usr/bin/unshare", "--net", "/bin/sh", "-c",
                          "ip link set lo up && exec " HUETRACK_TEST_PUBLISHER " " + std::to_string(test_domain())});
  std::this_thread::sleep_for(1s);
  const std::string pid = std::to_string(publisher.pid());
  const std::string plug_in = "ip link set va netns " + pid + " && ip addr add 10.99.0.2/24 dev vb && nsenter -t " +
                              pid + " -n sh -c 'ip link set va up && ip addr add 10.99.0.1/24 dev va'";
  ASSERT_EQ(std::system(plug_in.c_str()), 0);
  ASSERT_TRUE(has_carrier("10.99.0.2"));
  idl::DdsParticipant participant({.domain = test_domain()});
  EXPECT_THAT(participant.description(), HasSubstr("vb 10.99.0.2"));
  dds::DataReader& reader = participant.create_reader<msg::ObjectPositionPubSubType>(idl::object_position_topic,
                                                                                     idl::object_position_reader_qos());
  EXPECT_TRUE(ChildProcess::wait([&] { return !take_all<msg::ObjectPosition>(reader).empty(); }, 10s));
}

TEST(Network, JoiningAnewLeavesNothingBehind) {
  if (!in_own_network()) GTEST_SKIP() << "needs the right to make a network namespace, and iproute2 (ip)";
  EstimatePublisher publisher(known_options(test_domain()));
  EXPECT_TRUE(publisher.publish_status(known_status()));
  ASSERT_TRUE(interface_comes_up());
  for (int second = 0; second < 3; ++second) EXPECT_TRUE(publisher.publish_status(known_status()));
  EXPECT_THAT(publisher.description(), HasSubstr("va 10.99.0.1"));
  EXPECT_TRUE(publish_known(publisher, object_tracking::TrackState::tracking));
  EXPECT_THAT(publisher.warnings(), ElementsAre());
  EXPECT_EQ(publisher.counters().failures, 0U);
}

TEST(Network, AConfiguredInterfaceThatGoesIsWarnedOfAndPublishingGoesOn) {
  if (!in_own_network()) GTEST_SKIP() << "needs the right to make a network namespace, and iproute2 (ip)";
  ASSERT_TRUE(interface_comes_up());
  EstimatePublisherOptions options = known_options(test_domain());
  options.interfaces = {"va"};
  EstimatePublisher publisher(options);
  ASSERT_EQ(std::system("ip link del va"), 0);
  for (int second = 0; second < 3; ++second) publisher.publish_status(known_status());
  ASSERT_EQ(publisher.warnings().size(), 1U);
  EXPECT_THAT(publisher.warnings()[0], AllOf(HasSubstr("the network has changed"), HasSubstr("\"va\"")));
  EXPECT_TRUE(publish_known(publisher, object_tracking::TrackState::tracking));
}

TEST(EstimatePublisher, WrongOptionsAreNamed) {
  const auto refusal = [](auto change) -> std::string {
    EstimatePublisherOptions options = known_options(test_domain());
    change(options);
    try {
      EstimatePublisher{options};
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal([](auto& o) { o.targets = {"my ball"}; }), HasSubstr("my ball"));
  EXPECT_THAT(refusal([](auto& o) { o.targets = {"a", "a"}; }), HasSubstr("same name"));
  EXPECT_EQ(refusal([](auto& o) { o.targets.clear(), o.tracked_camera.clear(); }),
            "");  // the status alone, and what may be asked
  EXPECT_THAT(refusal([](auto& o) { o.tracked_camera = o.targets[0]; }),
              HasSubstr("has the name of the tracked camera"));
  EXPECT_THAT(refusal([](auto& o) { o.tracked_camera = "cam.0"; }), HasSubstr("camera \"cam.0\" must be a letter"));
  EXPECT_THAT(refusal([](auto& o) { o.frame_id = "/world"; }), HasSubstr("/world"));
  EXPECT_THAT(refusal([](auto& o) { o.domain = 1000; }), HasSubstr("1000"));
  EXPECT_THAT(refusal([](auto& o) { o.profiles = "/nowhere.xml"; }), HasSubstr("/nowhere.xml"));
}

}  // namespace
}  // namespace huetrack::publish
