// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The parameters of a request, wherever they stand: query, form fields, keys of a JSON body.
// Every complaint is a ProblemError that names the parameter.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/http/message.h"
#include "server/http/router.h"
#include "server/json.h"

namespace pliant::server {

class Parameters {
 public:
  // Throws "unknown_parameter" for a name that the route does not list, "duplicate_parameter",
  // "invalid_json", and "invalid_parameter" for text that is not UTF-8. The part or field "image"
  // is the picture, never a parameter.
  Parameters(const Route& route, const Request& request);

  bool has(const std::string& name) const { return values_.contains(name); }

  // Absent = nothing.
  std::optional<std::string> Text(const std::string& name) const;
  std::string RequiredText(const std::string& name) const;

  // A whole number within lowest..highest.
  std::optional<std::int64_t> Integer(const std::string& name, std::int64_t lowest,
                                      std::int64_t highest) const;
  std::optional<double> Number(const std::string& name, double lowest, double highest) const;
  // Comma-separated finite numbers, exactly `count` of them (a JSON body may give an array).
  std::optional<std::vector<double>> Numbers(const std::string& name, std::size_t count) const;

  template <typename T>
  std::optional<T> Choice(const std::string& name,
                          const std::vector<std::pair<std::string, T>>& choices) const {
    const std::optional<std::string> text = Text(name);
    if (!text) return std::nullopt;
    std::vector<std::string> names;
    for (const auto& [choice, value] : choices) {
      if (choice == *text) return value;
      names.push_back(choice);
    }
    ThrowNotOneOf(name, names);
  }

  // Text that is a JSON object, in one line.
  std::optional<std::string> JsonObject(const std::string& name) const;

 private:
  void Insert(const Route& route, const std::string& name, std::string value);
  [[noreturn]] static void ThrowNotOneOf(const std::string& name,
                                         const std::vector<std::string>& choices);

  std::map<std::string, std::string> values_;
};

// Throws ProblemError "invalid_parameter" for `name`.
[[noreturn]] void ThrowInvalid(const std::string& name, const std::string& detail);

}  // namespace pliant::server
