// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bounds-checked reads of little- and big-endian numbers. Internal to the descriptor library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>

#include "descriptor/image/image.h"

namespace pliant {

class ByteReader {
 public:
  ByteReader(Bytes bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

  std::size_t size() const { return bytes_.size(); }

  std::optional<std::uint8_t> U8(std::size_t at) const {
    if (at >= bytes_.size()) return std::nullopt;
    return bytes_[at];
  }
  std::optional<std::uint16_t> U16(std::size_t at) const { return Read<std::uint16_t>(at); }
  std::optional<std::uint32_t> U32(std::size_t at) const { return Read<std::uint32_t>(at); }

  bool StartsWith(std::size_t at, const char* text) const {
    const std::size_t length = std::strlen(text);
    return at <= bytes_.size() && bytes_.size() - at >= length &&
           std::memcmp(bytes_.data() + at, text, length) == 0;
  }

  // The rest from `at` on; empty when `at` is beyond the end.
  Bytes From(std::size_t at) const { return at < bytes_.size() ? bytes_.subspan(at) : Bytes{}; }

 private:
  template <typename T>
  std::optional<T> Read(std::size_t at) const {
    if (at > bytes_.size() || bytes_.size() - at < sizeof(T)) return std::nullopt;
    T value = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      const std::size_t shift = 8 * (big_endian_ ? sizeof(T) - 1 - i : i);
      value = static_cast<T>(value | static_cast<T>(static_cast<T>(bytes_[at + i]) << shift));
    }
    return value;
  }

  Bytes bytes_;
  bool big_endian_;
};

}  // namespace pliant
