// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A segment of the index as a file, which is mapped into memory: processes that use it share one
// copy, and the system can drop and read again what is not in use. Private to index/.
//
// The file is a safetensors file (descriptor/base/safetensors.h) with one tensor per array of the
// segment, and the XXH3 checksum of its data (64 bits, hexadecimal) in its metadata.
#pragma once

#include <filesystem>
#include <memory>

#include "index/rank/inverted_index.h"

namespace pliant {

class SegmentFile {
 public:
  // Durable when it returns. Throws what ThrowErrno throws.
  static void Write(const std::filesystem::path& path, const IndexSegment& segment);
  // Throws kNotFound "file_unreadable"; kCorrupt "tensor_file_corrupt" and "segment_damaged" for a
  // file that Write did not make, or that has changed since. Reads the whole file.
  static std::shared_ptr<const IndexSegment> Map(const std::filesystem::path& path);

 private:
  // Calls `visit(name, type, array)` for each array, those with the widest values first.
  template <typename Segment, typename Visit>
  static void ForEachArray(Segment& segment, const Visit& visit);
};

}  // namespace pliant
