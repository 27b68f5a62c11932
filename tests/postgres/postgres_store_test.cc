// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a store on PostgreSQL promises beyond a file: many writers at once, filters and text as SQL,
// connections that break, plain errors.
#include <atomic>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <libpq-fe.h>
#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "descriptor/base/utf8.h"
#include "index/files/text.h"
#include "index/store/blob_codec.h"
#include "index/store/open_store.h"
#include "index/store/sql/original_store.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"
#include "tests/unit/test_database.h"

namespace pliant {
namespace {

using Json = nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

const DescriptorInfo kModel{"test", DescriptorKind::kBinary, 8, "test-1"};

Features SomeFeatures() {
  Features features;
  features.width = features.height = 10;
  features.model_id = kModel.model_id;
  features.keypoints.resize(3);
  features.descriptors = Descriptors::Binary(3, 8);
  features.descriptors.bytes[9] = 0xFF;
  return InStoredPrecision(features);
}

// A server with its tables, a vocabulary that is active, and what tests do with it.
class PostgresStoreTest : public ::testing::Test {
 protected:
  PostgresStoreTest() : store_(Open()) {
    auto vocabulary = std::make_shared<Vocabulary>();
    vocabulary->words = Descriptors::Binary(2, 8);
    vocabulary->words.bytes[15] = 0xFF;
    vocabulary->codebook.code_bytes = 8;
    vocabulary->model_id = kModel.model_id;
    Writer& writer = store_->writer();
    const CollectionState collection = store_->catalogue().RequireCollection("default");
    vocabulary_ = writer.AddVocabulary(collection.key, *vocabulary);
    writer.FinishVocabulary("default", vocabulary_, Quantizer(vocabulary), false);
  }

  static std::string Url() {
    static int tests = 0;
    static const ::testing::TestInfo* last = nullptr;
    const ::testing::TestInfo* now = ::testing::UnitTest::GetInstance()->current_test_info();
    if (std::exchange(last, now) != now) ++tests;
    return testing::Database("test" + std::to_string(tests)).string();
  }
  static std::unique_ptr<Store> Open(int busy_timeout_ms = 10'000) {
    StoreOptions options;
    options.database = Url();
    options.model_of_new = [] { return kModel; };
    options.busy_timeout_ms = busy_timeout_ms;
    auto store = OpenStore(options);
    store->BeginWriting([] {});
    return store;
  }

  struct Image {
    std::string id;
    std::string metadata = "{}";
    std::string object = {};
    std::string source = {};
  };
  static std::vector<PutOutcome> Put(Store& store, const std::vector<Image>& images) {
    std::vector<AddRequest> requests;
    for (const Image& image : images) {
      AddRequest& request = requests.emplace_back();
      request.id = image.id;
      request.metadata = image.metadata;
      request.object = image.object;
      request.source = image.source;
      request.bytes =
          Bytes(reinterpret_cast<const std::uint8_t*>(image.id.data()), image.id.size());
    }
    std::vector<ImagePut> puts;
    for (const AddRequest& request : requests) {
      ImagePut& put = puts.emplace_back(ImagePut{.request = request});
      put.features = SomeFeatures();
      put.encoded = EncodeFeatures(put.features);
      put.record.collection = request.collection;
      put.record.id = *request.id;
      put.record.object = request.object;
      put.record.metadata = request.metadata;
      put.record.source = request.source;
      put.record.sha256 = Sha256Hex(request.bytes);
      put.record.media_type = "image/png";
      put.record.width = put.record.height = 10;
      put.record.keypoints = 3;
      put.record.bytes = request.bytes.size();
    }
    return store.writer().PutAll(puts);
  }

  std::set<std::string> AllIds() {
    std::set<std::string> ids;
    store_->catalogue().ForEachImagePage(ImageListing{}, [&](const ImagePage& page) {
      for (const ImageRecord& record : page.records) ids.insert(record.id);
    });
    return ids;
  }

  const std::unique_ptr<Store> store_;
  Key vocabulary_ = 0;
};

// SQL for what tests do to the server behind the store's back.
class Server {
 public:
  explicit Server(const std::string& url) : connection_(PQconnectdb(url.c_str())) {}
  ~Server() { PQfinish(connection_); }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  std::string Ask(const std::string& sql) {
    PGresult* result = PQexec(connection_, sql.c_str());
    const bool failed = PQresultStatus(result) == PGRES_FATAL_ERROR;
    std::string answer = failed                   ? PQerrorMessage(connection_)
                         : PQntuples(result) == 0 ? ""
                                                  : PQgetvalue(result, 0, 0);
    PQclear(result);
    if (failed) throw std::runtime_error(answer);
    return answer;
  }

