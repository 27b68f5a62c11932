// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Purging a cluster: what nobody can read goes, and nothing else, whoever reads meanwhile and
// wherever it is killed.
#include <chrono>
#include <map>
#include <random>
#include <thread>

#include "index/store/clickhouse/cluster_purge.h"
#include "tests/integration/program.h"
#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using std::chrono::seconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Clock = std::chrono::steady_clock;

constexpr seconds kPatience{90};

class PurgeTest : public EngineTest {
 protected:
  std::string Url() { return Options().database.string(); }

  clickhouse::PurgeReport Purge(seconds wait = seconds(30)) {
    clickhouse::ClusterAccess cluster(Url());
    return clickhouse::Purge(cluster, {seconds(0), seconds(0), wait});
  }

  std::uint64_t Count(const std::string& what, const std::string& table) {
    clickhouse::ClusterAccess cluster(Url());
    std::uint64_t count = 0;
    for (const auto& block : cluster.link.ReadEach(
             "SELECT toUInt64(" + what + ") AS n FROM " + table, {{"n", "UInt64"}})) {
      if (block.rows > 0) count += clickhouse::Row(block, 0).Number(0);
    }
    return count;
  }

  void Put(Engine& engine, const std::string& id, std::uint64_t seed) {
    Add(engine, RandomPng(seed), "of " + id, id);
    there_[id] = seed;
  }
  void Remove(Engine& engine, const std::string& id) {
    EXPECT_TRUE(engine.Remove("default", id));
    there_.erase(id);
  }

  void ExpectAll(Engine& engine, const char* when) {
    SCOPED_TRACE(when);
    for (const auto& [id, seed] : there_) {
      EXPECT_EQ(engine.Get("default", id).object, "of " + id);
      EXPECT_EQ(engine.GetContent("default", id), RandomPng(seed)) << id;
      EXPECT_THAT(Ids(engine.Search(RandomPng(seed), ByImage(1))), ElementsAre(id));
    }
    EXPECT_EQ(engine.GetCollection("default").images, there_.size());
    EXPECT_THAT(engine.Check(), IsEmpty());
  }

  // ClickHouse removes rows in its own time, and those of the newest block only after another one
  // has come.
  void PurgeUntilFewAreLeft(Engine& engine) {
    const auto until = Clock::now() + kPatience;
    const auto most = there_.size() + 8;
    for (std::uint64_t round = 0; Clock::now() < until; ++round) {
      for (int i = 0; i < 4; ++i) {
        Put(engine, "tick" + std::to_string(i), 5000 + 4 * round + static_cast<std::uint64_t>(i));
      }
      const clickhouse::PurgeReport report = Purge();
      EXPECT_EQ(report.readers, 0U);
      std::this_thread::sleep_for(seconds(1));
      if (Count("uniqExact(version)", "pictures") <= most + 4 &&
          Count("uniqExact(picture)", "features") <= most + 4 &&
          Count("uniqExact(picture)", "words") <= most + 4 &&
          Count("uniqExact(sha256)", "originals") <= most + 4) {
        return;
      }
    }
    ADD_FAILURE() << Count("uniqExact(version)", "pictures") << " states, "
                  << Count("uniqExact(picture)", "features") << " features, "
                  << Count("uniqExact(picture)", "words") << " words, "
                  << Count("uniqExact(sha256)", "originals") << " originals of " << there_.size()
                  << " pictures are left";
  }

  std::map<std::string, std::uint64_t> there_;  // seeds of the pictures, by id
};

TEST_F(PurgeTest, OldStatesGoAndNothingElse) {
  Engine engine(Options());
  for (std::uint64_t i = 1; i <= 12; ++i) Put(engine, "p" + std::to_string(i), i);
  Train(engine, 60);
  Engine other(Options());
  ExpectAll(other, "before");
  for (std::uint64_t round = 1; round <= 3; ++round) {
    for (std::uint64_t i = 1; i <= 12; ++i) Put(engine, "p" + std::to_string(i), 100 * round + i);
  }
  for (int i = 1; i <= 3; ++i) Remove(engine, "p" + std::to_string(i));
  engine.CreateCollection("gone");
  AddRequest request;
  const std::vector<std::uint8_t> bytes = RandomPng(999);
  request.collection = "gone";
  request.bytes = bytes;
  engine.Add(request);
  EXPECT_TRUE(engine.RemoveCollection("gone"));
  const std::uint64_t log = Count("count()", "log");
  ASSERT_GE(Count("uniqExact(version)", "pictures"), 52U);

  PurgeUntilFewAreLeft(engine);
  EXPECT_LT(Count("count()", "log"), log);
  ExpectAll(engine, "after");
  ExpectAll(other, "after, at another server");
  Engine fresh(Options());
  ExpectAll(fresh, "after, at a new server");
  // The same bytes as ever, whose rows have been purged.
  Put(engine, "p1", 1);
  ExpectAll(engine, "what was there once more");
  ExpectAll(other, "what was there once more, at another server");
}

