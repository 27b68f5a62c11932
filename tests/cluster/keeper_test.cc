// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Values, numbers, leases and locks of a ZooKeeper that works.
#include "index/store/clickhouse/keeper.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cluster/zookeeper.h"
#include "tests/unit/expect_error.h"

namespace pliant::testing {
namespace {

using clickhouse::Keeper;
using clickhouse::KeeperLease;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::chrono::steady_clock;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// One ZooKeeper for all tests, which use different names.
class KeeperOnZooKeeperTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { zookeeper_ = std::make_unique<ZooKeeper>(); }
  static void TearDownTestSuite() { zookeeper_.reset(); }

  static clickhouse::KeeperOptions Options() { return KeeperAt(zookeeper_->port()); }
  static Clock::time_point In(milliseconds time) { return Clock::now() + time; }

  // What is given back goes a moment later.
  static void ExpectGone(Keeper& keeper, const std::string& path) {
    const auto until = In(seconds(5));
    while (keeper.Read(path) && Clock::now() < until) std::this_thread::sleep_for(milliseconds(5));
    EXPECT_FALSE(keeper.Read(path).has_value()) << path;
  }

  static void WaitForPlaces(Keeper& keeper, const std::string& path, std::size_t count) {
    const auto until = In(seconds(10));
    while (keeper.Children(path).size() != count && Clock::now() < until) {
      std::this_thread::sleep_for(milliseconds(2));
    }
    ASSERT_EQ(keeper.Children(path).size(), count);
  }

