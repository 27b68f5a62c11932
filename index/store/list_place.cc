// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/list_place.h"

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

using Json = nlohmann::json;

}  // namespace

std::string WritePlace(bool is_text, const ListPlace& place) {
  const Json value = is_text ? Json(place.text) : Json(place.number);
  // Text in a database may be any bytes when another program has written it.
  return Json::array({value, place.tie}).dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::optional<ListPlace> ReadPlace(bool is_text, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  const bool fits = json.is_array() && json.size() == 2 && json[1].is_string() &&
                    (is_text ? json[0].is_string() : json[0].is_number_integer());
  if (!fits) {
    throw Error(ErrorCode::kInvalidArgument, "after_invalid",
                "the place to go on at is none of this list");
  }
  ListPlace place;
  place.tie = json[1].get<std::string>();
  if (is_text) {
    place.text = json[0].get<std::string>();
  } else {
    place.number = json[0].get<std::int64_t>();
  }
  return place;
}

}  // namespace pliant
