// A recording comes piece by piece, no faster than it is read, and whole or not at all.
#include "clients/live_view/recording_download.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

namespace huetrack::live_view {
namespace {

using namespace testing;
using namespace std::chrono_literals;
using State = RecordingDownload::State;

const RecordingDownload::Clock::time_point begun_at{1h};

msg::ControlReply piece_of(const msg::ControlRequest& request, const std::string& whole, std::size_t bytes,
                           const std::string& identity = "a") {
  msg::ControlReply reply;
  reply.client(request.client());
  reply.number(request.number());
  reply.granted(true);
  reply.rows().emplace_back().columns({std::to_string(whole.size()), identity});
  const std::string part = whole.substr(std::stoul(request.words().at(3)), bytes);
  reply.bytes({part.begin(), part.end()});
  return reply;
}

std::string read_all(RecordingDownload& download) {
  char buffer[7];
  std::string all;
  while (const std::size_t n = download.read(buffer, sizeof buffer)) all.append(buffer, n);
  return all;
}

TEST(RecordingDownload, ArrivesPieceByPiece) {
  const std::string whole = "abcdefghijklmnopqrstuvwxyz";
  RecordingDownload download({"record", "read", "run"}, "me", "host", 12);
  EXPECT_EQ(download.state(), State::awaited);
  std::string got;
  int asked = 0;
  while (const auto request = download.next_request(begun_at)) {
    EXPECT_EQ(request->host(), "host");
    EXPECT_EQ(request->pid(), 12u);
    EXPECT_THAT(request->words(), ElementsAre("record", "read", "run", std::to_string(got.size())));
    EXPECT_FALSE(download.next_request(begun_at)) << "it is on its way";
    download.take(piece_of(*request, whole, 10));
    EXPECT_EQ(download.state(), State::begun);
    EXPECT_EQ(download.bytes(), 26u);
    got += read_all(download);
    ++asked;
  }
  EXPECT_EQ(got, whole);
  EXPECT_EQ(asked, 3);
  EXPECT_EQ(download.state(), State::ended);
}

TEST(RecordingDownload, RequestsNoMoreThanIsRead) {
  const std::string whole(100, 'x');
  RecordingDownload download({"record", "read", "run"}, "me", "host", 12);
  int asked = 0;
  for (; const auto request = download.next_request(begun_at); ++asked) download.take(piece_of(*request, whole, 10));
  EXPECT_EQ(asked, 2);  // one to be read, and the next
  char one = 0;
  EXPECT_EQ(download.read(&one, 1), 1u);
  EXPECT_FALSE(download.next_request(begun_at));
  EXPECT_EQ(read_all(download).size(), 19u);
  EXPECT_TRUE(download.next_request(begun_at));
}

TEST(RecordingDownload, RepeatsRequestsThenFails) {
  RecordingDownload download({"record", "read", "run"}, "me", "host", 12);
  const auto first = download.next_request(begun_at);
  EXPECT_FALSE(download.next_request(begun_at + 900ms));
  const auto again = download.next_request(begun_at + 1s);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->number(), first->number());
  download.take(piece_of(*first, "abcdef", 3));
  download.take(piece_of(*again, "abcdef", 3));  // the second answer to it
  EXPECT_EQ(read_all(download), "abc");
  ASSERT_TRUE(download.next_request(begun_at + 2s));
  int news = 0;
  download.on_news([&] { ++news; });
  for (auto now = begun_at + 2s; now < begun_at + 30s; now += 100ms) download.next_request(now);
  EXPECT_EQ(download.state(), State::failed);
  EXPECT_EQ(download.failure(), "The service does not answer any more.");
  EXPECT_EQ(news, 1);
}

TEST(RecordingDownload, InconsistentPiecesEndIt) {
  const auto ended_by = [](const std::function<void(msg::ControlReply&)>& change) {
    RecordingDownload download({"record", "read", "run"}, "me", "host", 12);
    download.take(piece_of(*download.next_request(begun_at), "abcdef", 3));
    const auto request = download.next_request(begun_at);
    msg::ControlReply reply = piece_of(*request, "abcdef", 3);
    change(reply);
    download.take(reply);
    EXPECT_EQ(download.state(), State::failed);
    return download.failure();
  };
  EXPECT_THAT(ended_by([](auto& reply) { reply.rows()[0].columns()[1] = "b"; }), HasSubstr("has changed"));
  EXPECT_THAT(ended_by([](auto& reply) { reply.rows()[0].columns()[0] = "7"; }), HasSubstr("has changed"));
  EXPECT_THAT(ended_by([](auto& reply) { reply.rows()[0].columns()[0] = "-7"; }), HasSubstr("cannot be understood"));
  EXPECT_THAT(ended_by([](auto& reply) { reply.rows().clear(); }), HasSubstr("cannot be understood"));
  EXPECT_THAT(ended_by([](auto& reply) { reply.bytes().clear(); }), HasSubstr("does not fit"));
  EXPECT_THAT(ended_by([](auto& reply) { reply.bytes().resize(10); }), HasSubstr("does not fit"));
  EXPECT_EQ(ended_by([](auto& reply) {
              reply.granted(false);
              reply.reason("There is no recording run.");
            }),
            "There is no recording run.");
}

TEST(RecordingDownload, MissesNoChange) {
  RecordingDownload download({"record", "read", "run"}, "me", "host", 12);
  int waits = 0, news = 0;
  download.on_news([&] { ++news; });
  const auto wait = [&] { download.if_nothing([&] { ++waits; }); };
  wait();
  download.take(piece_of(*download.next_request(begun_at), "abcdef", 6));
  EXPECT_EQ(news, 1);
  wait();  // there is something to read
  EXPECT_EQ(waits, 1);
  read_all(download);
  wait();  // there is nothing to come
  EXPECT_EQ(waits, 1);
}

}  // namespace
}  // namespace huetrack::live_view
