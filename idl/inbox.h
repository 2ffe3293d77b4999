// Samples for a program that looks only now and then.
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

// Takes samples as they come, in Fast DDS' threads: as long as it lives, a reader holds the room of the most samples
// that ever waited in it, each as large as a sample of its topic may be, and anybody on the bus may send many at once.
// What waits here is bounded, in the order in which it came; what comes when it is full is lost. thread-safe.
template <typename Sample>
class Inbox : public eprosima::fastdds::dds::DataReaderListener {
 public:
  static constexpr std::size_t most_samples = 4096;
  static constexpr std::size_t most_bytes = 2 << 20;  // as serialized; a larger one has room alone

  // Once. The reader goes before this does: its participant is declared after this.
  void attach(eprosima::fastdds::dds::DataReader& reader) {
    reader.set_listener(this, eprosima::fastdds::dds::StatusMask::data_available());
    on_data_available(&reader);  // what came before
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
  // The next one that waits. nullopt: none does.
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
