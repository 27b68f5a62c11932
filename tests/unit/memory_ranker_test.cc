// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How the ranker in memory follows a store, played by a feed that the test can hold up.
#include "index/rank/memory_ranker.h"

#include <condition_variable>
#include <future>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/unit/expect_error.h"

namespace pliant {
namespace {

using std::chrono_literals::operator""s;

// What the store holds; every collection has the images of its vocabulary.
struct Content {
  std::vector<CollectionState> collections;
  std::map<Key, std::vector<IndexedImage>> images;  // by vocabulary
  FeedPosition position;
  std::vector<std::pair<std::int64_t, std::int64_t>> removals;  // number, version
  std::int64_t forgotten = 0;                                   // removals up to this number
  Key unreadable = 0;                                           // a vocabulary
  bool position_unreadable = false;
};

// Loading a vocabulary that is held waits until it is released.
class Gate {
 public:
  void Hold(Key vocabulary) {
    const std::lock_guard lock(mutex_);
    held_ = vocabulary;
  }
  void Release() {
    const std::lock_guard lock(mutex_);
    held_ = 0;
    changed_.notify_all();
  }
  void Pass(Key vocabulary) {
    std::unique_lock lock(mutex_);
    if (held_ != vocabulary) return;
    waiting_ = true;
    changed_.notify_all();
    changed_.wait(lock, [&] { return held_ != vocabulary; });
    waiting_ = false;
  }
  void AwaitWaiting() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return waiting_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  Key held_ = 0;
  bool waiting_ = false;
};

class FakeView : public FeedView {
 public:
  FakeView(Content content, Gate* gate) : content_(std::move(content)), gate_(*gate) {}
  FeedPosition Position() override {
    if (content_.position_unreadable) {
      throw Error(ErrorCode::kUnavailable, "database_unavailable", "nobody knows how far it is");
    }
    return content_.position;
  }
  std::vector<CollectionState> Collections() override { return content_.collections; }
  std::optional<std::vector<std::int64_t>> RemovedSince(const FeedPosition& at) override {
    if (at.removal < content_.forgotten) return std::nullopt;
    std::vector<std::int64_t> versions;
    for (const auto& [number, version] : content_.removals) {
      if (number > at.removal) versions.push_back(version);
    }
    return versions;
  }
  std::shared_ptr<const Vocabulary> ReadVocabulary(Key vocabulary) override {
    gate_.Pass(vocabulary);
    auto result = std::make_shared<Vocabulary>();
    result->words = Descriptors::Binary(4, 1);
    result->codebook.code_bytes = 1;
    result->model_id = "m";
    return result;
  }
  std::uint64_t CountImages(Key) override { return 0; }
  void ForEachImage(Key vocabulary, const Quantizer&, std::int64_t after, std::size_t,
                    const std::function<void(std::vector<IndexedImage>)>& work) override {
    if (vocabulary == content_.unreadable) {
      throw Error(ErrorCode::kUnavailable, "database_unavailable", "it is gone");
    }
    for (const IndexedImage& image : content_.images[vocabulary]) {
      if (image.key > after) work({image});  // each a chunk
    }
  }
  bool IsSigned(Key, const std::string&) override { return false; }

 private:
  Content content_;
  Gate& gate_;
};

class FakeFeed : public ChangeFeed {
 public:
  explicit FakeFeed(Gate* gate) : gate_(*gate) {}
  std::int64_t Version() override {
    const std::lock_guard lock(mutex_);
    return version_;
  }
  std::unique_ptr<FeedView> Poll() override {
    const std::lock_guard lock(mutex_);
    return std::make_unique<FakeView>(content_, &gate_);
  }
  void SignSaved(Key, const std::string&, const std::string&) override {}
  template <typename Change>
  void Commit(Change change) {
    const std::lock_guard lock(mutex_);
    change(content_);
    ++version_;
  }

