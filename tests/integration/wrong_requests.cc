// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/wrong_requests.h"

#include <map>
#include <utility>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

constexpr const char* kForm = "multipart/form-data; boundary=B";

std::string Form(const std::vector<std::pair<std::string, std::string>>& fields) {
  std::string form;
  for (const auto& [name, value] : fields) {
    form += "--B\r\nContent-Disposition: form-data; name=\"" + name + "\"\r\n\r\n" + value + "\r\n";
  }
  return form + "--B--\r\n";
}

}  // namespace

WrongRequests::WrongRequests(const Operation& operation, std::string path,
                             const std::function<std::string(std::string)>& filled)
    : operation_(operation),
      path_(WithRequired(path)),
      image_(operation.Takes("image/*")),
      json_(operation.Takes("application/json")),
      form_(operation.Takes("multipart/form-data")) {
  constexpr const char* kLines = "application/x-ndjson";
  type_ = image_                    ? "image/png"
          : json_                   ? "application/json"
          : form_                   ? kForm
          : operation.Takes(kLines) ? kLines
                                    : "";
  body_ = GoodBody();
  AddBodyFaults();
  AddMissingFields();
  AddPathFaults(filled);
  AddParameterFaults();
}

std::set<std::string> WrongRequests::MustHave() const {
  std::set<std::string> kinds = {"unknown parameter", "oversized address"};
  if (path_ == "/") kinds.erase("unknown parameter");
  if (operation_.json.contains("requestBody")) kinds.insert({"wrong type", "oversized"});
  if (form_ || !RequiredFields().empty()) kinds.insert("missing field");
  for (const Json& parameter : operation_.json.value("parameters", Json::array())) {
    if (parameter["in"] == "path" && !Makes(parameter["name"])) kinds.insert("unknown id");
  }
  return kinds;
}

void WrongRequests::Add(const std::string& kind, const std::string& what, const std::string& at,
                        const std::string& body, const std::string& type, int status,
                        const std::string& code) {
  wrong_.push_back({kind, what, operation_.method, at, body, type, status, code});
}

bool WrongRequests::Makes(const std::string& name) const {
  return operation_.method == "PUT" && operation_.path.ends_with("{" + name + "}");
}

bool WrongRequests::TakesAnyName() const {
  if (!operation_.Takes("application/merge-patch+json")) return false;
  const Json& schema =
      operation_.json["requestBody"]["content"]["application/merge-patch+json"]["schema"];
  return schema.contains("additionalProperties") && schema["additionalProperties"].is_object();
}

std::vector<std::string> WrongRequests::RequiredFields() const {
  if (!json_ || image_) return {};
  return operation_.json["requestBody"]["content"]["application/json"]["schema"].value(
      "required", std::vector<std::string>{});
}

std::string WrongRequests::WithQuery(const std::string& path, const std::string& query) {
  return path + (path.find('?') == std::string::npos ? '?' : '&') + query;
}

std::string WrongRequests::WithRequired(const std::string& path) const {
  std::string whole = path;
  for (const Json& parameter : operation_.json.value("parameters", Json::array())) {
    if (parameter["in"] != "query" || !parameter.value("required", false)) continue;
    const std::string value = parameter.contains("content") ? "%7B%22a%22%3A1%7D" : "1";
    whole = WithQuery(whole, parameter["name"].get<std::string>() + "=" + value);
  }
  return whole;
}

std::string WrongRequests::GoodBody() const {
  if (image_) return TestImage(1);
  if (form_ && !json_) return Form({{"image", TestImage(1)}});
  Json body = Json::object();
  for (const std::string& field : RequiredFields()) {
    const Json& schema =
        operation_
            .json["requestBody"]["content"]["application/json"]["schema"]["properties"][field];
    body[field] = "shelf";
    if (schema["type"] == "array") body[field] = Json::array({Json{{"image_id", "mug-1"}}});
    if (schema["type"] == "object") body[field] = Json{{"image", Base64Of(TestImage(1))}};
  }
  return json_ ? body.dump() : "";
}

