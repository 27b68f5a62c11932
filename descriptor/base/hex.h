// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bytes as hex digits and back. Internal to Pliant.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pliant {

std::string ToHex(std::span<const std::uint8_t> bytes);                  // lower case
std::optional<std::vector<std::uint8_t>> FromHex(std::string_view hex);  // nullopt = not hex
int HexValue(char digit);                                                // -1 = no hex digit

// Hex digits of system random numbers, for unique names.
std::string RandomHex(std::size_t digits);

}  // namespace pliant
