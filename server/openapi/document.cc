// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/openapi/document.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "descriptor/base/strings.h"
#include "descriptor/image/image.h"
#include "server/http/json.h"
#include "server/http/problem.h"
#include "server/http/router.h"

namespace pliant::server {
namespace {

std::string BinaryImage() { return std::string("an image: ") + kImageFormats; }

bool Answers(const Route& route, int status) {
  return std::any_of(route.answers.begin(), route.answers.end(),
                     [&](const Answer& answer) { return answer.status == status; });
}

// The answer has an ETag, and conditions of a GET count.
bool HasEtag(const Route& route) { return Answers(route, 304); }
// Clients can ask for parts of the answer.
bool TakesRange(const Route& route) { return Answers(route, 206); }

using Codes = std::set<std::string>;

void AddBodyCodes(const Route& route, Codes& codes) {
  if (route.body == BodyKind::kNone) return;
  codes.insert({"body_too_large", "unsupported_content_type", "unsupported_content_encoding",
                "unsupported_transfer_encoding"});
  if (route.body == BodyKind::kBulk) return;
  codes.insert("invalid_json");
  if (route.body == BodyKind::kJson) return;
  codes.insert({"missing_parameter", "invalid_parameter"});
  if (route.body == BodyKind::kMergePatch) return;
  codes.insert({"duplicate_parameter", "image_type_unknown", "image_empty", "image_truncated",
                "image_corrupt", "image_too_small", "image_too_large", "too_few_features",
                "fetch_off", "fetch_host_not_allowed", "fetch_failed"});
  if (route.scope >= Scope::kWrite) codes.insert("same_bytes");
}

void AddParameterCodes(const Route& route, Codes& codes) {
  codes.insert("unknown_parameter");
  for (const Parameter& parameter : route.parameters) {
    codes.insert({"invalid_parameter", "duplicate_parameter"});
    if (parameter.required) codes.insert("missing_parameter");
    if (parameter.name == "cursor") codes.insert("invalid_cursor");
    if (parameter.type == Parameter::Type::kJson || parameter.type == Parameter::Type::kJsonList ||
        parameter.type == Parameter::Type::kImage) {
      codes.insert("invalid_json");
    }
  }
}

void AddScopeCodes(const Route& route, Codes& codes) {
  if (route.scope != Scope::kPublic)
    codes.insert({"unauthorized", "forbidden", "rate_limited", "starting", "database_unavailable",
                  "database_outcome_unknown"});
  if (route.scope >= Scope::kWrite) codes.insert({"no_space", "read_only"});
}

// "images" for "images.create". A name without a point is its own tag, or has another one.
std::string TagOf(const Route& route) {
  static const std::map<std::string, std::string> tags = {
      {"livez", "health"}, {"readyz", "health"},  {"metrics", "health"}, {"openapi", "page"},
      {"me", "keys"},      {"preview", "images"}, {"qr", "keys"}};
  const std::string first = route.name.substr(0, route.name.find('.'));
  const auto tag = tags.find(first);
  return tag == tags.end() ? first : tag->second;
}

Json TagsOf(const std::vector<Route>& routes) {
  static const std::map<std::string, std::string> meanings = {
      {"aliases", "Alternative names of collections"},
      {"backups", "Copies of the database in the operator's directory"},
      {"collections", "Separate sets of images, objects and vocabularies"},
      {"compare", "Comparing two images"},
      {"demo", "Demonstration objects for a first try"},
      {"health", "Liveness, readiness and metrics of the server"},
      {"images", "Adding, reading, changing and deleting images"},
      {"imports", "Adding the images of a folder on the server"},
      {"jobs", "Background jobs"},
      {"keys", "API keys, and what the caller can do"},
      {"objects", "The objects that the images show"},
      {"page", "The web page, and this document"},
      {"search", "Find the object that an image shows"},
      {"vocabularies", "Training and activating vocabularies of visual words"}};
  std::set<std::string> used;
  for (const Route& route : routes) {
    if (route.scope != Scope::kPeer) used.insert(TagOf(route));
  }
  Json tags = Json::array();
  for (const std::string& name : used) {
    tags.push_back({{"name", name}, {"description", meanings.at(name)}});
  }
  return tags;
}

Json ImageProperties() {
  return {
      {"image",
       {{"type", "string"}, {"contentEncoding", "base64"}, {"description", BinaryImage()}}},
      {"image_url",
       {{"type", "string"},
        {"description",
         "instead of image: URL (http, https) from which the server fetches it, if the operator "
         "allows the host (--fetch-hosts)"}}}};
}

Json EitherImage() { return {{{"required", {"image"}}}, {{"required", {"image_url"}}}}; }

// One of the names; "x.KEY" stands for x. and any text.
Json ChoiceSchema(const std::vector<std::string>& choices) {
  if (std::ranges::none_of(choices, [](const auto& one) { return one.ends_with(".KEY"); })) {
    return {{"type", "string"}, {"enum", choices}};
  }
  std::string pattern;
  for (const std::string& one : choices) {
    pattern += pattern.empty() ? "^(" : "|";
    pattern += one.ends_with(".KEY") ? one.substr(0, one.size() - 4) + "\\..+" : one;
  }
  return {{"type", "string"}, {"pattern", pattern + ")$"}};
}

Json TypeSchema(const Parameter& parameter) {
  using Type = Parameter::Type;
  switch (parameter.type) {
    case Type::kText:
      return {{"type", "string"}};
    case Type::kInteger:
      return {{"type", "integer"},
              {"minimum", static_cast<std::int64_t>(parameter.lowest)},
              {"maximum", static_cast<std::uint64_t>(parameter.highest)}};
    case Type::kNumber:
      return {{"type", "number"}, {"minimum", parameter.lowest}, {"maximum", parameter.highest}};
    case Type::kNumbers:
      return {{"type", "array"},
              {"items", {{"type", "number"}}},
              {"minItems", parameter.count},
              {"maxItems", parameter.count}};
    case Type::kChoice:
      return ChoiceSchema(parameter.choices);
    case Type::kBoolean:
      return {{"type", "boolean"}};
    case Type::kJson:
      return {{"type", "object"}};
    case Type::kJsonList:
      return {{"type", "array"}};
    case Type::kImage:
      return {{"type", "object"},
              {"properties", ImageProperties()},
              {"additionalProperties", false},
              {"oneOf", EitherImage()}};
  }
  return {};
}

Json SchemaOf(const Parameter& parameter) {
  Json schema = TypeSchema(parameter);
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

// A place in a path that takes a name, and what is on it in examples.
struct Place {
  std::string_view pattern;
  const char* meaning;
  const char* example;
  const char* absent;  // the code for a name of nothing
};
constexpr Place kPlaces[] = {
    {"/collections/{c}", "name of a collection", "default", "collection_not_found"},
    {"/images/{id}", "id of an image", "$IMAGE", "image_not_found"},
    {"/jobs/{id}", "id of a job", "$JOB", "job_not_found"},
    {"/objects/{o}", "name of an object", "mug", "object_not_found"},
    {"/vocabularies/{v}", "number of a vocabulary", "$VOCABULARY", "vocabulary_not_found"},
    {"/backups/{b}", "name of a backup", "$BACKUP", "backup_not_found"},
    {"/keys/{k}", "id of a key", "$KEY_ID", "key_not_found"},
    {"/aliases/{a}", "name of an alias", "live", "alias_not_found"}};

// The places of the route's path, each with its position there.
std::vector<std::pair<std::size_t, const Place*>> PlacesOf(const Route& route) {
  std::vector<std::pair<std::size_t, const Place*>> places;
  for (const Place& place : kPlaces) {
    const std::size_t at = route.pattern.find(place.pattern);
    if (at != std::string::npos) places.emplace_back(at, &place);
  }
  std::sort(places.begin(), places.end());
  return places;
}

Json PathParameter(const Place& place) {
  const std::size_t open = place.pattern.find('{');
  return {{"name", std::string(place.pattern.substr(open + 1, place.pattern.size() - open - 2))},
          {"in", "path"},
          {"required", true},
          {"description", place.meaning},
          {"schema", {{"type", "string"}}}};
}

std::string ExampleOf(const Route& route) {
  if (route.example.find("$PLIANT") != std::string::npos) return route.example;
  std::string path = route.pattern;
  for (const auto& [at, place] : PlacesOf(route)) {
    const std::string_view capture = place->pattern.substr(place->pattern.find('{'));
    path.replace(path.find(capture), capture.size(), place->example);
  }
  const bool posts = route.method == "POST" && !route.example.empty();  // curl does so by itself
  const bool names_method = route.method != "GET" && !posts;
  return "curl " + (names_method ? "-X " + route.method + " " : "") + route.example +
         (route.example.empty() ? "" : " ") + "\"$PLIANT" + path + "\"";
}

Json Properties(const Route& route) {
  Json properties = Json::object();
  for (const Parameter& parameter : route.parameters) {
    properties[parameter.name] = SchemaOf(parameter);
    properties[parameter.name]["description"] = parameter.meaning;
  }
  return properties;
}

// The request can name a stored image instead.
bool MayDoWithoutImage(const Route& route) {
  return std::any_of(route.parameters.begin(), route.parameters.end(),
                     [](const Parameter& parameter) { return parameter.name == "image_id"; });
}

Json JsonContent(const Route& route) {
  Json schema = {{"type", "object"}, {"properties", Properties(route)}};
  for (const Parameter& parameter : route.parameters) {
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
  const Json image = {{"type", "string"}, {"format", "binary"}, {"description", BinaryImage()}};
  const bool pair = route.body == BodyKind::kPair;
  properties["image"] = pair ? Json{{"type", "array"}, {"items", image}, {"maxItems", 2}} : image;
  Json schema = {{"type", "object"}, {"properties", properties}};
  if (!pair && !MayDoWithoutImage(route)) schema["required"] = {"image"};
  return {{"schema", schema}};
}

Json RequestBody(const Route& route) {
  Json content = Json::object();
  for (const std::string& type : TypesOf(route.body)) {
    Json& one = content[type] = Json::object();
    if (route.body == BodyKind::kMergePatch) {
      one = {{"schema", {{"$ref", "#/components/schemas/" + route.body_schema}}}};
    } else if (type == "multipart/form-data") {
      one = FormContent(route);
    } else if (type == "application/json") {
      one = JsonContent(route);
    }
  }
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

// One response per status, with the codes of that status.
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

void AddHeaderParameters(const Route& route, Json& parameters) {
  const auto add = [&](const char* name, const char* meaning) {
    parameters.push_back({{"name", name},
                          {"in", "header"},
                          {"required", false},
                          {"description", meaning},
                          {"schema", {{"type", "string"}}}});
  };
  if (HeedsIdempotencyKey(route)) {
    add("Idempotency-Key",
        "a new value for each request; the server performs a repeated request only once");
  }
  if (route.takes_if_match)
    add("If-Match", "ETags: change the resource only if one of them is current; or *");
  if (route.takes_if_match && route.method == "PUT") {
    add("If-None-Match", "*: only if no image has this id");
  }
  if (HasEtag(route)) {
    add("If-None-Match", "ETags that the client has: 304 if one of them is current");
    add("If-Match", "ETags: 412 if none of them is current");
  }
  if (TakesRange(route)) {
    add("Range", "one range of bytes: `bytes=0-99`, `bytes=100-`, `bytes=-100`");
    add("If-Range", "an ETag: send the whole file if it is not current");
  }
}

Json Operation(const Route& route) {
  Json operation = {
      {"operationId", route.name}, {"summary", route.summary}, {"tags", {TagOf(route)}}};
  Json parameters = Json::array();
  for (const auto& [at, place] : PlacesOf(route)) parameters.push_back(PathParameter(*place));
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
    } else {  // the same status with another Content-Type
      response["content"].update(AnswerJson(answer)["content"]);
    }
  }
  AddProblems(route, responses);
  operation["responses"] = responses;
  // A server without keys (see --allow-anonymous) requires none.
  operation["security"] = Json::array();
  if (route.scope != Scope::kPublic) {
    operation["security"] = {{{"bearer", Json::array()}}, {{"header", Json::array()}}};
  }
  operation["x-scope"] = ScopeName(route.scope);
  operation["x-codeSamples"] = {{{"lang", "Shell"}, {"source", ExampleOf(route)}}};
  return operation;
}

}  // namespace

std::set<std::string> RouteCodes(const Route& route) {
  // What any request may meet, whatever it asks for.
  Codes codes = {"bad_request", "uri_too_long",          "headers_too_large", "request_timeout",
                 "internal",    "range_not_satisfiable", "host_not_allowed",  "busy"};
  AddScopeCodes(route, codes);
  AddBodyCodes(route, codes);
  AddParameterCodes(route, codes);
  if (route.method != "GET") codes.insert({"cross_site", "precondition_failed"});
  if (HeedsIdempotencyKey(route)) {
    codes.insert({"invalid_parameter", "idempotency_running", "idempotency_other"});
  }
  if (HasEtag(route)) codes.insert("precondition_failed");
  if (route.needs_index) codes.insert({"starting", "stopping"});
  for (const auto& [at, place] : PlacesOf(route)) {
    const bool makes_it = route.method == "PUT" && route.pattern.ends_with(place->pattern);
    if (!makes_it) codes.insert(place->absent);
  }
  if (route.pattern.starts_with("/v1/backups")) codes.insert("backups_off");
  codes.insert(route.codes.begin(), route.codes.end());
  return codes;
}

Json OpenApiDocument(const std::vector<Route>& routes) {
  Json paths = Json::object();
  for (const Route& route : routes) {
    if (route.name == "page" && route.pattern != "/") continue;  // parts of the page
    if (route.scope == Scope::kPeer) continue;                   // between servers
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
         "Send parameters in the query, as keys of a JSON body, or as form fields if the route "
         "takes an image. In a JSON body parameters have the types given here, and null counts as "
         "absent. Errors are application/problem+json (RFC 9457) with a stable `code`. Every "
         "answer has X-Request-Id. HEAD works on every route that has GET."},
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
