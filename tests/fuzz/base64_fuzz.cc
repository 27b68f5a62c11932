// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Base64 of cursors, keys and descriptors.
#include <algorithm>

#include "descriptor/base/base64.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Require;
  const std::string text(pliant::fuzz::TextOf({data, size}));
  std::string bytes;
  if (pliant::Base64UrlDecode(text, &bytes)) {
    Require(pliant::Base64UrlEncode(bytes) == text, "bytes have one form");
  }
  const std::string encoded = pliant::Base64UrlEncode(text);
  Require(pliant::Base64UrlDecode(encoded, &bytes) && bytes == text,
          "what is encoded can be decoded");
  std::string padded = pliant::Base64(text.data(), text.size());
  std::vector<std::uint8_t> decoded;
  Require(
      pliant::Base64Decode(padded, &decoded) && std::string(decoded.begin(), decoded.end()) == text,
      "the usual form can be decoded");
  Require(pliant::Base64Decode("data:x/y;base64," + padded, &decoded), "also as a URL");
  if (pliant::Base64Decode(text, &decoded) && !text.starts_with("data:")) {
    std::string digits = text.substr(0, text.find('='));
    std::erase_if(digits, [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; });
    std::replace(digits.begin(), digits.end(), '-', '+');
    std::replace(digits.begin(), digits.end(), '_', '/');
    const std::string again = pliant::Base64(decoded.data(), decoded.size());
    Require(again.substr(0, again.find('=')) == digits, "bytes have one form");
  }
  Require(padded.size() % 4 == 0, "the usual form is padded");
  std::replace(padded.begin(), padded.end(), '+', '-');
  std::replace(padded.begin(), padded.end(), '/', '_');
  Require(padded.substr(0, padded.find('=')) == encoded, "both forms are of the same bits");
  return 0;
}
