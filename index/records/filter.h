// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Conditions on the metadata of pictures: equal to one of some values, or within bounds.
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

// Holds for a picture whose metadata have `key` at the top level with a value that passes every
// test that is set. A list passes when one of its entries does. A picture without the key fails.
struct FilterCondition {
  std::string key;
  std::optional<std::vector<FilterValue>> any_of;  // equal to one of these
  std::optional<FilterBound> from;                 // not before it
  std::optional<FilterBound> to;                   // not after it; text in order of its bytes
};

// All conditions must hold. No conditions: every picture passes. Two conditions may have the same
// key; different entries of a list may meet them.
struct Filter {
  std::vector<FilterCondition> conditions;

  bool empty() const { return conditions.empty(); }
};

inline constexpr std::size_t kMaxFilterConditions = 64;
inline constexpr std::size_t kMaxFilterValues = 1000;  // of one condition

// Throws kInvalidArgument "filter_invalid" for too many conditions or values, a condition without a
// test, a bound that is no number and no text or not finite.
void CheckFilter(const Filter& filter);

// Whether metadata, the text of a JSON object, pass. Text that is none does not.
bool Passes(const Filter& filter, std::string_view metadata);

// Reads the JSON form: an object that has for each key one value ("shop": "east"), or an object of
// tests: {"in": [values]}, {"gt" | "gte" | "lt" | "lte": number or text}. For example
//   {"shop": "east", "year": {"gte": 2020, "lt": 2024}, "colour": {"in": ["red", "blue"]}}
// Throws kInvalidArgument "filter_invalid" that names the key and what is wrong with it.
Filter ParseFilter(const std::string& json);

}  // namespace pliant
