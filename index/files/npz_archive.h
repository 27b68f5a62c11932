// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// NumPy's .npz: a zip archive (stored, not compressed) of .npy files of version 1.0, for
// numpy.load.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pliant {

class NpzArchive {
 public:
  // Adds an array: its name (letters and digits), NumPy's type ("<f4", "|u1", "<i8"), its shape
  // (none = a single value) and its values, little-endian and row-major. Throws kTooLarge
  // "archive_too_large" above 2 GiB.
  void Add(std::string_view name, std::string_view dtype, std::span<const std::int64_t> shape,
           std::string_view values);
  // The same of one text, of type "<U" and its length; what is no UTF-8 becomes U+FFFD.
  void AddText(std::string_view name, std::string_view text);
  // A list of texts, of the length of the longest.
  void AddTexts(std::string_view name, std::span<const std::string> texts);

  // The whole file.
  std::string Finish() const;

 private:
  struct Entry {
    std::string name;
    std::uint32_t crc = 0;
    std::uint32_t size = 0;
    std::uint32_t offset = 0;
  };

  std::string files_;  // with their local headers
  std::vector<Entry> entries_;
};

}  // namespace pliant
