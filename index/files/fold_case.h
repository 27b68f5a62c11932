// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Text compared whatever its case. Thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace pliant {

// The code points of UTF-8 in lower case, one for one ("ß" stays: it is not "ss"), by Unicode's
// simple mappings; every byte that belongs to none becomes U+FFFD. Letters and accents that are
// characters of their own stay so: what is written with combining marks differs.
std::u32string FoldCase(std::string_view text);

// The words of `text`, folded, as white space parts them.
std::vector<std::u32string> FoldedWords(std::string_view text);

// Whether each of the folded words occurs in one of the texts.
bool OccurIn(const std::vector<std::u32string>& words, const std::vector<std::string_view>& texts);

}  // namespace pliant
