// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/json_schema.h"

#include <algorithm>

namespace pliant::testing {

namespace {

using Json = nlohmann::json;

class Comparison {
 public:
  explicit Comparison(const Json& document) : document_(document) {}

  std::vector<std::string> differences;

  void Compare(const Json& schema, const Json& value, const std::string& at) {
    if (schema.contains("$ref")) {
      const auto reference = schema["$ref"].get<std::string>();
      return Compare(document_.at(Json::json_pointer(reference.substr(1))), value, at);
    }
    if (schema.contains("oneOf")) CompareOneOf(schema["oneOf"], value, at);
    if (schema.contains("type") && !HasType(schema["type"], value)) {
      differences.push_back(at + " is " + value.dump().substr(0, 60) + ", not " +
                            schema["type"].dump());
      return;
    }
    if (schema.contains("enum") &&
        std::find(schema["enum"].begin(), schema["enum"].end(), value) == schema["enum"].end()) {
      differences.push_back(at + " is " + value.dump() + ", none of " + schema["enum"].dump());
    }
    if (value.is_number() &&
        (value < schema.value("minimum", value) || value > schema.value("maximum", value))) {
      differences.push_back(at + " is out of range: " + value.dump());
    }
    if (value.is_object()) CompareObject(schema, value, at);
    if (value.is_array() && schema.contains("items")) {
      for (std::size_t i = 0; i < value.size(); ++i) {
        Compare(schema["items"], value[i], at + "/" + std::to_string(i));
      }
    }
  }

 private:
  static bool HasType(const Json& types, const Json& value) {
    if (types.is_array()) {
      return std::any_of(types.begin(), types.end(),
                         [&](const Json& type) { return HasType(type, value); });
    }
    const auto type = types.get<std::string>();
    return (type == "object" && value.is_object()) || (type == "array" && value.is_array()) ||
           (type == "string" && value.is_string()) || (type == "boolean" && value.is_boolean()) ||
           (type == "integer" && value.is_number_integer()) ||
           (type == "number" && value.is_number()) || (type == "null" && value.is_null());
  }

  void CompareOneOf(const Json& choices, const Json& value, const std::string& at) {
    std::string why;
    for (const Json& choice : choices) {
      Comparison attempt(document_);
      attempt.Compare(choice, value, at);
      if (attempt.differences.empty()) return;
      why += " (" + attempt.differences.front() + ")";
    }
    differences.push_back(at + " is none of its forms:" + why);
  }

  void CompareObject(const Json& schema, const Json& value, const std::string& at) {
    for (const Json& name : schema.value("required", Json::array())) {
      if (!value.contains(name.get<std::string>())) {
        differences.push_back(at + " lacks " + name.dump());
      }
    }
    const Json properties = schema.value("properties", Json::object());
    const Json others = schema.value("additionalProperties", Json(false));
    for (const auto& [name, member] : value.items()) {
      const std::string where = at + "/" + name;
      if (properties.contains(name)) {
        Compare(properties[name], member, where);
      } else if (others.is_object()) {
        Compare(others, member, where);
      } else if (others != true && schema.contains("properties")) {
        differences.push_back(where + " is not documented");
      }
    }
  }

  const Json& document_;
};

}  // namespace

std::vector<std::string> SchemaDifferences(const Json& document, const Json& schema,
                                           const Json& value) {
  Comparison comparison(document);
  comparison.Compare(schema, value, "");
  return comparison.differences;
}

}  // namespace pliant::testing
