// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engines that hold parts of the index answer as one that holds all of it, bit by bit.
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "index/engine/index_parts.h"
#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

// Engines of this process instead of servers.
class Engines : public PartServers {
 public:
  explicit Engines(std::size_t parts) : engines_(parts) {}

  void Hold(std::size_t part, std::shared_ptr<Engine> engine) {
    engines_[part].push_back(std::move(engine));
  }
  std::chrono::milliseconds timeout() const override { return std::chrono::seconds(20); }

  Replies Ask(const std::string& whole, const std::string& to_kept, const Replies& first,
              Clock::time_point) override {
    const bool is_second = !first.empty();
    if (is_second && between_steps) between_steps();
    if (std::exchange(is_late, false)) return Replies(engines_.size());
    last_whole = whole;
    if (is_second) last_to_kept = to_kept;
    Replies replies(engines_.size());
    for (std::size_t part = 0; part < engines_.size(); ++part) {
      if (missing.contains(part) || (is_second && !first[part])) continue;
      const bool asks_kept = is_second && random_() % 2 == 0;
      const std::size_t server =
          asks_kept ? first[part]->server : random_() % engines_[part].size();
      replies[part] = AskOne(part, server, asks_kept ? to_kept : whole);
    }
    return replies;
  }

  std::set<std::size_t> missing;  // parts
  bool is_late = false;           // all parts, the next time
  std::function<void()> between_steps;
  int refused = 0;
  std::string last_whole;  // messages
  std::string last_to_kept;

 private:
  std::optional<Reply> AskOne(std::size_t part, std::size_t server, const std::string& message) {
    try {
      const IndexShare share = {static_cast<int>(part) + 1, static_cast<int>(engines_.size())};
      return Reply{engines_[part][server]->RankPart(share, message, 1, Clock::now() + timeout()),
                   server};
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "part_changed");
      ++refused;
      return std::nullopt;
    }
  }

  std::vector<std::vector<std::shared_ptr<Engine>>> engines_;
  std::mt19937_64 random_{5};
};

class PartsTest : public EngineTest, public ::testing::WithParamInterface<int> {
 protected:
  void SetUp() override {
    whole_ = std::make_unique<Engine>(Options());
    AddMany(*whole_, 12);
    Train(*whole_, 100);
    servers_ = std::make_shared<Engines>(static_cast<std::size_t>(GetParam()));
    for (int part = 1; part <= GetParam(); ++part) {
      for (int copy = 0; copy < (GetParam() == 2 ? 2 : 1); ++copy) {
        EngineOptions options = Options();
        options.share = {part, GetParam()};
        options.part_servers = [this] { return servers_; };
        auto engine = std::make_shared<Engine>(options);
        if (!asks_) asks_ = engine.get();
        servers_->Hold(static_cast<std::size_t>(part) - 1, std::move(engine));
      }
    }
  }
  void TearDown() override { servers_.reset(); }

  static void ExpectSame(const SearchResult& one, const SearchResult& parts) {
    EXPECT_EQ(one.total, parts.total);
    EXPECT_EQ(one.found, parts.found);
    EXPECT_EQ(one.evidence, parts.evidence);
    ASSERT_EQ(one.hits.size(), parts.hits.size());
    for (std::size_t i = 0; i < one.hits.size(); ++i) {
      EXPECT_EQ(one.hits[i].image_id, parts.hits[i].image_id) << "hit " << i;
      EXPECT_EQ(one.hits[i].object, parts.hits[i].object);
      EXPECT_EQ(one.hits[i].score, parts.hits[i].score);
      EXPECT_EQ(one.hits[i].probability, parts.hits[i].probability);
      EXPECT_EQ(one.hits[i].inliers, parts.hits[i].inliers);
    }
  }
  void ExpectSameAnswers(const std::vector<std::uint8_t>& image) {
    for (const RankMethod rank : {RankMethod::kNeighbours, RankMethod::kHistogram}) {
      for (const GroupBy group_by : {GroupBy::kImage, GroupBy::kObject}) {
        for (const std::size_t depth : {0U, 2U}) {
          SearchOptions options;
          options.rank = rank;
          options.group_by = group_by;
          options.limit = depth == 0 ? 0 : 3;
          options.offset = depth == 0 ? 0 : 2;
          options.verify_depth = depth;
          options.verify = depth == 0 ? Verification::kNone : Verification::kAuto;
          options.min_score = depth == 0 ? 0 : 0.01;
          ExpectSame(whole_->Search(image, options), asks_->Search(image, options));
        }
      }
    }
    SearchOptions some;
    some.filter = ParseFilter(R"({"colour": "red"})");
    ExpectSame(whole_->Search(image, some), asks_->Search(image, some));
    some.filter = {};
    some.object = "o1";
    some.without = {"p1"};
    ExpectSame(whole_->Search(image, some), asks_->Search(image, some));
  }

  static PartServers::Clock::time_point Later() {
    return PartServers::Clock::now() + std::chrono::seconds(60);
  }

  std::unique_ptr<Engine> whole_;
  std::shared_ptr<Engines> servers_;
  Engine* asks_ = nullptr;
};
INSTANTIATE_TEST_SUITE_P(Of, PartsTest, ::testing::Values(2, 4));

