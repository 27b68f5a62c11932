// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/parameter_values.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <fmt/format.h>

#include "server/http/parameters.h"

namespace pliant::server {

namespace {

// JSON does not tell 5 from 5.0 (JSON Schema, section 4.2.3).
bool IsWhole(const Json& value) {
  constexpr double kExact = 9007199254740992;  // 2^53
  if (!value.is_number_float()) return value.is_number();
  const double number = value.get<double>();
  return std::trunc(number) == number && std::abs(number) <= kExact;
}

// What a value of a JSON body must be, for people; empty = it is.
std::string WantedType(const Parameter& spec, const Json& value) {
  const auto unless = [](bool fits, const char* wanted) { return fits ? "" : wanted; };
  switch (spec.type) {
    case Parameter::Type::kText:
    case Parameter::Type::kChoice:
      return unless(value.is_string(), "text");
    case Parameter::Type::kInteger:
      return unless(IsWhole(value), "a whole number");
    case Parameter::Type::kNumber:
      return unless(value.is_number(), "a number");
    case Parameter::Type::kNumbers:
      return unless(value.is_array() && std::all_of(value.begin(), value.end(),
                                                    [](const Json& v) { return v.is_number(); }),
                    "an array of numbers");
    case Parameter::Type::kBoolean:
      return unless(value.is_boolean(), "true or false");
    case Parameter::Type::kJson:
    case Parameter::Type::kPicture:
      return unless(value.is_object(), "an object");
    case Parameter::Type::kJsonList:
      return unless(value.is_array(), "an array");
  }
  return {};
}

}  // namespace

void RequireType(const Parameter& spec, const Json& value) {
  if (const std::string wanted = WantedType(spec, value); !wanted.empty()) {
    ThrowInvalid(spec.name, fmt::format("{} must be {} in a JSON body.", spec.name, wanted));
  }
}

std::string JsonText(const Parameter& spec, const Json& value) {
  RequireType(spec, value);
  if (value.is_string()) return value.get<std::string>();
  if (spec.type == Parameter::Type::kInteger && value.is_number_float()) {
    return fmt::format("{:.0f}", value.get<double>());
  }
  std::string text = ToText(value);
  // An array of numbers reads like the comma-separated form.
  if (spec.type == Parameter::Type::kNumbers) text = text.substr(1, text.size() - 2);
  return text;
}

std::vector<double> ParseNumbers(const std::string& text) {
  std::vector<double> values;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    double value = 0;
    if (!ParseNumber(text.substr(begin, end - begin), &value) || !std::isfinite(value)) return {};
    values.push_back(value);
    begin = end + 1;
  }
  return values;
}

void CheckText(const Parameter& spec, const std::string& text) {
  const std::string& name = spec.name;
  switch (spec.type) {
    case Parameter::Type::kText:
      return;
    case Parameter::Type::kInteger: {
      std::int64_t value = 0;
      if (ParseNumber(text, &value) && static_cast<double>(value) >= spec.lowest &&
          static_cast<double>(value) <= spec.highest) {
        return;
      }
      ThrowInvalid(name, fmt::format("{} must be a whole number from {:.0f} to {:.0f}.", name,
                                     spec.lowest, spec.highest));
    }
    case Parameter::Type::kNumber: {
      double value = 0;
      if (ParseNumber(text, &value) && value >= spec.lowest && value <= spec.highest) return;
      ThrowInvalid(
          name, fmt::format("{} must be a number from {} to {}.", name, spec.lowest, spec.highest));
    }
    case Parameter::Type::kNumbers:
      if (ParseNumbers(text).size() == spec.count) return;
      ThrowInvalid(
          name, fmt::format("{} must be {} numbers with commas between them.", name, spec.count));
    case Parameter::Type::kChoice:
      if (std::find(spec.choices.begin(), spec.choices.end(), text) != spec.choices.end()) return;
      ThrowInvalid(name,
                   fmt::format("{} must be one of: {}.", name, fmt::join(spec.choices, ", ")));
    case Parameter::Type::kBoolean:
      if (text == "true" || text == "false") return;
      ThrowInvalid(name, name + " must be true or false.");
    case Parameter::Type::kJson:
      ParseJsonObject(text, name);
      return;
    case Parameter::Type::kJsonList:
      ParseJsonArray(text, name);
      return;
    case Parameter::Type::kPicture:
      return;
  }
}

}  // namespace pliant::server
