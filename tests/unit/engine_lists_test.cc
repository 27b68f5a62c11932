// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lists: order, pages, conditions, counts. Brute force over all records is the oracle.
#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "index/files/text.h"
#include "tests/unit/engine_fixture.h"
#include "tests/unit/facets.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class ListsTest : public EngineTest {
 protected:
  // Two images for each of a few times, of a few objects, with metadata. Bytes that are stored
  // need no description, so that many images cost little.
  void Fill(Engine& engine) {
    const std::vector<std::uint8_t> png = RandomPng(1);
    const char* objects[] = {"mug", "Cup", "", "Tasse Ü"};
    for (int i = 0; i < 30; ++i) {
      AddRequest add;
      add.bytes = png;
      add.id = "p" + std::to_string(100 + (i * 7) % 30);
      add.object = objects[i % 4];
      add.source = i % 3 == 0 ? "Photo of a MÜTZE.png" : "x.png";
      add.metadata = R"({"n": )" + std::to_string(i % 5) + R"(, "tags": ["t", "u)" +
                     std::to_string(i % 2) + "\"]" + (i % 6 == 0 ? R"(, "sold": true)" : "") + "}";
      engine.Add(add);
      if (i % 2 == 1) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    ImageChange change;
    change.metadata = R"({"changed": 1})";
    for (const char* id : {"p105", "p120", "p101"}) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      engine.Change("default", id, change);
    }
  }
  static std::vector<ImageRecord> All(Engine& engine) {
    ImageListing all;
    all.limit = 1000;
    return engine.ListPage(all).records;
  }
  static std::vector<std::string> Walk(Engine& engine, ImageListing list, int limit) {
    std::vector<std::string> ids;
    list.limit = limit;
    while (true) {
      const ImagePage page = engine.ListPage(list);
      EXPECT_LE(page.records.size(), static_cast<std::size_t>(limit));
      for (const ImageRecord& record : page.records) ids.push_back(record.id);
      if (!page.next) return ids;
      EXPECT_EQ(page.records.size(), static_cast<std::size_t>(limit));
      list.after = *page.next;
    }
  }
};

TEST_F(ListsTest, PagesOfAnyOrderAndConditionAreTheWholeOnce) {
  Engine engine(Options());
  Fill(engine);
  const std::vector<ImageRecord> all = All(engine);
  ASSERT_EQ(all.size(), 30U);
  const auto key = [](ImageOrder order, const ImageRecord& r) {
    const auto time = [](std::int64_t ms) { return std::to_string(ms); };  // all of one length
    return order == ImageOrder::kCreated   ? time(r.added_ms)
           : order == ImageOrder::kUpdated ? time(r.updated_ms)
           : order == ImageOrder::kObject  ? r.object
           : order == ImageOrder::kSource  ? r.source
                                           : r.id;
  };
  std::vector<Selection> selections(7);
  selections[1].object = "mug";
  selections[2].object = "";
  selections[3].filter = ParseFilter(R"({"n": {"gte": 3}})");
  selections[4].text = "mütze PHOTO";
  selections[5].object = "Cup";
  selections[5].filter = ParseFilter(R"({"not": {"sold": true}})");
  selections[5].text = "p1";
  selections[6].object = "none";
  const auto selected = [](const Selection& which, const ImageRecord& r) {
    const auto has = [&](const std::u32string& word) {
      return (FoldCase(r.id) + U'\n' + FoldCase(r.object) + U'\n' + FoldCase(r.source))
                 .find(word) != std::u32string::npos;
    };
    const auto words = FoldedWords(which.text);
    return (!which.object || *which.object == r.object) && Passes(which.filter, r.metadata) &&
           std::all_of(words.begin(), words.end(), has);
  };
  for (const ImageOrder order : {ImageOrder::kId, ImageOrder::kCreated, ImageOrder::kUpdated,
                                 ImageOrder::kObject, ImageOrder::kSource}) {
    for (const Selection& which : selections) {
      std::vector<ImageRecord> expected;
      std::copy_if(all.begin(), all.end(), std::back_inserter(expected),
                   [&](const ImageRecord& r) { return selected(which, r); });
      std::sort(expected.begin(), expected.end(), [&](const auto& a, const auto& b) {
        return std::pair(key(order, a), a.id) < std::pair(key(order, b), b.id);
      });
      std::vector<std::string> ids;
      for (const ImageRecord& r : expected) ids.push_back(r.id);
      for (const bool descending : {false, true}) {
        if (descending) std::reverse(ids.begin(), ids.end());
        ImageListing list;
        list.which = which;
        list.order = order;
        list.descending = descending;
        for (const int limit : {1, 4, 30, 31}) {
          EXPECT_EQ(Walk(engine, list, limit), ids)
              << static_cast<int>(order) << ' ' << which.text << ' ' << descending << ' ' << limit;
        }
        list.count = true;
        EXPECT_EQ(engine.ListPage(list).total, ids.size());
      }
    }
  }
}

