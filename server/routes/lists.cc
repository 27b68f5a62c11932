// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/lists.h"

#include <algorithm>

#include "descriptor/base/base64.h"
#include "descriptor/base/sha256.h"
#include "descriptor/base/strings.h"
#include "server/http/json.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr int kLargestPage = 500;

std::vector<std::string> FacetsOf(const Parameters& parameters) {
  const auto text = parameters.Text("facets");
  if (!text || text->empty()) return {};
  std::vector<std::string> keys = Split(*text + ',', ',');
  if (std::find(keys.begin(), keys.end(), "") != keys.end()) {
    ThrowInvalid("facets", "facets has an empty key. Remove the extra comma.");
  }
  return keys;
}

}  // namespace

Parameter CursorParameter() { return {"cursor", "`next` of the previous page"}; }

Parameter LimitParameter() {
  return Parameter("limit", "entries per page").Integer(1, kLargestPage).Default("50");
}

Json CursorJson(const std::string& list, const std::optional<std::string>& after) {
  return after ? Json(Base64UrlEncode(ToText(Json::array({list, *after})))) : Json(nullptr);
}

std::string AfterFromCursor(const Parameters& parameters, const std::string& list) {
  const auto cursor = parameters.Text("cursor");
  if (!cursor || cursor->empty()) return {};
  std::string text;
  if (Base64UrlDecode(*cursor, &text)) {
    const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
    if (json.is_array() && json.size() == 2 && json[0] == list && json[1].is_string()) {
      return json[1].get<std::string>();
    }
  }
  ThrowInvalidCursor();
}

void ThrowInvalidCursor() {
  throw ProblemError("invalid_cursor",
                     "Invalid cursor for this list. Start again without a cursor.",
                     {.parameter = "cursor"});
}

Response PageResponse(const Request& request, const Json& page) {
  Response response = JsonResponse(page);
  if (page.at("next").is_null()) return response;
  std::string link;
  for (const std::string& segment : request.segments) link += "/" + EncodeSegment(segment);
  link += "?cursor=" + page.at("next").get<std::string>();
  for (const auto& [name, value] : request.query) {
    if (name != "cursor") link += "&" + EncodeSegment(name) + "=" + EncodeSegment(value);
  }
  response.headers.emplace_back("Link", "<" + link + ">; rel=\"next\"");
  return response;
}

Parameter FilterParameter() {
  return Parameter("filter", "only images whose metadata match: a JSON object of conditions")
      .Json();
}

Parameter TextParameter() {
  return {"q",
          "only entries that contain all these words, ignoring case: in an image's id, object or "
          "file name, or in an object's name"};
}

Parameter OfObjectParameter() { return {"object", "only images of this object"}; }

std::vector<Parameter> ListParameters(const std::vector<std::string>& orders) {
  std::vector<std::string> choices = orders;
  for (const std::string& order : orders) choices.push_back("-" + order);
  return {
      FilterParameter(),
      TextParameter(),
      Parameter("sort", "the order of the list; a minus reverses it")
          .Choice(std::move(choices))
          .Default(orders.front().c_str()),
      Parameter("count", "count the entries of all pages").Boolean().Default("false"),
      {"facets", "comma-separated keys of the metadata: count the values of each key in the list"},
      CursorParameter(),
      LimitParameter()};
}

Selection SelectionOf(const Parameters& parameters, const std::string& collection) {
  Selection which;
  which.collection = collection;
  if (parameters.takes("object")) which.object = parameters.Text("object");
  if (const auto filter = parameters.Text("filter")) which.filter = ParseFilter(*filter);
  which.text = parameters.Text("q").value_or("");
  if (which.text.size() > kMaxTextBytes) {
    ThrowInvalid("q", "q can have at most " + std::to_string(kMaxTextBytes) + " bytes.");
  }
  return which;
}

std::string OrderKeyOf(const Parameters& parameters) {
  const std::string sort = parameters.Text("sort").value_or("");
  const std::size_t dot = sort.find('.');
  return dot == sort.npos ? std::string() : sort.substr(dot + 1);
}

std::string ListIdentity(const char* list, const Selection& which, const Parameters& parameters) {
  Json asked = Json::array({list, which.collection});
  for (const char* name : {"object", "filter", "q", "sort"}) {
    const auto value =
        parameters.takes(name) ? parameters.Text(name) : std::optional<std::string>();
    asked.push_back(value ? Json(*value) : Json(nullptr));
  }
  return Sha256Hex(ToText(asked));
}

PageOptions PageOptionsOf(const Parameters& parameters, const std::string& identity) {
  PageOptions page;
  page.limit = parameters.Value<int>("limit");
  page.descending = parameters.Text("sort").value_or("").starts_with('-');
  page.after = AfterFromCursor(parameters, identity);
  page.count = parameters.Value<bool>("count");
  page.facets = FacetsOf(parameters);
  return page;
}

}  // namespace pliant::server
