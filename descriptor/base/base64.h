// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// RFC 4648.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace pliant {

std::string Base64(const void* data, std::size_t bytes);
// Section 4 or 5, with or without padding and line breaks; a "data:...;base64," before it is taken
// off. False when the text is anything else.
bool Base64Decode(std::string_view text, std::vector<std::uint8_t>* bytes);

// Section 5, without padding.
std::string Base64UrlEncode(std::string_view bytes);
// False when the text is not base64url.
bool Base64UrlDecode(std::string_view text, std::string* bytes);

}  // namespace pliant