TEST_F(ListsTest, APageGoesOnWhereItEndedThoughImagesComeAndGo) {
  Engine engine(Options());
  Fill(engine);
  ImageListing list;
  list.order = ImageOrder::kCreated;
  list.descending = true;
  list.limit = 10;
  const ImagePage first = engine.ListPage(list);
  const std::string last = first.records.back().id;
  engine.Remove("default", last);
  Add(engine, RandomPng(2), "new", "new");
  list.after = *first.next;
  list.limit = 100;
  const ImagePage rest = engine.ListPage(list);
  EXPECT_EQ(rest.records.size(), 20U);
  for (const ImageRecord& record : rest.records) {
    EXPECT_NE(record.id, "new");
    for (const ImageRecord& before : first.records) EXPECT_NE(record.id, before.id);
  }
}

TEST_F(ListsTest, FacetsCountWhatIsListed) {
  Engine engine(Options());
  Fill(engine);
  ImageListing list;
  list.limit = 1;
  list.facets = {"n", "tags", "sold", "none"};
  list.which.filter = ParseFilter(R"({"n": {"lt": 3}})");
  const std::vector<Facet> facets = engine.ListPage(list).facets;
  ASSERT_EQ(facets.size(), 4U);
  EXPECT_EQ(facets[0].values.size(), 3U);
  EXPECT_EQ(CountOf(facets[0], std::uint64_t{2}), 6U);
  EXPECT_EQ(CountOf(facets[1], std::string("t")), 18U);
  EXPECT_EQ(CountOf(facets[2], true), 3U);
  EXPECT_EQ(facets[2].without, 15U);
  EXPECT_EQ(facets[3].without, 18U);
  EXPECT_THAT(facets[3].values, IsEmpty());
}

TEST_F(ListsTest, ObjectsComeInAnyOrderWithTheirImages) {
  Engine engine(Options());
  Fill(engine);
  Add(engine, RandomPng(1), "single", "q", R"({"n": 77, "tags": "t"})");
  struct Truth {
    std::uint64_t images = 0;
    std::int64_t created = INT64_MAX, updated = 0;
    std::string first;
  };
  std::map<std::string, Truth> truths;
  for (const ImageRecord& r : All(engine)) {
    if (r.object.empty()) continue;
    Truth& truth = truths[r.object];
    ++truth.images;
    truth.created = std::min(truth.created, r.added_ms);
    truth.updated = std::max(truth.updated, r.updated_ms);
    if (truth.first.empty() || r.id < truth.first) truth.first = r.id;
  }
  ObjectListing list;
  for (const ObjectOrder order :
       {ObjectOrder::kName, ObjectOrder::kCreated, ObjectOrder::kUpdated, ObjectOrder::kImages}) {
    for (const bool descending : {false, true}) {
      list.order = order;
      list.descending = descending;
      list.limit = 1;
      list.after.clear();
      std::vector<std::pair<std::int64_t, std::string>> seen;
      while (true) {
        const ObjectPage page = engine.ListPage(list);
        for (const ListedObject& object : page.records) {
          const Truth& truth = truths.at(object.record.object);
          EXPECT_EQ(object.record.images, truth.images);
          EXPECT_EQ(object.image_id, truth.first);
          EXPECT_EQ(object.created_ms, truth.created);
          EXPECT_EQ(object.updated_ms, truth.updated);
          seen.emplace_back(order == ObjectOrder::kName      ? 0
                            : order == ObjectOrder::kCreated ? truth.created
                            : order == ObjectOrder::kUpdated
                                ? truth.updated
                                : static_cast<std::int64_t>(truth.images),
                            object.record.object);
        }
        if (!page.next) break;
        list.after = *page.next;
      }
      ASSERT_EQ(seen.size(), truths.size());
      if (descending) std::reverse(seen.begin(), seen.end());
      EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
    }
  }
  ObjectListing some;
  some.which.filter = ParseFilter(R"({"n": 77})");
  some.count = true;
  some.facets = {"tags", "n"};
  const ObjectPage page = engine.ListPage(some);
  ASSERT_EQ(page.records.size(), 1U);
  EXPECT_EQ(page.records[0].record.object, "single");
  EXPECT_EQ(page.total, 1U);
  EXPECT_EQ(CountOf(page.facets.at(1), std::uint64_t{77}), 1U);
  ObjectListing named;
  named.which.text = "TASSE ü";
  ASSERT_EQ(engine.ListPage(named).records.size(), 1U);
  ObjectListing counted;
  counted.facets = {"tags"};
  EXPECT_EQ(CountOf(engine.ListPage(counted).facets.at(0), std::string("t")), 4U)
      << "objects, not images";
}

