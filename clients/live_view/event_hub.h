// What pages are told, kept once for all of them. A page reads at its own pace: it holds one number, how far it has
// come. A page that is too slow misses what is no longer kept; it costs nobody else anything.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

namespace huetrack::live_view {

using Text = std::shared_ptr<const std::string>;

// As a server-sent event.
std::string to_event(const std::string& name, const std::string& json);

// Who reads: a page, or a program that asked for one kind of events.
struct EventReader {
  std::string page = {};  // what is for one page is for this one; empty: for none
  // The name of the events that it wants, beside the pulse, by which both sides know of each other; empty: all.
  std::string only = {};
};

// thread-safe.
class EventHub {
 public:
  // stream_events, stream_bytes: how much of what was appended is kept, at most. keys, key_bytes: how much of what was
  // set; the oldest goes first. A page of sixteen cameras has some 40 keys and 4 MB.
  struct Limits {
    std::size_t stream_events = 4000, stream_bytes = 4'000'000;
    std::size_t keys = 256, key_bytes = 8'000'000;
  };
  EventHub() : EventHub(Limits{}) {}
  explicit EventHub(const Limits& limits) : limits_(limits) {}

  // Replaces the last one of this key: who is late sees only the newest. audience: only pages of this name see it;
  // empty: all do.
  void set(const std::string& key, std::string event, const std::string& audience = "");
  void erase(const std::string& key);
  // Every one counts, as long as it is kept. is_again: it was appended before, and is for pages that begin anew; who
  // wants one kind of events alone has had it.
  void append(std::string event, bool is_again = false);
  // Pages begin anew; who wants one kind of events alone still gets what he has not had.
  void forget_appended();

  // What comes after `cursor` (0: the beginning) for this reader, and moves it there; nullptr: nothing yet.
  Text next(std::uint64_t& cursor, const EventReader& reader = {}) const;
  std::uint64_t last() const;  // a cursor after which nothing is yet

  // Called after every change, under the hub's lock: must be quick, and must not call the hub. One listener.
  void on_news(std::function<void()> listener);
  // Runs `what` under the hub's lock when there is nothing after the cursor (and returns true): so no news is missed
  // between the look and the decision to wait.
  bool if_nothing_after(std::uint64_t cursor, const std::function<void()>& what) const;

 private:
  struct Entry {
    Text text;
    std::string audience;
    std::string key;            // empty: appended
    bool is_again = false;      // for pages alone
    bool is_forgotten = false;  // not for pages any more
  };
  void put(std::string event, const std::string* key, const std::string& audience, bool is_again = false);
  void forget(const std::string& key);  // both: under mutex_

  const Limits limits_;
  mutable std::mutex mutex_;
  std::map<std::uint64_t, Entry> entries_;       // guarded by mutex_; by number
  std::map<std::string, std::uint64_t> latest_;  // guarded by mutex_; number of a key's entry
  std::set<std::uint64_t> set_;                  // guarded by mutex_; the same numbers, ascending
  std::size_t set_bytes_ = 0;                    // guarded by mutex_; of those
  std::map<std::uint64_t, std::size_t> stream_;  // guarded by mutex_; sizes of the appended ones
  std::size_t bytes_ = 0;                        // guarded by mutex_; their sum
  std::uint64_t last_ = 0;                       // guarded by mutex_
  std::function<void()> listener_;               // guarded by mutex_
};

}  // namespace huetrack::live_view
