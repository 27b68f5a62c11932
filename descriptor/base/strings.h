// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Small tools for text. Only letters of ASCII have a case here; index/files/text.h knows all.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace pliant {

std::string Lower(std::string_view text);
bool EqualsIgnoringCase(std::string_view a, std::string_view b);

// Without blanks and tabs at both ends.
std::string_view Trimmed(std::string_view text);

// The parts before each separator, including empty ones; the last part needs no separator.
std::vector<std::string> Split(std::string_view text, char separator);
std::string Join(const std::vector<std::string>& parts, std::string_view separator);

}  // namespace pliant
