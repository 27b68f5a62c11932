// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/records/filter.h"

#include <algorithm>
#include <cmath>
#include <compare>

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
  if (json.is_number()) return FilterValue(json.get<double>());
  if (json.is_string()) return FilterValue(json.get_ref<const std::string&>());
  return std::nullopt;
}

std::partial_ordering Compare(const FilterValue& a, const FilterValue& b) {
  if (a.index() != b.index()) return std::partial_ordering::unordered;
  if (const auto* number = std::get_if<double>(&a)) return *number <=> std::get<double>(b);
  if (const auto* text = std::get_if<std::string>(&a)) return *text <=> std::get<std::string>(b);
  return a == b ? std::partial_ordering::equivalent : std::partial_ordering::unordered;
}

bool PassesValue(const FilterCondition& condition, const FilterValue& value) {
  if (condition.any_of && std::find(condition.any_of->begin(), condition.any_of->end(), value) ==
                              condition.any_of->end()) {
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
  if ((number != nullptr && std::isfinite(*number)) ||
      std::holds_alternative<std::string>(bound->value)) {
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
