// Takes samples from readers and waits for new ones.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <fastdds/dds/core/condition/StatusCondition.hpp>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <span>
#include <unordered_map>
#include <vector>

namespace huetrack::idl {

// Takes the next sample with valid data; false: none left.
template <typename Sample>
bool take_next(eprosima::fastdds::dds::DataReader& reader, Sample& sample, eprosima::fastdds::dds::SampleInfo& info) {
  while (reader.take_next_sample(&sample, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK)
    if (info.valid_data) return true;
  return false;
}
template <typename Sample>
bool take_next(eprosima::fastdds::dds::DataReader& reader, Sample& sample) {
  eprosima::fastdds::dds::SampleInfo info;
  return take_next(reader, sample, info);
}

// Waits for several readers with one wake-up. Take all samples first, then wait: earlier samples do not wake it. (Fast
// DDS 2.9's wait_for_unread_message() counts replaced samples as unread for ever and then never waits.)
// thread-compatible; the readers outlive it.
class Arrivals {
 public:
  explicit Arrivals(eprosima::fastdds::dds::DataReader& reader) : Arrivals(std::array{&reader}) {}
  // Numbered 0, 1, ... in this order.
  explicit Arrivals(std::span<eprosima::fastdds::dds::DataReader* const> readers) {
    for (auto* reader : readers) {
      auto& condition = reader->get_statuscondition();
      condition.set_enabled_statuses(eprosima::fastdds::dds::StatusMask::data_available());
      numbers_[&condition] = numbers_.size();
      set_.attach_condition(condition);
    }
  }
  Arrivals(const Arrivals&) = delete;
  Arrivals& operator=(const Arrivals&) = delete;

  // Waits for samples, at most for `longest`. Returns the numbers of the readers with samples; take all of them. Valid
  // until the next call.
  const std::vector<std::size_t>& wait(std::chrono::nanoseconds longest) {
    const auto s = std::chrono::duration_cast<std::chrono::seconds>(longest);
    active_.clear();
    set_.wait(active_, {static_cast<std::int32_t>(s.count()), static_cast<std::uint32_t>((longest - s).count())});
    ready_.clear();
    for (const auto* condition : active_) ready_.push_back(numbers_.at(condition));
    return ready_;
  }

 private:
  eprosima::fastdds::dds::WaitSet set_;
  eprosima::fastdds::dds::ConditionSeq active_;
  std::unordered_map<const eprosima::fastdds::dds::Condition*, std::size_t> numbers_;
  std::vector<std::size_t> ready_;
};

}  // namespace huetrack::idl
