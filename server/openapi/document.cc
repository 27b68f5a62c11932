// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/openapi/document.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "descriptor/base/strings.h"
#include "server/http/json.h"
#include "server/http/problem.h"
#include "server/http/router.h"
#include "server/openapi/route_codes.h"

namespace pliant::server {
namespace {

// Parameters in the OpenAPI document.
//
// In words, what an image may be.
inline constexpr const char* kBinaryImage = "an image: JPEG, PNG, WebP, BMP or TIFF";

// "images" of "images.create"; what has no point has one of its own, or one for several.
std::string TagOf(const Route& route) {
  static const std::map<std::string, std::string> tags = {
      {"livez", "health"}, {"readyz", "health"}, {"metrics", "health"},
      {"openapi", "page"}, {"me", "keys"},       {"preview", "images"}};
  const std::string first = route.name.substr(0, route.name.find('.'));
  const auto tag = tags.find(first);
  return tag == tags.end() ? first : tag->second;
}

// Those that the routes use, with descriptions. A tag that has none yet is described by its name; a
// test finds that.
Json TagsOf(const std::vector<Route>& routes) {
  static const std::map<std::string, std::string> meanings = {
      {"aliases", "Other names of collections, moved from one to another at once"},
      {"backups", "Copies of the database in the operator's directory"},
      {"collections", "Separate sets of images, objects and vocabularies"},
      {"compare", "Two images, whether stored or not"},
      {"demo", "Demonstration objects for a first try"},
      {"health", "Whether the server lives, whether it is ready, how it is doing"},
      {"images", "Images: adding, reading, changing, deleting"},
      {"imports", "Images of a folder on the server"},
      {"jobs", "What runs in the background"},
      {"keys", "API keys, and what the caller may do"},
      {"objects", "What the images show"},
      {"page", "The web page, and this document"},
      {"search", "Which object is this?"},
      {"vocabularies", "Visual words: training, choosing"}};
  std::set<std::string> used;
  for (const Route& route : routes) used.insert(TagOf(route));
  Json tags = Json::array();
  for (const std::string& name : used) {
    const auto meaning = meanings.find(name);
    tags.push_back(
        {{"name", name}, {"description", meaning == meanings.end() ? name : meaning->second}});
  }
  return tags;
}

Json ImageProperties() {
  return {
      {"image", {{"type", "string"}, {"contentEncoding", "base64"}, {"description", kBinaryImage}}},
      {"image_url",
       {{"type", "string"},
        {"description",
         "address (http, https) to fetch the image from, where the operator allows its host "
         "(--fetch-hosts); in place of image"}}}};
}

Json EitherImage() { return {{{"required", {"image"}}}, {{"required", {"image_url"}}}}; }

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
    case Parameter::Type::kImage:
      schema = {{"type", "object"},
                {"properties", ImageProperties()},
                {"additionalProperties", false},
                {"oneOf", EitherImage()}};
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
  if (type == Type::kJson || type == Type::kJsonList || type == Type::kImage) {
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
      {"c", "name of a collection"}, {"id", "id of an image or a job"},
      {"o", "name of an object"},    {"v", "number of a vocabulary"},
      {"b", "name of a backup"},     {"n", "number of an object"},
      {"k", "id of a key"},          {"a", "name of an alias"}};
  return {{"name", name},
          {"in", "path"},
          {"required", true},
          {"description", meanings.at(name)},
          {"schema", {{"type", "string"}}}};
}

Json Properties(const Route& route) {
  Json properties = Json::object();
  for (const Parameter& parameter : route.parameters) {
    properties[parameter.name] = SchemaOf(parameter);
    properties[parameter.name]["description"] = parameter.meaning;
  }
  return properties;
}

// Instead of an image the request may name one that is stored.
bool MayDoWithoutImage(const Route& route) {
  return std::any_of(route.parameters.begin(), route.parameters.end(),
                     [](const Parameter& parameter) { return parameter.name == "image_id"; });
}

Json JsonContent(const Route& route) {
  Json schema = {{"type", "object"}, {"properties", Properties(route)}};
  for (const Parameter& parameter : route.parameters) {
    // A form may have them as its fields.
    const bool image = parameter.type == Parameter::Type::kImage;
    if (parameter.required || image) schema["required"].push_back(parameter.name);
  }
  if (route.body == BodyKind::kImageOrJson) {
    schema["properties"].update(ImageProperties());
    if (!MayDoWithoutImage(route)) schema["oneOf"] = EitherImage();
  }
  return {{"schema", schema}};
}

Json FormContent(const Route& route) {
  Json properties = Properties(route);
  const Json image = {{"type", "string"}, {"format", "binary"}, {"description", kBinaryImage}};
  const bool pair = route.body == BodyKind::kPair;
  properties["image"] = pair ? Json{{"type", "array"}, {"items", image}, {"maxItems", 2}} : image;
  Json schema = {{"type", "object"}, {"properties", properties}};
  if (!pair && !MayDoWithoutImage(route)) schema["required"] = {"image"};
  return {{"schema", schema}};
}

Json RequestBody(const Route& route) {
  if (route.body == BodyKind::kMergePatch) {
    const Json patch = {{"schema", {{"$ref", "#/components/schemas/" + route.body_schema}}}};
    return {{"required", true},
            {"content", {{"application/merge-patch+json", patch}, {"application/json", patch}}}};
  }
  if (route.body == BodyKind::kBulk) {
    return {{"required", true},
            {"content", {{kNdjsonType, Json::object()}, {kTarType, Json::object()}}}};
  }
  Json content = Json::object();
  if (route.body == BodyKind::kImageOrJson) {
    content["image/*"] = Json::object();
    content["application/octet-stream"] = Json::object();
  }
  if (route.body != BodyKind::kJson) content["multipart/form-data"] = FormContent(route);
  content["application/json"] = JsonContent(route);
  return {{"required", route.body != BodyKind::kJson}, {"content", content}};
}

Json AnswerJson(const Answer& answer) {
  Json json = {{"description", answer.meaning}};
  if (!answer.schema.empty()) {
    json["content"][answer.content_type]["schema"] = {
        {"$ref", "#/components/schemas/" + answer.schema}};
  } else if (!answer.content_type.empty()) {
    json["content"][answer.content_type] = Json::object();
  }
  return json;
}

// One response a status, with the codes that come with it.
void AddProblems(const Route& route, Json& responses) {
  std::map<int, Json> codes;
  for (const std::string& code : RouteCodes(route)) {
    codes[ProblemCodeOf(code).status].push_back(code);
  }
  for (const auto& [status, names] : codes) {
    std::string text;
    for (const auto& name : names) {
      const auto code = name.get<std::string>();
      text += (text.empty() ? "`" : "; `") + code + "`: " + ProblemCodeOf(code).meaning;
    }
    Json schema = {{"allOf",
                    {{{"$ref", "#/components/schemas/Problem"}},
                     {{"properties", {{"code", {{"enum", names}}}}}}}}};
    responses[std::to_string(status)] = {
        {"description", text}, {"content", {{"application/problem+json", {{"schema", schema}}}}}};
  }
}

Json HeaderParameter(const char* name, const char* meaning) {
  return {{"name", name},
          {"in", "header"},
          {"required", false},
          {"description", meaning},
          {"schema", {{"type", "string"}}}};
}

void AddHeaderParameters(const Route& route, Json& parameters) {
  const auto add = [&](const char* name, const char* meaning) {
    parameters.push_back(HeaderParameter(name, meaning));
  };
  if (HeedsIdempotencyKey(route)) {
    add("Idempotency-Key", "any name for the request: sent again, it is answered but not done");
  }
  if (route.takes_if_match) add("If-Match", "ETags of the state that is meant to change, or *");
  if (route.takes_if_match && route.method == "PUT") {
    add("If-None-Match", "*: only where there is nothing of this id yet");
  }
  if (HasEtag(route)) {
    add("If-None-Match", "ETags that the client has: 304 if one of them is still right");
    add("If-Match", "ETags: 412 if none of them is right any more");
  }
  if (TakesRange(route)) {
    add("Range", "one range of bytes: `bytes=0-99`, `bytes=100-`, `bytes=-100`");
    add("If-Range", "an ETag: the whole, if it is not right any more");
  }
}

Json Operation(const Route& route) {
  Json operation = {
      {"operationId", route.name}, {"summary", route.summary}, {"tags", {TagOf(route)}}};
  Json parameters = Json::array();
  for (const std::string& segment : SplitPath(route.pattern)) {
    if (segment.starts_with('{')) {
      parameters.push_back(PathParameter(segment.substr(1, segment.size() - 2)));
    }
  }
  for (const Parameter& parameter : route.parameters) {
    parameters.push_back(QueryParameter(parameter, route.body == BodyKind::kNone));
  }
  AddHeaderParameters(route, parameters);
  if (!parameters.empty()) operation["parameters"] = parameters;
  if (route.body != BodyKind::kNone) operation["requestBody"] = RequestBody(route);
  Json responses = Json::object();
  for (const Answer& answer : route.answers) {
    Json& response = responses[std::to_string(answer.status)];
    if (response.is_null()) {
      response = AnswerJson(answer);
    } else {  // the same status with another type of content
      response["content"].update(AnswerJson(answer)["content"]);
    }
  }
  AddProblems(route, responses);
  operation["responses"] = responses;
  // Without keys (see --allow-anonymous) none is needed.
  operation["security"] = Json::array();
  if (route.scope != Scope::kPublic) {
    operation["security"] = {{{"bearer", Json::array()}}, {{"header", Json::array()}}};
  }
  operation["x-scope"] = ScopeName(route.scope);
  if (!route.example.empty()) {
    operation["x-codeSamples"] = {{{"lang", "Shell"}, {"source", route.example}}};
  }
  return operation;
}

}  // namespace

