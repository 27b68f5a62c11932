// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/records/filter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <compare>
#include <cstdio>
#include <limits>
#include <type_traits>
#include <utility>

#include <nlohmann/json.hpp>

#include "index/files/text.h"
#include "index/records/filter_value.h"

namespace pliant {
namespace {

using Json = nlohmann::json;

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
  if (IsFilterNumber(a) && IsFilterNumber(b)) return CompareNumbers(a, b);
  if (a.index() != b.index()) return std::partial_ordering::unordered;
  if (const auto* text = std::get_if<std::string>(&a)) return *text <=> std::get<std::string>(b);
  return a == b ? std::partial_ordering::equivalent : std::partial_ordering::unordered;
}

bool PassesText(const FilterCondition& condition, const FilterValue& value) {
  if (!condition.prefix && !condition.contains) return true;
  const auto* text = std::get_if<std::string>(&value);
  if (text == nullptr) return false;
  const std::u32string folded = FoldCase(*text);
  return (!condition.prefix || folded.starts_with(FoldCase(*condition.prefix))) &&
         (!condition.contains || folded.find(FoldCase(*condition.contains)) != folded.npos);
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
  return PassesText(condition, value);
}

bool IsValue(const Json& json, const FilterValue& value) {
  const auto scalar = FilterValueOf(json);
  return scalar && Compare(*scalar, value) == 0;
}

bool HasValue(const Json& json, const FilterValue& value) {
  if (!json.is_array()) return IsValue(json, value);
  return std::any_of(json.begin(), json.end(),
                     [&](const Json& entry) { return IsValue(entry, value); });
}

bool PassesJson(const FilterCondition& condition, const Json& value) {
  if (condition.not_equal && HasValue(value, *condition.not_equal)) return false;
  if (!condition.tests_entries()) return true;
  if (value.is_array()) {
    return std::any_of(value.begin(), value.end(), [&](const Json& entry) {
      const auto scalar = FilterValueOf(entry);
      return scalar && PassesValue(condition, *scalar);
    });
  }
  const auto scalar = FilterValueOf(value);
  return scalar && PassesValue(condition, *scalar);
}

bool PassesCondition(const FilterCondition& condition, const Json& metadata) {
  const auto found = metadata.find(condition.key);
  if (condition.exists && *condition.exists != (found != metadata.end())) return false;
  if (found == metadata.end()) return condition.exists.has_value() && !*condition.exists;
  return PassesJson(condition, *found);
}

bool PassesObject(const Filter& filter, const Json& metadata) {
  const auto passes = [&](const Filter& part) { return PassesObject(part, metadata); };
  return std::all_of(filter.conditions.begin(), filter.conditions.end(),
                     [&](const FilterCondition& condition) {
                       return PassesCondition(condition, metadata);
                     }) &&
         std::all_of(filter.all_of.begin(), filter.all_of.end(), passes) &&
         std::none_of(filter.none_of.begin(), filter.none_of.end(), passes) &&
         std::all_of(filter.any_of.begin(), filter.any_of.end(),
                     [&](const std::vector<Filter>& several) {
                       return std::any_of(several.begin(), several.end(), passes);
                     });
}

}  // namespace

bool Passes(const Filter& filter, std::string_view metadata) {
  if (filter.empty()) return true;
  const Json json = Json::parse(metadata, nullptr, /*allow_exceptions=*/false);
  return json.is_object() && PassesObject(filter, json);
}

std::string MetadataOrder(std::string_view metadata, const std::string& key) {
  const Json json = Json::parse(metadata, nullptr, /*allow_exceptions=*/false);
  const Json value = json.is_object() ? json.value(key, Json()) : Json();
  if (value.is_boolean()) return value.get<bool>() ? "1t" : "1f";
  if (value.is_number()) {  // the bits of positive numbers are in their order (IEEE 754)
    const double number = value.get<double>() + 0.0;  // no -0
    const auto bits = std::bit_cast<std::uint64_t>(number);
    char text[20];
    std::snprintf(text, sizeof text, "2%c%016llx", number < 0 ? 'n' : 'p',
                  static_cast<unsigned long long>(number < 0 ? ~bits : bits));
    return text;
  }
  return value.is_string() ? "3" + NaturalKey(EscapedNul(value.get<std::string>())) : "0";
}

}  // namespace pliant
