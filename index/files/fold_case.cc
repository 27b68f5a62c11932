// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/fold_case.h"

#include <algorithm>
#include <clocale>
#include <cwctype>

#include <locale.h>

#include "descriptor/base/error.h"
#include "descriptor/base/utf8.h"

namespace pliant {
namespace {

// The C library's tables, which do not depend on the language that the program runs in.
locale_t Unicode() {
  static const locale_t locale = [] {
    const locale_t made = newlocale(LC_CTYPE_MASK, "C.UTF-8", nullptr);
    if (made == nullptr) {
      throw Error(ErrorCode::kInternal, "locale_missing",
                  "the system has no locale C.UTF-8, which comes with its C library");
    }
    return made;
  }();
  return locale;
}

char32_t Fold(char32_t c) {
  if (c < 0x80) return c >= U'A' && c <= U'Z' ? c + 0x20 : c;
  // By way of the upper case: "ς" and "σ" are both "Σ".
  const auto upper = towupper_l(static_cast<wint_t>(c), Unicode());
  return static_cast<char32_t>(towlower_l(upper, Unicode()));
}

bool IsSpace(char32_t c) {
  return c == U' ' || (c >= U'\t' && c <= U'\r') || c == 0xA0 || c == 0x3000;
}

}  // namespace

std::u32string FoldCase(std::string_view text) {
  std::u32string folded = DecodeUtf8(text);
  for (char32_t& c : folded) c = Fold(c);
  return folded;
}

std::vector<std::u32string> FoldedWords(std::string_view text) {
  std::vector<std::u32string> words;
  std::u32string word;
  for (const char32_t c : FoldCase(text) + U' ') {
    if (!IsSpace(c)) {
      word += c;
    } else if (!word.empty()) {
      words.push_back(std::move(word));
      word.clear();
    }
  }
  return words;
}

bool OccurIn(const std::vector<std::u32string>& words, const std::vector<std::string_view>& texts) {
  std::vector<std::u32string> folded;
  for (const std::string_view text : texts) folded.push_back(FoldCase(text));
  return std::all_of(words.begin(), words.end(), [&](const std::u32string& word) {
    return std::any_of(folded.begin(), folded.end(), [&](const std::u32string& text) {
      return text.find(word) != std::u32string::npos;
    });
  });
}

}  // namespace pliant