void WrongRequests::AddBodyFaults() {
  if (!operation_.json.contains("requestBody")) return;
  Add("wrong type", "text", path_, "x", "text/plain", 415, "unsupported_content_type");
  if (!json_)
    Add("wrong type", "JSON", path_, "{}", "application/json", 415, "unsupported_content_type");
  if (!image_)
    Add("wrong type", "an image", path_, TestImage(1), "image/png", 415,
        "unsupported_content_type");
  Add("oversized", "body", path_, std::string(1'200'000, 'x'), type_, 413, "body_too_large");
  if (json_) Add("no JSON", "cut off", path_, "{", "application/json", 400, "invalid_json");
  if (json_) Add("no JSON", "a list", path_, "[]", "application/json", 400, "invalid_json");
  if (form_) {
    Add("no form", "without boundary", path_, body_, "multipart/form-data", 400, "bad_request");
    Add("no form", "cut off", path_, Form({{"image", "x"}}).substr(0, 40), kForm, 400,
        "bad_request");
  }
  if (!image_) return;
  const std::string half = body_.substr(0, body_.size() / 2);
  Add("no image", "text", path_, "hello", type_, 415, "image_type_unknown");
  Add("no image", "half", path_, half, type_, 422, "image_truncated");
  Add("no image", "in a form", path_, Form({{"image", "hello"}}), kForm, 415, "image_type_unknown");
}

void WrongRequests::AddMissingFields() {
  for (const std::string& field : RequiredFields()) {
    Add("missing field", field, path_, "{}", type_, 400, "missing_parameter");
    Add("missing field", field + " and body", path_, "", "", 400, "missing_parameter");
  }
  if (!form_) return;
  Add("missing field", "body", path_, "", image_ ? "" : kForm, 400, "missing_parameter");
  const bool limit = operation_.path.ends_with("/search");
  const bool compare = operation_.path.ends_with("/compare");
  // These have no other fields.
  const bool alone = operation_.path.ends_with("/locate") || operation_.path.ends_with("/preview");
  const auto others =
      compare ? Form({{"explain", "true"}}) : Form({{limit ? "limit" : "object", "1"}});
  Add("missing field", "image", path_, alone ? Form({}) : others, kForm, 400,
      alone ? "bad_request" : "missing_parameter");
  if (json_)
    Add("missing field", "image_id", path_, "{}", "application/json", 400, "missing_parameter");
}

void WrongRequests::AddPathFaults(const std::function<std::string(std::string)>& filled) {
  Add("oversized address", "query", WithQuery(path_, "x=" + std::string(9000, 'a')), body_, type_,
      414, "uri_too_long");
  for (const Json& parameter : operation_.json.value("parameters", Json::array())) {
    const std::string name = parameter["name"];
    if (parameter["in"] != "path") continue;
    const auto with = [&](const std::string& value) {
      std::string path = operation_.path;
      const std::string place = "{" + name + "}";
      return WithRequired(filled(path.replace(path.find(place), place.size(), value)));
    };
    Add("oversized address", name, with(std::string(2100, 'a')), body_, type_, 414, "uri_too_long");
    if (Makes(name)) {
      Add("bad id", name, with("a%20b"), body_, type_, 400, "invalid_parameter");
      continue;
    }
    static const std::map<std::string, std::string> codes = {
        {"c", "collection_not_found"}, {"o", "object_not_found"}, {"v", "vocabulary_not_found"},
        {"b", "backup_not_found"},     {"id", "image_not_found"}, {"k", "key_not_found"},
        {"a", "alias_not_found"}};
    const bool job = operation_.path.starts_with("/v1/jobs");
    Add("unknown id", name, with("no-such-thing"), body_, type_, 404,
        job ? "job_not_found" : codes.at(name));
  }
}

