#include "clients/live_view/event_hub.h"

#include <utility>

namespace huetrack::live_view {

std::string to_event(const std::string& name, const std::string& json) {
  return "event: " + name + "\ndata: " + json + "\n\n";
}

void EventHub::set(const std::string& key, std::string event, const std::string& audience) {
  const std::scoped_lock lock(mutex_);
  put(std::move(event), &key, audience);
}

void EventHub::erase(const std::string& key) {
  const std::scoped_lock lock(mutex_);
  forget(key);
}

void EventHub::forget(const std::string& key) {
  const auto it = latest_.find(key);
  if (it == latest_.end()) return;
  const auto entry = entries_.find(it->second);
  set_bytes_ -= entry->second.text->size();
  set_.erase(it->second);
  latest_.erase(it);
  entries_.erase(entry);  // last: key may be its own
}

void EventHub::append(std::string event, bool is_again, const std::string& audience) {
  const std::scoped_lock lock(mutex_);
  put(std::move(event), nullptr, audience, is_again);
}

void EventHub::forget_appended() {
  const std::scoped_lock lock(mutex_);
  for (const auto& [number, size] : stream_)
    if (Entry& entry = entries_.at(number); entry.audience.empty()) entry.is_forgotten = true;
}

void EventHub::put(std::string event, const std::string* key, const std::string& audience, bool is_again) {
  const std::uint64_t number = ++last_;
  const std::size_t size = event.size();
  if (key != nullptr) {
    forget(*key);
    entries_[number] = {std::make_shared<const std::string>(std::move(event)), audience, *key};
    latest_[*key] = number;
    set_.insert(number);
    set_bytes_ += size;
    while (set_.size() > 1 && (set_.size() > limits_.keys || set_bytes_ > limits_.key_bytes))
      forget(std::string(entries_.at(*set_.begin()).key));
  } else {
    entries_[number] = {std::make_shared<const std::string>(std::move(event)), audience, "", is_again};
    stream_[number] = size;
    bytes_ += size;
    while (stream_.size() > 1 && (stream_.size() > limits_.stream_events || bytes_ > limits_.stream_bytes)) {
      const auto oldest = stream_.begin();
      bytes_ -= oldest->second;
      entries_.erase(oldest->first);
      stream_.erase(oldest);
    }
  }
  if (listener_) listener_();
}

Text EventHub::next(std::uint64_t& cursor, const EventReader& reader) const {
  const std::string wanted = reader.only.empty() ? "" : "event: " + reader.only + "\n";
  const std::scoped_lock lock(mutex_);
  for (auto it = entries_.upper_bound(cursor); it != entries_.end(); ++it) {
    cursor = it->first;
    const Entry& entry = it->second;
    if (reader.only.empty() ? entry.is_forgotten : entry.is_again) continue;
    const bool is_wanted = entry.text->starts_with(wanted) || entry.text->starts_with("event: pulse\n");
    if (is_wanted && (entry.audience.empty() || entry.audience == reader.page)) return entry.text;
  }
  return nullptr;
}

std::uint64_t EventHub::last() const {
  const std::scoped_lock lock(mutex_);
  return last_;
}

void EventHub::on_news(std::function<void()> listener) {
  const std::scoped_lock lock(mutex_);
  listener_ = std::move(listener);
}

bool EventHub::if_nothing_after(std::uint64_t cursor, const std::function<void()>& what) const {
  const std::scoped_lock lock(mutex_);
  if (entries_.upper_bound(cursor) != entries_.end()) return false;
  what();
  return true;
}

}  // namespace huetrack::live_view
