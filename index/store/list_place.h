// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where a page of a list ended (ListPage::next), as text. Private to index/store/.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace pliant {

// The value that the list is in order of, there, and what decides between equal ones.
struct ListPlace {
  std::string text;
  std::int64_t number = 0;
  std::string tie;
};

std::string WritePlace(bool is_text, const ListPlace& place);
// nullopt for an empty text: the beginning. Throws kInvalidArgument "after_invalid".
std::optional<ListPlace> ReadPlace(bool is_text, const std::string& text);

}  // namespace pliant
