// A bounded queue of samples for a program that polls.
#pragma once

#include <cstddef>
#include <deque>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <mutex>
#include <optional>
#include <utility>

#include "idl/arrivals.h"

namespace huetrack::idl {

// Takes samples on arrival, in Fast DDS' threads, because a reader never releases the memory of its fullest moment, and
// every participant may flood it. Keeps the order of arrival; drops new samples when full. thread-safe.
template <typename Sample>
class Inbox : public eprosima::fastdds::dds::DataReaderListener {
 public:
  static constexpr std::size_t most_samples = 4096;
  static constexpr std::size_t most_bytes = 2 << 20;  // serialized; a single larger sample is accepted

  // Once. Declare the reader's participant after this, so that the reader is destroyed first.
  void attach(eprosima::fastdds::dds::DataReader& reader) {
    reader.set_listener(this, eprosima::fastdds::dds::StatusMask::data_available());
    on_data_available(&reader);  // earlier samples
  }

  void on_data_available(eprosima::fastdds::dds::DataReader* reader) override {
    Arrived arrived;
    while (take_next(*reader, arrived.sample, arrived.info)) {
      const std::size_t bytes = Sample::getCdrSerializedSize(arrived.sample);
      const std::scoped_lock lock(mutex_);
      if (waiting_.size() >= most_samples || (!waiting_.empty() && bytes_ + bytes > most_bytes)) continue;
      bytes_ += bytes;
      waiting_.emplace_back(std::move(arrived), bytes);
      arrived = {};
    }
  }

  struct Arrived {
    Sample sample;
    eprosima::fastdds::dds::SampleInfo info;
  };
  // The next sample; nullopt: none.
  std::optional<Arrived> take() {
    const std::scoped_lock lock(mutex_);
    if (waiting_.empty()) return std::nullopt;
    auto [arrived, bytes] = std::move(waiting_.front());
    waiting_.pop_front();
    bytes_ -= bytes;
    return std::move(arrived);
  }

 private:
  std::mutex mutex_;
  std::deque<std::pair<Arrived, std::size_t>> waiting_;  // guarded by mutex_; with their sizes
  std::size_t bytes_ = 0;                                // guarded by mutex_; their sum
};

}  // namespace huetrack::idl
