// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace pliant {

struct Utf8Character {
  char32_t point = 0;
  std::size_t length = 0;  // bytes; 0 = the text begins with an invalid byte (RFC 3629)
};
// The first character of a text, which must not be empty.
Utf8Character FirstCharacter(std::string_view text);

// The code points of UTF-8; invalid bytes are replaced by U+FFFD.
std::u32string DecodeUtf8(std::string_view text);

// Code points up to U+10FFFF.
std::string EncodeUtf8(std::u32string_view text);

}  // namespace pliant
