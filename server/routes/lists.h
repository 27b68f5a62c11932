// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What lists of images and objects have in common: which of them, in which order, what is counted
// beside, and cursors.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "index/engine/engine.h"
#include "index/json/json.h"
#include "index/records/listing.h"
#include "server/http/parameters.h"

namespace pliant::server {

Parameter CursorParameter();
Parameter LimitParameter();
int PageLimit(const Parameters& parameters);

// The position in a list. A cursor contains the parameters of its list, so it cannot be used with
// another list.
std::string MakeCursor(const std::string& list, const std::string& after);
// Empty when there is no cursor, or an empty one. Throws ProblemError "invalid_cursor".
std::string AfterFromCursor(const Parameters& parameters, const std::string& list);
[[noreturn]] void ThrowInvalidCursor();

Parameter FilterParameter();  // "filter"
Parameter TextParameter();    // "q"
// "filter", "q", "sort", "count", "facets"; `orders` may be sorted by, the first by default, and
// downwards with a minus.
std::vector<Parameter> ListParameters(const std::vector<std::string>& orders);

// Throws ProblemError "invalid_parameter" for "filter", which says where.
Filter FilterOf(const std::string& text);

// "object", "filter" and "q", as far as the route has them.
Selection SelectionOf(const Parameters& parameters, const std::string& collection);

template <typename Order>
using Orders = std::vector<std::pair<std::string, Order>>;

template <typename Order>
std::vector<std::string> NamesOf(const Orders<Order>& orders) {
  std::vector<std::string> names;
  for (const auto& [name, order] : orders) names.push_back(name);
  return names;
}

// The parameter "sort", without its minus; the first of `orders` when there is none.
template <typename Order>
Order OrderOf(const Parameters& parameters, const Orders<Order>& orders) {
  std::string sort = parameters.Text("sort").value_or(orders.front().first);
  if (sort.starts_with('-')) sort.erase(0, 1);
  for (const auto& [name, order] : orders) {
    if (name == sort) return order;
  }
  throw std::logic_error("there is no order " + sort);
}

// What a cursor of a list belongs to: with any other parameters it is refused.
std::string ListIdentity(const char* list, const Selection& which, const Parameters& parameters);

// All but the order. Throws ProblemError "invalid_cursor" and "invalid_parameter".
PageOptions PageOptionsOf(const Parameters& parameters, const std::string& identity);

// Throws ProblemError "invalid_cursor" for a place that somebody has made up.
template <typename Listing>
auto ListPageOf(Engine& engine, const Listing& list) {
  try {
    return engine.ListPage(list);
  } catch (const Error& error) {
    if (error.reason() == "after_invalid") ThrowInvalidCursor();
    throw;
  }
}

// {`name`: records, "next", and as asked "total" and "facets"}
Json PageJson(const char* name, Json records, const std::optional<std::string>& next,
              const std::optional<std::uint64_t>& total, const std::vector<Facet>& facets,
              const Parameters& parameters, const std::string& identity);

}  // namespace pliant::server
