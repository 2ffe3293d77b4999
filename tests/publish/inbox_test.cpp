#include "idl/inbox.h"

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include "idl/dds_participant.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/topics.h"
#include "publish/test_domain.h"

namespace huetrack::idl {
namespace {

using namespace std::chrono_literals;

// A writer of statuses and an inbox that has met it, on loopback.
class StatusInbox : public testing::Test {
 protected:
  StatusInbox() {
    inbox_.attach(reading_.create_reader<msg::ServiceStatusPubSubType>(status_topic, status_reader_qos()));
  }
  void SetUp() override {
    ASSERT_TRUE(comes_true([&] {
      eprosima::fastdds::dds::PublicationMatchedStatus readers;
      writer_.get_publication_matched_status(readers);
      return readers.current_count > 0;
    }));
  }
  static bool comes_true(const std::function<bool()>& condition) {
    for (int k = 0; k < 1000; ++k, std::this_thread::sleep_for(10ms))
      if (condition()) return true;
    return false;
  }
  void write(std::uint32_t pid, std::size_t bytes) {
    msg::ServiceStatus status;
    status.pid(pid);
    status.config_file(std::string(bytes, 'x'));
    writer_.write(&status);
    writer_.wait_for_acknowledgments({1, 0});
  }

  static ParticipantOptions on_loopback(const char* name) {
    return {.name = name, .domain = publish::test_domain(), .interfaces = {"lo"}};
  }
  DdsParticipant writing_{on_loopback("writer")};
  eprosima::fastdds::dds::DataWriter& writer_ =
      writing_.create_writer<msg::ServiceStatusPubSubType>(status_topic, status_writer_qos(), "");
  Inbox<msg::ServiceStatus> inbox_;
  DdsParticipant reading_{on_loopback("reader")};
};

TEST_F(StatusInbox, GivesWhatCameInItsOrder) {
  EXPECT_FALSE(inbox_.take());
  for (std::uint32_t pid = 0; pid < 20; ++pid) write(pid, 100);
  for (std::uint32_t pid = 0; pid < 20; ++pid) {
    std::optional<Inbox<msg::ServiceStatus>::Arrived> arrived;
    ASSERT_TRUE(comes_true([&] { return (arrived = inbox_.take()).has_value(); })) << pid;
    EXPECT_EQ(arrived->sample.pid(), pid);
    EXPECT_TRUE(arrived->info.valid_data);
  }
  EXPECT_FALSE(inbox_.take());
}

TEST_F(StatusInbox, KeepsNoMoreThanItHasRoomFor) {
  constexpr std::size_t bytes = 200'000, most = Inbox<msg::ServiceStatus>::most_bytes / bytes;
  for (std::uint32_t pid = 0; pid < 30; ++pid) write(pid, bytes);
  std::size_t kept = 0;
  while (const auto arrived = inbox_.take()) EXPECT_EQ(arrived->sample.pid(), kept++);  // the first ones
  EXPECT_GT(kept, most / 2);
  EXPECT_LE(kept, most);
  // There is room again.
  write(1000, bytes);
  EXPECT_TRUE(comes_true([&] { return inbox_.take().has_value(); }));
}

}  // namespace
}  // namespace huetrack::idl