Json OpenApiDocument(const std::vector<Route>& routes) {
  Json paths = Json::object();
  for (const Route& route : routes) {
    if (route.name == "page" && route.pattern != "/") continue;  // parts of the page
    paths[route.pattern][Lower(route.method)] = Operation(route);
  }
  const Json bearer = {{"type", "http"}, {"scheme", "bearer"}};
  const Json header = {{"type", "apiKey"}, {"in", "header"}, {"name", "X-API-Key"}};
  return {
      {"openapi", "3.1.0"},
      {"info",
       {{"title", "Pliant"},
        {"summary", "Find the same object again, however it is bent, folded or crumpled"},
        {"description",
         "Parameters may stand in the query, as keys of a JSON body, there with the types given "
         "here (null is as if it were left out), or, where a route takes an image, in form "
         "fields. Errors "
         "are application/problem+json (RFC 9457) with a stable `code`. Every answer carries "
         "X-Request-Id. HEAD works wherever GET does."},
        {"license", {{"name", "Apache-2.0"}, {"identifier", "Apache-2.0"}}},
        {"version", PLIANT_VERSION}}},
      {"servers", {{{"url", "/"}}}},
      {"tags", TagsOf(routes)},
      {"paths", paths},
      {"components",
       {{"schemas", OpenApiSchemas()},
        {"securitySchemes", {{"bearer", bearer}, {"header", header}}}}}};
}

}  // namespace pliant::server
