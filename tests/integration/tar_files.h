// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// TAR archives, as long as a test wants them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <string>

namespace pliant::testing {

inline constexpr const char* kTar = "application/x-tar";

// One file of a TAR archive (ustar).
inline std::string TarEntry(const std::string& name, const std::string& content, char type = '0') {
  std::string header(512, '\0');
  header.replace(0, std::min<std::size_t>(name.size(), 100), name.substr(0, 100));
  const auto octal = [&](std::size_t at, int digits, std::uint64_t value) {
    char text[24];
    std::snprintf(text, sizeof(text), "%0*llo", digits, static_cast<unsigned long long>(value));
    header.replace(at, static_cast<std::size_t>(digits), text);
  };
  octal(100, 7, 0644);
  octal(124, 11, content.size());
  octal(136, 11, 0);
  header[156] = type;
  header.replace(257, 8,
                 std::string("ustar\0"
                             "00",
                             8));
  header.replace(148, 8, "        ");
  std::uint64_t sum = 0;
  for (const char c : header) sum += static_cast<unsigned char>(c);
  octal(148, 6, sum);
  header[154] = '\0';
  std::string padded = content;
  padded.resize((content.size() + 511) / 512 * 512, '\0');
  return header + padded;
}

}  // namespace pliant::testing
