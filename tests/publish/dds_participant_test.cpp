#include "idl/dds_participant.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>

#include "idl/camera_hostPubSubTypes.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/ros2_messagesPubSubTypes.h"
#include "idl/topics.h"
#include "publish/known_samples.h"

namespace huetrack::publish {
namespace {

namespace dds = eprosima::fastdds::dds;
using ::testing::AllOf;
using ::testing::HasSubstr;

template <typename Call>
std::string refusal(Call call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

std::string refusal(idl::ParticipantOptions options) {
  options.domain = test_domain();
  return refusal([&] { idl::DdsParticipant{options}; });
}

std::filesystem::path file_with(const std::string& name, const std::string& text) {
  const std::filesystem::path file = std::filesystem::path(::testing::TempDir()) / name;
  std::ofstream(file) << text;
  return file;
}

TEST(ResolveDomain, ConfigBeforeEnvironmentBeforeZero) {
  ::unsetenv("ROS_DOMAIN_ID");
  EXPECT_EQ(idl::resolve_domain({}), 0);
  ::setenv("ROS_DOMAIN_ID", "42", 1);
  EXPECT_EQ(idl::resolve_domain({}), 42);
  EXPECT_EQ(idl::resolve_domain(7), 7);
  ::setenv("ROS_DOMAIN_ID", "", 1);
  EXPECT_EQ(idl::resolve_domain({}), 0);
}

TEST(ResolveDomain, WrongOnesAreRefused) {
  for (const char* wrong : {"-1", "233", "4x", "four", " 4", "99999999999999999999"}) {
    ::setenv("ROS_DOMAIN_ID", wrong, 1);
    EXPECT_THAT(refusal([] { idl::resolve_domain({}); }), AllOf(HasSubstr("ROS_DOMAIN_ID"), HasSubstr(wrong))) << wrong;
  }
  EXPECT_THAT(refusal([] { idl::resolve_domain(233); }), HasSubstr("0 to 232"));
}

TEST(DdsParticipant, MissingProfilesFileIsNamed) {
  EXPECT_THAT(refusal({.profiles = "/nowhere/dds.xml"}), HasSubstr("/nowhere/dds.xml"));
  EXPECT_THAT(refusal({.profiles = "/tmp"}), HasSubstr("not a file"));
  const auto endless = file_with("endless.xml", "<dds>");
  std::filesystem::resize_file(endless, 6ULL << 30U);  // of holes: no disk has less
  EXPECT_THAT(refusal({.profiles = endless}), HasSubstr("larger than 4 MiB"));
  std::filesystem::remove(endless);
}

TEST(DdsParticipant, MissingProfilesFileOfTheEnvironmentIsNamed) {
  ::setenv("FASTRTPS_DEFAULT_PROFILES_FILE", "/nowhere/env.xml", 1);
  EXPECT_THAT(refusal({}), AllOf(HasSubstr("/nowhere/env.xml"), HasSubstr("FASTRTPS_DEFAULT_PROFILES_FILE")));
}

TEST(DdsParticipant, BrokenProfilesFileIsNamedWithWhatIsWrong) {
  const auto truncated = file_with("truncated.xml", "<dds><profiles><participant profile_name=");
  EXPECT_THAT(refusal({.profiles = truncated}), HasSubstr("truncated.xml"));
  const auto unknown = file_with("unknown.xml", R"(<dds><profiles><participant profile_name="huetrack"><rtps>
      <leeseDuration/></rtps></participant></profiles></dds>)");
  EXPECT_THAT(refusal({.profiles = unknown}), AllOf(HasSubstr("unknown.xml"), HasSubstr("leeseDuration")));
  const auto not_dds = file_with("not_dds.xml", "<html><body/></html>");
  EXPECT_THAT(refusal({.profiles = not_dds}), HasSubstr("not_dds.xml"));
  EXPECT_THAT(refusal({.profiles = file_with("empty.xml", "")}), HasSubstr("empty.xml"));
}

TEST(DdsParticipant, InterfaceThatIsNotThereIsRefusedWithThoseThatAre) {
  EXPECT_THAT(refusal({.interfaces = {"203.0.113.77"}}), AllOf(HasSubstr("203.0.113.77"), HasSubstr("127.0.0.1")));
  EXPECT_THAT(refusal({.interfaces = {"lo", "nope0"}}), HasSubstr("nope0"));
}

TEST(DdsCheck, RefusesABrokenProfilesFileAndReturnsInterfacesThatAreNotThere) {
  const auto broken = file_with("broken.xml", "<dds><profiles><participant profile_name=");
  EXPECT_THAT(refusal([&] { idl::check({.profiles = broken}); }), HasSubstr("broken.xml"));
  EXPECT_THAT(idl::check({.interfaces = {"nope0", "lo", "203.0.113.77"}}),
              ::testing::ElementsAre(HasSubstr("nope0"), HasSubstr("203.0.113.77")));
  EXPECT_THAT(idl::check({.interfaces = {"lo"}}), ::testing::IsEmpty());
}

TEST(DdsParticipant, InterfaceByNameOrAddress) {
  for (const char* loopback : {"lo", "127.0.0.1"}) {
    const idl::DdsParticipant participant({.domain = test_domain(), .interfaces = {loopback}});
    EXPECT_THAT(participant.description(), HasSubstr("UDP on lo 127.0.0.1 only"));
  }
}

// Fast DDS does not connect two programs of one host when one uses loopback and the other does not.
TEST(DdsParticipant, LoopbackIsAlwaysAmongTheInterfaces) {
  for (const idl::NetworkInterface& i : idl::network_interfaces()) {
    if (i.name == "lo") continue;
    const idl::DdsParticipant participant({.domain = test_domain(), .interfaces = {i.name}});
    EXPECT_THAT(participant.description(), HasSubstr("UDP on " + i.name + " " + i.address + ", lo 127.0.0.1 only"));
    return;
  }
  GTEST_SKIP() << "this host has loopback only";
}

TEST(DdsParticipant, InterfacesBesideAParticipantProfileAreRefused) {
  EXPECT_THAT(refusal({.interfaces = {"lo"}, .profiles = HUETRACK_SOURCE_DIR "/configs/dds/loopback_only.xml"}),
              HasSubstr("interfaceWhiteList"));
}

TEST(DdsParticipant, DescriptionListsTheInterfacesInUse) {
  const idl::DdsParticipant participant({.domain = test_domain()});
  EXPECT_THAT(participant.description(), HasSubstr("domain " + std::to_string(test_domain())));
  for (const idl::NetworkInterface& i : idl::network_interfaces())
    EXPECT_THAT(participant.description(), HasSubstr(i.address));
}

TEST(DdsParticipant, AnUnchangedNetworkIsNoChange) {
  idl::DdsParticipant participant({.domain = test_domain()});
  for (int call = 0; call < 3; ++call) EXPECT_FALSE(participant.network_changed());
}

TEST(DdsParticipant, ProfileOfATopicsNameReplacesItsQosAndOthersKeepOurs) {
  idl::DdsParticipant participant(
      {.domain = test_domain(), .profiles = HUETRACK_SOURCE_DIR "/configs/dds/topic_qos.xml"});
  using TfType = tf2_msgs::msg::dds_::TFMessage_PubSubType;
  const auto qos_of = [&](const char* topic) {
    return participant.create_writer<TfType>(topic, idl::ros2_writer_qos(), "typehash=x;").get_qos();
  };
  const dds::DataWriterQos tf = qos_of(idl::ros2_tf_topic);
  EXPECT_EQ(tf.reliability().kind, dds::BEST_EFFORT_RELIABILITY_QOS);
  EXPECT_EQ(tf.history().depth, 1);
  EXPECT_EQ(tf.user_data().size(), 11U);  // the type hash is there all the same
  const dds::DataWriterQos other = qos_of("rt/other");
  EXPECT_EQ(other.reliability().kind, dds::RELIABLE_RELIABILITY_QOS);
  EXPECT_EQ(other.history().depth, 10);
  EXPECT_THAT(participant.description(), AllOf(HasSubstr("rt/tf"), ::testing::Not(HasSubstr("rt/other"))));
}

class ShippedProfiles : public ::testing::TestWithParam<std::string> {};

TEST_P(ShippedProfiles, Load) {
  const idl::DdsParticipant participant(
      {.domain = test_domain(), .profiles = HUETRACK_SOURCE_DIR "/configs/dds/" + GetParam()});
  EXPECT_THAT(participant.description(),
              HasSubstr(GetParam() == "topic_qos.xml" ? "UDP on" : "as the participant profile says"));
}

std::vector<std::string> shipped() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(HUETRACK_SOURCE_DIR "/configs/dds"))
    if (entry.path().extension() == ".xml") names.push_back(entry.path().filename().string());
  return names;
}

INSTANTIATE_TEST_SUITE_P(All, ShippedProfiles, ::testing::ValuesIn(shipped()),
                         [](const auto& file) { return file.param.substr(0, file.param.find('.')); });

TEST(PublisherIdentity, RoundTrip) {
  const idl::PublisherIdentity identity{"host-1.example", 4711, {"ball", "wand"}};
  const auto back = idl::PublisherIdentity::from(identity.user_data());
  ASSERT_TRUE(back);
  EXPECT_EQ(back->host, identity.host);
  EXPECT_EQ(back->pid, identity.pid);
  EXPECT_EQ(back->targets, identity.targets);
  for (const char* other :
       {"", "typehash=RIHS01_00;", "host=a;pid=b;targets=c;", "host=a;pid=1;", "host=a;pid=1;targets=c"})
    EXPECT_FALSE(idl::PublisherIdentity::from(other)) << other;
}

TEST(IsTargetName, WhatRosTopicsAllow) {
  for (const char* good : {"ball", "Ball_2", "a"}) EXPECT_TRUE(idl::is_target_name(good)) << good;
  EXPECT_TRUE(idl::is_target_name(std::string(idl::longest_name, 'a')));
  EXPECT_FALSE(idl::is_target_name(std::string(idl::longest_name + 1, 'a')));
  for (const char* bad : {"", "2ball", "_ball", "ball-2", "2nd", "a-b", "_a", "b\xC3\xA4ll", "a b", "a/b", "a__b"})
    EXPECT_FALSE(idl::is_target_name(bad)) << bad;
}

// A sample without a key hash has its key told by its type's support, in a thread of Fast DDS where nothing catches.
template <typename PubSubType>
eprosima::fastrtps::rtps::InstanceHandle_t key_of(typename PubSubType::type& sample) {
  PubSubType support;
  eprosima::fastrtps::rtps::InstanceHandle_t key;
  EXPECT_TRUE(support.getKey(&sample, &key, false));
  return key;
}

TEST(SampleKeys, OfAnyLengthAreKeys) {
  for (const std::size_t length : {0u, 1u, 255u, 256u, 300u, 70'000u}) {
    msg::ObjectPosition position;
    position.target(std::string(length, 'k'));
    const auto key = key_of<msg::ObjectPositionPubSubType>(position);
    EXPECT_TRUE(key.isDefined()) << length;
    EXPECT_EQ(key, key_of<msg::ObjectPositionPubSubType>(position)) << length;
    position.target(position.target() + "l");
    EXPECT_NE(key, key_of<msg::ObjectPositionPubSubType>(position)) << length;

    msg::LookedForColors looked_for;
    looked_for.host(std::string(length, 'h'));
    looked_for.camera(std::string(length, 'c'));
    EXPECT_TRUE(key_of<msg::LookedForColorsPubSubType>(looked_for).isDefined()) << length;
  }
}

}  // namespace
}  // namespace huetrack::publish