 private:
  std::mutex mutex_;
  std::int64_t version_ = 0;
  Content content_;
  Gate& gate_;
};

IndexedImage MakeImage(std::int64_t key, const std::string& id) {
  IndexedImage image;
  image.key = key;
  image.id = id;
  image.bow.words = {{1, 2}};
  image.bow.total = 2;
  image.bow.codes = {3, 4};
  return image;
}

void ReplaceP2(Content& c) {
  c.images[10] = {MakeImage(1, "p1"), MakeImage(4, "p2")};
  c.removals = {{1, 2}};
  c.position = {4, 1};
}

class MemoryRankerTest : public ::testing::Test {
 protected:
  MemoryRankerTest() {
    auto feed = std::make_unique<FakeFeed>(&gate_);
    feed_ = feed.get();
    feed_->Commit([](Content& c) {
      c.collections = {{1, "a", 10, 0}, {2, "b", 20, 0}};
      c.images[10] = {MakeImage(1, "p1"), MakeImage(2, "p2")};
      c.images[11] = {MakeImage(1, "p1"), MakeImage(2, "p2")};
      c.images[20] = {MakeImage(3, "q")};
      c.position = {3, 0};
    });
    ranker_ = std::make_unique<MemoryRanker>(std::move(feed));
  }
  // Of a collection's images, what a search finds.
  std::vector<std::int64_t> Versions(const CollectionView& view) {
    const RankQuery query = {.method = RankMethod::kHistogram, .bow = {{{1, 1}}, 1, {}, {}}};
    std::vector<std::int64_t> versions;
    for (const RankedImage& p : Rank(*view.snapshot, *view.quantizer, query, {}).best) {
      versions.push_back(p.ref.version);
    }
    return versions;
  }
  std::vector<std::int64_t> Versions(const std::string& collection) {
    return Versions(ranker_->View(collection));
  }
  using Found = std::vector<std::int64_t>;