TEST_F(PurgeTest, WhatIsBeingReadStaysUntilItsEnd) {
  Engine engine(Options());
  for (std::uint64_t i = 1; i <= 8; ++i) Put(engine, "p" + std::to_string(i), i);
  clickhouse::ClusterAccess cluster(Url());
  const auto until = Clock::now() + kPatience;
  while (clickhouse::ReadFloors(*cluster.keeper).size() < 2 && Clock::now() < until) {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  std::map<std::string, std::string> read;  // SHA-256 by id
  PictureListing list;
  list.limit = 2;
  const std::string first = engine.Get("default", "p8").sha256;
  engine.ForEachPage(list, [&](const PicturePage& page) {
    if (read.empty()) {
      for (std::uint64_t i = 1; i <= 4; ++i) Remove(engine, "p" + std::to_string(i));
      for (std::uint64_t i = 5; i <= 8; ++i) Put(engine, "p" + std::to_string(i), 100 + i);
      const clickhouse::PurgeReport report = Purge(seconds(8));
      EXPECT_GE(report.readers, 1U);
      EXPECT_EQ(report.states + report.removals + report.descriptions + report.originals, 0U);
    }
    for (const ImageRecord& record : page.records) read[record.id] = record.sha256;
  });
  EXPECT_EQ(read.size(), 8U) << "those that were there when it began";
  EXPECT_EQ(read["p8"], first);
  EXPECT_GT(Purge().states, 0U);
}

// A process that others do not know of finds out by itself.
TEST_F(PurgeTest, WhatWasPurgedUnderAReaderIsNeverShownAsWhole) {
  Engine engine(Options());
  for (std::uint64_t i = 1; i <= 8; ++i) Put(engine, "p" + std::to_string(i), i);
  clickhouse::ClusterAccess cluster(Url());
  clickhouse::Snapshots unknown(&cluster.link);
  const clickhouse::Snapshot snapshot = unknown.Now();
  EXPECT_NO_THROW(unknown.RequireKept(snapshot));
  for (std::uint64_t i = 1; i <= 8; ++i) Put(engine, "p" + std::to_string(i), 100 + i);
  EXPECT_NO_THROW(unknown.RequireKept(snapshot));
  EXPECT_GT(Purge().states, 0U);
  ExpectError(ErrorCode::kUnavailable, "snapshot_expired", [&] { unknown.RequireKept(snapshot); });
}

TEST_F(PurgeTest, OneAtATime) {
  Engine engine(Options());
  clickhouse::ClusterAccess cluster(Url());
  const auto other = cluster.keeper->TryLease("purge", "");
  ExpectError(ErrorCode::kConflict, "purge_running", [&] { Purge(seconds(1)); });
}

TEST_F(PurgeTest, KilledAnywhereItGoesOn) {
  Engine engine(Options());
  for (std::uint64_t i = 1; i <= 8; ++i) Put(engine, "p" + std::to_string(i), i);
  Train(engine, 60);
  constexpr unsigned kSeed = 3;
  std::mt19937 random(kSeed);
  for (std::uint64_t round = 1; round <= 6; ++round) {
    for (int i = 0; i < 6; ++i) {
      const std::uint64_t number = 1 + random() % 8;
      const std::string id = "p" + std::to_string(number);
      if (random() % 3 == 0 && there_.count(id) > 0) {
        Remove(engine, id);
      } else {
        Put(engine, id, 100 * round + static_cast<std::uint64_t>(i));
      }
    }
    const auto announced = [this] {
      return Count("max(version)", "registry WHERE kind = 'purge'");
    };
    const std::uint64_t before = announced();
    Program purge(
        {"cluster", "purge", "--db", Url(), "--older-than", "0", "--log-older-than", "0"});
    // It waits for the lease of the one that was killed before it, and then for readers; what comes
    // afterwards takes a second.
    const auto until = Clock::now() + kPatience;
    while (announced() == before && Clock::now() < until) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(random() % 7000));
    purge.Signal(SIGKILL);
    purge.Wait();
    ExpectAll(engine, "after it was killed");
  }
  PurgeUntilFewAreLeft(engine);
  ExpectAll(engine, "at the end");
  Engine fresh(Options());
  ExpectAll(fresh, "at the end, at a new server");
}

}  // namespace
}  // namespace pliant::testing
