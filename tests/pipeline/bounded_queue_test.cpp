#include "pipeline/bounded_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <numeric>
#include <thread>
#include <vector>

namespace huetrack::pipeline {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;

template <typename T>
std::vector<T> drain(BoundedQueue<T>& queue) {
  std::vector<T> items;
  while (auto item = queue.pop()) items.push_back(std::move(*item));
  return items;
}

TEST(BoundedQueue, LiveDropsTheOldestAndCounts) {
  BoundedQueue<int> queue(2, WhenFull::drop_oldest);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(queue.push(i));
  EXPECT_EQ(queue.dropped(), 3u);
  queue.close();
  EXPECT_THAT(drain(queue), ElementsAre(3, 4));
}

TEST(BoundedQueue, ReplayWaitsAndLosesNothing) {
  BoundedQueue<int> queue(2, WhenFull::wait);
  std::jthread producer([&] {
    for (int i = 0; i < 1000; ++i) queue.push(i);
    queue.close();
  });
  std::vector<int> expected(1000);
  std::iota(expected.begin(), expected.end(), 0);
  EXPECT_EQ(drain(queue), expected);
  EXPECT_EQ(queue.dropped(), 0u);
}

TEST(BoundedQueue, CloseWakesAWaitingProducer) {
  BoundedQueue<int> queue(1, WhenFull::wait);
  ASSERT_TRUE(queue.push(1));
  bool taken = true;
  std::jthread producer([&] { taken = queue.push(2); });
  std::this_thread::sleep_for(20ms);
  queue.close();
  producer.join();
  EXPECT_FALSE(taken);
  EXPECT_THAT(drain(queue), ElementsAre(1));  // what was in the queue before is still handed out
}

TEST(BoundedQueue, CloseWakesAWaitingConsumer) {
  BoundedQueue<int> queue(1, WhenFull::wait);
  std::optional<int> got = 7;
  std::jthread consumer([&] { got = queue.pop(); });
  std::this_thread::sleep_for(20ms);
  queue.close();
  consumer.join();
  EXPECT_EQ(got, std::nullopt);
}

TEST(BoundedQueue, AbandonDiscardsTheItems) {
  BoundedQueue<int> queue(4, WhenFull::wait);
  queue.push(1);
  queue.abandon();
  EXPECT_TRUE(queue.ended());
  EXPECT_EQ(queue.pop(), std::nullopt);
  EXPECT_FALSE(queue.push(2));
}

TEST(BoundedQueue, PopForTimesOutAndDistinguishesTheEnd) {
  BoundedQueue<int> queue(1, WhenFull::wait);
  EXPECT_EQ(queue.pop_for(1ms), std::nullopt);
  EXPECT_FALSE(queue.ended());
  queue.push(3);
  EXPECT_EQ(queue.pop_for(1h), 3);
  queue.close();
  EXPECT_EQ(queue.pop_for(1h), std::nullopt);
  EXPECT_TRUE(queue.ended());
}

TEST(BoundedQueue, CarriesMoveOnlyItems) {
  BoundedQueue<std::unique_ptr<int>> queue(1, WhenFull::wait);
  queue.push(std::make_unique<int>(5));
  EXPECT_EQ(**queue.pop(), 5);
}

TEST(BoundedQueue, ManyProducersAndConsumersPassEveryItemOnce) {
  BoundedQueue<int> queue(3, WhenFull::wait);
  constexpr int producers = 4, consumers = 3, each = 500;
  std::vector<std::vector<int>> got(consumers);
  {
    std::vector<std::jthread> consuming;
    for (auto& items : got) consuming.emplace_back([&] { items = drain(queue); });
    {
      std::vector<std::jthread> producing;
      for (int p = 0; p < producers; ++p)
        producing.emplace_back([&, p] {
          for (int i = 0; i < each; ++i) queue.push(p * each + i);
        });
    }
    queue.close();
  }
  std::vector<int> seen;
  for (const auto& items : got) seen.insert(seen.end(), items.begin(), items.end());
  std::ranges::sort(seen);
  std::vector<int> expected(producers * each);
  std::iota(expected.begin(), expected.end(), 0);
  EXPECT_EQ(seen, expected);
}

TEST(BoundedQueue, RefusesCapacityZero) {
  EXPECT_THROW(BoundedQueue<int>(0, WhenFull::wait), std::invalid_argument);
}

}  // namespace
}  // namespace huetrack::pipeline
