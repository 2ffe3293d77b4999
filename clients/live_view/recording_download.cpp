#include "clients/live_view/recording_download.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <utility>

namespace huetrack::live_view {
namespace {

using namespace std::chrono_literals;

constexpr auto ask_again_after = 1s;  // a reliable reader and writer that have met lose nothing: they had not met
constexpr auto give_up_after = 8s;    // below the ten seconds in which a page's server gives up its reader

std::optional<std::uint64_t> number_in(const std::string& text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

}  // namespace

RecordingDownload::RecordingDownload(std::vector<std::string> words, std::string client, std::string host,
                                     std::uint32_t pid)
    : words_(std::move(words)), client_(std::move(client)), host_(std::move(host)), pid_(pid) {}

std::vector<std::string> RecordingDownload::print_words(const std::vector<std::string>& board) {
  std::vector<std::string> words{"calibrate", "print"};
  words.insert(words.end(), board.begin(), board.end());
  return words;
}

std::optional<msg::ControlRequest> RecordingDownload::next_request(Clock::time_point now) {
  const std::scoped_lock lock(mutex_);
  if (!failure_.empty()) return std::nullopt;
  if (!is_asked_) {
    if (ahead_ || (total_ && got_ >= *total_)) return std::nullopt;
    is_asked_ = true;
    ++number_;
    first_asked_at_ = now;
  } else if (now - first_asked_at_ > give_up_after) {
    end("The service does not answer any more.");
    return std::nullopt;
  } else if (now - asked_at_ < ask_again_after) {
    return std::nullopt;
  }
  asked_at_ = now;
  msg::ControlRequest request;
  request.client(client_);
  request.number(number_);
  request.host(host_);
  request.pid(pid_);
  request.words(words_);
  request.words().push_back(std::to_string(got_));
  return request;
}

void RecordingDownload::take(const msg::ControlReply& reply) {
  const std::scoped_lock lock(mutex_);
  if (!is_asked_ || reply.number() != number_ || !failure_.empty()) return;  // a second answer to what was asked twice
  is_asked_ = false;
  if (!reply.granted()) return end(reply.reason());
  const auto* const columns = reply.rows().empty() ? nullptr : &reply.rows()[0].columns();
  const auto total = columns != nullptr && columns->size() >= 2 ? number_in((*columns)[0]) : std::nullopt;
  if (!total || *total == 0) return end("The service's answer cannot be understood.");
  if (total_ && (*total_ != *total || identity_ != (*columns)[1]))
    return end("It has changed while it was read: read it again.");
  total_ = total;
  identity_ = (*columns)[1];
  if (reply.bytes().empty() || got_ + reply.bytes().size() > *total_) return end("A piece of it does not fit.");
  got_ += reply.bytes().size();
  if (ready_.size() == read_) {
    ready_ = reply.bytes();
    read_ = 0;
  } else {
    ahead_ = reply.bytes();
  }
  if (listener_) listener_();
}

void RecordingDownload::fail(const std::string& why) {
  const std::scoped_lock lock(mutex_);
  end(why);
}

void RecordingDownload::end(std::string why) {
  if (failure_.empty()) failure_ = std::move(why);
  if (listener_) listener_();
}

RecordingDownload::State RecordingDownload::state() const {
  const std::scoped_lock lock(mutex_);
  if (!failure_.empty()) return State::failed;
  if (!total_) return State::awaited;
  return got_ == *total_ && ready_.size() == read_ && !ahead_ ? State::ended : State::begun;
}

std::string RecordingDownload::failure() const {
  const std::scoped_lock lock(mutex_);
  return failure_;
}

std::uint64_t RecordingDownload::bytes() const {
  const std::scoped_lock lock(mutex_);
  return total_.value_or(0);
}

std::size_t RecordingDownload::read(char* buffer, std::size_t size) {
  const std::scoped_lock lock(mutex_);
  if (ready_.size() == read_ && ahead_) {
    ready_ = std::move(*ahead_);
    read_ = 0;
    ahead_.reset();
  }
  const std::size_t part = std::min(size, ready_.size() - read_);
  if (part > 0) std::memcpy(buffer, ready_.data() + read_, part);
  read_ += part;
  return part;
}

void RecordingDownload::on_news(std::function<void()> listener) {
  const std::scoped_lock lock(mutex_);
  listener_ = std::move(listener);
}

void RecordingDownload::if_nothing(const std::function<void()>& what) const {
  const std::scoped_lock lock(mutex_);
  if (failure_.empty() && ready_.size() == read_ && !ahead_ && (!total_ || got_ < *total_)) what();
}

}  // namespace huetrack::live_view
