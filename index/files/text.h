// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Text from outside: checks, display, and comparison in any case. Thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace pliant {

bool IsValidUtf8(std::string_view text);
bool HasControlCharacter(std::string_view text);  // of ASCII

// Whether valid UTF-8 has no invisible characters, no characters that change the writing direction
// and no 8-bit control characters. Two such texts that look the same are the same.
bool LooksAsItIs(std::string_view text);

// Whether all are letters and digits of ASCII, or of `marks`.
bool IsNameOf(std::string_view text, std::string_view marks);

// `text` with control characters and invalid UTF-8 bytes escaped as \xHH, and characters that are
// invisible or change the direction of writing as \u{H...}, for display, JSON and names derived
// from file names.
std::string ToDisplayText(std::string_view text);

// The display text of a name for a message: of a longer one the first bytes, and "...".
inline constexpr std::size_t kMostShownBytes = 512;  // an object's name
std::string Shown(std::string_view name, std::size_t most_bytes = kMostShownBytes);

// Text whose bytes are in the natural order of `text`: runs of digits by their value, so that "(2)"
// is before "(10)". A run is written as the number of its digits, without leading zeros, and these.
std::string NaturalKey(std::string_view text);

// RFC 3986, 2.1: every byte but letters, digits and those in `kept` as %HH.
std::string PercentEncode(std::string_view text, std::string_view kept);

// The code points of UTF-8 in lower case, one for one ("ß" stays: it is not "ss"), by Unicode's
// simple mappings. Invalid bytes are replaced by U+FFFD. There is no normalisation: text with
// combining marks differs from text with precomposed letters.
std::u32string FoldCase(std::string_view text);

// The words of `text`, folded, separated by white space.
std::vector<std::u32string> FoldedWords(std::string_view text);

// Whether each of the folded words occurs in one of the texts.
bool OccurIn(const std::vector<std::u32string>& words, const std::vector<std::string_view>& texts);

}  // namespace pliant
