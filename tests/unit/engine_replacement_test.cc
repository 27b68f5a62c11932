// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images that are replaced while they are searched for.
#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

TEST_F(EngineTest, AReplacedImageIsNeverMissing) {
  Engine engine(Options());
  AddMany(engine, 6);
  Train(engine, 60);
  // The same bytes with other metadata: every state of the image answers the query.
  const auto bytes = RandomPng(2);
  std::atomic<bool> done{false};
  std::atomic<int> searches{0};
  std::atomic<int> misses{0};
  const auto search = [&](Verification verify) {
    SearchOptions options = ByImage(3);
    options.verify = verify;
    options.threads = 1;
    while (!done) {
      const std::vector<std::string> ids = Ids(engine.Search(bytes, options));
      misses += std::count(ids.begin(), ids.end(), "p2") != 1;
      ++searches;
    }
  };
  {
    std::jthread with([&] { search(Verification::kTps); });
    std::jthread without([&] { search(Verification::kNone); });
    for (int i = 0; i < 150 || searches < 100; ++i) {
      Add(engine, bytes, "o1", "p2", R"({"state": )" + std::to_string(i) + "}");
    }
    done = true;
  }
  EXPECT_EQ(misses, 0) << "of " << searches;
  EXPECT_THAT(engine.Check(), ::testing::IsEmpty());
}

TEST_F(EngineTest, AFilterHoldsForTheNewStateToo) {
  Engine engine(Options());
  AddMany(engine, 4);
  Train(engine, 40);
  const auto bytes = RandomPng(2);
  Add(engine, bytes, "o1", "p2", R"({"n": 0})");
  std::atomic<bool> done{false};
  std::atomic<int> wrong{0};
  {
    std::jthread searcher([&] {
      SearchOptions options = ByImage(3);
      options.filter = ParseFilter(R"({"n": 0})");
      while (!done) {
        for (const Hit& hit : engine.Search(bytes, options).hits) {
          wrong += hit.metadata != R"({"n":0})";
        }
      }
    });
    for (int i = 0; i < 60; ++i) {
      Add(engine, bytes, "o1", "p2", R"({"n": )" + std::to_string(i % 2) + "}");
    }
    done = true;
  }
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace pliant::testing