 private:
  PGconn* connection_;
};

// Follows the feed as a ranker does, and finds what it must not see.
class Follower {
 public:
  explicit Follower(ChangeFeed* feed, Key vocabulary) : feed_(*feed), vocabulary_(vocabulary) {}

  void Poll() {
    const std::unique_ptr<FeedView> view = feed_.Poll();
    const auto removed = view->RemovedSince(at_);
    ASSERT_TRUE(removed.has_value());
    const FeedPosition now = view->Position();
    ASSERT_TRUE(now.Continues(at_));
    const Quantizer quantizer(view->ReadVocabulary(vocabulary_));
    view->ForEachImage(
        vocabulary_, quantizer, at_.image, 1000, [&](std::vector<IndexedImage> images) {
          for (const IndexedImage& image : images) {
            EXPECT_TRUE(there_.emplace(image.key, image.id).second) << image.id << " came twice";
          }
        });
    for (const std::int64_t key : *removed) {
      EXPECT_TRUE(gone_.insert(key).second) << key << " was removed twice";
      there_.erase(key);
    }
    at_ = now;
    std::map<std::string, int> halves;
    for (const auto& [key, id] : there_) ++halves[id.substr(0, id.rfind('-'))];
    for (const auto& [pair, count] : halves) EXPECT_EQ(count, 2) << "half of " << pair;
    EXPECT_EQ(there_.size(), view->CountImages(view->Collections().at(0).key));
  }

  std::set<std::string> Ids() const {
    std::set<std::string> ids;
    for (const auto& [key, id] : there_) ids.insert(id);
    return ids;
  }

