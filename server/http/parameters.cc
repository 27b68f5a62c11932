// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/parameters.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include <fmt/format.h>

#include "index/files/text.h"
#include "server/http/multipart.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr const char* kImageUrl = "image_url";

const Parameter* FindSpec(const Route& route, const std::string& name) {
  const auto it = std::find_if(route.parameters.begin(), route.parameters.end(),
                               [&](const Parameter& parameter) { return parameter.name == name; });
  return it == route.parameters.end() ? nullptr : &*it;
}

// What stands for an image is taken out of the object. `of` begins its name in what is said of it,
// and is the parameter at fault where there is no other.
ImageText TakeImage(Json& object, const std::string& of = {}) {
  const auto take = [&](const char* name, const char* what) -> std::optional<std::string> {
    const auto found = object.find(name);
    if (found == object.end()) return std::nullopt;
    Json value = std::move(*found);
    object.erase(found);
    if (value.is_null()) return std::nullopt;
    if (!value.is_string()) {
      ThrowInvalid(of.empty() ? name : of,
                   fmt::format("{} must be text: {}.", of.empty() ? name : of + "." + name, what));
    }
    return std::move(value.get_ref<std::string&>());
  };
  ImageText image;
  image.base64 = take(kImagePart, "base64");
  image.url = take(kImageUrl, "an address on the web");
  if (image.base64 && image.url) {
    ThrowInvalid(of.empty() ? kImageUrl : of,
                 (of.empty() ? "" : of + ": ") + "image_url and image exclude each other.");
  }
  return image;
}

// Whole text to number; false for anything left over.
template <typename T>
bool ParseNumber(const std::string& text, T* value) {
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, *value);
  return error == std::errc() && stop == end && !text.empty();
}

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
    case Parameter::Type::kImage:
      return unless(value.is_object(), "an object");
    case Parameter::Type::kJsonList:
      return unless(value.is_array(), "an array");
  }
  return {};
}

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
    case Parameter::Type::kImage:
      return;
  }
}

}  // namespace

Parameters::Parameters(const Route& route, const Request& request) : route_(route) {
  for (const auto& [name, value] : request.query) Insert(Known(name), value);
  for (const Part& part : request.parts) {
    if (part.name != kImagePart) Insert(Known(part.name), part.content);
  }
  // A merge patch is the handler's: in it null means something, and types do.
  const bool in_body = request.content_type == "application/json" && !request.body.empty() &&
                       route.body != BodyKind::kMergePatch;
  if (in_body) {
    Json body = ParseJsonObject(request.body, "body");
    if (route.body == BodyKind::kImageOrJson) image_ = TakeImage(body);
    for (auto& [name, value] : body.items()) {
      const Parameter& spec = Known(name);
      if (value.is_null()) continue;
      if (spec.type == Parameter::Type::kImage) {
        RequireType(spec, value);
        InsertImage(spec, std::move(value));
      } else {
        Insert(spec, JsonText(spec, value));
      }
    }
  }
  for (const Parameter& parameter : route_.parameters) {
    if (parameter.required && !images_.contains(parameter.name) &&
        Text(parameter.name).value_or("").empty()) {
      throw ProblemError("missing_parameter", parameter.name + " is required.")
          .Parameter(parameter.name);
    }
  }
}

const Parameter& Parameters::Known(const std::string& name) const {
  if (const Parameter* spec = FindSpec(route_, name)) return *spec;
  std::vector<std::string> known;
  for (const Parameter& parameter : route_.parameters) known.push_back(parameter.name);
  const std::string offer =
      known.empty() ? "It takes none." : fmt::format("It takes: {}.", fmt::join(known, ", "));
  throw ProblemError("unknown_parameter",
                     fmt::format("There is no parameter '{}' here. {}", name.substr(0, 64), offer))
      .Parameter(name.substr(0, 64));
}

void Parameters::Insert(const Parameter& spec, std::string value) {
  const std::string& name = spec.name;
  if (!IsValidUtf8(value)) ThrowInvalid(name, name + " is not UTF-8.");
  if (spec.type == Parameter::Type::kImage) {
    InsertImage(spec, ParseJsonObject(value, name));
    return;
  }
  RequireNew(name);
  CheckText(spec, value);
  values_.emplace(name, std::move(value));
}

void Parameters::InsertImage(const Parameter& spec, Json value) {
  const std::string& name = spec.name;
  RequireNew(name);
  ImageText image = TakeImage(value, name);
  if (!value.empty()) {
    ThrowInvalid(name, fmt::format("{}: there is no '{}', only image and image_url.", name,
                                   value.begin().key().substr(0, 64)));
  }
  if (!image.base64 && !image.url) {
    ThrowInvalid(name, name + " needs an image: image (base64) or image_url.");
  }
  images_.emplace(name, std::move(image));
}

void Parameters::RequireNew(const std::string& name) const {
  if (!has(name)) return;
  throw ProblemError("duplicate_parameter", name + " was given more than once.").Parameter(name);
}

bool Parameters::takes(const std::string& name) const { return FindSpec(route_, name) != nullptr; }

const Parameter& Parameters::Spec(const std::string& name) const {
  if (const Parameter* spec = FindSpec(route_, name)) return *spec;
  throw std::logic_error("route " + route_.name + " has no parameter " + name);
}

std::optional<std::string> Parameters::Value(const std::string& name, Parameter::Type type) const {
  if (Spec(name).type != type) throw std::logic_error("parameter " + name + " is of another kind");
  const auto it = values_.find(name);
  if (it == values_.end()) return std::nullopt;
  return it->second;
}

std::optional<std::string> Parameters::Text(const std::string& name) const {
  return Value(name, Spec(name).type);
}

std::optional<std::int64_t> Parameters::Integer(const std::string& name) const {
  const auto text = Value(name, Parameter::Type::kInteger);
  if (!text) return std::nullopt;
  std::int64_t value = 0;
  ParseNumber(*text, &value);
  return value;
}

std::optional<double> Parameters::Number(const std::string& name) const {
  const auto text = Value(name, Parameter::Type::kNumber);
  if (!text) return std::nullopt;
  double value = 0;
  ParseNumber(*text, &value);
  return value;
}

std::optional<std::vector<double>> Parameters::Numbers(const std::string& name) const {
  const auto text = Value(name, Parameter::Type::kNumbers);
  if (!text) return std::nullopt;
  return ParseNumbers(*text);
}

std::optional<bool> Parameters::Flag(const std::string& name) const {
  const auto text = Value(name, Parameter::Type::kBoolean);
  if (!text) return std::nullopt;
  return *text == "true";
}

std::optional<std::string> Parameters::JsonObject(const std::string& name) const {
  const auto text = Value(name, Parameter::Type::kJson);
  if (!text) return std::nullopt;
  return ToText(ParseJsonObject(*text, name));
}

const ImageText* Parameters::Image(const std::string& name) const {
  if (Spec(name).type != Parameter::Type::kImage) {
    throw std::logic_error("parameter " + name + " is of another kind");
  }
  const auto it = images_.find(name);
  return it == images_.end() ? nullptr : &it->second;
}

std::optional<Json> Parameters::JsonList(const std::string& name) const {
  const auto text = Value(name, Parameter::Type::kJsonList);
  if (!text) return std::nullopt;
  return ParseJsonArray(*text, name);
}

void ThrowInvalid(const std::string& name, const std::string& detail) {
  throw ProblemError("invalid_parameter", detail).Parameter(name);
}

}  // namespace pliant::server
