// The latest replies to requests: a repeated request gets the same reply and is not executed twice, whatever was
// requested in between (idl/README.md). Private to this module.
#pragma once

#include <algorithm>
#include <cstddef>
#include <deque>
#include <utility>

namespace huetrack::page {

// Two requests, or a request and a reply.
bool is_same(const auto& a, const auto& b) {
  return a.client() == b.client() && a.number() == b.number();
}

template <typename Reply>
class RecentReplies {
 public:
  explicit RecentReplies(std::size_t most) : most_(most) {}

  // nullptr: it is a new request
  const Reply* to(const auto& request) const {
    const auto found = std::ranges::find_if(replies_, [&](const Reply& reply) { return is_same(reply, request); });
    return found == replies_.end() ? nullptr : &*found;
  }
  const Reply& keep(Reply reply) {
    if (replies_.size() == most_) replies_.pop_front();
    return replies_.emplace_back(std::move(reply));
  }

 private:
  std::size_t most_;  // > 0
  std::deque<Reply> replies_;
};

}  // namespace huetrack::page
