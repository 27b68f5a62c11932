// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The parameters of a request, wherever they stand: query, form fields, keys of a JSON body.
// Every complaint is a ProblemError that names the parameter.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "server/http/json.h"
#include "server/http/message.h"
#include "server/http/router.h"

namespace pliant::server {

// An image in JSON: base64, or an address to fetch it from. Never both; neither = there is none.
struct ImageText {
  std::optional<std::string> base64 = {};
  std::optional<std::string> url = {};
};

class Parameters {
 public:
  // Checks everything against what the route says of its parameters. Throws "unknown_parameter" for
  // a name that it does not list, "duplicate_parameter", "missing_parameter", "invalid_json", and
  // "invalid_parameter" for text that is not UTF-8 or a value that the parameter cannot have; in a
  // JSON body also for one of another type ("5" is no number). There null is as good as nothing.
  // The part or field "image" is the image, never a parameter; in a JSON body it is base64, or
  // "image_url" stands in its place.
  // `route` must outlive this.
  Parameters(const Route& route, const Request& request);

  bool has(const std::string& name) const {
    return values_.contains(name) || images_.contains(name);
  }
  bool takes(const std::string& name) const;  // whether the route has a parameter of that name

  // The key "image" of a JSON body, where the route takes an image; null = there is none.
  const std::string* image_base64() const { return image_.base64 ? &*image_.base64 : nullptr; }
  // Likewise the key "image_url". Never both.
  const std::string* image_url() const { return image_.url ? &*image_.url : nullptr; }

  // Absent = nothing. The name must be one of the route's, of the kind asked for; else
  // std::logic_error.
  std::optional<std::string> Text(const std::string& name) const;
  std::optional<std::int64_t> Integer(const std::string& name) const;
  std::optional<double> Number(const std::string& name) const;
  std::optional<std::vector<double>> Numbers(const std::string& name) const;
  std::optional<bool> Flag(const std::string& name) const;
  // Text that is a JSON object, in one line.
  std::optional<std::string> JsonObject(const std::string& name) const;
  // nullptr = absent. As long as this lives.
  const ImageText* Image(const std::string& name) const;
  // The elements of a JSON array.
  std::optional<Json> JsonList(const std::string& name) const;

  template <typename T>
  std::optional<T> Choice(const std::string& name,
                          const std::vector<std::pair<std::string, T>>& choices) const {
    const std::optional<std::string> text = Value(name, Parameter::Type::kChoice);
    if (!text) return std::nullopt;
    for (const auto& [choice, value] : choices) {
      if (choice == *text) return value;
    }
    throw std::logic_error("parameter " + name + " may be '" + *text + "', which has no meaning");
  }

 private:
  // Throws "unknown_parameter".
  const Parameter& Known(const std::string& name) const;
  void Insert(const Parameter& spec, std::string value);
  void InsertImage(const Parameter& spec, Json value);
  void RequireNew(const std::string& name) const;
  const Parameter& Spec(const std::string& name) const;
  std::optional<std::string> Value(const std::string& name, Parameter::Type type) const;

  const Route& route_;
  std::map<std::string, std::string> values_;
  std::map<std::string, ImageText> images_;
  ImageText image_;
};

// Throws ProblemError "invalid_parameter" for `name`.
[[noreturn]] void ThrowInvalid(const std::string& name, const std::string& detail);

}  // namespace pliant::server
