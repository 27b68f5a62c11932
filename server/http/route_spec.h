// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a route takes and gives, as data: requests are checked against it, and the OpenAPI document
// is made of it, so that the two cannot differ.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace pliant::server {

// One parameter. In the query and in forms it is text of this type, in a JSON body a value of the
// type that the OpenAPI document gives for it. Built like
//   Parameter("limit", "hits a page").Integer(1, 1000).Default("10")
struct Parameter {
  enum class Type {
    kText,
    kInteger,   // lowest..highest
    kNumber,    // lowest..highest
    kNumbers,   // exactly `count` of them, with commas between
    kChoice,    // one of `choices`
    kBoolean,   // "true" or "false"
    kJson,      // a JSON object
    kJsonList,  // a JSON array
    kImage,     // a JSON object: {"image": base64} or {"image_url": address}
  };

  Parameter(const char* parameter_name, const char* for_what)
      : name(parameter_name), meaning(for_what) {}

  Parameter Integer(std::int64_t from, std::int64_t to) && {
    type = Type::kInteger;
    lowest = static_cast<double>(from);
    highest = static_cast<double>(to);
    return std::move(*this);
  }
  Parameter Number(double from, double to) && {
    type = Type::kNumber;
    lowest = from;
    highest = to;
    return std::move(*this);
  }
  Parameter Numbers(std::size_t how_many) && {
    type = Type::kNumbers;
    count = how_many;
    return std::move(*this);
  }
  Parameter Choice(std::vector<std::string> names) && {
    type = Type::kChoice;
    choices = std::move(names);
    return std::move(*this);
  }
  Parameter Boolean() && {
    type = Type::kBoolean;
    return std::move(*this);
  }
  Parameter Json() && {
    type = Type::kJson;
    return std::move(*this);
  }
  Parameter JsonList() && {
    type = Type::kJsonList;
    return std::move(*this);
  }
  Parameter Image() && {
    type = Type::kImage;
    return std::move(*this);
  }
  // What it is when it is not given, as text.
  Parameter Default(const char* value) && {
    default_value = value;
    return std::move(*this);
  }
  Parameter Required() && {
    required = true;
    return std::move(*this);
  }

  std::string name;
  std::string meaning;
  Type type = Type::kText;
  double lowest = 0;
  double highest = 0;
  std::size_t count = 0;
  std::vector<std::string> choices = {};
  std::string default_value = {};
  bool required = false;
};

// One way in which a route answers when nothing is wrong.
struct Answer {
  int status = 200;
  std::string meaning;
  std::string schema = {};  // name of a component; empty = no body, or one that is no JSON
  std::string content_type = "application/json";  // when `schema` or a body; empty = no body
};

}  // namespace pliant::server
