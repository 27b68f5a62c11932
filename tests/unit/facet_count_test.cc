// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What lists count, and how words are compared whatever their case.
#include "index/store/facet_count.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "index/files/text.h"
#include "tests/unit/facets.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(FoldCase, LettersOfAnyWritingLoseTheirCase) {
  EXPECT_EQ(FoldCase("Rote MÜTZE"), FoldCase("rote mütze"));
  EXPECT_EQ(FoldCase("ΟΔΟΣ"), FoldCase("οδος"));
  EXPECT_EQ(FoldCase("ЧАШКА"), FoldCase("чашка"));
  EXPECT_NE(FoldCase("ß"), FoldCase("ss"));
  EXPECT_NE(FoldCase("a"), FoldCase("ä"));
  EXPECT_EQ(FoldCase("\xff").size(), 1U) << "no UTF-8 is a character, too";
  EXPECT_THAT(FoldedWords("  Red\t MUG\xE3\x80\x80x "), ElementsAre(U"red", U"mug", U"x"));
  EXPECT_THAT(FoldedWords(" \n"), IsEmpty());
}

TEST(FacetCount, CountsItemsNotEntries) {
  FacetCount count({"tags", "n"});
  for (const char* metadata :
       {R"({"tags": ["a", "b", "a"], "n": 1})", R"({"tags": "a", "n": 1.0})", R"({"n": null})",
        R"({"tags": [], "n": {"x": 1}})", R"({"n": -1, "tags": [["a"]]})"}) {
    count.BeginItem();
    count.Add(metadata);
  }
  count.BeginItem();  // of two images
  count.Add(R"({"tags": "b", "n": true})");
  count.Add(R"({"tags": "b"})");
  const std::vector<Facet> facets = count.Result();
  ASSERT_EQ(facets.size(), 2U);
  EXPECT_EQ(facets[0].key, "tags");
  EXPECT_EQ(facets[0].values.size(), 2U);
  EXPECT_EQ(CountOf(facets[0], std::string("a")), 2U);
  EXPECT_EQ(CountOf(facets[0], std::string("b")), 2U);
  EXPECT_EQ(facets[0].without, 1U);
  EXPECT_TRUE(facets[0].complete);
  EXPECT_EQ(CountOf(facets[1], std::uint64_t{1}), 2U) << "1 and 1.0 are one";
  EXPECT_EQ(CountOf(facets[1], std::int64_t{-1}), 1U);
  EXPECT_EQ(CountOf(facets[1], std::monostate{}), 1U);
  EXPECT_EQ(CountOf(facets[1], true), 1U);
  EXPECT_EQ(facets[1].without, 0U);
}

TEST(FacetCount, HoldsSoMuchInMemoryAndSaysSo) {
  FacetCount count({"n"});
  const std::string filler(5000, 'x');
  for (int i = 0; i < 1000; ++i) {
    count.BeginItem();
    count.Add(R"({"n": ")" + std::to_string(i) + filler + "\"}");
  }
  const Facet facet = count.Result().at(0);
  EXPECT_FALSE(facet.complete);
  EXPECT_EQ(facet.values.size(), kFacetValues);
  EXPECT_EQ(facet.without, 0U);
  FacetCount few({"n"});
  for (std::size_t i = 0; i <= kFacetValues; ++i) {
    few.BeginItem();
    few.Add(R"({"n": )" + std::to_string(i) + "}");
    few.BeginItem();
    few.Add(R"({"n": 7})");
  }
  const Facet listed = few.Result().at(0);
  EXPECT_FALSE(listed.complete) << "one is not listed";
  EXPECT_EQ(listed.values.front().value, FilterValue(std::uint64_t{7}));
}
}  // namespace
}  // namespace pliant::testing
