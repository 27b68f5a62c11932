// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JSON values that can be given up when memory has run out. Private to files/.
#pragma once

#include <utility>

#include <nlohmann/json.hpp>

namespace pliant {

// The destructor of nlohmann::json moves what a value contains into a vector; where there is no
// memory for that vector, it ends the program. Taken apart from its leaves up, a value needs none.
// For values of few levels: this goes down by recursion.
class OwnedJson {
 public:
  explicit OwnedJson(nlohmann::json value) noexcept : value_(std::move(value)) {}
  ~OwnedJson() { TakeApart(&value_); }
  OwnedJson(const OwnedJson&) = delete;
  OwnedJson& operator=(const OwnedJson&) = delete;

  // Leaves an empty array or object; values of other types as they are.
  static void TakeApart(nlohmann::json* value) noexcept {
    if (!value->is_structured()) return;
    for (nlohmann::json& child : *value) TakeApart(&child);
    value->clear();
  }

  nlohmann::json& operator*() { return value_; }
  nlohmann::json* operator->() { return &value_; }

 private:
  nlohmann::json value_;
};

}  // namespace pliant
