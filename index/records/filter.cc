// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/records/filter.h"

#include <algorithm>
#include <cmath>
#include <compare>
#include <limits>
#include <type_traits>
#include <utility>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "index/files/text.h"

namespace pliant {
namespace {

using Json = nlohmann::json;

constexpr int kDeepest = 4;  // filter, tests, list of values, and what does not belong there
constexpr std::size_t kMaxFilterBytes = 64 * 1024;

[[noreturn]] void ThrowInvalid(const std::string& message) {
  throw Error(ErrorCode::kInvalidArgument, "filter_invalid", "filter " + message);
}

// Nothing for a list or an object.
std::optional<FilterValue> ValueOf(const Json& json) {
  if (json.is_null()) return FilterValue(std::monostate{});
  if (json.is_boolean()) return FilterValue(json.get<bool>());
  if (json.is_number_unsigned()) return FilterValue(json.get<std::uint64_t>());
  if (json.is_number_integer()) return FilterValue(json.get<std::int64_t>());
  if (json.is_number()) return FilterValue(json.get<double>());
  if (json.is_string()) return FilterValue(json.get_ref<const std::string&>());
  return std::nullopt;
}

bool IsNumber(const FilterValue& value) {
  return std::holds_alternative<double>(value) || std::holds_alternative<std::int64_t>(value) ||
         std::holds_alternative<std::uint64_t>(value);
}

// Exact, where a conversion to double would round: the whole part is compared as an integer, and
// only where that is equal the fraction decides.
template <typename Integer>
std::partial_ordering CompareInteger(Integer a, double b) {
  if (std::isnan(b)) return std::partial_ordering::unordered;
  // Both bounds are powers of two (or 0) and so doubles without rounding.
  constexpr auto kLowest = static_cast<double>(std::numeric_limits<Integer>::min());
  const double above = std::ldexp(1.0, std::numeric_limits<Integer>::digits);
  if (b < kLowest) return std::partial_ordering::greater;
  if (b >= above) return std::partial_ordering::less;
  const double whole = std::trunc(b);
  const auto integer = static_cast<Integer>(whole);
  if (a != integer) return a <=> integer;
  return 0.0 <=> (b - whole);
}

std::partial_ordering Flipped(std::partial_ordering order) { return 0 <=> order; }

std::partial_ordering CompareNumbers(const FilterValue& a, const FilterValue& b) {
  return std::visit(
      [](const auto& x, const auto& y) -> std::partial_ordering {
        using X = std::decay_t<decltype(x)>;
        using Y = std::decay_t<decltype(y)>;
        if constexpr (!std::is_arithmetic_v<X> || !std::is_arithmetic_v<Y>) {
          return std::partial_ordering::unordered;
        } else if constexpr (std::is_same_v<X, bool> || std::is_same_v<Y, bool>) {
          return std::partial_ordering::unordered;
        } else if constexpr (std::is_same_v<X, double> && std::is_same_v<Y, double>) {
          return x <=> y;
        } else if constexpr (std::is_same_v<Y, double>) {
          return CompareInteger(x, y);
        } else if constexpr (std::is_same_v<X, double>) {
          return Flipped(CompareInteger(y, x));
        } else {
          if (std::cmp_less(x, y)) return std::partial_ordering::less;
          return std::cmp_equal(x, y) ? std::partial_ordering::equivalent
                                      : std::partial_ordering::greater;
        }
      },
      a, b);
}

std::partial_ordering Compare(const FilterValue& a, const FilterValue& b) {
  if (IsNumber(a) && IsNumber(b)) return CompareNumbers(a, b);
  if (a.index() != b.index()) return std::partial_ordering::unordered;
  if (const auto* text = std::get_if<std::string>(&a)) return *text <=> std::get<std::string>(b);
  return a == b ? std::partial_ordering::equivalent : std::partial_ordering::unordered;
}

bool PassesValue(const FilterCondition& condition, const FilterValue& value) {
  if (condition.any_of &&
      std::none_of(condition.any_of->begin(), condition.any_of->end(),
                   [&](const FilterValue& wanted) { return Compare(value, wanted) == 0; })) {
    return false;
  }
  if (condition.from) {
    const auto order = Compare(value, condition.from->value);
    if (!(order > 0 || (condition.from->inclusive && order == 0))) return false;
  }
  if (condition.to) {
    const auto order = Compare(value, condition.to->value);
    if (!(order < 0 || (condition.to->inclusive && order == 0))) return false;
  }
  return true;
}

bool PassesJson(const FilterCondition& condition, const Json& value) {
  if (value.is_array()) {
    return std::any_of(value.begin(), value.end(), [&](const Json& entry) {
      const auto scalar = ValueOf(entry);
      return scalar && PassesValue(condition, *scalar);
    });
  }
  const auto scalar = ValueOf(value);
  return scalar && PassesValue(condition, *scalar);
}

void CheckBound(const std::string& key, const std::optional<FilterBound>& bound) {
  if (!bound) return;
  const auto* number = std::get_if<double>(&bound->value);
  const bool finite = number == nullptr || std::isfinite(*number);
  if ((IsNumber(bound->value) && finite) || std::holds_alternative<std::string>(bound->value)) {
    return;
  }
  ThrowInvalid("key \"" + key + "\": a bound must be a number or text");
}

std::vector<FilterValue> ReadList(const std::string& key, const Json& list) {
  if (!list.is_array()) ThrowInvalid("key \"" + key + "\": \"in\" must be a list of values");
  std::vector<FilterValue> values;
  for (const Json& entry : list) {
    const auto value = ValueOf(entry);
    if (!value)
      ThrowInvalid("key \"" + key + "\": \"in\" must list numbers, text, true, false or null");
    values.push_back(*value);
  }
  return values;
}

void SetBound(const std::string& key, const std::string& test, const Json& json,
              std::optional<FilterBound>* bound) {
  const auto value = ValueOf(json);
  if (!value) ThrowInvalid("key \"" + key + "\": \"" + test + "\" must be a number or text");
  if (*bound) ThrowInvalid("key \"" + key + "\" has two bounds on one side");
  *bound = FilterBound{*value, test.size() == 3};  // gte, lte
}

FilterCondition ReadCondition(const std::string& key, const Json& json) {
  FilterCondition condition;
  condition.key = key;
  if (const auto value = ValueOf(json)) {
    condition.any_of = {*value};
    return condition;
  }
  if (!json.is_object()) {
    ThrowInvalid("key \"" + key +
                 "\" must have a value or tests; for one of several: {\"in\": [...]}");
  }
  for (const auto& [test, argument] : json.items()) {
    if (test == "in") {
      condition.any_of = ReadList(key, argument);
    } else if (test == "gt" || test == "gte") {
      SetBound(key, test, argument, &condition.from);
    } else if (test == "lt" || test == "lte") {
      SetBound(key, test, argument, &condition.to);
    } else {
      ThrowInvalid("key \"" + key + "\" has the test \"" + ToDisplayText(test.substr(0, 32)) +
                   "\"; there are in, gt, gte, lt and lte");
    }
  }
  return condition;
}

}  // namespace

void CheckFilter(const Filter& filter) {
  if (filter.conditions.size() > kMaxFilterConditions) {
    ThrowInvalid("has more than " + std::to_string(kMaxFilterConditions) + " conditions");
  }
  for (const FilterCondition& condition : filter.conditions) {
    const std::string key = ToDisplayText(condition.key);
    if (!condition.any_of && !condition.from && !condition.to) {
      ThrowInvalid("key \"" + key + "\" has no test; there are in, gt, gte, lt and lte");
    }
    if (condition.any_of && condition.any_of->size() > kMaxFilterValues) {
      ThrowInvalid("key \"" + key + "\" lists more than " + std::to_string(kMaxFilterValues) +
                   " values");
    }
    CheckBound(key, condition.from);
    CheckBound(key, condition.to);
  }
}

bool Passes(const Filter& filter, std::string_view metadata) {
  if (filter.empty()) return true;
  const Json json = Json::parse(metadata, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return false;
  return std::all_of(filter.conditions.begin(), filter.conditions.end(),
                     [&](const FilterCondition& condition) {
                       const auto found = json.find(condition.key);
                       return found != json.end() && PassesJson(condition, *found);
                     });
}

Filter ParseFilter(const std::string& text) {
  if (text.size() > kMaxFilterBytes) ThrowInvalid("is larger than 64 KiB");
  bool too_deep = false;
  const auto watch_depth = [&](int depth, Json::parse_event_t, Json&) {
    too_deep = too_deep || depth > kDeepest;
    return !too_deep;
  };
  const Json json = Json::parse(text, watch_depth, /*allow_exceptions=*/false);
  if (too_deep) ThrowInvalid("is nested too deep: a key has a value, or an object of tests");
  if (!json.is_object()) {
    ThrowInvalid("must be a JSON object such as {\"shop\": \"east\", \"year\": {\"gte\": 2020}}");
  }
  Filter filter;
  for (const auto& [key, value] : json.items()) {
    filter.conditions.push_back(ReadCondition(key, value));
  }
  CheckFilter(filter);
  return filter;
}

}  // namespace pliant