  Gate gate_;
  FakeFeed* feed_ = nullptr;
  std::unique_ptr<MemoryRanker> ranker_;
};

TEST_F(MemoryRankerTest, FollowsWhatIsCommitted) {
  EXPECT_EQ(Versions("a"), (Found{1, 2}));
  feed_->Commit(ReplaceP2);
  EXPECT_EQ(Versions("a"), (Found{1, 4}));
  EXPECT_EQ(Versions("b"), (Found{3}));
  testing::ExpectError(ErrorCode::kNotFound, "collection_not_found", [&] { ranker_->View("c"); });
  feed_->Commit([](Content& c) {
    c.images[10] = {MakeImage(4, "p2")};
    c.forgotten = c.position.removal = 9;
  });
  EXPECT_EQ(Versions("a"), (Found{4})) << "what was forgotten is loaded anew";
}

TEST_F(MemoryRankerTest, WhatCouldNotBeFollowedIsFollowedLater) {
  EXPECT_EQ(Versions("a"), (Found{1, 2}));
  EXPECT_EQ(Versions("b"), (Found{3}));
  feed_->Commit([](Content& c) {
    for (const Key v : {10, 20}) c.images[v].push_back(MakeImage(4 + v, "z"));
    c.position = {24, 0};
    c.unreadable = 20;
  });
  for (int i = 0; i < 2; ++i) {
    testing::ExpectError(ErrorCode::kUnavailable, "database_unavailable",
                         [&] { ranker_->View("b"); });
  }
  gate_.Hold(20);  // would be waited for if it had to be loaded anew
  feed_->Commit([](Content& c) { c.unreadable = 0; });
  EXPECT_EQ(Versions("b"), (Found{3, 24}));
  EXPECT_EQ(Versions("a"), (Found{1, 2, 14}));
  gate_.Release();
}

TEST_F(MemoryRankerTest, WhatFailsAtItsEndIsNotFollowedTwice) {
  EXPECT_EQ(Versions("a"), (Found{1, 2}));
  feed_->Commit([](Content& c) {
    ReplaceP2(c);
    c.position_unreadable = true;
  });
  testing::ExpectError(ErrorCode::kUnavailable, "database_unavailable",
                       [&] { ranker_->View("a"); });
  feed_->Commit([](Content& c) { c.position_unreadable = false; });
  EXPECT_EQ(Versions("a"), (Found{1, 4}));
}

TEST_F(MemoryRankerTest, SearchesGoOnWhileAVocabularyIsLoaded) {
  ranker_->Load();
  gate_.Hold(11);
  feed_->Commit([](Content& c) { c.collections[0].vocabulary = 11; });
  auto loads = std::async(std::launch::async, [&] { return ranker_->View("a").vocabulary; });
  gate_.AwaitWaiting();
  auto others = std::async(std::launch::async, [&] {
    EXPECT_EQ(ranker_->View("a").vocabulary, 10) << "the state before";
    EXPECT_EQ(ranker_->View("b").vocabulary, 20);
    feed_->Commit([](Content& c) {  // p1 goes, and q gets a neighbour
      for (const Key v : {10, 11}) std::erase_if(c.images[v], [](auto& p) { return p.key == 1; });
      c.removals = {{1, 1}};
      c.images[20].push_back(MakeImage(5, "r"));
      c.position = {5, 1};
    });
    EXPECT_EQ(Versions("a"), (Found{2})) << "what is removed is gone at once";
    EXPECT_EQ(Versions("b"), (Found{3, 5}));
    EXPECT_GT(ranker_->memory_bytes(), 0U);
  });
  const bool in_time = others.wait_for(20s) == std::future_status::ready;
  gate_.Release();
  EXPECT_TRUE(in_time) << "a search waited for another collection's vocabulary";
  EXPECT_EQ(loads.get(), 11);
  others.get();
  EXPECT_EQ(ranker_->View("a").vocabulary, 11);
  EXPECT_EQ(Versions("a"), (Found{2})) << "what changed meanwhile was followed";
}

TEST_F(MemoryRankerTest, AWriterWaitsUntilItsSwitchIsSeen) {
  ranker_->Load();
  gate_.Hold(11);
  feed_->Commit([](Content& c) { c.collections[0].vocabulary = 11; });
  auto writer = std::async(std::launch::async, [&] { ranker_->Follow(); });
  gate_.AwaitWaiting();
  EXPECT_EQ(ranker_->View("a").vocabulary, 10);
  gate_.Release();
  writer.get();
  EXPECT_EQ(ranker_->View("a").vocabulary, 11);
}

TEST_F(MemoryRankerTest, WhatIsPreparedIsNotLoadedAgain) {
  ranker_->Load();
  auto prepared = ranker_->Prepare(1, 11);
  gate_.Hold(11);  // whoever loads it now hangs
  feed_->Commit([](Content& c) {
    c.collections[0].vocabulary = 11;
    c.images[11].push_back(MakeImage(6, "late"));
    c.position = {6, 0};
  });
  auto writer = std::async(std::launch::async, [&] { ranker_->Follow(); });
  const bool in_time = writer.wait_for(20s) == std::future_status::ready;
  gate_.Release();
  EXPECT_TRUE(in_time);
  writer.get();
  EXPECT_EQ(ranker_->View("a").vocabulary, 11);
  EXPECT_EQ(Versions("a"), (Found{6, 1, 2})) << "in order of id";
}

TEST_F(MemoryRankerTest, AnErrorWhileLoadingIsThrownAndForgotten) {
  feed_->Commit([](Content& c) { c.images[10][0].bow.words = {{99, 1}}; });  // no such word
  EXPECT_THROW(ranker_->View("a"), std::exception);
  EXPECT_EQ(Versions("b"), (Found{3}));
  feed_->Commit([](Content& c) { c.images[10][0] = MakeImage(1, "p1"); });
  EXPECT_EQ(Versions("a"), (Found{1, 2}));
}

}  // namespace
}  // namespace pliant
