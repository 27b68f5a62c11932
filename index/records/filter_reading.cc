// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Reading and checking filters: every complaint says where.
#include <cmath>
#include <set>

#include "descriptor/base/error.h"
#include "index/files/text.h"
#include "index/records/filter.h"
#include "index/records/filter_value.h"

namespace pliant {
namespace {

using Json = nlohmann::json;

constexpr const char* kTests = "in, ne, gt, gte, lt, lte, prefix, contains and exists.";
constexpr std::size_t kShownBytes = 32;  // of a name in a message

// An and or an or takes two levels; then a key's tests, their list, and what does not belong there.
constexpr int kDeepestJson = 2 * kMaxFilterDepth + 4;

[[noreturn]] void ThrowInvalid(const std::string& where, const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, "filter_invalid", "filter" + where + ": " + what);
}

std::string At(const std::string& where, const std::string& key) {
  return where + "." + Shown(key, kShownBytes);
}

std::string At(const std::string& where, const char* list, std::size_t i) {
  return where + "." + list + "[" + std::to_string(i) + "]";
}

std::vector<FilterValue> ReadList(const std::string& where, const Json& list) {
  if (!list.is_array()) ThrowInvalid(where, "\"in\" must be a list of values.");
  std::vector<FilterValue> values;
  for (const Json& entry : list) {
    const auto value = FilterValueOf(entry);
    if (!value) ThrowInvalid(where, "\"in\" must list numbers, text, true, false or null.");
    values.push_back(*value);
  }
  return values;
}

void SetBound(const std::string& where, const std::string& test, const Json& json,
              std::optional<FilterBound>* bound) {
  const auto value = FilterValueOf(json);
  if (!value) ThrowInvalid(where, "\"" + test + "\" must be a number or text.");
  if (*bound) ThrowInvalid(where, "use only one lower bound and one upper bound.");
  *bound = FilterBound{*value, test.size() == 3};  // gte, lte
}

void ReadTest(const std::string& where, const std::string& test, const Json& argument,
              FilterCondition* condition) {
  if (test == "in") {
    condition->any_of = ReadList(where, argument);
  } else if (test == "ne") {
    condition->not_equal = FilterValueOf(argument);
    if (!condition->not_equal) {
      ThrowInvalid(where, "\"ne\" must be a number, text, true, false or null.");
    }
  } else if (test == "exists") {
    if (!argument.is_boolean()) ThrowInvalid(where, "\"exists\" must be true or false.");
    condition->exists = argument.get<bool>();
  } else if (test == "prefix" || test == "contains") {
    if (!argument.is_string() || argument == "") {
      ThrowInvalid(where, "\"" + test + "\" must be text, not empty.");
    }
    (test == "prefix" ? condition->prefix : condition->contains) = argument.get<std::string>();
  } else if (test == "gt" || test == "gte") {
    SetBound(where, test, argument, &condition->from);
  } else if (test == "lt" || test == "lte") {
    SetBound(where, test, argument, &condition->to);
  } else {
    ThrowInvalid(where,
                 "unknown test \"" + Shown(test, kShownBytes) + "\". Known tests: " + kTests);
  }
}

FilterCondition ReadCondition(const std::string& where, const std::string& key, const Json& json) {
  FilterCondition condition;
  condition.key = key.starts_with('\\') ? key.substr(1) : key;
  if (const auto value = FilterValueOf(json)) {
    condition.any_of = {*value};
    return condition;
  }
  if (!json.is_object()) {
    ThrowInvalid(where, "must be a value or tests. For several values: {\"in\": [...]}.");
  }
  for (const auto& [test, argument] : json.items()) ReadTest(where, test, argument, &condition);
  return condition;
}

Filter ReadFilter(const std::string& where, const Json& json);

std::vector<Filter> ReadFilters(const std::string& where, const char* name, const Json& json) {
  if (!json.is_array()) ThrowInvalid(where + "." + name, "must be a list of filters.");
  std::vector<Filter> filters;
  for (std::size_t i = 0; i < json.size(); ++i) {
    filters.push_back(ReadFilter(At(where, name, i), json[i]));
  }
  return filters;
}

// As deep as ParseFilter lets JSON be; Checker counts the levels.
Filter ReadFilter(const std::string& where, const Json& json) {
  if (!json.is_object()) ThrowInvalid(where, "must be a JSON object.");
  Filter filter;
  for (const auto& [key, value] : json.items()) {
    if (key == "and") {
      filter.all_of = ReadFilters(where, "and", value);
      if (filter.all_of.empty()) ThrowInvalid(where + ".and", "must have at least one filter.");
    } else if (key == "or") {
      filter.any_of.push_back(ReadFilters(where, "or", value));
    } else if (key == "not") {
      filter.none_of.push_back(ReadFilter(where + ".not", value));
    } else {
      filter.conditions.push_back(ReadCondition(At(where, key), key, value));
    }
  }
  return filter;
}

void CheckBound(const std::string& where, const std::optional<FilterBound>& bound) {
  if (!bound) return;
  const auto* number = std::get_if<double>(&bound->value);
  const bool finite = number == nullptr || std::isfinite(*number);
  if ((IsFilterNumber(bound->value) && finite) ||
      std::holds_alternative<std::string>(bound->value)) {
    return;
  }
  ThrowInvalid(where, "a bound must be a number or text.");
}

void CheckCondition(const std::string& where, const FilterCondition& condition) {
  const bool tests_value = condition.tests_entries() || condition.not_equal;
  if (!tests_value && !condition.exists) {
    ThrowInvalid(where, std::string("has no test. Known tests: ") + kTests);
  }
  if (tests_value && condition.exists && !*condition.exists) {
    ThrowInvalid(where, "\"exists\": false cannot be combined with other tests.");
  }
  if (condition.any_of && condition.any_of->size() > kMaxFilterValues) {
    ThrowInvalid(where, "\"in\" can have at most " + std::to_string(kMaxFilterValues) + " values.");
  }
  CheckBound(where, condition.from);
  CheckBound(where, condition.to);
}

class Checker {
 public:
  void Check(const std::string& where, const Filter& filter, int depth) {
    if (depth > kMaxFilterDepth) {
      ThrowInvalid(where,
                   "is nested more than " + std::to_string(kMaxFilterDepth) + " levels deep.");
    }
    if (depth > 1 && filter.empty()) ThrowInvalid(where, "must not be empty.");
    for (const FilterCondition& condition : filter.conditions) {
      Count();
      CheckCondition(At(where, condition.key), condition);
    }
    CheckAll(where, "and", filter.all_of, depth);
    for (const std::vector<Filter>& several : filter.any_of) {
      if (several.empty()) ThrowInvalid(where + ".or", "must have at least one filter.");
      CheckAll(where, "or", several, depth);
    }
    for (const Filter& none : filter.none_of) {
      Count();
      Check(where + ".not", none, depth + 1);
    }
  }

