// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/utf8.h"

namespace pliant {
namespace {

// What a sequence of this length must reach: shorter ones write it, too.
constexpr char32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};

bool IsCharacter(char32_t point, std::size_t length) {
  return point >= kLeast[length] && point <= 0x10FFFF && (point < 0xD800 || point > 0xDFFF);
}

}  // namespace

Utf8Character FirstCharacter(std::string_view text) {
  const auto lead = static_cast<unsigned char>(text[0]);
  if (lead < 0x80) return {lead, 1};
  const std::size_t length = lead >> 5 == 6 ? 2 : lead >> 4 == 14 ? 3 : 4;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < length) return {};
  char32_t point = lead & (0xFF >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    const auto next = static_cast<unsigned char>(text[i]);
    if (next >> 6 != 2) return {};
    point = point << 6 | (next & 0x3F);
  }
  return IsCharacter(point, length) ? Utf8Character{point, length} : Utf8Character{};
}

std::u32string DecodeUtf8(std::string_view text) {
  std::u32string points;
  while (!text.empty()) {
    const Utf8Character first = FirstCharacter(text);
    points += first.length > 0 ? first.point : U'\uFFFD';
    text.remove_prefix(first.length > 0 ? first.length : 1);
  }
  return points;
}

std::string EncodeUtf8(std::u32string_view text) {
  std::string bytes;
  for (const char32_t c : text) {
    if (c < 0x80) {
      bytes += static_cast<char>(c);
      continue;
    }
    const int more = c < 0x800 ? 1 : c < 0x10000 ? 2 : 3;  // bytes that follow the first
    constexpr char32_t kFirst[] = {0xC0, 0xE0, 0xF0};
    bytes += static_cast<char>(kFirst[more - 1] | c >> 6 * more);
    for (int i = more - 1; i >= 0; --i) bytes += static_cast<char>(0x80 | (c >> 6 * i & 0x3F));
  }
  return bytes;
}

}  // namespace pliant
