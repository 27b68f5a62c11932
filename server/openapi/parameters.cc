// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/openapi/parameters.h"

#include <map>

namespace pliant::server {

Json PictureProperties() {
  return {
      {"image", {{"type", "string"}, {"contentEncoding", "base64"}, {"description", kBinaryImage}}},
      {"image_url",
       {{"type", "string"},
        {"description",
         "address (http, https) to fetch the picture from, where the operator allows its host "
         "(--fetch-hosts); in place of image"}}}};
}

Json EitherPicture() { return {{{"required", {"image"}}}, {{"required", {"image_url"}}}}; }

Json SchemaOf(const Parameter& parameter) {
  Json schema;
  switch (parameter.type) {
    case Parameter::Type::kText:
      schema = {{"type", "string"}};
      break;
    case Parameter::Type::kInteger:
      schema = {{"type", "integer"},
                {"minimum", static_cast<std::int64_t>(parameter.lowest)},
                {"maximum", static_cast<std::uint64_t>(parameter.highest)}};
      break;
    case Parameter::Type::kNumber:
      schema = {{"type", "number"}, {"minimum", parameter.lowest}, {"maximum", parameter.highest}};
      break;
    case Parameter::Type::kNumbers:
      schema = {{"type", "array"},
                {"items", {{"type", "number"}}},
                {"minItems", parameter.count},
                {"maxItems", parameter.count}};
      break;
    case Parameter::Type::kChoice:
      schema = {{"type", "string"}, {"enum", parameter.choices}};
      break;
    case Parameter::Type::kBoolean:
      schema = {{"type", "boolean"}};
      break;
    case Parameter::Type::kJson:
      schema = {{"type", "object"}};
      break;
    case Parameter::Type::kJsonList:
      schema = {{"type", "array"}};
      break;
    case Parameter::Type::kPicture:
      schema = {{"type", "object"},
                {"properties", PictureProperties()},
                {"additionalProperties", false},
                {"oneOf", EitherPicture()}};
      break;
  }
  if (parameter.default_value.empty()) return schema;
  const Json value = Json::parse(parameter.default_value, nullptr, /*allow_exceptions=*/false);
  schema["default"] =
      value.is_number() || value.is_boolean() ? value : Json(parameter.default_value);
  return schema;
}

Json QueryParameter(const Parameter& parameter, bool only) {
  Json json = {{"name", parameter.name},
               {"in", "query"},
               {"description", parameter.meaning},
               {"required", only && parameter.required}};
  using Type = Parameter::Type;
  const Type type = parameter.type;
  if (type == Type::kJson || type == Type::kJsonList || type == Type::kPicture) {
    json["content"] = {{"application/json", {{"schema", SchemaOf(parameter)}}}};
  } else {
    if (type == Type::kNumbers) {
      json["style"] = "form";
      json["explode"] = false;
    }
    json["schema"] = SchemaOf(parameter);
  }
  return json;
}

Json PathParameter(const std::string& name) {
  static const std::map<std::string, std::string> meanings = {
      {"c", "name of a collection"}, {"id", "id of a picture or a job"},
      {"o", "name of an object"},    {"v", "number of a vocabulary"},
      {"b", "name of a backup"},     {"n", "number of an object"},
      {"k", "id of a key"},          {"a", "name of an alias"}};
  return {{"name", name},
          {"in", "path"},
          {"required", true},
          {"description", meanings.at(name)},
          {"schema", {{"type", "string"}}}};
}

}  // namespace pliant::server
