// Recordings of the running service, by command: begun, ended, saved after the fact, listed, fetched, and replayed.
// `huetrackd run` on films, `huetrack control`, `huetrackd replay`: processes of their own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "end_to_end/film_service.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
using namespace testing;

class RecordLive : public FilmService {
 protected:
  RecordLive() : FilmService("record_live") {
    soak::make_films(folder, 2, 320, 240, false);
    write(true);
    start();
  }
  void write(bool may_record) const {
    configure("record: {folder: " + recordings.string() + ", pre_roll_s: 2, after_s: 0.5, on_lost: false}\n" +
              "control: {allow_record: " + (may_record ? "true" : "false") + "}\n");
  }
  Result control(std::vector<std::string> words) const {
    words.insert(words.begin(), "control");
    return huetrack(words);
  }
  // The columns of the recordings' list.
  std::map<std::string, std::vector<std::string>> listed() const {
    std::map<std::string, std::vector<std::string>> rows;
    std::istringstream lines(control({"record", "list"}).out);
    std::string line;
    for (std::getline(lines, line); std::getline(lines, line);) {
      std::istringstream text(line);
      std::vector<std::string> columns;
      for (std::string column; std::getline(text, column, '\t');) columns.push_back(column);
      if (!columns.empty()) rows[columns[0]] = columns;
    }
    return rows;
  }
  const fs::path recordings = folder / "recordings";
};

TEST_F(RecordLive, ARecordingIsMadeByCommandFetchedAndReplayed) {
  ASSERT_TRUE(comes_true([&] { return control({"record", "state"}).status == 0; })) << service->err();
  EXPECT_THAT(control({"record", "state"}).out,
              AllOf(StartsWith("state\tidle\n"), HasSubstr("\npre_roll_s\t2\n"), HasSubstr(recordings.string())));
  const Result started = control({"record", "start"});
  ASSERT_EQ(started.status, 0) << started.err;
  EXPECT_THAT(started.err, HasSubstr("Recording to " + recordings.string()));
  EXPECT_EQ(control({"record", "start"}).status, 1);
  std::this_thread::sleep_for(std::chrono::seconds(1));
  ASSERT_EQ(control({"record", "stop"}).status, 0);
  EXPECT_THAT(control({"record", "stop"}).err, HasSubstr("Nothing is being recorded."));
  ASSERT_TRUE(comes_true([&] {
    const auto rows = listed();
    return rows.size() == 1 && rows.begin()->second.at(5) == "done";
  }));
  const auto rows = listed();
  const std::string name = rows.begin()->first;
  EXPECT_GT(std::stod(rows.begin()->second.at(2)), 1.0);  // and of the pre-roll what there was
  EXPECT_EQ(rows.begin()->second.at(4), "2");

  const fs::path tar = folder / "fetched.tar";
  const Result fetched = control({"record", "download", name, "--out", tar.string()});
  ASSERT_EQ(fetched.status, 0) << fetched.err;
  EXPECT_EQ(control({"record", "download", name, "--out", tar.string()}).status, 1) << "it is there already";
  ASSERT_EQ(std::system(("tar -xf " + tar.string() + " -C " + folder.string()).c_str()), 0);
  ASSERT_EQ(std::system(("diff -r " + (folder / name).string() + " " + (recordings / name).string()).c_str()), 0);
  Process replay({HUETRACKD, "replay", (folder / name / "huetrackd.yaml").string(), (folder / name).string(),
                  "--no-dds", "--tracks", (folder / "tracks.csv").string()},
                 folder / "replay.out", folder / "replay.err");
  ASSERT_EQ(replay.wait(), 0) << replay.err();
  EXPECT_THAT(contents(folder / "tracks.csv"), HasSubstr(",tracking,"));

  const Result saved = control({"record", "save"});
  ASSERT_EQ(saved.status, 0) << saved.err;
  EXPECT_THAT(saved.err, ContainsRegex("Saving the last [0-9.]+ s, and 0.5 more, to " + recordings.string()));
  EXPECT_TRUE(comes_true([&] {
    const auto all = listed();
    return all.size() == 2 && std::ranges::all_of(all, [](const auto& row) { return row.second.at(5) == "done"; });
  }));
}

TEST_F(RecordLive, WhatMayNotBeIsRefused) {
  ASSERT_TRUE(comes_true([&] { return control({"record", "state"}).status == 0; })) << service->err();
  EXPECT_THAT(control({"record", "dance"}).err, HasSubstr("does not know that request"));
  EXPECT_THAT(control({"record", "download", "../c.yaml"}).err, HasSubstr("that is no recording's name"));
  EXPECT_THAT(control({"record", "read", "../films", "0"}).err, HasSubstr("not a valid name of a recording"));
  EXPECT_THAT(control({"record", "download", "none"}).err, HasSubstr("no recording none"));
  EXPECT_FALSE(fs::exists("none.tar"));
  EXPECT_THAT(control({"record", "state", "--service", "elsewhere/1"}).err,
              HasSubstr("there is no service elsewhere/1"));
  write(false);
  service->kill(SIGHUP);
  ASSERT_TRUE(comes_true([&] { return control({"record", "state"}).status == 1; }));
  EXPECT_THAT(control({"record", "start"}).err, HasSubstr("Set control: {allow_record: true} in"));
  EXPECT_FALSE(fs::exists(recordings));
}

}  // namespace
}  // namespace huetrack::end_to_end
