// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/parameters.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "index/text.h"
#include "server/problem.h"

namespace pliant::server {

namespace {

constexpr const char* kImagePart = "image";

// Whole text to number; false for anything left over.
template <typename T>
bool ParseNumber(const std::string& text, T* value) {
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, *value);
  return error == std::errc() && stop == end && !text.empty();
}

std::string JsonText(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  std::string text = ToText(value);
  // An array of numbers reads like the comma-separated form.
  if (value.is_array()) text = text.substr(1, text.size() - 2);
  return text;
}

}  // namespace

Parameters::Parameters(const Route& route, const Request& request) {
  for (const auto& [name, value] : request.query) Insert(route, name, value);
  for (const Part& part : request.parts) {
    if (part.name != kImagePart) Insert(route, part.name, part.content);
  }
  if (request.content_type == "application/json" && !request.body.empty()) {
    const Json body = ParseJsonObject(request.body, "body");
    for (const auto& [name, value] : body.items()) {
      if (!value.is_null()) Insert(route, name, JsonText(value));
    }
  }
}

void Parameters::Insert(const Route& route, const std::string& name, std::string value) {
  const auto& known = route.parameters;
  if (std::find(known.begin(), known.end(), name) == known.end()) {
    const std::string offer =
        known.empty() ? "It takes none." : fmt::format("It takes: {}.", fmt::join(known, ", "));
    throw ProblemError("unknown_parameter", fmt::format("There is no parameter '{}' here. {}",
                                                        name.substr(0, 64), offer))
        .Parameter(name.substr(0, 64));
  }
  if (!IsValidUtf8(value)) ThrowInvalid(name, name + " is not UTF-8.");
  if (!values_.emplace(name, std::move(value)).second) {
    throw ProblemError("duplicate_parameter", name + " was given more than once.").Parameter(name);
  }
}

std::optional<std::string> Parameters::Text(const std::string& name) const {
  const auto it = values_.find(name);
  if (it == values_.end()) return std::nullopt;
  return it->second;
}

std::string Parameters::RequiredText(const std::string& name) const {
  std::optional<std::string> text = Text(name);
  if (!text || text->empty()) {
    throw ProblemError("missing_parameter", name + " is required.").Parameter(name);
  }
  return *text;
}

std::optional<std::int64_t> Parameters::Integer(const std::string& name, std::int64_t lowest,
                                                std::int64_t highest) const {
  const std::optional<std::string> text = Text(name);
  if (!text) return std::nullopt;
  std::int64_t value = 0;
  if (!ParseNumber(*text, &value) || value < lowest || value > highest) {
    ThrowInvalid(name,
                 fmt::format("{} must be a whole number from {} to {}.", name, lowest, highest));
  }
  return value;
}

std::optional<double> Parameters::Number(const std::string& name, double lowest,
                                         double highest) const {
  const std::optional<std::string> text = Text(name);
  if (!text) return std::nullopt;
  double value = 0;
  if (!ParseNumber(*text, &value) || !(value >= lowest && value <= highest)) {
    ThrowInvalid(name, fmt::format("{} must be a number from {} to {}.", name, lowest, highest));
  }
  return value;
}

std::optional<std::vector<double>> Parameters::Numbers(const std::string& name,
                                                       std::size_t count) const {
  const std::optional<std::string> text = Text(name);
  if (!text) return std::nullopt;
  std::vector<double> values;
  std::size_t begin = 0;
  while (begin <= text->size() && values.size() <= count) {
    const std::size_t end = std::min(text->find(',', begin), text->size());
    double value = 0;
    if (!ParseNumber(text->substr(begin, end - begin), &value) || !std::isfinite(value)) {
      values.clear();
      break;
    }
    values.push_back(value);
    begin = end + 1;
  }
  if (values.size() != count) {
    ThrowInvalid(name, fmt::format("{} must be {} numbers with commas between them.", name, count));
  }
  return values;
}

std::optional<std::string> Parameters::JsonObject(const std::string& name) const {
  const std::optional<std::string> text = Text(name);
  if (!text) return std::nullopt;
  return ToText(ParseJsonObject(*text, name));
}

void Parameters::ThrowNotOneOf(const std::string& name, const std::vector<std::string>& choices) {
  ThrowInvalid(name, fmt::format("{} must be one of: {}.", name, fmt::join(choices, ", ")));
}

void ThrowInvalid(const std::string& name, const std::string& detail) {
  throw ProblemError("invalid_parameter", detail).Parameter(name);
}

}  // namespace pliant::server
