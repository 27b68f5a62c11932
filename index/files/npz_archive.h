// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// NumPy's .npz: a zip archive (stored, not compressed) of .npy files of version 1.0, for
// numpy.load. Its arrays are filled a piece at a time, several at once, in a file that can be
// written anywhere, so that none is in memory. Above 4 GiB it is of the kind ZIP64.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pliant {

class NpzArchive {
 public:
  // Puts bytes at a place of the file; every place is written once, in any order.
  using Write = std::function<void(std::uint64_t offset, std::string_view bytes)>;

  explicit NpzArchive(Write write) : write_(std::move(write)) {}

  // An array that is to come: its name (letters and digits), NumPy's type ("<f4", "|u1", "<i8",
  // "<U8") and its shape (none = a single value). All of them before the first Append. Returns what
  // Append calls it.
  std::size_t Declare(std::string_view name, std::string_view dtype,
                      std::span<const std::int64_t> shape);

  // Of the whole file, once all are declared.
  std::uint64_t bytes();

  // The next values of an array, little-endian and row-major.
  void Append(std::size_t array, std::string_view values);
  // A value of type "<Un", n = `length`; what is no UTF-8 becomes U+FFFD. NumPy has no text of
  // length 0: a type needs 1.
  void AppendText(std::size_t array, std::string_view text, std::size_t length);
  static std::size_t TextLength(std::string_view text);

  // After all values: the rest of the file. Throws kInternal "archive_incomplete" if some are
  // missing.
  void Finish();

 private:
  struct Entry {
    std::string name;           // of the file in the archive
    std::string header;         // of the .npy
    std::uint64_t size = 0;     // with the header
    std::uint64_t offset = 0;   // of its head in the archive
    std::uint64_t begin = 0;    // of its content
    std::uint64_t written = 0;  // of its content, but for what waits
    std::uint32_t crc = 0;      // of what was appended
    std::string waiting;
  };

  void Place();
  std::uint64_t Lay(bool large);
  void Flush(Entry& entry);
  std::string Head(const Entry& entry) const;
  std::string Directory() const;

  const Write write_;
  std::vector<Entry> entries_;
  bool placed_ = false;
  bool large_ = false;           // ZIP64
  std::uint64_t directory_ = 0;  // its offset
  std::uint64_t bytes_ = 0;
};

}  // namespace pliant
