// The program itself, as a user runs it, against a publisher in another process.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "client/osc_reader.h"
#include "publish/child_process.h"
#include "publish/known_samples.h"
#include "slow_motion.h"

namespace huetrack::client {
namespace {

using publish::ChildProcess;
using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using Clock = std::chrono::steady_clock;

const std::string domain = std::to_string(publish::test_domain());

std::vector<std::string> huetrack(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), HUETRACK_CLIENT);
  arguments.insert(arguments.end(), {"--domain", domain});
  return arguments;
}

std::vector<std::string> test_publisher() {
  return {HUETRACK_TEST_PUBLISHER, domain};
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// The test publisher repeats the same samples; the client begins somewhere among them and must miss none.
void expect_cycle(const std::vector<std::string>& lines, const std::vector<std::string>& cycle) {
  ASSERT_FALSE(lines.empty());
  const auto first = std::ranges::find(cycle, lines[0]);
  ASSERT_NE(first, cycle.end()) << lines[0];
  const auto offset = static_cast<std::size_t>(first - cycle.begin());
  for (std::size_t i = 0; i < lines.size(); ++i) EXPECT_EQ(lines[i], cycle[(offset + i) % cycle.size()]) << i;
}

const std::vector<std::string> csv_cycle{
    "ball,1700000000.123456789,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,searching,2,0.875",
    "ball,1700000000.223456789,1.125,-1.5,2.1,0.25,-0.3,9.81,1e-06,2e-07,3e-07,4e-06,5e-07,9e-06,tracking,2,0.875",
    "ball,1700000000.323456789,2.125,-1.5,2.1,0.25,-0.3,9.81,1e-06,2e-07,3e-07,4e-06,5e-07,9e-06,coasting,2,0.875",
    "ball,1700000000.423456789,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,lost,2,0.875",
};

TEST(Watch, Csv) {
  ChildProcess publisher(test_publisher());
  ChildProcess client(huetrack({"watch", "--format", "csv", "--count", "12"}));
  ASSERT_EQ(client.exit_status(10s), 0) << client.err();
  std::vector<std::string> lines = lines_of(client.out());
  ASSERT_EQ(lines.size(), 13U);
  EXPECT_EQ(lines[0], "target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence");
  lines.erase(lines.begin());
  expect_cycle(lines, csv_cycle);
}

TEST(Watch, TumCountsPrintedLines) {
  ChildProcess publisher(test_publisher());
  ChildProcess client(huetrack({"watch", "--format", "tum", "--count", "5"}));
  ASSERT_EQ(client.exit_status(10s), 0) << client.err();
  const std::vector<std::string> lines = lines_of(client.out());
  EXPECT_EQ(lines.size(), 5U);
  expect_cycle(lines, {"1700000000.223456789 1.125 -1.5 2.1 0 0 0 1", "1700000000.323456789 2.125 -1.5 2.1 0 0 0 1"});
}

TEST(Watch, JsonAndText) {
  ChildProcess publisher(test_publisher());
  ChildProcess json(huetrack({"watch", "--format", "json", "--count", "4"}));
  ChildProcess text(huetrack({"watch", "--count", "4"}));
  ASSERT_EQ(json.exit_status(10s), 0) << json.err();
  ASSERT_EQ(text.exit_status(10s), 0) << text.err();
  for (const std::string& line : lines_of(json.out()))
    EXPECT_THAT(line, AllOf(StartsWith(R"({"target":"ball","t":1700000000.)"),
                            HasSubstr(R"("per_view":[{"camera":"left")"), ::testing::EndsWith("}]}")));
  EXPECT_THAT(text.out(),
              AllOf(HasSubstr("tracking   x   1.1250  y  -1.5000  z   2.1000 m   sigma    1.0    2.0    3.0 mm"),
                    HasSubstr("searching  x        -")));
}

// A program that listens for datagrams on a port of its own.
class Listener {
 public:
  Listener() : fd_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ::bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address);
    socklen_t size = sizeof address;
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    const timeval patience{10, 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  }
  ~Listener() { ::close(fd_); }
  Listener(const Listener&) = delete;
  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  std::string receive() const {
    std::string text(65536, '\0');
    const auto size = ::recv(fd_, text.data(), text.size(), 0);
    text.resize(size > 0 ? std::size_t(size) : 0);
    return text;
  }

 private:
  int fd_;
  int port_ = 0;
};

TEST(Watch, JsonByUdp) {
  const Listener listener;
  ChildProcess publisher(test_publisher());
  ChildProcess client(huetrack({"watch", "--udp", listener.address(), "--count", "8"}));
  std::set<std::string> states;
  for (int i = 0; i < 8; ++i) {
    const auto json = nlohmann::json::parse(listener.receive());
    EXPECT_EQ(json.at("target"), "ball");
    states.insert(json.at("state").get<std::string>());
  }
  EXPECT_EQ(states.size(), 4U);
  EXPECT_EQ(client.exit_status(10s), 0) << client.err();
  EXPECT_EQ(client.out(), "");
  EXPECT_THAT(client.err(), HasSubstr("8 samples sent to " + listener.address()));
}

