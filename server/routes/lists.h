// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lists page by page: the common parameters, cursors, and the answer.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "index/json/record_json.h"
#include "index/records/listing.h"
#include "server/http/parameters.h"
#include "server/routes/answers.h"
#include "server/routes/service.h"

namespace pliant::server {

Parameter CursorParameter();
Parameter LimitParameter();

// A cursor holds the list that it belongs to and the position after which the next page begins; no
// position: null.
Json CursorJson(const std::string& list, const std::optional<std::string>& after);
// Empty for no cursor, or an empty one. Throws ProblemError "invalid_cursor".
std::string AfterFromCursor(const Parameters& parameters, const std::string& list);
[[noreturn]] void ThrowInvalidCursor();

// A page of a list whose "next" is a cursor or null, which is also a Link header (RFC 8288).
Response PageResponse(const Request& request, const Json& page);

Parameter FilterParameter();    // "filter"
Parameter TextParameter();      // "q"
Parameter OfObjectParameter();  // "object"
// "filter", "q", "sort", "count", "facets", "cursor", "limit". `orders` are the values of "sort",
// the default first; a minus reverses the order.
std::vector<Parameter> ListParameters(const std::vector<std::string>& orders);

// "object", "filter" and "q", as far as the route has them. Throws ProblemError
// "invalid_parameter", and what ParseFilter throws.
Selection SelectionOf(const Parameters& parameters, const std::string& collection);

// The parameter "sort", without its minus; the first of `orders` by default.
template <typename Order>
Order OrderOf(const Parameters& parameters, const Choices<Order>& orders) {
  std::string sort = parameters.Text("sort").value_or(orders.front().first);
  if (sort.starts_with('-')) sort.erase(0, 1);
  return std::find_if(orders.begin(), orders.end(),
                      [&](const auto& order) {
                        return IsChoice(order.first, sort);  // one is: the parameter is a choice
                      })
      ->second;
}

// KEY of the order "metadata.KEY"; else empty.
std::string OrderKeyOf(const Parameters& parameters);

// Identifies the list to its cursors: a cursor of a list with other parameters is invalid.
std::string ListIdentity(const char* list, const Selection& which, const Parameters& parameters);

// All but the order. Throws ProblemError "invalid_cursor" and "invalid_parameter".
PageOptions PageOptionsOf(const Parameters& parameters, const std::string& identity);

// A page of a list of the collection: {`name`: records, "next"}, and "total" and "facets" if the
// request asks for them. `Listing` and `to_json`: what the engine lists, and one record as JSON.
template <typename Listing, typename Order, typename ToJson>
Response ListAnswer(Service& service, const Request& request, const Parameters& parameters,
                    const char* name, const Choices<Order>& orders, ToJson to_json) {
  Listing list;
  list.which = SelectionOf(parameters, CollectionOf(service, request));
  const std::string identity = ListIdentity(name, list.which, parameters);
  static_cast<PageOptions&>(list) = PageOptionsOf(parameters, identity);
  list.order = OrderOf(parameters, orders);
  if constexpr (requires { list.order_key; }) list.order_key = OrderKeyOf(parameters);
  try {
    const auto page = service.engine().ListPage(list);
    Json records = Json::array();
    for (const auto& record : page.records) records.push_back(to_json(record));
    Json json = {{name, std::move(records)}, {"next", CursorJson(identity, page.next)}};
    if (page.total) json["total"] = *page.total;
    if (parameters.has("facets")) json["facets"] = FacetsJson(page.facets);
    return PageResponse(request, json);
  } catch (const Error& error) {  // the client made the cursor's position up
    if (error.reason() == "after_invalid") ThrowInvalidCursor();
    throw;
  }
}

}  // namespace pliant::server
