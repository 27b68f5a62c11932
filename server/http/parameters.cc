// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/parameters.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "descriptor/base/strings.h"
#include "index/files/text.h"
#include "index/usage/usage.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

using Type = Parameter::Type;

constexpr std::size_t kShownNameBytes = 64;
constexpr std::size_t kMostFieldBytes = 64 * 1024;  // of a part that is not an image

const Parameter* FindSpec(const Route& route, const std::string& name) {
  const auto it = std::find_if(route.parameters.begin(), route.parameters.end(),
                               [&](const Parameter& parameter) { return parameter.name == name; });
  return it == route.parameters.end() ? nullptr : &*it;
}

// Moves the keys of an image out of the object. `of`: the parameter that holds them; empty = the
// body.
ImageText TakeImage(Json& object, const std::string& of = {}) {
  const auto take = [&](const char* key, const char* what) -> std::optional<std::string> {
    const auto found = object.find(key);
    if (found == object.end()) return std::nullopt;
    Json value = std::move(*found);
    object.erase(found);
    if (value.is_null()) return std::nullopt;
    if (!value.is_string()) {
      ThrowInvalid(of.empty() ? key : of,
                   fmt::format("{}{} must be text: {}.", of.empty() ? "" : of + ".", key, what));
    }
    return std::move(value.get_ref<std::string&>());
  };
  ImageText image{take(kImagePart, "base64"), take("image_url", "a URL")};
  if (image.base64 && image.url) {
    ThrowInvalid(of.empty() ? "image_url" : of,
                 (of.empty() ? "" : of + ": ") + "image and image_url cannot be combined.");
  }
  return image;
}

// The text of a query or a form as a value; one of another type when the text has no such value.
Json ValueOf(const Parameter& spec, const std::string& text) {
  const auto or_null = [](const auto& number) { return number ? Json(*number) : Json(); };
  switch (spec.type) {
    case Type::kText:
    case Type::kChoice:
      return text;
    case Type::kInteger:
      return or_null(NumberOf<std::int64_t>(text));
    case Type::kNumber:
      return or_null(NumberOf<double>(text));
    case Type::kNumbers: {
      Json numbers = Json::array();
      for (const std::string& one : Split(text + ",", ','))
        numbers.push_back(or_null(NumberOf<double>(one)));
      return numbers;
    }
    case Type::kBoolean:
      return text == "true" || text == "false" ? Json(text == "true") : Json();
    case Type::kJson:
    case Type::kImage:
      return ParseJson(text, spec.name);
    case Type::kJsonList:
      return ParseJson(text, spec.name, Json::value_t::array);
  }
  return {};
}

// Fits into 64 bits. JSON does not tell 5 from 5.0 (JSON Schema, section 4.2.3).
bool IsWhole(const Json& value) {
  constexpr double kExact = 9007199254740992;  // 2^53
  if (value.is_number_unsigned()) {
    return value.get<std::uint64_t>() <= std::numeric_limits<std::int64_t>::max();
  }
  if (!value.is_number_float()) return value.is_number();
  const double number = value.get<double>();
  return std::trunc(number) == number && std::abs(number) <= kExact;
}

bool IsNumberIn(const Json& value, double lowest, double highest) {
  return value.is_number() && value.get<double>() >= lowest && value.get<double>() <= highest;
}

// What the value must be, for people; empty = it is.
std::string WantedOf(const Parameter& spec, const Json& value) {
  const auto unless = [](bool fits, std::string wanted) {
    return fits ? std::string() : std::move(wanted);
  };
  switch (spec.type) {
    case Type::kText:
      return unless(value.is_string(), "text");
    case Type::kChoice:
      return unless(std::any_of(spec.choices.begin(), spec.choices.end(),
                                [&](const std::string& choice) {
                                  return value.is_string() &&
                                         IsChoice(choice, value.get_ref<const std::string&>());
                                }),
                    fmt::format("one of: {}", fmt::join(spec.choices, ", ")));
    case Type::kInteger:
      return unless(IsWhole(value) && IsNumberIn(value, spec.lowest, spec.highest),
                    fmt::format("a whole number from {:.0f} to {:.0f}", spec.lowest, spec.highest));
    case Type::kNumber:
      return unless(IsNumberIn(value, spec.lowest, spec.highest),
                    fmt::format("a number from {} to {}", spec.lowest, spec.highest));
    case Type::kNumbers:
      return unless(value.is_array() && value.size() == spec.count &&
                        std::all_of(value.begin(), value.end(),
                                    [](const Json& one) {
                                      constexpr double kMost = std::numeric_limits<double>::max();
                                      return IsNumberIn(one, -kMost, kMost);
                                    }),
                    fmt::format("{} comma-separated numbers", spec.count));
    case Type::kBoolean:
      return unless(value.is_boolean(), "true or false");
    case Type::kJson:
    case Type::kImage:
      return unless(value.is_object(), "an object");
    case Type::kJsonList:
      return unless(value.is_array(), "an array");
  }
  return {};
}

}  // namespace