TEST(Watch, OscByUdp) {
  const Listener listener;
  ChildProcess publisher(test_publisher());
  ChildProcess client(huetrack({"watch", "--udp", listener.address(), "--format", "osc", "--count", "8"}));
  int with_position = 0;
  for (int i = 0; i < 8; ++i) {
    const OscBundle bundle = read_osc(listener.receive());
    ASSERT_FALSE(bundle.messages.empty());
    EXPECT_EQ(bundle.messages[0].address, "/huetrack/ball/state");
    if (bundle.messages.size() < 2) continue;
    ++with_position;
    EXPECT_EQ(bundle.messages[1].values.at(1), -1.5F);
  }
  EXPECT_EQ(with_position, 4);  // tracking and coasting, of four states
}

TEST(Watch, ReportsAMissingUdpReceiverOnce) {
  std::string address;
  {
    const Listener listener;
    address = listener.address();
  }
  ChildProcess publisher(test_publisher());
  ChildProcess client(huetrack({"watch", "--udp", address, "--format", "osc", "--count", "20"}));
  EXPECT_EQ(client.exit_status(10s), 0) << client.err();
  const std::string told = client.err();
  const auto first = told.find("no receiver at " + address);
  ASSERT_NE(first, std::string::npos) << told;
  EXPECT_EQ(told.find("nobody listens", first + 1), std::string::npos) << told;
}

TEST(Watch, RejectsInvalidUdpAddresses) {
  for (const auto& [arguments, message] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"watch", "--udp", "9000"}, "--udp wants HOST:PORT, for example 127.0.0.1:9000, not \"9000\""},
           {{"watch", "--udp", "localhost:99999"}, "--udp wants HOST:PORT"},
           {{"watch", "--udp", "no.such.host.invalid:9000"}, "--udp no.such.host.invalid:9000: "},
           {{"watch", "--format", "osc"}, "--format osc needs a UDP receiver: --udp HOST:PORT"}}) {
    ChildProcess client(huetrack(arguments));
    EXPECT_EQ(client.exit_status(10s), 1);
    EXPECT_THAT(client.err(), HasSubstr(message));
    EXPECT_EQ(lines_of(client.err()).size(), 1U) << client.err();
  }
}

TEST(Watch, ReportsMissingAndNewPublishersWithinTwoSeconds) {
  const auto start = Clock::now();
  ChildProcess client(huetrack({"watch", "--format", "csv"}));
  EXPECT_TRUE(client.says("no publisher of huetrack positions on domain " + domain, slow_motion * 3s));
  EXPECT_LT(Clock::now() - start, slow_motion * 2s);
  EXPECT_THAT(client.err(), AllOf(HasSubstr("ROS_DOMAIN_ID"), HasSubstr("127.0.0.1")));
  ChildProcess publisher(test_publisher());
  EXPECT_TRUE(client.says("a publisher is there: process " + std::to_string(publisher.pid()), 3s));
  EXPECT_TRUE(ChildProcess::wait([&] { return lines_of(client.out()).size() > 4; }, 3s));  // and it is read
  client.send(SIGINT);
  EXPECT_EQ(client.exit_status(2s), 0);
}

TEST(Watch, ReportsAKilledPublisherAndReadsItsSuccessor) {
  ChildProcess client(huetrack({"watch", "--format", "csv"}));
  {
    ChildProcess publisher(test_publisher());
    ASSERT_TRUE(client.says("a publisher is there", 5s));
    const auto killed = Clock::now();
    publisher.send(SIGKILL);
    EXPECT_TRUE(client.says("a publisher went away: process " + std::to_string(publisher.pid()), 3s));
    const std::chrono::duration<double> took = Clock::now() - killed;
    RecordProperty("seconds", std::to_string(took.count()));
    EXPECT_LT(took.count(), 1.5);
  }
  const std::size_t before = lines_of(client.out()).size();
  ChildProcess successor(test_publisher());
  EXPECT_TRUE(ChildProcess::wait([&] { return lines_of(client.out()).size() > before + 4; }, 5s));
  EXPECT_TRUE(client.says("a publisher is there: process " + std::to_string(successor.pid()), 1s));
  client.send(SIGTERM);
  EXPECT_EQ(client.exit_status(2s), 0);
}

