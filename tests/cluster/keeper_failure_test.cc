// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Holders that die or sleep, a ZooKeeper that goes and comes back, connections that are cut.
#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <random>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "index/store/clickhouse/keeper.h"
#include "tests/cluster/zookeeper.h"
#include "tests/unit/expect_error.h"

namespace pliant::testing {
namespace {

using clickhouse::Keeper;
using clickhouse::KeeperLease;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::chrono::steady_clock;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr milliseconds kSession{3000};  // KeeperAt

class KeeperFailureTest : public ::testing::Test {
 protected:
  static Clock::time_point In(milliseconds time) { return Clock::now() + time; }

  template <typename Condition>
  static bool Within(milliseconds time, Condition condition) {
    const auto until = In(time);
    while (!condition()) {
      if (Clock::now() > until) return false;
      std::this_thread::sleep_for(milliseconds(5));
    }
    return true;
  }

  // Another process has the lock.
  std::unique_ptr<Program> Holder(const std::string& path) const {
    auto holder = std::make_unique<Program>(
        std::vector<std::string>{"--hold", std::to_string(zookeeper_.port()), path},
        ProgramLimits{}, "/proc/self/exe");
    EXPECT_TRUE(Within(seconds(20), [&] { return holder->Out() == "held\n"; })) << holder->Err();
    return holder;
  }

  void ExpectUnavailable(const std::function<void()>& call) {
    const auto before = Clock::now();
    ExpectError(ErrorCode::kUnavailable, "keeper_unavailable", call);
    EXPECT_LT(Clock::now() - before, seconds(5));
  }

