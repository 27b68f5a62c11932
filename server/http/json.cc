// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/json.h"

#include <set>
#include <vector>

#include <fmt/format.h>

#include "server/http/problem.h"

namespace pliant::server {

Json ParseJson(const std::string& text, const std::string& name, Json::value_t top) {
  const auto fail = [&](const std::string& why) {
    return ProblemError("invalid_json", name + " " + why, {.parameter = name});
  };
  bool too_deep = false;
  bool too_many = false;
  std::vector<std::set<std::string>> names;  // of the objects that are open
  std::string twice;
  const auto watch = [&](int depth, Json::parse_event_t event, const Json& parsed) {
    const bool opens = event == Json::parse_event_t::object_start ||
                       event == Json::parse_event_t::array_start;  // the top has depth 0
    if (opens && depth >= kMaxJsonDepth) too_deep = true;
    if (event == Json::parse_event_t::object_start) names.emplace_back();
    if (event == Json::parse_event_t::object_end) names.pop_back();
    if (event == Json::parse_event_t::key) {
      const std::string& key = parsed.get_ref<const std::string&>();
      if (!names.back().insert(key).second && twice.empty()) twice = "'" + key.substr(0, 64) + "'";
      if (names.back().size() > kMaxJsonNames) too_many = true;
    }
    return !too_deep && !too_many;  // what is refused here is not kept
  };
  Json json = Json::parse(text, watch, /*allow_exceptions=*/false);
  if (too_deep) throw fail(fmt::format("is nested more than {} levels deep.", kMaxJsonDepth));
  if (too_many) throw fail(fmt::format("has more than {} keys in one object.", kMaxJsonNames));
  if (json.is_discarded()) throw fail("is not valid JSON.");
  if (!twice.empty()) throw fail("has the key " + twice + " more than once.");
  if (json.type() != top) throw fail(fmt::format("must be a JSON {}.", Json(top).type_name()));
  return json;
}

}  // namespace pliant::server
