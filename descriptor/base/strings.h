// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Small tools for text. Only letters of ASCII have a case here; index/files/text.h knows all.
#pragma once

#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace pliant {

std::string Lower(std::string_view text);
bool EqualsIgnoringCase(std::string_view a, std::string_view b);

// Without blanks and tabs at both ends.
std::string_view Trimmed(std::string_view text);

// The parts before each separator, including empty ones; the last part needs no separator.
std::vector<std::string> Split(std::string_view text, char separator);
std::string Join(const std::vector<std::string>& parts, std::string_view separator);

// The number that the whole text is, as std::from_chars reads it: without blanks and plus sign.
// `base`: for whole numbers other than decimal. Nothing for other text and for numbers that do not
// fit.
template <typename Number, typename... Base>
std::optional<Number> NumberOf(std::string_view text, Base... base) {
  Number value{};
  const char* const begin = text.data();
  const char* const end = begin + text.size();
  const auto [stop, error] = std::from_chars(begin, end, value, base...);
  return error == std::errc() && stop == end ? std::optional(value) : std::nullopt;
}

}  // namespace pliant
