// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/base64.h"

#include <algorithm>
#include <array>
#include <initializer_list>

namespace pliant {
namespace {

constexpr std::string_view kDigits =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr std::string_view kUrlDigits =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

constexpr std::int8_t kNone = -1;
constexpr std::int8_t kBlank = -2;
using Values = std::array<std::int8_t, 256>;  // of each character

constexpr Values ValuesOf(std::initializer_list<std::string_view> alphabets,
                          std::string_view blanks = {}) {
  Values values{};
  for (std::int8_t& value : values) value = kNone;
  for (const std::string_view digits : alphabets) {
    for (std::size_t i = 0; i < digits.size(); ++i) {
      values[static_cast<unsigned char>(digits[i])] = static_cast<std::int8_t>(i);
    }
  }
  for (const char c : blanks) values[static_cast<unsigned char>(c)] = kBlank;
  return values;
}

constexpr std::string_view kBlanks = " \t\r\n";
constexpr Values kAnyValues = ValuesOf({kDigits, kUrlDigits}, kBlanks);
constexpr Values kUrlValues = ValuesOf({kUrlDigits});

std::string Encode(const std::uint8_t* data, std::size_t bytes, std::string_view digits, bool pad) {
  std::string text;
  text.reserve((bytes + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes; i += 3) {
    const std::size_t have = std::min<std::size_t>(3, bytes - i);
    std::uint32_t group = data[i] << 16;
    if (have > 1) group |= data[i + 1] << 8;
    if (have > 2) group |= data[i + 2];
    for (std::size_t j = 0; j < 4; ++j) {
      if (j <= have) {
        text += digits[(group >> (18 - 6 * j)) & 63];
      } else if (pad) {
        text += '=';
      }
    }
  }
  return text;
}

// One form for each value: no left-over character, no stray bits.
template <typename Container>
bool Decode(std::string_view text, const Values& values, Container* bytes) {
  bytes->clear();
  bytes->reserve(text.size() / 4 * 3 + 2);
  std::uint32_t group = 0;
  int bits = 0;
  for (const char c : text) {
    const std::int8_t value = values[static_cast<unsigned char>(c)];
    if (value == kBlank) continue;
    if (value < 0) return false;
    group = (group << 6 | static_cast<std::uint32_t>(value)) & 0xffff;
    bits += 6;
    if (bits >= 8) {
      bits -= 8;
      bytes->push_back(static_cast<typename Container::value_type>(group >> bits & 0xff));
    }
  }
  return bits < 6 && (group & ((1U << bits) - 1)) == 0;
}

}  // namespace

std::string Base64(const void* data, std::size_t bytes) {
  return Encode(static_cast<const std::uint8_t*>(data), bytes, kDigits, true);
}

bool Base64Decode(std::string_view text, std::vector<std::uint8_t>* bytes) {
  constexpr std::string_view kData = "data:";
  constexpr std::string_view kMark = ";base64,";
  constexpr std::size_t kMaxTypeBytes = 256;
  if (text.starts_with(kData)) {
    const std::size_t mark = text.substr(0, kMaxTypeBytes).find(kMark);
    if (mark == std::string_view::npos) return false;
    text.remove_prefix(mark + kMark.size());
  }
  const std::size_t end = text.find_last_not_of(kBlanks) + 1;
  std::size_t padding = 0;
  for (text = text.substr(0, end); text.ends_with('='); text.remove_suffix(1)) ++padding;
  return Decode(text, kAnyValues, bytes) && (padding == 0 || (bytes->size() + padding) % 3 == 0) &&
         padding < 3;
}

std::string Base64UrlEncode(std::string_view bytes) {
  return Encode(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), kUrlDigits,
                false);
}

bool Base64UrlDecode(std::string_view text, std::string* bytes) {
  return Decode(text, kUrlValues, bytes);
}

}  // namespace pliant