 private:
  void CheckAll(const std::string& where, const char* name, const std::vector<Filter>& filters,
                int depth) {
    if (!filters.empty()) Count();
    for (std::size_t i = 0; i < filters.size(); ++i) {
      Check(At(where, name, i), filters[i], depth + 1);
    }
  }
  void Count() {
    if (++terms_ <= kMaxFilterTerms) return;
    ThrowInvalid("", "has more than " + std::to_string(kMaxFilterTerms) +
                         " conditions, ands, ors and nots.");
  }

  std::size_t terms_ = 0;
};

}  // namespace

void CheckFilter(const Filter& filter) { Checker().Check("", filter, 1); }

Filter ParseFilter(const std::string& text) {
  if (text.size() > kMaxFilterBytes) ThrowInvalid("", "can have at most 64 KiB.");
  // Of two keys that are the same a parser keeps one: what the other demands would be lost.
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  bool too_deep = false;
  std::string twice;
  const auto watch = [&](int depth, Json::parse_event_t event, const Json& parsed) {
    too_deep = too_deep || depth > kDeepestJson;
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end && !keys.empty()) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.empty()) {
      const auto& key = parsed.get_ref<const std::string&>();
      if (!keys.back().insert(key).second && twice.empty()) twice = Shown(key, kShownBytes);
    }
    return !too_deep;
  };
  const Json json = Json::parse(text, watch, /*allow_exceptions=*/false);
  if (too_deep) {
    ThrowInvalid("", "is nested too deep; use at most " + std::to_string(kMaxFilterDepth) +
                         " levels of and, or and not.");
  }
  if (!json.is_object()) {
    ThrowInvalid("",
                 "must be a JSON object such as {\"shop\": \"east\", \"year\": {\"gte\": 2020}}.");
  }
  if (!twice.empty()) {
    ThrowInvalid("",
                 "has the key \"" + twice + "\" twice in one object. Combine both with \"and\".");
  }
  Filter filter = ReadFilter("", json);
  CheckFilter(filter);
  return filter;
}

}  // namespace pliant
