#include "hosts/clock_offset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace huetrack::hosts {
namespace {

using namespace std::chrono_literals;
using capture::Timestamp;

// A network with one-way delays of 0.1 ms, sometimes much longer, and a drifting clock at its other end.
class Network {
 public:
  explicit Network(std::uint64_t seed) : random_(seed) {}
  double offset_s = 0, drift = 0, least_s = 1e-4, usual_s = 1e-4, busy_s = 0.02, busy = 0.2;

  Timestamp theirs(double ours_s) const { return at(ours_s + offset_s + drift * ours_s); }
  static Timestamp at(double s) { return Timestamp(capture::duration_of(1'700'000'000.0) + capture::duration_of(s)); }
  Exchange exchange(double at_s) {
    const double there_s = way(), there_for_s = 5e-5, back_s = way();
    return {.request_sent = at(at_s),
            .request_received = theirs(at_s + there_s),
            .reply_sent = theirs(at_s + there_s + there_for_s),
            .reply_received = at(at_s + there_s + there_for_s + back_s)};
  }
  double error_s(const ClockOffset& clock, double at_s) const {
    return std::abs(capture::seconds(clock.ours(theirs(at_s)) - at(at_s)));
  }

 private:
  double way() {
    std::exponential_distribution<double> tail(1.0);
    const bool is_busy = std::uniform_real_distribution<double>(0, 1)(random_) < busy;
    return least_s + usual_s * tail(random_) + (is_busy ? busy_s * tail(random_) : 0);
  }
  std::mt19937_64 random_;
};

// Probes as RemoteCameras sends them.
double ask(ClockOffset& clock, Network& network, double from_s, double seconds) {
  double t = from_s;
  for (int i = 0; t < from_s + seconds; ++i) {
    clock.add(network.exchange(t));
    t += i < 20 ? 0.03 : 0.25;
  }
  return t;
}

TEST(ClockOffset, IsNotKnownAtFirst) {
  ClockOffset clock;
  EXPECT_FALSE(clock.is_known());
  EXPECT_EQ(clock.at(Network::at(1)), 0ns);
}

TEST(ClockOffset, ConvergesInTenSecondsOnABusyNetwork) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Network network(seed);
    network.offset_s = 0.04, network.drift = 50e-6;
    ClockOffset clock;
    const double end_s = ask(clock, network, 0, 10);
    ASSERT_TRUE(clock.is_known());
    EXPECT_LT(network.error_s(clock, end_s), 0.5e-3) << "seed " << seed;
    EXPECT_LT(network.error_s(clock, end_s), 5 * clock.sigma_s(Network::at(end_s))) << "seed " << seed;
    EXPECT_LT(clock.sigma_s(Network::at(end_s)), 0.5e-3) << "seed " << seed;
  }
}

TEST(ClockOffset, FollowsHoursOfDrift) {
  Network network(7);
  network.offset_s = -3, network.drift = -80e-6;
  ClockOffset clock;
  double worst_s = 0;
  for (int i = 0; i < 4 * 7200; ++i) {
    const double t = 0.25 * i;
    clock.add(network.exchange(t));
    if (i > 40) worst_s = std::max(worst_s, network.error_s(clock, t));
  }
  EXPECT_LT(worst_s, 0.5e-3);
  EXPECT_NEAR(clock.drift(), -80e-6, 20e-6);
}

TEST(ClockOffset, OffsetOfYearsLosesNoNanoseconds) {
  Network network(3);
  network.offset_s = -1.6e9;  // a camera host without a battery for its clock, and without NTP
  ClockOffset clock;
  const double end_s = ask(clock, network, 0, 10);
  EXPECT_LT(network.error_s(clock, end_s), 0.5e-3);
}

TEST(ClockOffset, OfOneMachineIsExact) {
  Network network(5);
  network.offset_s = 3e-6;
  ClockOffset clock;
  clock.set_sync({.offset = 3us, .sigma_s = 0});
  ask(clock, network, 0, 20);
  ASSERT_TRUE(clock.is_known());
  EXPECT_FALSE(clock.is_contradicted());
  EXPECT_EQ(clock.at(Network::at(20)), 3us);
  EXPECT_EQ(clock.sigma_s(Network::at(20)), 0);
}

// Chrony rightly reports 0.2 ms for both clocks, while exchanges take tens of milliseconds. The combined error must not
// be that of the worse measurement.
TEST(ClockOffset, CombinesNtpAndExchanges) {
  double squares = 0, stated = 0, alone = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    std::mt19937_64 random(seed);
    Network network(seed);
    network.offset_s = std::normal_distribution<double>(0, 2e-4)(random);
    network.least_s = 5e-3, network.usual_s = 8e-3;
    ClockOffset kept_clock, clock;
    kept_clock.set_sync({.offset = 0ns, .sigma_s = 2e-4});
    ask(clock, network, 0, 10);
    const double end_s = ask(kept_clock, network, 0, 10);
    squares += std::pow(network.error_s(kept_clock, end_s), 2) / 50;
    alone += std::pow(network.error_s(clock, end_s), 2) / 50;
    stated += kept_clock.sigma_s(Network::at(end_s)) / 50;
    EXPECT_FALSE(kept_clock.is_contradicted()) << "seed " << seed;
  }
  EXPECT_LT(std::sqrt(squares), 3e-4);
  EXPECT_GT(std::sqrt(alone), 3e-4) << "the network is a bad one";
  EXPECT_NEAR(stated, 2e-4, 0.5e-4);
}

// The host uses another NTP server, which has an error of 80 ms: both kernels report small errors that do not hold
// between the two.
TEST(ClockOffset, PrefersExchangesToAContradictingNtp) {
  Network network(13);
  network.offset_s = 0.08;
  ClockOffset clock;
  clock.set_sync({.offset = 0ns, .sigma_s = 1e-3});
  const double end_s = ask(clock, network, 0, 10);
  EXPECT_TRUE(clock.is_contradicted());
  EXPECT_LT(network.error_s(clock, end_s), 0.5e-3);
}

TEST(ClockOffset, UncertaintyGrowsWithoutAnswers) {
  Network network(17);
  ClockOffset clock;
  const double end_s = ask(clock, network, 0, 10);
  EXPECT_GT(clock.sigma_s(Network::at(end_s + 100)), 5 * clock.sigma_s(Network::at(end_s)));
}

TEST(ClockOffset, FollowsAStepOfTheOtherClock) {
  Network network(9);
  network.offset_s = 0.01;
  ClockOffset clock;
  double t = ask(clock, network, 0, 20);
  network.offset_s = 2.5;
  t = ask(clock, network, t, 5);
  EXPECT_LT(network.error_s(clock, t), 0.5e-3);
}

TEST(ClockOffset, IgnoresImpossibleExchanges) {
  Network network(11);
  ClockOffset clock;
  for (int i = 0; i < 10; ++i) {
    Exchange exchange = network.exchange(i);
    exchange.reply_received = exchange.request_sent - 1ms;
    clock.add(exchange);
    exchange = network.exchange(i);
    exchange.reply_sent = exchange.request_received + 1h;
    clock.add(exchange);
  }
  EXPECT_FALSE(clock.is_known());
}

}  // namespace
}  // namespace huetrack::hosts