void WrongRequests::AddParameterFaults() {
  if (path_ != "/") {  // the page, whose links gain parameters on their way
    Add("unknown parameter", "in the query", WithQuery(path_, "no_such=1"), body_, type_, 400,
        "unknown_parameter");
  }
  if (form_) {
    Add("unknown parameter", "in a form", path_, Form({{"image", TestImage(1)}, {"no_such", "1"}}),
        kForm, 400, "unknown_parameter");
  }
  if (json_)
    Add("unknown parameter", "in JSON", path_, R"({"no_such": 1})", "application/json", 400,
        TakesAnyName() ? "invalid_parameter" : "unknown_parameter");
  for (const Json& parameter : operation_.json.value("parameters", Json::array())) {
    if (parameter["in"] != "query") continue;
    const std::string name = parameter["name"];
    const bool required = parameter.value("required", false);
    const std::string at = required ? path_.substr(0, path_.find('?')) : path_;
    const auto with = [&](const std::string& value) { return WithQuery(at, name + "=" + value); };
    if (required) Add("missing field", name, at, body_, type_, 400, "missing_parameter");
    Add("bad parameter", name + " not UTF-8", with("%ff"), body_, type_, 400, "invalid_parameter");
    Add("bad parameter", name + " twice", with("1") + "&" + name + "=2", body_, type_, 400,
        IsText(parameter) ? "duplicate_parameter" : "");
    if (parameter.contains("content")) {
      Add("bad parameter", name, with("{"), body_, type_, 400, "invalid_json");
      const std::string type = parameter["content"]["application/json"]["schema"]["type"];
      if (json_) AddWrongTypes(name, type == "array" ? "array of anything" : type);
      continue;
    }
    const Json& schema = parameter["schema"];
    std::vector<std::string> bad;
    if (!IsText(parameter) && (schema["type"] == "string" || schema["type"] == "boolean"))
      bad = {"no-such-word", "1", ""};
    if (schema["type"] == "integer" || schema["type"] == "number") {
      bad = {std::to_string(schema["minimum"].get<double>() - 1), "x", ""};
    }
    if (schema["type"] == "array") bad = {"1,x"};
    for (const std::string& value : bad) {
      Add("bad parameter", name, with(value), body_, type_, 400, "invalid_parameter");
    }
    if (json_) AddWrongTypes(name, schema["type"]);
    if (name == "cursor") Add("bad cursor", name, with("x"), body_, type_, 400, "invalid_cursor");
  }
}

// A value of each JSON type but that which the field has: none is taken for another.
void WrongRequests::AddWrongTypes(const std::string& name, const std::string& type) {
  if (operation_.Takes("application/merge-patch+json")) return;  // it has no parameters in its body
  const std::pair<const char*, const char*> values[] = {{"string", R"("5")"},
                                                        {"integer", "1.5"},
                                                        {"boolean", "true"},
                                                        {"object", "{}"},
                                                        {"array", R"(["x"])"}};
  for (const auto& [of, value] : values) {
    const bool number = type == "number" && of == std::string("integer");
    if ((of == type && type != "integer" && type != "array") || number) continue;
    if (type == "array of anything" && of == std::string("array")) continue;
    Json body = Json::parse(json_ && !image_ ? body_ : "{}");
    body[name] = Json::parse(value);
    Add("wrong type in JSON", name + ": " + value, path_, body.dump(), "application/json", 400,
        "invalid_parameter");
  }
  Add("no JSON", name + " twice", path_, "{\"" + name + "\": null, \"" + name + "\": null}",
      "application/json", 400, "invalid_json");
}

bool WrongRequests::IsText(const Json& parameter) {
  return parameter.contains("schema") && parameter["schema"]["type"] == "string" &&
         !parameter["schema"].contains("enum") && !parameter["schema"].contains("pattern");
}

}  // namespace pliant::testing