TEST(Watch, ReportsALeavingPublisherAtOnce) {
  ChildProcess client(huetrack({"watch"}));
  ChildProcess publisher(test_publisher());
  ASSERT_TRUE(client.says("a publisher is there", 5s));
  publisher.send(SIGTERM);
  ASSERT_EQ(publisher.exit_status(5s), 0);
  EXPECT_TRUE(client.says("a publisher went away", 500ms));
}

TEST(Watch, UnknownTargetListsThePublishedOnes) {
  ChildProcess publisher(test_publisher());
  ChildProcess client(huetrack({"watch", "--target", "bal"}));
  EXPECT_TRUE(client.says("no publisher of target bal on domain " + domain + "; there are: ball, wand", 3s));
  EXPECT_EQ(client.out(), "");
}

TEST(Watch, KnownTargetIsFiltered) {
  ChildProcess publisher(test_publisher());  // announces ball and wand, publishes ball
  ChildProcess wand(huetrack({"watch", "--target", "wand", "--timeout", "1"}));
  ChildProcess ball(huetrack({"watch", "--target", "ball", "--count", "3"}));
  EXPECT_EQ(ball.exit_status(5s), 0);
  EXPECT_EQ(wand.exit_status(5s), 1);
  EXPECT_EQ(wand.out(), "");
  EXPECT_THAT(wand.err(), AllOf(HasSubstr("no sample for 1"), ::testing::Not(HasSubstr("no publisher of target"))));
}

TEST(Watch, TimeoutEndsWithAnError) {
  ChildProcess client(huetrack({"watch", "--count", "1", "--timeout", "0.3"}));
  EXPECT_EQ(client.exit_status(3s), 1);
  EXPECT_THAT(client.err(), HasSubstr("--timeout"));
}

TEST(Watch, ClosedPipeEndsSilently) {
  ChildProcess publisher(test_publisher());
  ChildProcess shell({"/bin/bash", "-c",
                      std::string(HUETRACK_CLIENT) + " watch --format csv --domain " + domain +
                          " 2>/dev/null | head -n 2; echo ${PIPESTATUS[0]} >&2"});
  ASSERT_EQ(shell.exit_status(10s), 0);
  EXPECT_EQ(lines_of(shell.out()).size(), 2U);
  EXPECT_EQ(shell.err(), "0\n");
}

TEST(Watch, ReportsAFullDisk) {
  ChildProcess client(
      {"/bin/bash", "-c", std::string(HUETRACK_CLIENT) + " watch --format csv --domain " + domain + " > /dev/full"});
  EXPECT_EQ(client.exit_status(5s), 1);
  EXPECT_THAT(client.err(), HasSubstr("No space left on device"));
}