  ZooKeeper zookeeper_;
  Keeper keeper_{KeeperAt(zookeeper_.port())};
};

TEST_F(KeeperFailureTest, AHolderThatIsKilledLosesTheLock) {
  const auto holder = Holder("locks/killed");
  ExpectError(ErrorCode::kUnavailable, "keeper_busy",
              [&] { keeper_.Lock("locks/killed", In(milliseconds(300))); });
  holder->Signal(SIGKILL);
  const auto lock = keeper_.Lock("locks/killed", In(kSession + seconds(5)));
  EXPECT_TRUE(lock->held());
}

TEST_F(KeeperFailureTest, AHolderThatSleptKnowsThatItHasLost) {
  const auto holder = Holder("locks/slept");
  holder->Signal(SIGSTOP);
  const auto lock = keeper_.Lock("locks/slept", In(kSession + seconds(5)));
  EXPECT_TRUE(lock->held());
  EXPECT_EQ(holder->Out(), "held\n");
  holder->Signal(SIGCONT);
  EXPECT_TRUE(Within(seconds(2), [&] { return holder->Out() == "held\nlost\n"; }));
  EXPECT_TRUE(lock->held());
}

TEST_F(KeeperFailureTest, AKeeperThatIsGoneForLong) {
  auto lease = keeper_.TryLease("leases/1", "");
  auto lock = keeper_.Lock("locks/1", In(seconds(5)));
  ASSERT_NE(lease, nullptr);
  ASSERT_TRUE(keeper_.Create("value", "kept"));
  zookeeper_.Kill();
  const auto killed = Clock::now();
  ExpectUnavailable([&] { keeper_.Create("other", ""); });
  EXPECT_TRUE(Within(kSession, [&] { return !lease->held(); }));
  EXPECT_FALSE(lock->held());
  EXPECT_GT(Clock::now() - killed, kSession / 2) << "it is not given up at once";
  ExpectUnavailable([&] { keeper_.Read("value"); });
  ExpectUnavailable([&] { keeper_.TryLease("leases/2", ""); });
  ExpectUnavailable([&] { keeper_.Lock("locks/2", In(seconds(60))); });
  ExpectUnavailable([&] { keeper_.TakeNumbers("numbers", 1); });

  zookeeper_.Start();
  EXPECT_TRUE(Within(seconds(10), [&] {
    try {
      return keeper_.Read("value")->text == "kept";
    } catch (const Error&) {
      return false;
    }
  }));
  EXPECT_FALSE(lease->held()) << "for ever";
  EXPECT_FALSE(lock->held());
  // What the old session had goes with it.
  const auto again = keeper_.Lock("locks/1", In(kSession + seconds(5)));
  EXPECT_TRUE(again->held());
  EXPECT_GT(again->token(), lock->token());
  lease.reset();
  lock.reset();
  EXPECT_TRUE(again->held());
}

TEST_F(KeeperFailureTest, AKeeperThatComesBackInTimeCostsNoLease) {
  const auto lease = keeper_.TryLease("leases/1", "");
  ASSERT_NE(lease, nullptr);
  zookeeper_.Freeze();
  std::this_thread::sleep_for(kSession / 3);
  zookeeper_.Thaw();
  EXPECT_EQ(keeper_.Read("leases/1")->made, lease->token());
  std::this_thread::sleep_for(kSession);
  EXPECT_TRUE(lease->held());
}

TEST_F(KeeperFailureTest, AKeeperThatHangs) {
  auto lease = keeper_.TryLease("leases/1", "");
  ASSERT_NE(lease, nullptr);
  std::stop_source stop;
  std::jthread waiting([&] {
    ExpectError(ErrorCode::kUnavailable, "keeper_unavailable", [&] {
      Keeper other(KeeperAt(zookeeper_.port()));
      const auto first = other.Lock("locks/1", In(seconds(5)));
      other.Lock("locks/1", In(std::chrono::minutes(1)));
    });
  });
  EXPECT_TRUE(Within(seconds(5), [&] { return keeper_.Children("locks/1").size() == 2; }));
  zookeeper_.Freeze();
  EXPECT_TRUE(Within(kSession, [&] { return !lease->held(); }));
  ExpectUnavailable([&] { keeper_.Read("leases/1"); });
  ExpectUnavailable([&] { keeper_.TryLease("leases/1", ""); });
  waiting.join();
  const auto before = Clock::now();
  lease.reset();
  EXPECT_LT(Clock::now() - before, milliseconds(200)) << "giving back waits for nobody";
  zookeeper_.Thaw();
  EXPECT_TRUE(Within(seconds(10), [&] {
    try {
      return keeper_.TryLease("leases/1", "") != nullptr;
    } catch (const Error&) {
      return false;
    }
  }));
}

TEST_F(KeeperFailureTest, HostsThatAreSilentOrGoneCostLittle) {
  const SilentPort silent;
  clickhouse::KeeperOptions options = KeeperAt(zookeeper_.port());
  options.hosts = {{"127.0.0.1", silent.port()}, {"127.0.0.1", 1}, options.hosts[0]};
  options.session_timeout = seconds(30);  // the library alone would wait for two thirds of it
  for (int i = 0; i < 10; ++i) {
    Keeper keeper(options);
    const auto before = Clock::now();
    EXPECT_TRUE(keeper.Create("hosts/" + std::to_string(i), ""));
    EXPECT_LT(Clock::now() - before, seconds(2));
  }
}

TEST_F(KeeperFailureTest, EndsThoughTheKeeperHangs) {
  const auto before = [&] {
    Keeper other(KeeperAt(zookeeper_.port()));
    const auto lease = other.TryLease("leases/1", "");
    zookeeper_.Freeze();
    return Clock::now();
  }();
  EXPECT_LT(Clock::now() - before, seconds(6));
  zookeeper_.Thaw();
}

// The answer to a create gets lost, and so does nothing else: the lock's node is there.
TEST_F(KeeperFailureTest, WhatWasMadeWithoutAnAnswerIsFound) {
  std::atomic<bool> cut{false};
  std::atomic<int> cuts{0};
  const auto lets_pass = [&](bool to_server, const std::string& bytes) {
    if (to_server && bytes.find("/cut/") != std::string::npos && cuts < 2) cut = true;
    if (to_server || !cut) return true;
    cut = false;
    ++cuts;
    return false;
  };
  Wire wire(zookeeper_.port(), lets_pass);
  Keeper keeper(KeeperAt(wire.port()));
  ASSERT_TRUE(keeper_.Create("cut/lock", ""));
  EXPECT_FALSE(keeper.Read("connected"));
  auto lock = keeper.Lock("cut/lock", In(seconds(10)));
  EXPECT_EQ(cuts, 2);
  EXPECT_TRUE(lock->held());
  EXPECT_EQ(keeper_.Children("cut/lock").size(), 1u);
  lock.reset();
  EXPECT_TRUE(Within(seconds(5), [&] { return keeper_.Children("cut").empty(); }));

  cuts = 0;
  auto lease = keeper.TryLease("cut/lease", "text");
  EXPECT_EQ(cuts, 2);
  ASSERT_NE(lease, nullptr);
  EXPECT_EQ(keeper_.Read("cut/lease")->made, lease->token());
  EXPECT_EQ(keeper_.TryLease("cut/lease", ""), nullptr);
  cuts = 0;
  lease.reset();  // this answer gets lost, too
  EXPECT_TRUE(Within(seconds(5), [&] { return !keeper_.Read("cut/lease"); }));
  EXPECT_TRUE(Within(seconds(5), [&] { return keeper.TryLease("cut/lease", "") != nullptr; }));
}

// Connections break all the time, in both directions: nothing is held twice, nothing stays behind.
TEST_F(KeeperFailureTest, LocksAndNumbersOverBadWires) {
  std::mutex mutex;
  std::minstd_rand random(18);
  std::atomic<bool> bad{true};
  const auto lets_pass = [&](bool, const std::string&) {
    const std::lock_guard lock(mutex);
    return !bad || random() % 25 != 0;
  };
  Wire wire(zookeeper_.port(), lets_pass);
  Keeper first(KeeperAt(wire.port()));
  Keeper second(KeeperAt(wire.port()));
  std::atomic<int> inside{0};
  std::atomic<int> locked{0};
  std::atomic<int> leased{0};
  std::atomic<int> lease_inside{0};
  std::atomic<int> overlaps{0};
  std::atomic<int> lost{0};
  std::set<std::uint64_t> numbers;
  const auto until = In(seconds(8));
  const auto work = [&](Keeper& keeper, int turn) {
    while (Clock::now() < until) {
      try {
        if (turn % 3 == 0) {
          const auto lock = keeper.Lock("bad/lock", In(seconds(3)));
          if (inside++ != 0) ++overlaps;
          ++locked;
          --inside;
          if (!lock->held()) ++lost;
        } else if (turn % 3 == 1) {
          const auto lease = keeper.TryLease("bad/lease", "");
          if (!lease) continue;
          if (lease_inside++ != 0) ++overlaps;
          ++leased;
          --lease_inside;
          if (!lease->held()) ++lost;
        } else {
          const std::uint64_t number = keeper.TakeNumbers("bad/numbers", 1);
          const std::lock_guard guard(mutex);
          EXPECT_TRUE(numbers.insert(number).second) << number;
        }
        ++turn;
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kUnavailable) << error.what();
        ++turn;
      }
    }
  };
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < 6; ++i) {
      threads.emplace_back([&, i] { work(i % 2 == 0 ? first : second, i); });
    }
  }
  bad = false;
  EXPECT_LE(overlaps, lost) << "only one who has lost it may have company";
  EXPECT_GT(locked, 0);
  EXPECT_GT(leased, 0);
  EXPECT_GT(numbers.size(), 0u);
  EXPECT_TRUE(Within(seconds(10), [&] {
    return keeper_.Children("bad/lock").empty() && !keeper_.Read("bad/lease");
  }));
  std::printf("%d locks, %d leases, %zu numbers, %d lost\n", locked.load(), leased.load(),
              numbers.size(), lost.load());
}

}  // namespace
}  // namespace pliant::testing
