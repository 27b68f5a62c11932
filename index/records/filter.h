// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Conditions on the metadata of images: equal to one of some values or none, within bounds, there
// or not there, and what and, or and not make of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace pliant {

// null, true or false, a number, text. Values of different kinds are never equal, and neither is
// before the other. Numbers are one kind and are compared exactly, also a whole number with one
// that is not: 9007199254740993 differs from 9007199254740992, although both are the same double.
using FilterValue =
    std::variant<std::monostate, bool, double, std::string, std::int64_t, std::uint64_t>;

struct FilterBound {
  FilterValue value;  // a number or text
  bool inclusive = true;
};

// Holds for an image whose metadata have `key` at the top level with a value that passes every
// test that is set. A list passes `any_of`, `from` and `to` when one of its entries passes all
// three. An image without the key fails, but for `exists` false.
struct FilterCondition {
  std::string key;
  std::optional<std::vector<FilterValue>> any_of = {};  // equal to one of these
  std::optional<FilterBound> from = {};                 // not before it
  std::optional<FilterBound> to = {};                   // not after it; text in order of its bytes
  std::optional<FilterValue> not_equal = {};  // neither it, nor a list with an entry that is it
  std::optional<bool> exists = {};            // the key is there, whatever its value; or is not
};

// All of it must hold. Nothing: every image passes. Two conditions may have the same key;
// different entries of a list may meet them.
struct Filter {
  std::vector<FilterCondition> conditions = {};
  std::vector<Filter> all_of = {};               // and
  std::vector<std::vector<Filter>> any_of = {};  // or: of each of these, one at least
  std::vector<Filter> none_of = {};              // not

  bool empty() const {
    return conditions.empty() && all_of.empty() && any_of.empty() && none_of.empty();
  }
};

// Conditions, ands, ors and nots of a filter, at every depth.
inline constexpr std::size_t kMaxFilterTerms = 64;
inline constexpr std::size_t kMaxFilterValues = 1000;  // of one condition
inline constexpr int kMaxFilterDepth = 8;              // 1: no and, or, not
inline constexpr std::size_t kMaxFilterBytes = 64 * 1024;

// Throws kInvalidArgument "filter_invalid", which says where, for too many terms or values, for too
// deep a filter, an empty one inside of another, a condition without a test, a bound that is no
// number and no text or not finite, and for `exists` false beside other tests.
void CheckFilter(const Filter& filter);

// Whether metadata, the text of a JSON object, pass. Text that is none passes only an empty filter.
bool Passes(const Filter& filter, std::string_view metadata);

// Reads the JSON form: an object that has for each key of the metadata one value
// ("shop": "east"), or an object of tests:
//   {"in": [values]}, {"ne": value}, {"gt" | "gte" | "lt" | "lte": number or text},
//   {"exists": true or false}
// and beside the keys
//   "and": [filters], "or": [filters], "not": filter
// For example
//   {"shop": "east", "or": [{"year": {"gte": 2020, "lt": 2024}}, {"colour": {"in": ["red", 7]}}],
//    "not": {"sold": true}}
// A backslash before a name is taken off: "\\and" (in JSON) is the metadata's key "and", and a key
// that begins with one is written with two. Throws kInvalidArgument "filter_invalid" that says
// where, as in  filter.or[1].year: "in" must be a list of values
Filter ParseFilter(const std::string& json);

}  // namespace pliant
