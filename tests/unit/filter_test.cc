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
  refused(R"({"a": {"gt": 1, "gte": 2}})", "two bounds");
  refused(R"({"a": {"in": [[[[1]]]]}})", "deep");
  refused(R"({"a": )" + std::string(3000, '1') + "}", "JSON object");  // no finite number
  std::string many = R"({"a": {"in": [0)";
  for (std::size_t i = 0; i < kMaxFilterValues; ++i) many += ",1";
  refused(many + "]}}", "more than 1000");
  Filter filter;
  filter.conditions.push_back({"a", {}, FilterBound{std::nan(""), true}, {}});
  ExpectError(ErrorCode::kInvalidArgument, "filter_invalid", [&] { CheckFilter(filter); });
}

}  // namespace
}  // namespace pliant