TEST_F(ListsTest, NamesComeInNaturalOrder) {
  Engine engine(Options());
  const std::vector<std::uint8_t> png = RandomPng(1);
  const std::vector<std::string> names = {
      "Photo 010", "Photo 9 (2)", "Photo 9 (10)",     "Photo", "Photo 10", "a12345678901234",
      "0",         "00x",         "a12345678901235b", "-1",    "Ü 2",      "Ü 11"};
  for (std::size_t i = 0; i < names.size(); ++i) {
    AddRequest add;
    add.bytes = png;
    add.id = std::string(1, static_cast<char>('a' + i));
    add.object = add.source = names[i];
    engine.Add(add);
  }
  const std::vector<std::string> wanted = {
      "-1",           "0",         "00x",      "Photo",           "Photo 9 (2)",
      "Photo 9 (10)", "Photo 010", "Photo 10", "a12345678901234", "a12345678901235b",
      "Ü 2",          "Ü 11"};
  const auto name_of = [&](const std::string& id) {
    return names.at(static_cast<std::size_t>(id[0] - 'a'));
  };
  for (const bool descending : {false, true}) {
    std::vector<std::string> expected = wanted;
    if (descending) std::reverse(expected.begin(), expected.end());
    for (const ImageOrder order : {ImageOrder::kObject, ImageOrder::kSource}) {
      ImageListing list;
      list.order = order;
      list.descending = descending;
      std::vector<std::string> seen;
      for (const std::string& id : Walk(engine, list, 1)) seen.push_back(name_of(id));
      EXPECT_EQ(seen, expected);
    }
    ObjectListing list;
    list.descending = descending;
    list.limit = 1;
    std::vector<std::string> seen;
    do {
      const ObjectPage page = engine.ListPage(list);
      seen.push_back(page.records.at(0).record.object);
      list.after = page.next.value_or("");
    } while (!list.after.empty());
    EXPECT_EQ(seen, expected);
  }
}

TEST_F(ListsTest, ImagesComeInTheOrderOfAFieldOfTheirMetadata) {
  Engine engine(Options());
  const std::vector<std::uint8_t> png = RandomPng(1);
  // In this order; the first six are equal.
  const std::vector<std::string> metadata = {"{}",
                                             R"({"v":null})",
                                             R"({"v":[1]})",
                                             R"({"v":{"v":1}})",
                                             R"({"other":1})",
                                             R"({"v":[]})",
                                             R"({"v":false})",
                                             R"({"v":true})",
                                             R"({"v":-1e300})",
                                             R"({"v":-10})",
                                             R"({"v":-9.5})",
                                             R"({"v":0})",
                                             R"({"v":2})",
                                             R"({"v":10})",
                                             R"({"v":18446744073709551615})",
                                             R"({"v":1e300})",
                                             R"({"v":""})",
                                             R"({"v":"\u0000"})",
                                             R"({"v":"\u0001"})",
                                             R"({"v":"10"})",
                                             R"({"v":"A 2"})",
                                             R"({"v":"A 10"})",
                                             R"({"v":"a"})",
                                             R"({"v":"ü"})"};
  std::vector<std::string> ids;
  for (std::size_t i = 0; i < metadata.size(); ++i) {
    AddRequest add;
    add.bytes = png;
    add.id = (i < 6 ? "a" : std::string(1, static_cast<char>('z' - i))) + std::to_string(i);
    add.metadata = metadata[i];
    engine.Add(add);
    ids.push_back(*add.id);
  }
  ImageListing list;
  list.order = ImageOrder::kMetadata;
  list.order_key = "v";
  EXPECT_EQ(Walk(engine, list, 1), ids);
  EXPECT_EQ(Walk(engine, list, 50), ids);
  std::reverse(ids.begin(), ids.end());
  list.descending = true;
  EXPECT_EQ(Walk(engine, list, 1), ids);
}

