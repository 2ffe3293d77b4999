#include "clients/live_view/event_hub.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace huetrack::live_view {
namespace {

using testing::ElementsAre;

std::vector<std::string> all(const EventHub& hub, std::uint64_t& cursor) {
  std::vector<std::string> texts;
  while (const Text text = hub.next(cursor)) texts.push_back(*text);
  return texts;
}

TEST(EventHub, EveryPageReadsAtItsOwnPace) {
  EventHub hub;
  std::uint64_t quick = 0, slow = 0;
  hub.append("a");
  EXPECT_THAT(all(hub, quick), ElementsAre("a"));
  hub.append("b");
  EXPECT_THAT(all(hub, quick), ElementsAre("b"));
  EXPECT_THAT(all(hub, quick), ElementsAre());
  EXPECT_THAT(all(hub, slow), ElementsAre("a", "b"));
}

TEST(EventHub, KeepsTheLatestEventOfAKey) {
  EventHub hub;
  std::uint64_t page = 0;
  hub.set("preview/a", "a1");
  hub.set("preview/b", "b1");
  hub.append("position");
  hub.set("preview/a", "a2");
  EXPECT_THAT(all(hub, page), ElementsAre("b1", "position", "a2"));
  hub.set("preview/b", "b2");
  EXPECT_THAT(all(hub, page), ElementsAre("b2"));
  hub.erase("preview/b");
  std::uint64_t late = 0;
  EXPECT_THAT(all(hub, late), ElementsAre("position", "a2"));
}

TEST(EventHub, DeliversAddressedEventsToOnePage) {
  EventHub hub;
  hub.set("teach/a", "for a", "a");
  hub.append("for all");
  hub.append("reply 1", false, "c");
  hub.append("reply 2", false, "c");
  const auto seen_by = [&](const std::string& page) {
    std::vector<std::string> texts;
    std::uint64_t cursor = 0;
    while (const Text text = hub.next(cursor, {.page = page})) texts.push_back(*text);
    EXPECT_TRUE(hub.if_nothing_after(cursor, [] {}));  // what is not for it does not keep it awake
    return texts;
  };
  EXPECT_THAT(seen_by("a"), ElementsAre("for a", "for all"));
  EXPECT_THAT(seen_by("b"), ElementsAre("for all"));
  EXPECT_THAT(seen_by("c"), ElementsAre("for all", "reply 1", "reply 2"));  // none replaces another
  hub.set("teach/a", "more for a", "a");
  EXPECT_THAT(seen_by(""), ElementsAre("for all"));
  hub.forget_appended();
  EXPECT_THAT(seen_by("a"), ElementsAre("more for a"));
  EXPECT_THAT(seen_by("c"), ElementsAre("reply 1", "reply 2"));
}

TEST(EventHub, RepetitionsAreForPagesOnly) {
  EventHub hub;
  const std::string position = to_event("position", "1");
  const EventReader program{.only = "position"};
  std::uint64_t page = 0, cursor = 0;
  std::uint64_t slow = 0, fresh_page = 0;
  hub.append(position);
  EXPECT_EQ(*hub.next(page), position);
  EXPECT_EQ(*hub.next(cursor, program), position);
  hub.forget_appended();
  EXPECT_EQ(hub.next(fresh_page), nullptr);
  hub.append(position, true);
  EXPECT_EQ(*hub.next(page), position);
  EXPECT_EQ(hub.next(cursor, program), nullptr);
  EXPECT_EQ(*hub.next(slow, program), position);  // still unread
  EXPECT_EQ(hub.next(slow, program), nullptr);
}

TEST(EventHub, BoundsTheStream) {
  EventHub hub({.stream_events = 3, .stream_bytes = 1000});
  for (const char* text : {"1", "2", "3", "4", "5"}) hub.append(text);
  std::uint64_t page = 0;
  EXPECT_THAT(all(hub, page), ElementsAre("3", "4", "5"));
  EventHub small({.stream_events = 100, .stream_bytes = 10});
  small.append(std::string(6, 'a'));
  small.append(std::string(6, 'b'));  // together too much
  page = 0;
  EXPECT_THAT(all(small, page), ElementsAre("bbbbbb"));
  small.append(std::string(60, 'c'));  // larger than the limit alone: kept nevertheless
  EXPECT_THAT(all(small, page), ElementsAre(std::string(60, 'c')));
}

TEST(EventHub, NotifiesItsListenerOfEveryChange) {
  EventHub hub;
  int news = 0;
  hub.on_news([&] { ++news; });
  hub.append("a");
  hub.set("k", "b");
  EXPECT_EQ(news, 2);
  std::uint64_t page = 0;
  bool waits = false;
  EXPECT_FALSE(hub.if_nothing_after(page, [&] { waits = true; }));
  all(hub, page);
  EXPECT_FALSE(waits);
  EXPECT_TRUE(hub.if_nothing_after(page, [&] { waits = true; }));
  EXPECT_TRUE(waits);
}

TEST(EventHub, BoundsTheKeysOldestFirst) {
  EventHub hub({.keys = 3, .key_bytes = 100});
  for (int i = 0; i < 1000; ++i) hub.set("preview/" + std::to_string(i), std::to_string(i));
  std::uint64_t cursor = 0;
  std::vector<std::string> kept;
  while (const Text text = hub.next(cursor)) kept.push_back(*text);
  EXPECT_EQ(kept, (std::vector<std::string>{"997", "998", "999"}));
  hub.set("large", std::string(90, 'x'));
  hub.set("preview/999", "a" + std::string(20, 'y'));  // the large one has to go
  cursor = 0;
  kept.clear();
  while (const Text text = hub.next(cursor)) kept.push_back(*text);
  EXPECT_EQ(kept, (std::vector<std::string>{"a" + std::string(20, 'y')}));
}

}  // namespace
}  // namespace huetrack::live_view