 private:
  ChangeFeed& feed_;
  const Key vocabulary_;
  FeedPosition at_;
  std::map<std::int64_t, std::string> there_;
  std::set<std::int64_t> gone_;
};

// Each writer is a process of its own as far as the database can tell. Images come, are replaced
// and go in pairs, so that a state that never was has half of one.
TEST_F(PostgresStoreTest, AFollowerSeesEachChangeOfManyWritersOnceAndInOrder) {
  constexpr int kWriters = 16;
  constexpr int kRounds = 12;
  std::atomic<int> working = kWriters;
  std::vector<std::jthread> writers;
  for (int w = 0; w < kWriters; ++w) {
    writers.emplace_back([&, w] {
      const auto store = Open(60'000);
      std::mt19937 dice(static_cast<unsigned>(w));
      for (int round = 0; round < kRounds; ++round) {
        const std::string pair = "w" + std::to_string(w) + "-" + std::to_string(dice() % 4);
        if (dice() % 3 == 0) {
          Selection both;
          both.text = pair + "-";
          store->writer().RemoveWhere(both);
        } else {
          const std::string metadata = R"({"round":)" + std::to_string(round) + "}";
          Put(*store, {{pair + "-a", metadata}, {pair + "-b", metadata}});
        }
      }
      --working;
    });
  }
  const auto feed = store_->OpenFeed();
  Follower follower(feed.get(), vocabulary_);
  int looks = 0;
  std::int64_t version = -1;
  while (working > 0 && !HasFatalFailure()) {
    if (const std::int64_t now = feed->Version(); now != version) {
      version = now;
      follower.Poll();
      ++looks;
    }
  }
  writers.clear();
  follower.Poll();
  EXPECT_EQ(follower.Ids(), AllIds());
  EXPECT_GT(looks, kRounds);
  EXPECT_THAT(store_->catalogue().Check(), ::testing::IsEmpty());
}

FilterValue RandomValue(std::mt19937& dice) {
  switch (dice() % 8) {
    case 0:
      return std::monostate();
    case 1:
      return dice() % 2 == 0;
    case 2:
      return static_cast<double>(dice() % 4) + 0.5;
    case 3:
      return std::string(std::vector<std::string>{"a", "A", "b", "", "ä", "\\u0000"}[dice() % 6]);
    case 4:
      return std::string("x") + std::string(dice() % 2, '\0') + std::string(dice() % 2, '\1') + "y";
    case 5:
      return std::uint64_t{9007199254740992} + dice() % 3;
    case 6:
      return static_cast<double>(dice() % 3);
    default:
      return static_cast<std::int64_t>(dice() % 4) - 1;
  }
}

Json JsonOf(const FilterValue& value) {
  return std::visit(
      [](const auto& one) -> Json {
        if constexpr (std::is_same_v<std::decay_t<decltype(one)>, std::monostate>) {
          return nullptr;
        } else {
          return one;
        }
      },
      value);
}

const std::vector<std::string> kNames = {"k", "k\"'?$1", std::string("z\0", 2)};

Json RandomMetadata(std::mt19937& dice) {
  Json metadata = Json::object();
  for (const std::string& name : kNames) {
    if (dice() % 4 == 0) continue;
    Json value = JsonOf(RandomValue(dice));
    if (dice() % 3 == 0) {
      value = Json::array();
      for (unsigned i = dice() % 4; i > 0; --i) value.push_back(JsonOf(RandomValue(dice)));
      if (dice() % 5 == 0) value.push_back(Json::array({1}));
    } else if (dice() % 8 == 0) {
      value = Json{{"k", 1}};
    }
    metadata[name] = value;
  }
  return metadata;
}

FilterBound RandomBound(std::mt19937& dice) {
  while (true) {
    FilterValue value = RandomValue(dice);
    if (std::holds_alternative<std::monostate>(value) || std::holds_alternative<bool>(value))
      continue;
    return {value, dice() % 2 == 0};
  }
}

Filter RandomFilter(std::mt19937& dice, int depth) {
  Filter filter;
  for (unsigned i = depth == 0 ? 1 : dice() % 2; i > 0; --i) {
    FilterCondition condition{kNames[dice() % kNames.size()]};
    if (dice() % 6 == 0) {
      condition.exists = dice() % 2 == 0;
      if (!*condition.exists) {
        filter.conditions.push_back(condition);
        continue;
      }
    }
    if (dice() % 2 == 0) condition.any_of = {RandomValue(dice), RandomValue(dice)};
    if (dice() % 3 == 0) condition.from = RandomBound(dice);
    if (dice() % 3 == 0) condition.to = RandomBound(dice);
    if (dice() % 4 == 0) condition.not_equal = RandomValue(dice);
    if (!condition.any_of && !condition.from && !condition.to && !condition.not_equal) {
      condition.exists = true;
    }
    filter.conditions.push_back(condition);
  }
  if (depth > 0) {
    filter.all_of.push_back(RandomFilter(dice, depth - 1));
    if (dice() % 2 == 0) filter.none_of.push_back(RandomFilter(dice, depth - 1));
    if (dice() % 2 == 0) {
      filter.any_of.push_back({RandomFilter(dice, depth - 1), RandomFilter(dice, depth - 1)});
    }
  }
  return filter;
}

TEST_F(PostgresStoreTest, FiltersInSqlPassWhatFiltersPass) {
  std::mt19937 dice(7);
  std::vector<Image> images;
  for (int i = 0; i < 60; ++i) {
    images.push_back({"p" + std::to_string(i), RandomMetadata(dice).dump()});
  }
  Put(*store_, images);
  const Key collection = store_->catalogue().RequireCollection("default").key;
  std::size_t passed = 0;
  for (int i = 0; i < 400; ++i) {
    const Filter filter = RandomFilter(dice, i % 3);
    CheckFilter(filter);
    const Admission admission = store_->catalogue().Admit(collection, std::nullopt, filter, {});
    std::set<std::string> expected;
    for (const Image& image : images) {
      if (Passes(filter, image.metadata)) expected.insert(image.id);
    }
    std::vector<ImageRef> refs;
    for (const std::int64_t version : *admission.versions)
      refs.push_back({collection, "", version});
    std::set<std::string> found;
    for (const auto& image : store_->catalogue().LoadImages(refs, Load::kRecords)) {
      found.insert(image->record.id);
    }
    ASSERT_EQ(found, expected) << "filter " << i;
    passed += found.size();
  }
  EXPECT_GT(passed, 1000U);
}

TEST_F(PostgresStoreTest, TextIsFoundWhateverItsCase) {
  const std::vector<std::string> names = {"Straße",   "STRASSE", "ΣΊΣΥΦΟΣ", "σίσυφος", "İstanbul",
                                          "ISTANBUL", "ǅ",       "ＡＢＣ",  "a_%\\b",  "Ünï 'x'"};
  std::vector<Image> images;
  for (std::size_t i = 0; i < names.size(); ++i) {
    images.push_back({"p" + std::to_string(i), "{}", names[i], i % 2 == 0 ? names[9 - i] : ""});
  }
  Put(*store_, images);
  for (const std::string& text : names) {
    for (const std::string& asked :
         {text, EncodeUtf8(FoldCase(text)), text.substr(0, 1), "p " + text}) {
      if (!IsValidUtf8(asked)) continue;
      ImageListing list;
      list.which.text = asked;
      std::set<std::string> found;
      for (const ImageRecord& record : store_->catalogue().ListImagePage(list).records) {
        found.insert(record.id);
      }
      std::set<std::string> expected;
      for (const Image& image : images) {
        if (OccurIn(FoldedWords(asked), {image.id, image.object, image.source})) {
          expected.insert(image.id);
        }
      }
      EXPECT_EQ(found, expected) << asked;
    }
  }
}

// Sessions end at any moment; what was answered is there, and the same request again does no harm.
TEST_F(PostgresStoreTest, NothingIsLostOrTwiceWhenConnectionsBreak) {
  std::atomic<bool> stop = false;
  std::atomic<int> unknown = 0;
  std::jthread killer([&] {
    Server server(Url());
    while (!stop) {
      server.Ask(
          "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity "
          "WHERE application_name = 'pliant' AND random() < 0.3");
      std::this_thread::sleep_for(
          std::chrono::milliseconds(20));  // the rate of kills, no condition
    }
  });
  const auto insist = [&](const auto& work) {
    for (int tries = 0; tries < 200; ++tries) {
      try {
        return work();
      } catch (const Error& error) {
        ASSERT_EQ(error.code(), ErrorCode::kUnavailable) << error.what();
        if (error.reason() == "database_outcome_unknown") ++unknown;
      }
    }
    FAIL() << "never done";
  };
  std::vector<std::jthread> writers;
  for (int w = 0; w < 4; ++w) {
    writers.emplace_back([&, w] {
      for (int i = 0; i < 60; ++i) {
        const std::string id = std::to_string(w) + "-" + std::to_string(i);
        insist([&] { Put(*store_, {{id}}); });
        if (i % 3 == 0) insist([&] { store_->writer().Remove("default", id, {}); });
      }
    });
  }
  writers.clear();
  stop = true;
  killer.join();
  insist([&] {
    const std::set<std::string> ids = AllIds();
    EXPECT_EQ(ids.size(), 4U * 40U);
    EXPECT_FALSE(ids.contains("1-3"));
    EXPECT_TRUE(ids.contains("1-4"));
  });
  insist([&] { EXPECT_THAT(store_->catalogue().Check(), ::testing::IsEmpty()); });
}

TEST_F(PostgresStoreTest, UploadsCanBeInOneFolderOfAllServers) {
  const testing::TemporaryFolder folder;
  const auto other = Open();
  for (Store* store : {store_.get(), other.get()}) store->OpenOriginals(folder / "originals", true);
  Put(*store_, {{"a"}, {"b"}});
  EXPECT_EQ(other->catalogue().ReadContent("default", "a"), std::vector<std::uint8_t>{'a'});
  EXPECT_EQ(other->catalogue().DescribeOriginals()->files, 2U);
  EXPECT_TRUE(other->writer().Remove("default", "a", {}));
  const OriginalStore files(folder / "originals");
  EXPECT_THAT(files.List(), ::testing::ElementsAre(Sha256Hex("b")));
  EXPECT_EQ(store_->writer().SweepOriginals(), 0U);
  EXPECT_THAT(store_->catalogue().Check(), ::testing::IsEmpty());
}

TEST(OriginalStore, AFileIsPutBackWhereItsRemovalIsNotConfirmed) {
  const testing::TemporaryFolder folder;
  const OriginalStore files(folder.path());
  files.Claim({"id", "database"});
  const std::vector<std::uint8_t> bytes = {1, 2, 3};
  const std::string sha256 = Sha256Hex(bytes);
  IncomingOriginal incoming(folder.path(), sha256, bytes);
  files.Publish(incoming);
  EXPECT_THROW(files.RemoveIf(sha256, [] { throw std::runtime_error("the turn is over"); }),
               std::runtime_error);
  EXPECT_EQ(files.Read(sha256, 3), bytes);
  EXPECT_EQ(files.RemoveAbandoned(), 0U);
  EXPECT_TRUE(files.RemoveIf(sha256, [] {}));
  EXPECT_FALSE(files.RemoveIf(sha256, [] {}));
  EXPECT_THAT(files.List(), ::testing::IsEmpty());
}

TEST_F(PostgresStoreTest, AWriterThatHoldsTheTurnTooLongIsRefusedAndEnds) {
  Server other(Url());
  other.Ask("BEGIN");
  other.Ask("UPDATE feed SET position = position + 1 WHERE key = 0");
  const auto store = Open(300);
  testing::ExpectError(ErrorCode::kUnavailable, "database_busy", [&] { Put(*store, {{"waits"}}); });
  other.Ask("ROLLBACK");
  EXPECT_EQ(Put(*store, {{"waits"}}).front().outcome, AddOutcome::kCreated);
}

TEST_F(PostgresStoreTest, RefusalsNameTheDatabaseAndNoPassword) {
  StoreOptions options;
  options.model_of_new = [] { return kModel; };
  const auto refusal = [&](const std::string& url) {
    options.database = url;
    try {
      OpenStore(options);
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), Not(HasSubstr("secret"))) << url;
      return error.reason();
    }
    return std::string("opened");
  };
  EXPECT_EQ(refusal("postgresql://pliant:secret@[::1/pliant"), "database_url_invalid");
  EXPECT_EQ(refusal("postgresql://pliant:secret@127.0.0.1:1/pliant"), "database_unavailable");
  std::string other = Url();
  other.replace(other.find("/pliant"), 7, "/no_such_database");
  EXPECT_EQ(refusal(other), "database_not_found");
  options.create = false;
  EXPECT_EQ(refusal(testing::Database("without tables").string()), "database_not_found");
  EXPECT_EQ(refusal(Url()), "opened");
  Server(Url()).Ask("UPDATE pliant SET version = 2");
  EXPECT_EQ(refusal(Url()), "other_schema");
}

TEST_F(PostgresStoreTest, JobsAndRequestsAreOneProcesss) {
  const auto one = OpenServiceStore(Url());
  const auto other = OpenServiceStore(Url());
  EXPECT_NE(one->Owner(), other->Owner());
  EXPECT_TRUE(one->Lives(other->Owner()));
  JobRecord job;
  job.id = "j";
  job.kind = "training";
  job.collection = "default";
  job.state = "running";
  job.owner = one->Owner();
  EXPECT_TRUE(one->AddOnlyJob(job));
  JobRecord second = job;
  second.id = "k";
  EXPECT_FALSE(other->AddOnlyJob(second));
  std::atomic<int> taken = 0;
  {
    std::vector<std::jthread> takers;
    for (int i = 0; i < 8; ++i) {
      takers.emplace_back([&] {
        const auto store = OpenServiceStore(Url());
        taken += store->TakeJob("j", one->Owner()) ? 1 : 0;
      });
    }
  }
  EXPECT_EQ(taken, 1);
  EXPECT_FALSE(one->SaveJob(job)) << "it is another's by now";
  const RepeatableRequest request{"caller", "name", std::string(64, 'a')};
  EXPECT_EQ(one->BeginRequest(request).kind, RequestState::kBegun);
  EXPECT_EQ(other->BeginRequest(request).kind, RequestState::kRunning);
  one->EndRequest(request, "answer");
  EXPECT_EQ(other->BeginRequest(request).answer, "answer");
}

TEST(FeedPosition, ContinuesWhereNothingThatWasSeenIsUndone) {
  const FeedPosition before{.commit = 10, .history = 1};
  EXPECT_TRUE((FeedPosition{.commit = 10, .history = 1}).Continues(before));
  EXPECT_FALSE((FeedPosition{.commit = 9, .history = 1}).Continues(before));
  EXPECT_TRUE((FeedPosition{.commit = 12, .history = 2, .left_at = 10}).Continues(before));
  EXPECT_FALSE((FeedPosition{.commit = 12, .history = 2, .left_at = 9}).Continues(before));
  EXPECT_FALSE((FeedPosition{.commit = 30, .history = 3, .left_at = 20}).Continues(before));
}

}  // namespace
}  // namespace pliant