Parameters::Parameters(const Route& route, const Request& request, const char* body_name)
    : route_(route) {
  // Mail and social networks add parameters to links. The page has none.
  const bool is_page = route.name == "page";
  for (const auto& [name, value] : request.query) {
    if (!is_page) InsertText(name, value);
  }
  for (const Part& part : request.parts) {
    if (part.name != kImagePart) InsertPart(part);
  }
  // A merge patch is the handler's: in it null means something, and types do.
  if (request.content_type == "application/json" && !request.body.empty() &&
      route.body != BodyKind::kMergePatch) {
    Json body = ParseJson(request.body, body_name);
    if (route.body == BodyKind::kImageOrJson) {
      ImageText image = TakeImage(body);
      if (image.base64 || image.url) images_.emplace("", std::move(image));
    }
    for (auto& [name, value] : body.items()) {
      const Parameter& spec = Known(name);
      if (!value.is_null()) Insert(spec, std::move(value));
    }
  }
  for (const Parameter& parameter : route_.parameters) {
    if (parameter.required && !images_.contains(parameter.name) &&
        Text(parameter.name).value_or("").empty()) {
      throw ProblemError("missing_parameter", parameter.name + " is required.",
                         {.parameter = parameter.name});
    }
  }
}

const Parameter& Parameters::Known(const std::string& name, bool is_file) const {
  if (const Parameter* spec = FindSpec(route_, name)) return *spec;
  std::vector<std::string> known;
  const bool takes_images = route_.body == BodyKind::kImageOrJson || route_.body == BodyKind::kPair;
  if (takes_images) known.emplace_back(kImagePart);
  for (const Parameter& parameter : route_.parameters) known.push_back(parameter.name);
  const std::string shown = Shown(name, kShownNameBytes);
  const std::string meant =
      is_file && takes_images ? "; did you mean the part \"image\"?" : cli::DidYouMean(name, known);
  throw ProblemError(
      "unknown_parameter",
      fmt::format("Unknown parameter \"{}\"{} This route takes {}.", shown,
                  meant.empty() ? "." : meant,
                  known.empty() ? "none" : fmt::format("{}", fmt::join(known, ", "))),
      {.parameter = shown});
}

void Parameters::InsertPart(const Part& part) {
  const bool is_file = !part.filename.empty() || part.content_type.starts_with("image/") ||
                       part.content.size() > kMostFieldBytes;
  (void)Known(part.name, is_file);
  if (part.content.size() > kMostFieldBytes) {
    throw ProblemError(
        "body_too_large",
        fmt::format("{} has more than {} bytes. Send an image as the part \"image\".", part.name,
                    kMostFieldBytes),
        {.parameter = part.name});
  }
  InsertText(part.name, std::string(part.content));
}

void Parameters::InsertText(const std::string& name, const std::string& text) {
  const Parameter& spec = Known(name);
  if (!IsValidUtf8(text)) {
    ThrowInvalid(name, name + " must be valid UTF-8, not " + Shown(text, kShownNameBytes) + ".");
  }
  Insert(spec, ValueOf(spec, text));
}

void Parameters::Insert(const Parameter& spec, Json value) {
  const std::string& name = spec.name;
  if (has(name)) {
    throw ProblemError("duplicate_parameter", name + " was given more than once.",
                       {.parameter = name});
  }
  if (const std::string wanted = WantedOf(spec, value); !wanted.empty()) {
    ThrowInvalid(name, name + " must be " + wanted + ".");
  }
  if (spec.type != Type::kImage) {
    values_.emplace(name, std::move(value));
    return;
  }
  ImageText image = TakeImage(value, name);
  if (!value.empty()) {
    ThrowInvalid(name, fmt::format("Unknown key \"{}\" in {}. Use image or image_url.",
                                   value.begin().key().substr(0, kShownNameBytes), name));
  }
  if (!image.base64 && !image.url) {
    ThrowInvalid(name, name + " needs an image: image (base64) or image_url.");
  }
  images_.emplace(name, std::move(image));
}

bool Parameters::takes(const std::string& name) const { return FindSpec(route_, name) != nullptr; }

const Parameter& Parameters::Spec(const std::string& name) const {
  if (const Parameter* spec = FindSpec(route_, name)) return *spec;
  throw std::logic_error("route " + route_.name + " has no parameter " + name);
}

Json Parameters::DefaultOf(const std::string& name) const {
  return ValueOf(Spec(name), Spec(name).default_value);
}

std::optional<std::string> Parameters::Text(const std::string& name) const {
  const auto value = Get<Json>(name);
  if (!value) return std::nullopt;
  return value->is_string() ? value->get<std::string>() : ToText(*value);
}

const ImageText* Parameters::Image(const std::string& name) const {
  if (!name.empty() && Spec(name).type != Type::kImage) {
    throw std::logic_error("parameter " + name + " has another type");
  }
  const auto it = images_.find(name);
  return it == images_.end() ? nullptr : &it->second;
}

void ThrowInvalid(const std::string& name, const std::string& detail) {
  throw ProblemError("invalid_parameter", detail, {.parameter = name});
}

}  // namespace pliant::server