  static std::unique_ptr<ZooKeeper> zookeeper_;
  Keeper keeper_{Options()};
  Keeper other_{Options()};
};

std::unique_ptr<ZooKeeper> KeeperOnZooKeeperTest::zookeeper_;

TEST_F(KeeperOnZooKeeperTest, ValuesHaveVersions) {
  EXPECT_FALSE(keeper_.Read("values/a/b").has_value());
  EXPECT_FALSE(keeper_.Write("values/a/b", "nobody", 0));
  EXPECT_FALSE(keeper_.Remove("values/a/b"));
  EXPECT_THAT(keeper_.Children("values/a"), IsEmpty());

  EXPECT_TRUE(keeper_.Create("values/a/b", "first"));
  EXPECT_FALSE(other_.Create("values/a/b", "second"));
  const auto first = other_.Read("values/a/b");
  ASSERT_TRUE(first.has_value());
  EXPECT_EQ(first->text, "first");
  EXPECT_EQ(first->version, 0);

  EXPECT_TRUE(other_.Write("values/a/b", "changed", 0));
  EXPECT_FALSE(keeper_.Write("values/a/b", "too late", 0));
  const auto changed = keeper_.Read("values/a/b");
  ASSERT_TRUE(changed.has_value());
  EXPECT_EQ(changed->text, "changed");
  EXPECT_EQ(changed->version, 1);
  EXPECT_EQ(changed->made, first->made);

  EXPECT_TRUE(keeper_.Create("values/a/a", ""));
  EXPECT_GT(keeper_.Read("values/a/a")->made, first->made);
  EXPECT_THAT(other_.Children("values/a"), ElementsAre("a", "b"));
  ExpectError(ErrorCode::kConflict, "keeper_not_empty", [&] { keeper_.Remove("values/a"); });
  EXPECT_TRUE(keeper_.Remove("values/a/b"));
  EXPECT_FALSE(other_.Read("values/a/b").has_value());
}

TEST_F(KeeperOnZooKeeperTest, TextsAreBytes) {
  std::string all;
  for (int i = 0; i < 256; ++i) all.push_back(static_cast<char>(i));
  const std::string large(Keeper::kMaxTextBytes, '\0');
  EXPECT_TRUE(keeper_.Create("texts/empty", ""));
  EXPECT_TRUE(keeper_.Create("texts/all", all));
  EXPECT_TRUE(keeper_.Create("texts/large", large));
  EXPECT_EQ(other_.Read("texts/empty")->text, "");
  EXPECT_EQ(other_.Read("texts/all")->text, all);
  EXPECT_EQ(other_.Read("texts/large")->text, large);
  EXPECT_TRUE(keeper_.Write("texts/large", "", 0));
  EXPECT_EQ(other_.Read("texts/large")->text, "");
}

TEST_F(KeeperOnZooKeeperTest, NumbersAreGivenOutOnce) {
  constexpr int kThreads = 8;
  constexpr int kEach = 40;
  std::array<std::vector<std::uint64_t>, 2 * kThreads> taken;
  {
    std::vector<std::jthread> threads;
    for (std::size_t i = 0; i < taken.size(); ++i) {
      threads.emplace_back([&, i] {
        Keeper& keeper = i % 2 == 0 ? keeper_ : other_;
        for (int n = 0; n < kEach; ++n) taken[i].push_back(keeper.TakeNumbers("numbers/n", 3, 10));
      });
    }
  }
  std::set<std::uint64_t> all;
  for (const auto& numbers : taken) {
    EXPECT_TRUE(std::is_sorted(numbers.begin(), numbers.end()));
    for (const std::uint64_t first : numbers) {
      for (std::uint64_t n = first; n < first + 3; ++n) EXPECT_TRUE(all.insert(n).second) << n;
    }
  }
  EXPECT_EQ(*all.begin(), 10u);
  EXPECT_EQ(*all.rbegin(), 9u + 3 * kEach * taken.size()) << "none is left out without a failure";
}

TEST_F(KeeperOnZooKeeperTest, CountersEndAndMayBeDamaged) {
  EXPECT_TRUE(keeper_.Create("numbers/end", "18446744073709551610"));
  EXPECT_EQ(keeper_.TakeNumbers("numbers/end", 5), 18446744073709551610u);
  ExpectError(ErrorCode::kConflict, "keeper_numbers_exhausted",
              [&] { keeper_.TakeNumbers("numbers/end", 1); });
  for (const char* text : {"", "x", "-1", "12 ", "18446744073709551616"}) {
    const std::string path = "numbers/damaged";
    keeper_.Remove(path);
    EXPECT_TRUE(keeper_.Create(path, text));
    ExpectError(ErrorCode::kCorrupt, "keeper_corrupt", [&] { keeper_.TakeNumbers(path, 1); });
  }
}

TEST_F(KeeperOnZooKeeperTest, ALeaseHasOneHolder) {
  auto lease = keeper_.TryLease("leases/17", "who");
  ASSERT_NE(lease, nullptr);
  EXPECT_TRUE(lease->held());
  EXPECT_EQ(other_.Read("leases/17")->text, "who");
  EXPECT_EQ(other_.Read("leases/17")->made, lease->token());
  EXPECT_EQ(other_.TryLease("leases/17", "another"), nullptr);
  EXPECT_EQ(keeper_.TryLease("leases/17", "the same process"), nullptr);
  ExpectError(ErrorCode::kConflict, "keeper_path_leased",
              [&] { keeper_.Create("leases/17/below", ""); });
  const std::int64_t before = lease->token();
  lease.reset();
  ExpectGone(other_, "leases/17");
  lease = other_.TryLease("leases/17", "another");
  ASSERT_NE(lease, nullptr);
  EXPECT_GT(lease->token(), before);
}

TEST_F(KeeperOnZooKeeperTest, LeasesAreTakenByOneOfMany) {
  for (int round = 0; round < 10; ++round) {
    const std::string path = "leases/many" + std::to_string(round);
    std::atomic<int> winners{0};
    std::array<std::unique_ptr<KeeperLease>, 8> leases;
    {
      std::vector<std::jthread> threads;
      for (std::size_t i = 0; i < leases.size(); ++i) {
        threads.emplace_back([&, i] {
          leases[i] = (i % 2 == 0 ? keeper_ : other_).TryLease(path, "");
          if (leases[i]) ++winners;
        });
      }
    }
    EXPECT_EQ(winners, 1);
  }
  for (int round = 0; round < 10; ++round) {
    ExpectGone(keeper_, "leases/many" + std::to_string(round));
  }
}

TEST_F(KeeperOnZooKeeperTest, ALeaseEndsWithItsKeeper) {
  std::unique_ptr<KeeperLease> lease;
  {
    Keeper short_lived(Options());
    lease = short_lived.TryLease("leases/short", "");
    ASSERT_NE(lease, nullptr);
  }
  EXPECT_FALSE(lease->held());
  EXPECT_FALSE(keeper_.Read("leases/short").has_value());
  lease.reset();
}

TEST_F(KeeperOnZooKeeperTest, ALockExcludesOthersAndItsTokensGrow) {
  constexpr int kRounds = 15;
  std::atomic<int> inside{0};
  std::int64_t last = 0;  // guarded by the lock under test
  int entered = 0;
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < 8; ++i) {
      threads.emplace_back([&, i] {
        Keeper& keeper = i % 2 == 0 ? keeper_ : other_;
        for (int round = 0; round < kRounds; ++round) {
          const auto lock = keeper.Lock("locks/busy", In(seconds(60)));
          EXPECT_TRUE(lock->held());
          EXPECT_EQ(++inside, 1);
          EXPECT_GT(lock->token(), last);
          last = lock->token();
          ++entered;
          --inside;
        }
      });
    }
  }
  EXPECT_EQ(entered, 8 * kRounds);
  ExpectGone(keeper_, "locks/busy");
}

