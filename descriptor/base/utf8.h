// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace pliant {

// The code points of UTF-8; every byte that belongs to none becomes U+FFFD.
std::u32string DecodeUtf8(std::string_view text);

// Code points up to U+10FFFF.
std::string EncodeUtf8(std::u32string_view text);

}  // namespace pliant
