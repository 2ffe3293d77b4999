// The events for all pages, stored once. Each page reads at its own pace with a cursor; a slow page misses events that
// are no longer stored, without an effect on others.
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

// A page, or a program that subscribed to one kind of events.
struct EventReader {
  std::string page = {};  // receives the events addressed to this page; empty: none of these
  // The name of the subscribed events, in addition to the pulse; empty: all.
  std::string only = {};
};

// thread-safe.
class EventHub {
 public:
  // Limits of what append() and set() store; the oldest is dropped first. Sixteen cameras need about 40 keys and 4 MB.
  struct Limits {
    std::size_t stream_events = 4000, stream_bytes = 4'000'000;
    std::size_t keys = 256, key_bytes = 8'000'000;
  };
  EventHub() : EventHub(Limits{}) {}
  explicit EventHub(const Limits& limits) : limits_(limits) {}

  // Replaces the event of this key: late joiners get the latest one. audience: the only page that gets it; empty: all.
  void set(const std::string& key, std::string event, const std::string& audience = "");
  void erase(const std::string& key);
  // Every event is delivered. is_again: a repetition for pages that start anew; not for subscribers of one kind.
  // audience: as set().
  void append(std::string event, bool is_again = false, const std::string& audience = "");
  // Pages start anew, but still get what was appended for them alone; subscribers of one kind still get the events
  // that they have not read.
  void forget_appended();

  // The next event after `cursor` (0: the beginning) for this reader; advances the cursor. nullptr: none yet.
  Text next(std::uint64_t& cursor, const EventReader& reader = {}) const;
  std::uint64_t last() const;  // the cursor after the newest event

  // Called after every change, under the hub's lock: must be fast and must not call the hub. One listener.
  void on_news(std::function<void()> listener);
  // If there is nothing after the cursor, runs `what` under the hub's lock and returns true: no event is missed between
  // the check and the decision to wait.
  bool if_nothing_after(std::uint64_t cursor, const std::function<void()>& what) const;

 private:
  struct Entry {
    Text text;
    std::string audience;
    std::string key;            // empty: appended
    bool is_again = false;      // for pages alone
    bool is_forgotten = false;  // no longer for pages
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