TEST_F(ListsTest, TextIsFoundByItsBeginningAndByAPart) {
  Engine engine(Options());
  const std::vector<std::uint8_t> png = RandomPng(1);
  const std::map<std::string, std::string> all = {{"a", R"({"v":"MÜTZE 10%"})"},
                                                  {"b", R"({"v":["red","Mützenband"]})"},
                                                  {"c", R"({"v":"die mütze"})"},
                                                  {"d", R"({"v":10})"},
                                                  {"e", "{}"}};
  for (const auto& [id, metadata] : all) {
    AddRequest add;
    add.bytes = png;
    add.id = id;
    add.metadata = metadata;
    engine.Add(add);
  }
  for (const std::string filter :
       {R"({"v":{"prefix":"mütze"}})", R"({"v":{"contains":"mütze"}})",
        R"({"v":{"contains":"0%"}})", R"({"v":{"prefix":"1"}})",
        R"({"v":{"prefix":"RED","contains":"band"}})", R"({"v":{"prefix":"m","ne":"red"}})",
        R"({"not":{"v":{"contains":"m"}}})", R"({"v":{"in":["red"],"prefix":"r"}})",
        R"({"v":{"contains":"\u0000"}})"}) {
    ImageListing list;
    list.which.filter = ParseFilter(filter);
    std::vector<std::string> expected;
    for (const auto& [id, metadata] : all) {
      if (Passes(list.which.filter, metadata)) expected.push_back(id);
    }
    EXPECT_EQ(Walk(engine, list, 10), expected) << filter;
  }
}

TEST_F(ListsTest, RemovesWhatIsSelectedAndNoMore) {
  Engine engine(Options());
  Fill(engine);
  Train(engine);
  Selection which;
  ExpectError(ErrorCode::kInvalidArgument, "selection_empty", [&] { engine.RemoveWhere(which); });
  which.filter = ParseFilter(R"({"n": {"in": [0, 1]}})");
  which.object = "mug";
  const std::vector<ImageRecord> before = All(engine);
  const auto gone = [&](const ImageRecord& r) {
    return r.object == "mug" && Passes(which.filter, r.metadata);
  };
  const auto expected =
      static_cast<std::uint64_t>(std::count_if(before.begin(), before.end(), gone));
  ASSERT_GT(expected, 0U);
  EXPECT_EQ(engine.RemoveWhere(which), expected);
  for (const ImageRecord& r : All(engine)) EXPECT_FALSE(gone(r)) << r.id;
  EXPECT_EQ(engine.GetCollection("default").images, 30 - expected);
  EXPECT_EQ(engine.RemoveWhere(which), 0U);
  which.object.reset();
  which.filter = ParseFilter(R"({"n": {"gte": 0}})");
  EXPECT_EQ(engine.RemoveWhere(which), 30 - expected);
  EXPECT_EQ(engine.GetCollection("default").images, 0U);
  EXPECT_EQ(engine.GetCollection("default").objects, 0U) << "objects without images are gone";
  EXPECT_THAT(engine.Check(), IsEmpty());
  which.collection = "nowhere";
  ExpectError(ErrorCode::kNotFound, "collection_not_found", [&] { engine.RemoveWhere(which); });
}

TEST_F(ListsTest, WhatIsNoListIsNamed) {
  Engine engine(Options());
  Fill(engine);
  const auto refused = [&](const std::string& reason, const ImageListing& list) {
    ExpectError(ErrorCode::kInvalidArgument, reason, [&] { engine.ListPage(list); });
  };
  ImageListing list;
  list.limit = 0;
  refused("limit_invalid", list);
  list = {};
  list.which.text = "\xff";
  refused("text_invalid", list);
  list.which.text = std::string(kMaxTextBytes + 1, 'x');
  refused("text_invalid", list);
  list = {};
  list.facets = {"a", "a"};
  refused("facets_invalid", list);
  list.facets.clear();
  for (std::size_t i = 0; i <= kMaxFacets; ++i) list.facets.push_back(std::to_string(i));
  refused("facets_invalid", list);
  for (const char* after : {"x", "[]", "[1, 2]", R"([1, "p1"])", R"(["a", "b", "c"])"}) {
    list = {};
    list.after = after;
    refused("after_invalid", list);
  }
  list.order = ImageOrder::kCreated;
  list.after = R"(["text", "p1"])";
  refused("after_invalid", list);
  list = {};
  list.which.filter.conditions.push_back({.key = "x"});
  refused("filter_invalid", list);
}

}  // namespace
}  // namespace pliant::testing
