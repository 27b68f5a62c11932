// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/records/filter.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "tests/unit/expect_error.h"

namespace pliant {
namespace {

using testing::ExpectError;

bool Pass(const std::string& filter, const std::string& metadata) {
  return Passes(ParseFilter(filter), metadata);
}

TEST(Filter, EqualValuesOfTheSameKindPass) {
  EXPECT_TRUE(Pass(R"({"shop": "east"})", R"({"shop": "east", "n": 1})"));
  EXPECT_FALSE(Pass(R"({"shop": "east"})", R"({"shop": "West"})"));
  EXPECT_FALSE(Pass(R"({"shop": "east"})", R"({"n": 1})"));
  EXPECT_TRUE(Pass(R"({"n": 1})", R"({"n": 1.0})"));
  EXPECT_FALSE(Pass(R"({"n": 1})", R"({"n": "1"})"));
  EXPECT_FALSE(Pass(R"({"n": 1})", R"({"n": true})"));
  EXPECT_FALSE(Pass(R"({"n": 0})", R"({"n": null})"));
  EXPECT_TRUE(Pass(R"({"n": null})", R"({"n": null})"));
  EXPECT_FALSE(Pass(R"({"n": null})", "{}"));
  EXPECT_TRUE(Pass(R"({"sold": false})", R"({"sold": false})"));
  EXPECT_FALSE(Pass(R"({"n": 1})", R"({"n": {"n": 1}})"));
  EXPECT_TRUE(Pass(R"({"größe": "ß"})", R"({"größe": "ß"})"));
}

TEST(Filter, NumbersAreComparedExactly) {
  // Two to the power of 53, and the next number: the same double.
  EXPECT_FALSE(Pass(R"({"n": 9007199254740992})", R"({"n": 9007199254740993})"));
  EXPECT_TRUE(Pass(R"({"n": 9007199254740993})", R"({"n": 9007199254740993})"));
  EXPECT_FALSE(Pass(R"({"n": {"in": [9007199254740992]}})", R"({"n": 9007199254740993})"));
  EXPECT_TRUE(Pass(R"({"n": {"gt": 9007199254740992}})", R"({"n": 9007199254740993})"));
  EXPECT_FALSE(Pass(R"({"n": {"lte": 9007199254740992}})", R"({"n": 9007199254740993})"));
  EXPECT_FALSE(Pass(R"({"n": -9007199254740992})", R"({"n": -9007199254740993})"));
  EXPECT_TRUE(Pass(R"({"n": {"lt": -9007199254740992}})", R"({"n": -9007199254740993})"));
  EXPECT_FALSE(Pass(R"({"n": 18446744073709551614})", R"({"n": 18446744073709551615})"));
  EXPECT_TRUE(Pass(R"({"n": {"gt": 9223372036854775807}})", R"({"n": 18446744073709551615})"));
  EXPECT_TRUE(Pass(R"({"n": {"gt": -1}})", R"({"n": 18446744073709551615})"));
  // Whole numbers beside others.
  EXPECT_TRUE(Pass(R"({"n": 9007199254740992.0})", R"({"n": 9007199254740992})"));
  EXPECT_FALSE(Pass(R"({"n": 9007199254740992.0})", R"({"n": 9007199254740993})"));
  EXPECT_TRUE(Pass(R"({"n": {"lt": 2.5}})", R"({"n": 2})"));
  EXPECT_TRUE(Pass(R"({"n": {"gt": -2.5}})", R"({"n": -2})"));
  EXPECT_FALSE(Pass(R"({"n": {"gt": -2.5}})", R"({"n": -3})"));
  EXPECT_TRUE(Pass(R"({"n": {"gt": 2}})", R"({"n": 2.5})"));
  EXPECT_TRUE(Pass(R"({"n": {"lt": 1e300}})", R"({"n": 18446744073709551615})"));
  EXPECT_TRUE(Pass(R"({"n": {"gt": -1e300}})", R"({"n": -9223372036854775808})"));
  EXPECT_FALSE(Pass(R"({"n": 18446744073709551616.0})", R"({"n": 18446744073709551615})"));
  EXPECT_FALSE(Pass(R"({"n": 1})", R"({"n": true})"));
}

TEST(Filter, InAndBounds) {
  const std::string in = R"({"colour": {"in": ["red", 7, null]}})";
  EXPECT_TRUE(Pass(in, R"({"colour": "red"})"));
  EXPECT_TRUE(Pass(in, R"({"colour": 7})"));
  EXPECT_TRUE(Pass(in, R"({"colour": null})"));
  EXPECT_FALSE(Pass(in, R"({"colour": "blue"})"));
  EXPECT_FALSE(Pass(R"({"colour": {"in": []}})", R"({"colour": "blue"})"));
  for (const auto& [year, inside] :
       {std::pair{2019.9, false}, {2020, true}, {2023, true}, {2024, false}}) {
    EXPECT_EQ(
        Pass(R"({"year": {"gte": 2020, "lt": 2024}})", "{\"year\": " + std::to_string(year) + "}"),
        inside)
        << year;
    EXPECT_EQ(Pass(R"({"year": {"gt": 2019.9, "lte": 2023}})",
                   "{\"year\": " + std::to_string(year) + "}"),
              inside)
        << year;
  }
  EXPECT_FALSE(Pass(R"({"year": {"gte": 2020}})", R"({"year": "2021"})"));
  EXPECT_TRUE(Pass(R"({"day": {"gte": "2024-05-01"}})", R"({"day": "2024-11-30"})"));
  EXPECT_FALSE(Pass(R"({"day": {"gt": "2024-05-01"}})", R"({"day": "2024-05-01"})"));
  EXPECT_TRUE(Pass(R"({"n": {"in": [1, 5], "gt": 3}})", R"({"n": 5})"));
  EXPECT_FALSE(Pass(R"({"n": {"in": [1, 5], "gt": 3}})", R"({"n": 1})"));
}

TEST(Filter, OneEntryOfAListIsEnoughAndAllKeysMustHold) {
  EXPECT_TRUE(Pass(R"({"tags": "new"})", R"({"tags": ["old", "new"]})"));
  EXPECT_FALSE(Pass(R"({"tags": "new"})", R"({"tags": ["old", ["new"]]})"));
  EXPECT_FALSE(Pass(R"({"tags": "new"})", R"({"tags": []})"));
  // 1 and 9 are outside, and no entry is on both sides.
  EXPECT_FALSE(Pass(R"({"n": {"gt": 2, "lt": 8}})", R"({"n": [1, 9]})"));
  EXPECT_FALSE(Pass(R"({"a": 1, "b": 2})", R"({"a": 1, "b": 3})"));
  EXPECT_TRUE(Pass(R"({"a": 1, "b": 2})", R"({"a": 1, "b": 2})"));
  EXPECT_TRUE(Pass("{}", R"({"a": 1})"));
  EXPECT_FALSE(Passes(ParseFilter(R"({"a": 1})"), "no JSON"));
}

TEST(Filter, TextByItsBeginningOrAPart) {
  EXPECT_TRUE(Pass(R"({"v": {"prefix": "mü"}})", R"({"v": "MÜTZE"})"));
  EXPECT_FALSE(Pass(R"({"v": {"prefix": "tze"}})", R"({"v": "MÜTZE"})"));
  EXPECT_TRUE(Pass(R"({"v": {"contains": "tZe"}})", R"({"v": ["x", "MÜTZE"]})"));
  EXPECT_FALSE(Pass(R"({"v": {"contains": "%"}})", R"({"v": "MÜTZE"})"));
  EXPECT_FALSE(Pass(R"({"v": {"contains": "1"}})", R"({"v": 10})")) << "a number is no text";
  EXPECT_FALSE(Pass(R"({"v": {"prefix": "r", "contains": "b"}})", R"({"v": ["red", "ab"]})"));
  EXPECT_FALSE(Pass(R"({"v": {"contains": "x"}})", "{}"));
  for (const char* filter : {R"({"v": {"prefix": 1}})", R"({"v": {"contains": ""}})"}) {
    ExpectError(ErrorCode::kInvalidArgument, "filter_invalid", [&] { ParseFilter(filter); });
  }
}

TEST(Filter, NotEqual) {
  const std::string ne = R"({"colour": {"ne": "red"}})";
  EXPECT_TRUE(Pass(ne, R"({"colour": "blue"})"));
  EXPECT_FALSE(Pass(ne, R"({"colour": "red"})"));
  EXPECT_TRUE(Pass(ne, R"({"colour": 7})"));
  EXPECT_TRUE(Pass(ne, R"({"colour": null})"));
  EXPECT_FALSE(Pass(ne, R"({"shade": "blue"})")) << "an image without the key";
  EXPECT_TRUE(Pass(ne, R"({"colour": ["blue", "green"]})"));
  EXPECT_FALSE(Pass(ne, R"({"colour": ["blue", "red"]})")) << "no entry may be it";
  EXPECT_TRUE(Pass(ne, R"({"colour": []})"));
  EXPECT_TRUE(Pass(ne, R"({"colour": {"red": "red"}})"));
  EXPECT_FALSE(Pass(R"({"n": {"ne": null}})", R"({"n": null})"));
  EXPECT_TRUE(Pass(R"({"n": {"ne": 9007199254740992}})", R"({"n": 9007199254740993})"));
  EXPECT_FALSE(Pass(R"({"n": {"ne": 1}})", R"({"n": 1.0})"));
  EXPECT_TRUE(Pass(R"({"n": {"ne": 4, "gt": 3}})", R"({"n": [1, 5]})"));
  EXPECT_FALSE(Pass(R"({"n": {"ne": 4, "gt": 3}})", R"({"n": [4, 5]})"));
}

TEST(Filter, Exists) {
  for (const char* there : {R"({"n": 0})", R"({"n": null})", R"({"n": []})", R"({"n": {}})"}) {
    EXPECT_TRUE(Pass(R"({"n": {"exists": true}})", there)) << there;
    EXPECT_FALSE(Pass(R"({"n": {"exists": false}})", there)) << there;
  }
  EXPECT_FALSE(Pass(R"({"n": {"exists": true}})", R"({"m": {"n": 1}})"));
  EXPECT_TRUE(Pass(R"({"n": {"exists": false}})", R"({"m": {"n": 1}})"));
  EXPECT_FALSE(Passes(ParseFilter(R"({"n": {"exists": false}})"), "no JSON"));
  EXPECT_TRUE(Pass(R"({"n": {"exists": true, "gt": 1}})", R"({"n": 2})"));
}

TEST(Filter, AndOrNot) {
  const std::string either = R"({"or": [{"shop": "east"}, {"year": {"lt": 2000}, "sold": true}]})";
  EXPECT_TRUE(Pass(either, R"({"shop": "east"})"));
  EXPECT_TRUE(Pass(either, R"({"year": 1999, "sold": true})"));
  EXPECT_FALSE(Pass(either, R"({"year": 1999, "sold": false})"));
  const std::string both = R"({"n": {"gt": 0}, "and": [{"n": {"gt": 2}}, {"n": {"lt": 8}}]})";
  EXPECT_TRUE(Pass(both, R"({"n": [1, 9]})")) << "different entries meet them";
  EXPECT_FALSE(Pass(both, R"({"n": 1})"));
  EXPECT_FALSE(Pass(both, R"({"n": 9})"));
  EXPECT_TRUE(Pass(R"({"not": {"n": 1}})", "{}")) << "not negates all of it";
  EXPECT_FALSE(Pass(R"({"not": {"n": 1}})", R"({"n": 1})"));
  EXPECT_TRUE(Pass(R"({"not": {"n": 1, "m": 2}})", R"({"n": 1})"));
  EXPECT_FALSE(Passes(ParseFilter(R"({"not": {"n": 1}})"), "no JSON"));
  EXPECT_TRUE(Pass(R"({"a": 1, "or": [{"b": 2}, {"b": 3}], "not": {"c": 4}})",
                   R"({"a": 1, "b": 3, "c": 5})"));
  EXPECT_FALSE(Pass(R"({"a": 1, "or": [{"b": 2}, {"b": 3}], "not": {"c": 4}})",
                    R"({"a": 1, "b": 3, "c": 4})"));
  EXPECT_FALSE(Pass(R"({"a": 1, "or": [{"b": 2}, {"b": 3}], "not": {"c": 4}})",
                    R"({"a": 2, "b": 3, "c": 5})"));
  EXPECT_TRUE(Pass(R"({"not": {"or": [{"a": 1}, {"not": {"b": 2}}]}})", R"({"a": 2, "b": 2})"));
}

TEST(Filter, AnyKeyCanBeNamed) {
  EXPECT_TRUE(Pass(R"({"\\and": 1})", R"({"and": 1})"));
  EXPECT_TRUE(Pass(R"({"\\not": {"gt": 1}})", R"({"not": 2})"));
  EXPECT_TRUE(Pass(R"({"\\\\x": 1})", R"({"\\x": 1})"));
  EXPECT_TRUE(Pass(R"({"in": 1, "exists": 2})", R"({"in": 1, "exists": 2})"));
  EXPECT_TRUE(Pass(R"({"": 1})", R"({"": 1})"));
}

TEST(Filter, DepthAndNumberOfTermsHaveLimits) {
  const auto nested = [](int nots) {
    std::string filter = R"({"n": {"in": [1]}})";
    for (int i = 0; i < nots; ++i) filter = R"({"not": )" + filter + "}";
    return filter;
  };
  const auto ors = [](int depth) {
    std::string filter = R"({"n": {"in": [1]}})";
    for (int i = 0; i < depth; ++i) filter = R"({"or": [)" + filter + "]}";
    return filter;
  };
  EXPECT_EQ(Pass(nested(kMaxFilterDepth - 1), R"({"n": 1})"), kMaxFilterDepth % 2 == 1);
  EXPECT_TRUE(Pass(ors(kMaxFilterDepth - 1), R"({"n": 1})"));
  for (const std::string& deep :
       {nested(kMaxFilterDepth), ors(kMaxFilterDepth), nested(5000), ors(5000)}) {
    ExpectError(ErrorCode::kInvalidArgument, "filter_invalid", [&] { ParseFilter(deep); });
  }
  const auto many = [](std::size_t terms) {
    std::string filter = R"({"or": [{"n": 0})";
    for (std::size_t i = 2; i < terms; ++i) filter += R"(,{"n": )" + std::to_string(i) + "}";
    return filter + "]}";
  };
  EXPECT_TRUE(Pass(many(kMaxFilterTerms), R"({"n": 5})"));
  ExpectError(ErrorCode::kInvalidArgument, "filter_invalid",
              [&] { ParseFilter(many(kMaxFilterTerms + 1)); });
  Filter filter;  // not read from text
  filter.conditions.push_back({.key = "n", .exists = true});
  for (int i = 0; i < kMaxFilterDepth; ++i) filter = Filter{.none_of = {filter}};
  ExpectError(ErrorCode::kInvalidArgument, "filter_invalid", [&] { CheckFilter(filter); });
  ExpectError(ErrorCode::kInvalidArgument, "filter_invalid",
              [&] { CheckFilter(Filter{.any_of = {{}}}); });
}

TEST(Filter, WhatIsNoFilterIsNamed) {
  const auto refused = [](const std::string& text, const std::string& part) {
    try {
      ParseFilter(text);
      ADD_FAILURE() << text << " was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "filter_invalid");
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  refused("", "JSON object");
  refused("[1]", "JSON object");
  refused("{\"a\": ", "JSON object");
  refused(R"({"a": [1, 2]})", "\"in\"");
  refused(R"({"a": {}})", "no test");
  refused(R"({"a": {"like": "x"}})", "like");
  refused(R"({"a": {"in": 3}})", "list");
  refused(R"({"a": {"in": [[3]]}})", "\"in\" must list");
  refused(R"({"a": {"gt": true}})", "number or text");
  refused(R"({"a": {"gt": [1]}})", "number or text");
  refused(R"({"a": {"gt": 1, "gte": 2}})", "one lower bound");
  refused(R"({"a": {"in": [[[[1]]]]}})", "\"in\" must list");
  refused(R"({"a": )" + std::string(30, '[') + std::string(30, ']') + "}", "deep");
  refused(R"({"a": {"ne": [1]}})", "filter.a: \"ne\"");
  refused(R"({"a": {"exists": 1}})", "filter.a: \"exists\"");
  refused(R"({"a": {"exists": false, "ne": 1}})", "cannot be combined");
  refused(R"({"and": {"a": 1}})", "filter.and: must be a list");
  refused(R"({"or": []})", "filter.or: must have at least one");
  refused(R"({"and": []})", "filter.and: must have at least one");
  refused(R"({"or": "x"})", "filter.or: must be a list");
  refused(R"({"not": 3})", "filter.not: must be a JSON object");
  refused(R"({"not": {}})", "filter.not: must not be empty");
  refused(R"({"or": [{"a": 1}, {}]})", "filter.or[1]: must not be empty");
  refused(R"({"or": [{"a": 1}, 7]})", "filter.or[1]: must be a JSON object");
  refused(R"({"a": 1, "or": [{"a": 1}, {"not": {"year": {"in": 3}}}]})",
          "filter.or[1].not.year: \"in\" must be a list");
  refused(R"({"a": 1, "a": 2})", "\"a\" twice");
  refused(R"({"a": {"gt": 1, "gt": 2}})", "\"gt\" twice");
  refused(R"({"a": {"gt": NaN}})", "JSON object");
  refused("{\"a\": \"\xff\"}", "JSON object");
  refused(R"({"a": )" + std::string(3000, '1') + "}", "JSON object");  // no finite number
  std::string many = R"({"a": {"in": [0)";
  for (std::size_t i = 0; i < kMaxFilterValues; ++i) many += ",1";
  refused(many + "]}}", "at most 1000");
  Filter filter;
  filter.conditions.push_back({.key = "a", .from = FilterBound{std::nan(""), true}});
  ExpectError(ErrorCode::kInvalidArgument, "filter_invalid", [&] { CheckFilter(filter); });
}

}  // namespace
}  // namespace pliant