TEST_P(PartsTest, AnswerAsOneIndexWhileImagesComeAndGo) {
  std::mt19937_64 random(3);
  for (int step = 0; step < 12; ++step) {
    const std::string id = "p" + std::to_string(1 + random() % 14);
    const std::uint64_t seed = random() % 20;
    switch (random() % 4) {
      case 0:
        whole_->Remove("default", id);
        break;
      case 1: {
        ImageChange change;
        change.object = "o" + std::to_string(random() % 4);
        if (whole_->Remove("default", "changed")) break;
        Add(*whole_, RandomPng(seed), "o9", "changed");
        whole_->Change("default", "changed", change);
        break;
      }
      default:
        Add(*whole_, RandomPng(seed), "o" + std::to_string(random() % 4), id,
            random() % 2 == 0 ? R"({"colour": "red"})" : "{}");
    }
    SCOPED_TRACE("step " + std::to_string(step));
    ExpectSameAnswers(RandomPng(random() % 20));
  }
  EXPECT_THAT(whole_->Check(), ::testing::IsEmpty());
  EXPECT_THAT(asks_->Check(), ::testing::IsEmpty());
}

TEST_P(PartsTest, AChangeBetweenTheStepsIsNoHalfAnswer) {
  bool changed = false;
  servers_->between_steps = [&] {
    if (std::exchange(changed, true)) return;
    whole_->Remove("default", "p2");
    Add(*whole_, RandomPng(3), "o7", "p20");
  };
  const SearchResult found = asks_->Search(RandomPng(3), ByImage());
  EXPECT_TRUE(changed);
  if (servers_->refused > 0) ExpectSame(whole_->Search(RandomPng(3), ByImage()), found);
  ExpectSameAnswers(RandomPng(3));
}

TEST_P(PartsTest, APartWithoutServerIsAnErrorUnlessTheSearchIsPartial) {
  servers_->missing = {1};
  ExpectError(ErrorCode::kUnavailable, "part_unavailable",
              [&] { asks_->Search(RandomPng(3), ByImage()); });
  SearchOptions partial = ByImage(0);
  partial.partial = true;
  const SearchResult some = asks_->Search(RandomPng(3), partial);
  EXPECT_DOUBLE_EQ(some.searched, 1 - 1.0 / GetParam());
  servers_->missing.clear();
  EXPECT_DOUBLE_EQ(asks_->Search(RandomPng(3), partial).searched, 1);
  for (int part = 0; part < GetParam(); ++part) servers_->missing.insert(part);
  ExpectError(ErrorCode::kUnavailable, "part_unavailable",
              [&] { asks_->Search(RandomPng(3), partial); });
}

TEST_P(PartsTest, SearchesGoOnWhileAVocabularyIsSwitched) {
  asks_->Search(RandomPng(3), ByImage());
  const std::string asked_before = servers_->last_whole;
  whole_->UseVocabulary("default", Train(*whole_, 60).id);
  EXPECT_EQ(Ids(asks_->Search(RandomPng(3), ByImage())).at(0), "p3");
  // A server that has not switched asks one that has.
  EXPECT_NO_THROW(asks_->RankPart({1, GetParam()}, asked_before, 1, Later()));
  // A server that has switched asks some that have not.
  servers_->is_late = true;
  EXPECT_EQ(Ids(asks_->Search(RandomPng(3), ByImage())).at(0), "p3");
  EXPECT_FALSE(servers_->is_late);
}

TEST_P(PartsTest, AServerOfAnotherDatabaseDoesNotAnswer) {
  EngineOptions options = Options();
  options.database = Database(folder_ / "copy.db");
  options.share = {1, GetParam()};
  options.part_servers = [this] { return servers_; };
  Engine other(options);
  AddMany(other, 12);
  Train(other, 100);
  asks_->Search(RandomPng(3), ByImage());
  ExpectError(ErrorCode::kNotFound, "part_elsewhere",
              [&] { other.RankPart(options.share, servers_->last_whole, 1, Later()); });
}

TEST_P(PartsTest, MessagesThatAreNotThoseOfAServerAreRefused) {
  asks_->Search(RandomPng(3), ByImage());
  const std::string valid = servers_->last_whole;
  const auto ask = [&](int parts, const std::string& message,
                       PartServers::Clock::time_point until) {
    return [=, this] { asks_->RankPart({1, parts}, message, 1, until); };
  };
  const int parts = GetParam();
  const std::string large(5'000'000, '\xff');
  ExpectError(ErrorCode::kNotFound, "part_elsewhere", ask(7, valid, Later()));
  for (int i = 0; i < 2; ++i) {  // the votes are used once, at most
    try {
      ask(parts, servers_->last_to_kept, Later())();
      EXPECT_EQ(i, 0);
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "part_elsewhere");
    }
  }
  for (const std::string& message : {std::string(), large, valid.substr(0, 4) + large}) {
    ExpectError(ErrorCode::kInvalidArgument, "peer_message_invalid", ask(parts, message, Later()));
  }
  ExpectError(ErrorCode::kUnavailable, "busy", ask(parts, valid, {}));
  std::mt19937_64 random(9);
  for (int i = 0; i < 2000; ++i) {
    std::string broken = valid;
    const std::size_t at = random() % std::min<std::size_t>(broken.size(), 400);
    switch (random() % 3) {
      case 0:
        broken.resize(at);
        break;
      case 1:
        broken[at] = static_cast<char>(random());
        break;
      default:
        broken.insert(at, 1, static_cast<char>(random()));
    }
    try {
      asks_->RankPart({1, GetParam()}, broken, 1, Later());
    } catch (const Error& error) {
      EXPECT_THAT(error.reason(), ::testing::AnyOf("peer_message_invalid", "part_elsewhere",
                                                   "part_changed", "collection_not_found"));
    }
  }
}

}  // namespace
}  // namespace pliant::testing
