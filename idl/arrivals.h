// Waits until a reader has something to take.
#pragma once

#include <chrono>
#include <fastdds/dds/core/condition/StatusCondition.hpp>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>

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
    const auto s = std::chrono::duration_cast<std::chrono::seconds>(longest);
    eprosima::fastdds::dds::ConditionSeq active;
    set_.wait(active, eprosima::fastrtps::Duration_t(static_cast<std::int32_t>(s.count()),
                                                     static_cast<std::uint32_t>((longest - s).count())));
  }

 private:
  eprosima::fastdds::dds::WaitSet set_;
};

}  // namespace huetrack::idl