TEST_F(KeeperOnZooKeeperTest, ALockIsFairAndWakesOneAtATime) {
  constexpr int kWaiters = 6;
  auto first = keeper_.Lock("locks/fair", In(seconds(5)));
  std::mutex mutex;
  std::vector<int> order;
  std::vector<std::jthread> threads;
  for (int i = 0; i < kWaiters; ++i) {
    threads.emplace_back([&, i] {
      const auto lock = (i % 2 == 0 ? keeper_ : other_).Lock("locks/fair", In(seconds(60)));
      const std::lock_guard guard(mutex);
      order.push_back(i);
    });
    WaitForPlaces(keeper_, "locks/fair", 2 + i);
  }
  const auto until = In(seconds(5));
  const std::string expected = "watching 6 paths\nTotal watches:6";
  while (zookeeper_->Ask("wchs").find(expected) == std::string::npos && Clock::now() < until) {
    std::this_thread::sleep_for(milliseconds(10));
  }
  EXPECT_THAT(zookeeper_->Ask("wchs"), HasSubstr(expected));
  first.reset();
  threads.clear();
  EXPECT_THAT(order, ElementsAre(0, 1, 2, 3, 4, 5));
  ExpectGone(keeper_, "locks/fair");
}

TEST_F(KeeperOnZooKeeperTest, WaitingForALockEnds) {
  auto lock = keeper_.Lock("locks/long", In(seconds(5)));
  const auto before = Clock::now();
  ExpectError(ErrorCode::kUnavailable, "keeper_busy",
              [&] { other_.Lock("locks/long", In(milliseconds(200))); });
  EXPECT_GE(Clock::now() - before, milliseconds(200));
  std::stop_source stop;
  {
    const std::jthread stopper([&stop] {
      std::this_thread::sleep_for(milliseconds(100));
      stop.request_stop();
    });
    ExpectError(ErrorCode::kCancelled, "cancelled",
                [&] { other_.Lock("locks/long", In(std::chrono::minutes(10)), stop.get_token()); });
  }
  EXPECT_LT(Clock::now() - before, seconds(3));
  WaitForPlaces(keeper_, "locks/long", 1);  // who gave up has left the queue
  lock.reset();
  EXPECT_NE(other_.Lock("locks/long", In(seconds(5))), nullptr);
  ExpectGone(keeper_, "locks/long");
}

TEST_F(KeeperOnZooKeeperTest, OneInTheMiddleOfTheQueueLeaves) {
  auto first = keeper_.Lock("locks/middle", In(seconds(5)));
  std::stop_source stop;
  std::jthread middle([&] {
    ExpectError(ErrorCode::kCancelled, "cancelled",
                [&] { other_.Lock("locks/middle", In(seconds(60)), stop.get_token()); });
  });
  WaitForPlaces(keeper_, "locks/middle", 2);
  std::atomic<bool> entered{false};
  std::jthread last([&] {
    const auto lock = keeper_.Lock("locks/middle", In(seconds(60)));
    entered = true;
  });
  WaitForPlaces(keeper_, "locks/middle", 3);
  stop.request_stop();
  middle.join();
  std::this_thread::sleep_for(milliseconds(200));
  EXPECT_FALSE(entered) << "the first one still has it";
  first.reset();
  last.join();
  EXPECT_TRUE(entered);
}

}  // namespace
}  // namespace pliant::testing
