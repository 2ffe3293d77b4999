// What anybody on the bus may send, and the client must not take for the service's, nor hand on to a terminal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fastdds/dds/publisher/DataWriterListener.hpp>

#include "huetrack/printable_sample.h"
#include "idl/dds_participant.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/topics.h"
#include "publish/child_process.h"
#include "publish/test_domain.h"

namespace huetrack::client {
namespace {

using publish::ChildProcess;
using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::Not;

TEST(PrintableSample, NamesAreWordsAndSentencesAreLines) {
  msg::ObjectPosition position;
  position.target("red\x1b[2J,\n1");
  position.per_view().resize(1);
  position.per_view()[0].camera(std::string(500, 'c'));
  make_printable(position);
  EXPECT_EQ(position.target(), "red [2J_ 1");
  EXPECT_EQ(position.per_view()[0].camera().size(), 67u);
  msg::ServiceStatus status;
  status.config_file("\x1b]0;owned\x07");
  status.warnings({"one\n  warnings  none"});
  make_printable(status);
  EXPECT_EQ(status.config_file(), " ]0;owned ");
  EXPECT_EQ(status.warnings()[0], "one   warnings  none");
}

TEST(SecondPublisher, MarksASecondPublisherInTextAndIgnoresItElsewhere) {
  const std::string domain = std::to_string(publish::test_domain());
  ChildProcess publisher({HUETRACK_TEST_PUBLISHER, domain});
  ChildProcess text({HUETRACK_CLIENT, "watch", "--domain", domain});
  ChildProcess csv({HUETRACK_CLIENT, "watch", "--format", "csv", "--domain", domain});
  const auto lines = [](const ChildProcess& client) { return std::ranges::count(client.out(), '\n'); };
  ASSERT_TRUE(ChildProcess::wait([&] { return lines(text) > 5 && lines(csv) > 5; }, 10s)) << text.err();

  idl::DdsParticipant second({.name = "second", .domain = publish::test_domain()});
  auto& writer = second.create_writer<msg::ObjectPositionPubSubType>(idl::object_position_topic,
                                                                     idl::object_position_writer_qos(), "");
  msg::ObjectPosition lie;
  lie.target("ball");
  lie.state(msg::TRACK_STATE_TRACKING);
  lie.position({666, 666, 666});
  EXPECT_TRUE(ChildProcess::wait(
      [&] {
        writer.write(&lie);
        return text.out().find("666.0000") != std::string::npos &&
               csv.err().find("second publisher") != std::string::npos;
      },
      10s))
      << text.err() << csv.err();
  EXPECT_THAT(text.err(), HasSubstr("comes from a second publisher, too, which is marked here: a program that is not"));
  std::istringstream all(text.out());
  for (std::string line; std::getline(all, line);) {
    if (line.find("666.0000") == std::string::npos) {
      EXPECT_THAT(line, Not(HasSubstr("NOT THE SAME PUBLISHER")));
    } else {
      EXPECT_THAT(line, HasSubstr("NOT THE SAME PUBLISHER: a program that is not huetrackd"));
    }
  }
  EXPECT_THAT(csv.err(), HasSubstr("left out here"));
  EXPECT_THAT(csv.out(), Not(HasSubstr("666")));
}

}  // namespace
}  // namespace huetrack::client
