// DDS Security by the profiles that configs/dds/secure.sh makes: members of one authority see one another, a stranger
// and a member of another authority see nothing and are not heard, and a member sends what its role says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "end_to_end/process.h"
#include "publish/test_domain.h"
#include "soak/films.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using namespace testing;

const fs::path bundled_demo = HUETRACK_SOURCE_DIR "/configs/demo";
const std::string secure_script = HUETRACK_SOURCE_DIR "/configs/dds/secure.sh";

class Secure : public Test {
 protected:
  Secure() {
    std::string pattern = (fs::temp_directory_path() / "huetrack-secure-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("mkdtemp");
    folder_ = pattern;
  }
  ~Secure() override { fs::remove_all(folder_); }

  std::unique_ptr<Process> start(const std::vector<std::string>& command) {
    const std::string name = std::to_string(started_++);
    return std::make_unique<Process>(
        command, folder_ / (name + ".out"), folder_ / (name + ".err"),
        std::map<std::string, std::string>{{"ROS_DOMAIN_ID", std::to_string(publish::test_domain())}});
  }
  struct Result {
    int status;
    std::string out, err;
  };
  Result run(const std::vector<std::string>& command) {
    const auto process = start(command);
    const int status = process->wait();
    return {status, process->out(), process->err()};
  }
  // A folder of members.
  fs::path members(const std::string& name, std::vector<std::string> of = {}) {
    std::vector<std::string> command{"/bin/bash", secure_script, folder_ / name};
    command.insert(command.end(), of.begin(), of.end());
    const Result made = run(command);
    if (made.status != 0) throw std::runtime_error(made.err);
    return folder_ / name;
  }
  static std::string profile(const fs::path& members, const std::string& name) {
    return members / name / "huetrack.xml";
  }
  // The demo's configuration, with this profile.
  std::string configuration(const std::string& name, const std::string& with_profile) {
    const fs::path file = folder_ / name;
    std::ofstream text(file);
    text << "version: 1\nrig: " << (bundled_demo / "recording/rig.yaml").string()
         << "\ntargets: {lime: {color: {hue_deg: [65, 115]}}}\n";
    if (!with_profile.empty()) text << "dds: {profile: " << with_profile << "}\n";
    return file;
  }
  std::vector<std::string> replay(const std::string& config) {
    return {HUETRACKD, "replay", config, bundled_demo / "recording", "--speed", "real"};
  }
  std::unique_ptr<Process> watch(const std::string& with_profile) {
    std::vector<std::string> command{HUETRACK, "watch"};
    if (!with_profile.empty()) command.insert(command.end(), {"--profiles", with_profile});
    return start(command);
  }
  static std::string heard(Process& watcher) {
    watcher.kill(SIGTERM);
    watcher.wait();
    return watcher.out();
  }

  fs::path folder_;
  int started_ = 0;
};

TEST_F(Secure, MembersOfOneAuthoritySeeOneAnotherAndNobodyElseDoes) {
  const fs::path ours = members("ours"), theirs = members("theirs", {"watcher:watcher"});
  const auto member = watch(profile(ours, "watcher")), foreigner = watch(profile(theirs, "watcher")),
             stranger = watch("");
  auto command = replay(configuration("service.yaml", profile(ours, "service")));
  command.insert(command.end(), {"--wait-for-subscriber", "20"});
  const Result service = run(command);
  ASSERT_EQ(service.status, 0) << service.err;
  std::this_thread::sleep_for(500ms);
  const std::string seen = heard(*member);
  EXPECT_GT(std::ranges::count(seen, '\n'), 140) << member->err();
  ASSERT_FALSE(foreigner->has_ended() || stranger->has_ended()) << foreigner->err() << stranger->err();
  EXPECT_EQ(heard(*foreigner), "");
  EXPECT_EQ(heard(*stranger), "");
}

TEST_F(Secure, AStrangersPositionsAreNotHeard) {
  const auto member = watch(profile(members("ours"), "watcher"));
  std::this_thread::sleep_for(1s);
  const Result stranger = run(replay(configuration("stranger.yaml", "")));
  ASSERT_EQ(stranger.status, 0) << stranger.err;
  ASSERT_FALSE(member->has_ended()) << member->err();
  EXPECT_EQ(heard(*member), "");
}

TEST_F(Secure, AMemberSendsWhatItsRoleSays) {
  const fs::path ours = members("ours");
  const Result refused = run(replay(configuration("watcher.yaml", profile(ours, "watcher"))));
  EXPECT_NE(refused.status, 0);
  EXPECT_THAT(refused.err, HasSubstr("the permissions of this participant"));
  // Nor may it sign itself another role's permissions.
  const std::string text = folder_ / "permissions.xml", forged = folder_ / "forged.p7s",
                    key = ours / "watcher/member.key", certificate = ours / "watcher/member.pem",
                    authority = ours / "watcher/authority.pem";
  std::ofstream(text) << "<dds/>\n";
  ASSERT_EQ(run({"/usr/bin/openssl", "smime", "-sign", "-in", text, "-text", "-out", forged, "-signer", certificate,
                 "-inkey", key})
                .status,
            0);
  EXPECT_NE(run({"/usr/bin/openssl", "smime", "-verify", "-in", forged, "-CAfile", authority}).status, 0);
  EXPECT_EQ(
      run({"/usr/bin/openssl", "smime", "-verify", "-in", ours / "watcher/permissions.xml.p7s", "-CAfile", authority})
          .status,
      0);
  // Who may not teach may watch the page.
  const auto page = start({HUETRACK, "view", "--port", "0", "--profiles", profile(ours, "watcher")});
  for (int tries = 0; tries < 200 && page->out().empty() && !page->has_ended(); ++tries)
    std::this_thread::sleep_for(50ms);
  EXPECT_THAT(page->out(), HasSubstr("http://127.0.0.1")) << page->err();
}

// What matches, what is looked for and where outlines are expected go between a host and a tracker of one authority,
// and a tracker without keys is told nothing.
TEST_F(Secure, AHostTellsWhatMatchesToTrackersOfItsAuthority) {
  const fs::path keys = members("ours", {"tracker:service", "pi:host"}), films = folder_ / "films";
  soak::make_films(films, 2, 320, 240);
  const auto cameras = [](const std::string& of_each) {
    return "cameras:\n  cam0: {" + of_each + "}\n  cam1: {" + of_each + "}\n";
  };
  std::ofstream(folder_ / "host.yaml")
      << "version: 1\nhost: pi\ndds: {profile: " << profile(keys, "pi") << "}\n"
      << "cameras:\n"
         "  cam0: {device: /dev/film/cam0, size: [320, 240], format: mjpeg, fps: 30}\n"
         "  cam1: {device: /dev/film/cam1, size: [320, 240], format: mjpeg, fps: 30}\n";
  const auto tracker = [&](const std::string& name, const std::string& bus) {
    std::ofstream(folder_ / (name + ".yaml"))
        << "version: 1\nrig: " << (films / "rig.yaml").string()
        << "\ntargets: {lime: {radius_m: 0.05, shape: ball, color: {hue_deg: [65, 115]}}}\n"
        << bus << cameras("host: pi, send: matches");
    return start({HUETRACKD, "run", folder_ / (name + ".yaml"), "--tracks", folder_ / (name + ".csv")});
  };
  const auto host = start({FILM_HOST, films, folder_ / "host.yaml"});
  const auto ours = tracker("ours", "dds: {profile: " + profile(keys, "tracker") + "}\n");
  const auto strangers = tracker("strangers", "");
  const auto tracked = [&](const std::string& name) {
    const std::string rows = contents(folder_ / (name + ".csv"));
    std::size_t count = 0;
    for (auto at = rows.find(",tracking,"); at != std::string::npos; at = rows.find(",tracking,", at + 1)) ++count;
    return count;
  };
  EXPECT_TRUE(comes_true([&] { return tracked("ours") > 60; })) << ours->err() << host->err();
  EXPECT_TRUE(comes_true([&] { return strangers->err().find("its host pi is not found") != std::string::npos; }))
      << strangers->err();
  ASSERT_FALSE(strangers->has_ended()) << strangers->err();
  EXPECT_EQ(tracked("strangers"), 0U);
  ours->kill(SIGINT);
  ours->wait();
  host->kill(SIGINT);
  host->wait();
  EXPECT_THAT(host->out() + host->err(), Not(HasSubstr("keys of this host are older")));
}

TEST_F(Secure, WhatIsAskedForWronglyMakesNothing) {
  const Result no_role = run({"/bin/bash", secure_script, folder_ / "keys", "anna:watcher", "tom:boss"});
  EXPECT_EQ(no_role.status, 2);
  EXPECT_THAT(no_role.err, HasSubstr("tom:boss: boss is no role: service, host, watcher or operator"));
  EXPECT_FALSE(fs::exists(folder_ / "keys/anna"));
  const fs::path ours = members("ours");
  const std::string key = contents(ours / "watcher/member.key");
  EXPECT_THAT(key, HasSubstr("PRIVATE KEY"));
  const Result again = run({"/bin/bash", secure_script, ours, "watcher:operator"});
  EXPECT_EQ(again.status, 1);
  EXPECT_THAT(again.err, HasSubstr("is there already"));
  EXPECT_EQ(contents(ours / "watcher/member.key"), key);
  EXPECT_EQ(fs::status(ours / "authority/authority.key").permissions() & fs::perms(077), fs::perms::none);
}

}  // namespace
}  // namespace huetrack::end_to_end