TEST(Export, FullDiskLeavesNoFiles) {
#ifdef __SANITIZE_THREAD__
  GTEST_SKIP() << "ThreadSanitizer maps a file of its own, and dies where no file may have a byte";
#endif
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("full_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "tracks.csv") << "target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence\n"
                                          "ball,0.1,0,0,1,0,0,0,1e-6,0,0,1e-6,0,1e-6,tracking,2,0.9\n";
  for (const char* out : {"bag", "track.mcap"}) {
    // No file may have a byte: as on a disk that is full, for one process.
    ChildProcess client({"/bin/bash", "-c",
                         "(trap '' XFSZ; ulimit -f 0; " + std::string(HUETRACK_CLIENT) + " export " +
                             (folder / "tracks.csv").string() + " --out " + (folder / out).string() +
                             ") 2>&1 | cat; exit ${PIPESTATUS[0]}"});
    EXPECT_EQ(client.exit_status(5s), 1) << out;
    EXPECT_EQ(lines_of(client.out()).size(), 1U) << client.out();
    EXPECT_FALSE(std::filesystem::exists(folder / out)) << out;
  }
  std::filesystem::remove_all(folder);
}

TEST(Export, RejectsARecordingAsTrack) {
  ChildProcess client({HUETRACK_CLIENT, "export", ::testing::TempDir(), "--out", "/none/track.mcap"});
  EXPECT_EQ(client.exit_status(5s), 1);
  EXPECT_THAT(client.err(), HasSubstr("a recording's pictures are exported by --pictures"));
}

TEST(Watch, ReportsWrongArguments) {
  ChildProcess format(huetrack({"watch", "--format", "xml"}));
  EXPECT_THAT(format.exit_status(5s), ::testing::Optional(::testing::Ne(0)));
  EXPECT_THAT(format.err(), AllOf(HasSubstr("--format"), HasSubstr("tum")));
  ChildProcess profiles(huetrack({"watch", "--profiles", "/nowhere.xml"}));
  EXPECT_EQ(profiles.exit_status(5s), 1);
  EXPECT_THAT(profiles.err(), HasSubstr("/nowhere.xml"));
}

TEST(Log, WritesCsvAndDoesNotOverwrite) {
  const std::string file = ::testing::TempDir() + "huetrack_log_" + std::to_string(::getpid()) + ".csv";
  std::filesystem::remove(file);
  ChildProcess publisher(test_publisher());
  ChildProcess first(huetrack({"log", file, "--count", "8"}));
  ASSERT_EQ(first.exit_status(10s), 0) << first.err();
  EXPECT_EQ(first.out(), "");
  EXPECT_THAT(first.err(), HasSubstr("8 samples in " + file));
  ChildProcess second(huetrack({"log", file, "--count", "1"}));
  EXPECT_EQ(second.exit_status(10s), 1);
  EXPECT_THAT(second.err(), HasSubstr("exists"));
  std::ifstream stream(file);
  std::vector<std::string> lines = lines_of({std::istreambuf_iterator<char>(stream), {}});
  ASSERT_EQ(lines.size(), 9U);
  lines.erase(lines.begin());
  expect_cycle(lines, csv_cycle);
  ChildProcess third(huetrack({"log", file, "--overwrite", "--count", "1"}));
  EXPECT_EQ(third.exit_status(10s), 0) << third.err();
  std::filesystem::remove(file);
}

TEST(Status, PrintsTheLatest) {
  ChildProcess publisher(test_publisher());
  ChildProcess client(huetrack({"status"}));
  ASSERT_EQ(client.exit_status(5s), 3) << "a camera is unplugged: " << client.err();
  EXPECT_THAT(client.out(), AllOf(HasSubstr("process " + std::to_string(publisher.pid())), HasSubstr("c0ffee"),
                                  ContainsRegex("left +delivering"), HasSubstr("unplugged: plug it in"),
                                  HasSubstr("the light is low")));
}

TEST(Status, AsJson) {
  ChildProcess publisher(test_publisher());
  ChildProcess client(huetrack({"status", "--format", "json"}));
  ASSERT_EQ(client.exit_status(5s), 3) << client.err();
  const auto json = nlohmann::json::parse(client.out());
  EXPECT_EQ(json.at("healthy"), false);
  EXPECT_EQ(json.at("status").at("pid"), publisher.pid());
  EXPECT_THAT(json.at("problems").dump(), AllOf(HasSubstr("unplugged: plug it in"), HasSubstr("the light is low")));
  EXPECT_TRUE(json.at("times").is_object());
}

TEST(Status, AsJsonWithoutAService) {
  ChildProcess client(huetrack({"status", "--format", "json"}));
  EXPECT_EQ(client.exit_status(5s), 1);
  EXPECT_EQ(nlohmann::json::parse(client.out()).at("healthy"), false);
}

TEST(Status, ReportsMissingServicesWithinTwoSeconds) {
  const auto start = Clock::now();
  ChildProcess client(huetrack({"status"}));
  EXPECT_EQ(client.exit_status(slow_motion * 5s), 1);
  EXPECT_LT(Clock::now() - start, slow_motion * 2s);
  EXPECT_THAT(client.err(), HasSubstr("no huetrackd publishes its status on domain " + domain));
}

// configs/service/completion.bash, as bash calls it.
TEST(Completion, MatchesTheHelp) {
  const auto offered = [](const std::string& words) {
    ChildProcess bash({"/bin/bash", "-c",
                       "source '" HUETRACK_SOURCE_DIR "/configs/service/completion.bash'; COMP_WORDS=('" HUETRACK_CLIENT
                       "' " +
                           words + "); COMP_CWORD=$((${#COMP_WORDS[@]}-1)); _huetrack_complete; echo ${COMPREPLY[*]}"});
    EXPECT_EQ(bash.exit_status(10s), 0) << bash.err();
    return bash.out();
  };
  EXPECT_EQ(offered("w"), "watch\n");
  EXPECT_THAT(offered("''"), AllOf(HasSubstr("watch"), HasSubstr("status"), HasSubstr("export")));
  EXPECT_EQ(offered("watch --ud"), "--udp\n");
  EXPECT_EQ(offered("watch --format ''"), "text csv json tum osc\n");
  EXPECT_EQ(offered("watch --format js"), "json\n");
  EXPECT_EQ(offered("plot tr"), "\n") << "files are bash's";
  EXPECT_EQ(offered("control ''"), "record target camera calibrate replay undo redo history\n");
  EXPECT_EQ(offered("control re"), "record replay redo\n");
  EXPECT_EQ(offered("control --service h/1 record s"), "state start stop save\n");
  EXPECT_THAT(offered("control calibrate ''"),
              AllOf(HasSubstr("wave "), HasSubstr("report print"), Not(HasSubstr("["))));
  EXPECT_EQ(offered("control record delete ''"), "\n");
  EXPECT_EQ(offered("control --ou"), "--out\n");
}

}  // namespace
}  // namespace huetrack::client
