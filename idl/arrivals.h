// Waits until readers have something to take.
#pragma once

#include <chrono>
#include <fastdds/dds/core/condition/StatusCondition.hpp>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <span>
#include <unordered_map>
#include <vector>

namespace huetrack::idl {

// Take first, then wait: what came before wait() and was not taken does not wake it. Not DataReader's own
// wait_for_unread_message(): it counts samples that a newer one has replaced, unread, as unread ones for good (Fast DDS
// 2.9), and from then on never waits. thread-compatible; the reader outlives it.
class Arrivals {
 public:
  explicit Arrivals(eprosima::fastdds::dds::DataReader& reader) {
    auto& condition = reader.get_statuscondition();
    condition.set_enabled_statuses(eprosima::fastdds::dds::StatusMask::data_available());
    set_.attach_condition(condition);
  }
  Arrivals(const Arrivals&) = delete;
  Arrivals& operator=(const Arrivals&) = delete;

  // Until something comes, at most for so long.
  void wait(std::chrono::nanoseconds longest) {
    eprosima::fastdds::dds::ConditionSeq active;
    set_.wait(active, as_duration(longest));
  }

  static eprosima::fastrtps::Duration_t as_duration(std::chrono::nanoseconds longest) {
    const auto s = std::chrono::duration_cast<std::chrono::seconds>(longest);
    return {static_cast<std::int32_t>(s.count()), static_cast<std::uint32_t>((longest - s).count())};
  }

 private:
  eprosima::fastdds::dds::WaitSet set_;
};

// The same of several readers, for one thread: what came of all of them while it was at work costs one wake-up.
// thread-compatible; the readers outlive it.
class ArrivalsOfMany {
 public:
  // They are the numbers 0, 1, ... in this order.
  explicit ArrivalsOfMany(std::span<eprosima::fastdds::dds::DataReader* const> readers) {
    for (auto* reader : readers) {
      auto& condition = reader->get_statuscondition();
      condition.set_enabled_statuses(eprosima::fastdds::dds::StatusMask::data_available());
      numbers_[&condition] = numbers_.size();
      set_.attach_condition(condition);
    }
  }
  ArrivalsOfMany(const ArrivalsOfMany&) = delete;
  ArrivalsOfMany& operator=(const ArrivalsOfMany&) = delete;

  // Until something comes, at most for so long. Replaces what is in `out`: the readers to take from, each until it has
  // nothing more.
  void wait(std::chrono::nanoseconds longest, std::vector<std::size_t>& out) {
    set_.wait(active_, Arrivals::as_duration(longest));
    out.clear();
    for (const auto* condition : active_) out.push_back(numbers_.at(condition));
    active_.clear();
  }

 private:
  eprosima::fastdds::dds::WaitSet set_;
  eprosima::fastdds::dds::ConditionSeq active_;
  std::unordered_map<const eprosima::fastdds::dds::Condition*, std::size_t> numbers_;
};

}  // namespace huetrack::idl
