// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The parameters of a request: from the query, from form fields (multipart/form-data, RFC 7578) and
// from the keys of a JSON body. Every refusal is a ProblemError that names the parameter.
#pragma once

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

inline constexpr const char* kImagePart = "image";  // the parts of that name are images

// An image in JSON: either base64, or an address to fetch it from.
struct ImageText {
  std::optional<std::string> base64 = {};
  std::optional<std::string> url = {};
};

// What the words of a choice mean.
template <typename T>
using Choices = std::vector<std::pair<std::string, T>>;

template <typename T>
std::vector<std::string> NamesOf(const Choices<T>& choices) {
  std::vector<std::string> names;
  for (const auto& [name, meaning] : choices) names.push_back(name);
  return names;
}

class Parameters {
 public:
  // Checks all values against the route's parameters. Throws "unknown_parameter" for a name that
  // the route does not list, "duplicate_parameter", "missing_parameter", "invalid_json", and
  // "invalid_parameter" for text that is not UTF-8 and for values that the parameter cannot have.
  // A JSON body must have the right types ("5" is no number); null means that there is no value.
  // The form field "image" is the image and no parameter; in a JSON body it is base64, and
  // "image_url" can replace it. `route` must outlive this. `body`: what messages call a JSON body.
  Parameters(const Route& route, const Request& request, const char* body = "body");

  bool has(const std::string& name) const {
    return values_.contains(name) || images_.contains(name);
  }
  bool takes(const std::string& name) const;  // whether the route has a parameter of that name

  // Absent = nothing. `T` is std::int64_t, double, std::vector<double>, bool or Json, as the type
  // of the parameter is. Throws std::logic_error unless `name` is one of the route's parameters.
  template <typename T>
  std::optional<T> Get(const std::string& name) const {
    const auto found = values_.find(Spec(name).name);
    return found == values_.end() ? std::nullopt : std::optional(found->second.get<T>());
  }
  // The same, or the default that the route declares for the parameter.
  template <typename T>
  T Value(const std::string& name) const {
    return Get<Json>(name).value_or(DefaultOf(name)).template get<T>();
  }
  std::optional<std::string> Text(const std::string& name) const;  // of any type; JSON on one line
  // Null = absent; owned by this. Without a name: the image in a JSON body, beside the parameters.
  const ImageText* Image(const std::string& name = {}) const;

  template <typename T>
  std::optional<T> Choice(const std::string& name, const Choices<T>& choices) const {
    const auto text = Get<std::string>(name);
    if (!text) return std::nullopt;
    for (const auto& [choice, value] : choices) {
      if (choice == *text) return value;
    }
    throw std::logic_error("parameter " + name + " has no meaning for '" + *text + "'");
  }

 private:
  // Throws "unknown_parameter". `is_file`: a file of a form has that name.
  const Parameter& Known(const std::string& name, bool is_file = false) const;
  void InsertPart(const Part& part);
  void InsertText(const std::string& name, const std::string& text);
  void Insert(const Parameter& spec, Json value);
  const Parameter& Spec(const std::string& name) const;
  Json DefaultOf(const std::string& name) const;

  const Route& route_;
  std::map<std::string, Json> values_;
  std::map<std::string, ImageText> images_;  // "" = the body's own
};

// Throws ProblemError "invalid_parameter" for `name`.
[[noreturn]] void ThrowInvalid(const std::string& name, const std::string& detail);

}  // namespace pliant::server
