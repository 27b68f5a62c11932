// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features as arrays of a NumPy archive: `keypoints` float32 N x 6 (x, y, size, angle, response,
// octave), `descriptors` float32 or uint8 N x D, and `model_id` (text).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "descriptor/features/features.h"

namespace pliant {

// NumPy's .npz: a zip archive (stored, not compressed) of .npy files of version 1.0, for
// numpy.load. Several arrays can be filled in turn, piece by piece. The file is written at any
// offset, so that no array is in memory. It is ZIP64, as NumPy's own archives are.
class NpzArchive {
 public:
  // Writes bytes at an offset of the file. Every byte is written once, in any order.
  using Write = std::function<void(std::uint64_t offset, std::string_view bytes)>;
  // To a file in memory, which must outlive it.
  static Write ToMemory(std::string* file);

  explicit NpzArchive(Write write) : write_(std::move(write)) {}

  // Declares an array: its name (letters and digits), NumPy's type ("<f4", "|u1", "<i8", "<U8") and
  // its shape (empty = a single value). Declare all arrays before the first Append. Returns the
  // array's number for Append.
  std::size_t Declare(std::string_view name, std::string_view dtype,
                      std::span<const std::int64_t> shape);

  // Size of the whole file, after all arrays are declared.
  std::uint64_t bytes();

  // The next values of an array, little-endian and row-major.
  void Append(std::size_t array, std::string_view values);
  // A value of type "<Un", n = `length`. Invalid UTF-8 is replaced by U+FFFD. NumPy has no text of
  // length 0: a type needs 1.
  void AppendText(std::size_t array, std::string_view text, std::size_t length);
  static std::size_t TextLength(std::string_view text);

  // Call it after all values: writes the rest of the file. Throws kInternal "archive_incomplete" if
  // some are missing.
  void Finish();

 private:
  struct Entry {
    std::string name;           // of the file in the archive
    std::string header;         // of the .npy
    std::uint64_t size = 0;     // with the header
    std::uint64_t offset = 0;   // of its head in the archive
    std::uint64_t begin = 0;    // of its content
    std::uint64_t written = 0;  // of its content
    std::uint32_t crc = 0;      // of what was written
  };

  void Place();
  std::string Head(const Entry& entry) const;
  std::string Directory() const;

  const Write write_;
  std::vector<Entry> entries_;
  bool placed_ = false;
  std::uint64_t directory_ = 0;  // its offset
  std::uint64_t bytes_ = 0;
};

// The whole file of one image, with the additional values `width` and `height` (int64), in pixels
// of the upright image.
std::string FeaturesNpz(const Features& features);

// The sizes of the arrays of several images.
struct FeatureTotals {
  std::int64_t images = 0;
  std::int64_t rows = 0;
  DescriptorKind kind = DescriptorKind::kFloat;
  int dim = 0;
  std::string model_id;
  std::size_t name_length = 1;    // characters of the longest
  std::size_t object_length = 0;  // likewise; 0: there are no objects

  void Count(std::string_view name, std::size_t keypoints);
};

// Features of several images: the rows of all, one image after the other; `names` (text) P;
// `objects` (text) P, if the totals say so; `starts` int64 P + 1, where image i has the rows
// starts[i] .. starts[i + 1]; `width` and `height` int64 P. Any number: nothing stays in memory.
class FeaturesArchive {
 public:
  FeaturesArchive(const FeatureTotals& totals, NpzArchive::Write write);

  std::uint64_t bytes() { return archive_.bytes(); }  // of the whole file
  // The number of images must equal the totals, otherwise kInternal "archive_incomplete".
  void Add(std::string_view name, std::string_view object, const Features& features);
  void Finish();

 private:
  void AddNumber(std::size_t array, std::int64_t value);

  const FeatureTotals totals_;
  NpzArchive archive_;
  std::int64_t rows_ = 0;  // so far
  std::size_t keypoints_, descriptors_, names_, objects_ = 0, starts_, width_, height_;
};

}  // namespace pliant
