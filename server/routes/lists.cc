// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/lists.h"

#include <algorithm>

#include "descriptor/base/base64.h"
#include "descriptor/base/sha256.h"
#include "index/json/record_json.h"
#include "server/http/json.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr int kDefaultPage = 50;
constexpr int kLargestPage = 500;

std::vector<std::string> FacetsOf(const Parameters& parameters) {
  std::vector<std::string> keys;
  const auto text = parameters.Text("facets");
  if (!text || text->empty()) return keys;
  for (std::size_t begin = 0; begin <= text->size();) {
    const std::size_t end = std::min(text->find(',', begin), text->size());
    keys.push_back(text->substr(begin, end - begin));
    begin = end + 1;
  }
  for (const std::string& key : keys) {
    if (key.empty()) ThrowInvalid("facets", "facets has an empty key between its commas.");
    if (std::count(keys.begin(), keys.end(), key) > 1) {
      ThrowInvalid("facets", "facets has a key twice.");
    }
  }
  if (keys.size() > kMaxFacets) {
    ThrowInvalid("facets", "facets may have " + std::to_string(kMaxFacets) + " keys.");
  }
  return keys;
}

}  // namespace

Parameter CursorParameter() {
  return {"cursor", "`next` of the page before, for the one after it"};
}

Parameter LimitParameter() {
  return Parameter("limit", "entries a page").Integer(1, kLargestPage).Default("50");
}

int PageLimit(const Parameters& parameters) {
  return static_cast<int>(parameters.Integer("limit").value_or(kDefaultPage));
}

std::string MakeCursor(const std::string& list, const std::string& after) {
  return Base64UrlEncode(ToText(Json::array({list, after})));
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
                     "The cursor is none that this list gave. Ask again without one.")
      .Parameter("cursor");
}

Parameter FilterParameter() {
  return Parameter("filter", "only images whose metadata pass: a JSON object of conditions").Json();
}

Parameter TextParameter() {
  return {"q",
          "only what these words occur in, whatever their case: the id, the object or the file's "
          "name of an image, the name of an object"};
}

std::vector<Parameter> ListParameters(const std::vector<std::string>& orders) {
  std::vector<std::string> choices = orders;
  for (const std::string& order : orders) choices.push_back("-" + order);
  return {FilterParameter(),
          TextParameter(),
          Parameter("sort", "what the list is in order of; with a minus downwards")
              .Choice(std::move(choices))
              .Default(orders.front().c_str()),
          Parameter("count", "whether to count all there are").Boolean().Default("false"),
          {"facets",
           "keys of the metadata, with commas between: how many of the list have which value"}};
}

Filter FilterOf(const std::string& text) {
  try {
    return ParseFilter(text);
  } catch (const Error& error) {
    ThrowInvalid("filter", error.what());
  }
}

Selection SelectionOf(const Parameters& parameters, const std::string& collection) {
  Selection which;
  which.collection = collection;
  if (parameters.takes("object")) which.object = parameters.Text("object");
  if (const auto filter = parameters.Text("filter")) which.filter = FilterOf(*filter);
  which.text = parameters.Text("q").value_or("");
  if (which.text.size() > kMaxTextBytes) {
    ThrowInvalid("q", "q may have " + std::to_string(kMaxTextBytes) + " bytes.");
  }
  return which;
}

std::string ListIdentity(const char* list, const Selection& which, const Parameters& parameters) {
  Json asked = Json::array({list, which.collection});
  for (const char* name : {"object", "filter", "q", "sort"}) {
    const auto value =
        parameters.takes(name) ? parameters.Text(name) : std::optional<std::string>();
    asked.push_back(value ? Json(*value) : Json(nullptr));
  }
  const std::string text = ToText(asked);
  return Sha256Hex({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

PageOptions PageOptionsOf(const Parameters& parameters, const std::string& identity) {
  PageOptions page;
  page.limit = PageLimit(parameters);
  page.descending = parameters.Text("sort").value_or("").starts_with('-');
  page.after = AfterFromCursor(parameters, identity);
  page.count = parameters.Flag("count").value_or(false);
  page.facets = FacetsOf(parameters);
  return page;
}

Json PageJson(const char* name, Json records, const std::optional<std::string>& next,
              const std::optional<std::uint64_t>& total, const std::vector<Facet>& facets,
              const Parameters& parameters, const std::string& identity) {
  Json json = {{name, std::move(records)},
               {"next", next ? Json(MakeCursor(identity, *next)) : Json(nullptr)}};
  if (total) json["total"] = *total;
  if (parameters.has("facets")) json["facets"] = FacetsJson(facets);
  return json;
}

}  // namespace pliant::server
