// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/text.h"

#include <algorithm>
#include <array>
#include <clocale>
#include <cstddef>
#include <cstdint>
#include <cwctype>
#include <sstream>

#include <locale.h>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/utf8.h"

namespace pliant {
namespace {

struct Range {
  std::uint32_t first, last;
};

// Control characters of eight bits (ECMA-48: a terminal may obey them), and what is invisible or
// turns what follows around (Unicode's Default_Ignorable_Code_Point; UAX #9, UTR #36) or is a blank
// that is no space: two names that look the same would not be the same.
constexpr std::array<Range, 19> kDeceptive = {{{0x80, 0x9F},
                                               {0xAD, 0xAD},
                                               {0x34F, 0x34F},
                                               {0x61C, 0x61C},
                                               {0x115F, 0x1160},
                                               {0x17B4, 0x17B5},
                                               {0x180B, 0x180F},
                                               {0x200B, 0x200F},
                                               {0x2028, 0x202E},
                                               {0x2060, 0x206F},
                                               {0x2800, 0x2800},
                                               {0x3164, 0x3164},
                                               {0xFE00, 0xFE0F},
                                               {0xFEFF, 0xFEFF},
                                               {0xFFA0, 0xFFA0},
                                               {0xFFF0, 0xFFFB},
                                               {0x1BCA0, 0x1BCA3},
                                               {0x1D173, 0x1D17A},
                                               {0xE0000, 0x10FFFF}}};

bool IsDeceptive(std::uint32_t point) {
  return std::any_of(kDeceptive.begin(), kDeceptive.end(), [point](const Range& range) {
    return point >= range.first && point <= range.last;
  });
}

bool IsVariationSelector(std::uint32_t point) { return point >= 0xFE00 && point <= 0xFE0F; }

// Finds deceptive characters of valid UTF-8, one code point after the other. Joiners and variation
// selectors stay where writing needs them: after a letter of another script than ours (Persian,
// Hindi), and in an emoji.
class DeceptionFinder {
 public:
  // `last` = nothing follows.
  bool IsDeceptiveHere(std::uint32_t point, bool last) {
    const bool joiner = point == 0x200C || point == 0x200D;
    const bool joins = joiner && before_ >= 0x600 && !last;
    const bool deceptive = IsDeceptive(point) && !joins && !Varies(point);
    before_ = joiner || deceptive ? 0 : point;
    return deceptive;
  }
  // An escape replaces invalid text here.
  void OnEscape() { before_ = 0; }

 private:
  // Signs that are drawn as emojis: (c), (R), those of a telephone's keys, and later ones.
  bool Varies(std::uint32_t point) const {
    const bool key = before_ == '#' || before_ == '*' || (before_ >= '0' && before_ <= '9');
    return IsVariationSelector(point) && !IsVariationSelector(before_) &&
           (key || before_ == 0xA9 || before_ == 0xAE || before_ >= 0x600);
  }

  std::uint32_t before_ = 0;
};

// \u{202e}
std::string Escaped(std::uint32_t point) {
  std::ostringstream out;
  out << "\\u{" << std::hex << point << '}';
  return out.str();
}

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

bool IsValidUtf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t length = FirstCharacter(text).length;
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

bool HasControlCharacter(std::string_view text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

bool LooksAsItIs(std::string_view text) {
  DeceptionFinder finder;
  while (!text.empty()) {
    const Utf8Character first = FirstCharacter(text);
    if (finder.IsDeceptiveHere(first.point, text.size() == first.length)) return false;
    text.remove_prefix(first.length);
  }
  return true;
}

bool IsNameOf(std::string_view text, std::string_view marks) {
  return std::all_of(text.begin(), text.end(), [&](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           marks.find(c) != std::string_view::npos;
  });
}

std::string ToDisplayText(std::string_view text) {
  std::string out;
  DeceptionFinder finder;
  while (!text.empty()) {
    const auto [point, length] = FirstCharacter(text);
    if (length == 0 || HasControlCharacter(text.substr(0, 1))) {
      const auto byte = static_cast<std::uint8_t>(text[0]);
      out += "\\x" + ToHex({&byte, 1});
      finder.OnEscape();
    } else if (finder.IsDeceptiveHere(point, text.size() == length)) {
      out += Escaped(point);
    } else {
      out += text.substr(0, length);
    }
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return out;
}

std::string Shown(std::string_view name, std::size_t most_bytes) {
  if (name.size() <= most_bytes) return ToDisplayText(name);
  const auto begins_inside = [&] {  // a character
    return (static_cast<unsigned char>(name[most_bytes]) & 0xC0) == 0x80;
  };
  for (int i = 0; i < 3 && most_bytes > 0 && begins_inside(); ++i) --most_bytes;
  return ToDisplayText(name.substr(0, most_bytes)) + "...";
}

std::string NaturalKey(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789";
  constexpr std::size_t kCountDigits = 5;  // of the number of digits: more than a name can have
  std::string key;
  while (!text.empty()) {
    const std::size_t before = std::min(text.find_first_of(kDigits), text.size());
    key += text.substr(0, before);
    text.remove_prefix(before);
    if (text.empty()) break;
    const std::size_t end = std::min(text.find_first_not_of(kDigits), text.size());
    const std::size_t zeros = std::min(text.find_first_not_of('0'), end);
    const std::string count = std::to_string(end - zeros);
    key.append(kCountDigits - std::min(kCountDigits, count.size()), '0');
    key.append(count).append(text.substr(zeros, end - zeros));
    text.remove_prefix(end);
  }
  return key;
}

std::string PercentEncode(std::string_view text, std::string_view kept) {
  static constexpr char kDigits[] = "0123456789ABCDEF";
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (IsNameOf({&c, 1}, kept)) {
      out += c;
    } else {
      out += {'%', kDigits[byte >> 4], kDigits[byte & 15]};
    }
  }
  return out;
}

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
