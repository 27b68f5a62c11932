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

std::u32string DecodeUtf8(std::string_view text) {
  std::u32string points;
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const std::size_t length = lead < 0x80 ? 1 : lead >> 5 == 6 ? 2 : lead >> 4 == 14 ? 3 : 4;
    char32_t point = length == 1 ? lead : lead & (0xFF >> (length + 1));
    bool good = lead < 0x80 || (lead >= 0xC2 && lead < 0xF5 && i + length <= text.size());
    for (std::size_t j = 1; good && j < length; ++j) {
      const auto next = static_cast<unsigned char>(text[i + j]);
      good = next >> 6 == 2;
      point = point << 6 | (next & 0x3F);
    }
    good = good && IsCharacter(point, length);
    points += good ? point : U'\uFFFD';
    i += good ? length : 1;
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
