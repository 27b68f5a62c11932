// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Conditions on the metadata of images: equality, bounds and existence, combined by and, or and
// not.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace pliant {

// null, true or false, a number, text. Values of different kinds are never equal and have no order.
// All numbers are one kind and are compared exactly: 9007199254740993 differs from
// 9007199254740992, although both are the same double.
using FilterValue =
    std::variant<std::monostate, bool, double, std::string, std::int64_t, std::uint64_t>;

struct FilterBound {
  FilterValue value;  // a number or text
  bool inclusive = true;
};

// Matches an image whose metadata have `key` at the top level with a value that passes all given
// tests. A list passes `any_of`, `from`, `to`, `prefix` and `contains` if one of its entries passes
// all of them. An image without the key passes only `exists` false.
struct FilterCondition {
  std::string key;
  std::optional<std::vector<FilterValue>> any_of = {};  // equal to one of these
  std::optional<FilterBound> from = {};                 // at least this
  std::optional<FilterBound> to = {};                   // at most this; text in order of its bytes
  std::optional<std::string> prefix = {};               // text that begins with this, in any case
  std::optional<std::string> contains = {};             // text that contains this, in any case
  std::optional<FilterValue> not_equal = {};            // neither this, nor a list that has this
  std::optional<bool> exists = {};                      // whether the key exists, with any value

  bool tests_entries() const { return any_of || from || to || prefix || contains; }
};

// All parts must match. An empty filter matches every image. Two conditions can have the same key;
// different entries of a list can pass them.
struct Filter {
  std::vector<FilterCondition> conditions = {};
  std::vector<Filter> all_of = {};               // and
  std::vector<std::vector<Filter>> any_of = {};  // or: at least one of each list
  std::vector<Filter> none_of = {};              // not

  bool empty() const {
    return conditions.empty() && all_of.empty() && any_of.empty() && none_of.empty();
  }
};

// Number of conditions, ands, ors and nots of a filter, at all depths.
inline constexpr std::size_t kMaxFilterTerms = 64;
inline constexpr std::size_t kMaxFilterValues = 1000;  // of one condition
inline constexpr int kMaxFilterDepth = 8;              // 1 = no and, or, not
inline constexpr std::size_t kMaxFilterBytes = 64 * 1024;

// Throws kInvalidArgument "filter_invalid" with the position: too many terms or values, too deep,
// an empty filter inside another, a condition without a test, a bound that is not text or a finite
// number, or `exists` false with other tests.
void CheckFilter(const Filter& filter);

// Whether metadata (the text of a JSON object) pass. Other text passes only an empty filter.
bool Passes(const Filter& filter, std::string_view metadata);

// Text whose bytes are in the order of the values of `key` in such metadata: images without the key
// and other values first, then false and true, numbers, and text in natural order.
std::string MetadataOrder(std::string_view metadata, const std::string& key);

// Reads the JSON form: an object that has for each key of the metadata one value ("shop": "east"),
// or an object of tests:
//   {"in": [values]}, {"ne": value}, {"gt" | "gte" | "lt" | "lte": number or text},
//   {"prefix": text}, {"contains": text}, {"exists": true or false}
// and in addition to the keys
//   "and": [filters], "or": [filters], "not": filter
// For example
//   {"shop": "east", "or": [{"year": {"gte": 2020, "lt": 2024}}, {"colour": {"in": ["red", 7]}}],
//    "not": {"sold": true}}
// A backslash before a name is removed: "\\and" (in JSON) is the metadata's key "and". Write a key
// that begins with a backslash with two. Throws kInvalidArgument "filter_invalid" with the
// position, as in filter.or[1].year: "in" must be a list of values
Filter ParseFilter(const std::string& json);

}  // namespace pliant
