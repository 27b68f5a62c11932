// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How many images, objects and descriptors there are: kept, so that nobody has to count.
#include <SQLiteCpp/SQLiteCpp.h>

#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::uint64_t Scalar(const std::filesystem::path& file, const char* sql) {
  SQLite::Database db(file.string(), SQLite::OPEN_READONLY);
  return static_cast<std::uint64_t>(db.execAndGet(sql).getInt64());
}

class CountsTest : public EngineTest {
 protected:
  void ExpectCounted(Engine& engine) {
    const std::filesystem::path file = Options().database;
    const EngineStats stats = engine.Stats();
    EXPECT_EQ(stats.images, Scalar(file, "SELECT count(*) FROM images"));
    EXPECT_EQ(stats.objects, Scalar(file, "SELECT count(*) FROM objects"));
    EXPECT_EQ(stats.descriptors, Scalar(file, "SELECT sum(keypoints) FROM images"));
    EXPECT_THAT(engine.Check(), IsEmpty());
  }
};

TEST_F(CountsTest, FollowEveryChange) {
  Engine engine(Options());
  AddMany(engine, 6);
  ExpectCounted(engine);
  EXPECT_EQ(engine.GetCollection("default").images, 6u);
  EXPECT_EQ(engine.GetCollection("default").objects, 3u);
  Add(engine, RandomPng(9), "other", "p1");  // another image in its place
  ExpectCounted(engine);
  EXPECT_EQ(engine.GetCollection("default").objects, 4u);
  engine.Remove("default", "p2");
  engine.RemoveObject("default", "o2");
  ExpectCounted(engine);
  engine.CreateCollection("toys");
  AddRequest request;
  request.collection = "toys";
  const auto png = RandomPng(20);
  request.bytes = png;
  engine.Add(request);
  EXPECT_EQ(engine.GetCollection("toys").images, 1u);
  EXPECT_EQ(engine.GetCollection("toys").objects, 0u);
  ExpectCounted(engine);
  engine.RemoveCollection("toys");
  ExpectCounted(engine);
}

// Counting them anew would take the longer the more there are; every scrape of /metrics asks.
TEST_F(CountsTest, AreReadAndNotCounted) {
  Engine engine(Options());
  AddMany(engine, 2);
  SQLite::Database(Options().database.string(), SQLite::OPEN_READWRITE)
      .exec("UPDATE collections SET images = 7, objects = 8, descriptors = 9");
  EXPECT_EQ(engine.Stats().images, 7u);
  EXPECT_EQ(engine.Stats().objects, 8u);
  EXPECT_EQ(engine.Stats().descriptors, 9u);
  EXPECT_EQ(engine.GetCollection("default").images, 7u);
  EXPECT_THAT(engine.Check(), ::testing::Contains(HasSubstr("are not what it holds")));
}

}  // namespace
}  // namespace pliant::testing
