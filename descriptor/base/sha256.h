// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// SHA-256 (FIPS 180-4) through OpenSSL.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace pliant {

// 64 lower-case hex digits. Thread-safe.
std::string Sha256Hex(std::span<const std::uint8_t> bytes);
std::string Sha256Hex(std::string_view text);

}  // namespace pliant
