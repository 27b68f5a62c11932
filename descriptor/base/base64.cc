// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/base64.h"

#include <algorithm>

#include <openssl/evp.h>

namespace pliant {
namespace {

constexpr std::string_view kBlanks = " \t\r\n";

void Replace(std::string& text, char from, char to) {
  std::replace(text.begin(), text.end(), from, to);
}

// Section 4 without padding. One form for each value: no left-over character, no stray bits.
template <typename Container>
bool Decode(std::string text, Container* bytes) {
  const std::size_t padding = (4 - text.size() % 4) % 4;
  text.append(padding, '=');
  bytes->resize(text.size() / 4 * 3);
  const auto* from = reinterpret_cast<const unsigned char*>(text.data());
  auto* to = reinterpret_cast<unsigned char*>(bytes->data());
  if (padding == 3 || EVP_DecodeBlock(to, from, static_cast<int>(text.size())) < 0) return false;
  bytes->resize(bytes->size() - padding);
  return Base64(bytes->data(), bytes->size()) == text;
}

}  // namespace

std::string Base64(const void* data, std::size_t bytes) {
  std::string text((bytes + 2) / 3 * 4, '\0');  // and OpenSSL writes a zero behind it
  EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                  static_cast<const unsigned char*>(data), static_cast<int>(bytes));
  return text;
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
  std::string digits(text);
  std::erase_if(digits, [](char c) { return kBlanks.find(c) != std::string_view::npos; });
  Replace(digits, '-', '+');
  Replace(digits, '_', '/');
  if (padding > 0 && (padding > 2 || (digits.size() + padding) % 4 != 0)) return false;
  return Decode(std::move(digits), bytes);
}

std::string Base64UrlEncode(std::string_view bytes) {
  std::string text = Base64(bytes.data(), bytes.size());
  text.erase(std::min(text.find('='), text.size()));
  Replace(text, '+', '-');
  Replace(text, '/', '_');
  return text;
}

bool Base64UrlDecode(std::string_view text, std::string* bytes) {
  if (text.find_first_of("+/=") != std::string_view::npos) return false;
  std::string digits(text);
  Replace(digits, '-', '+');
  Replace(digits, '_', '/');
  return Decode(std::move(digits), bytes);
}

}  // namespace pliant
