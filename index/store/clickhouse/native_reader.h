// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Reads Native blocks (native_format.h) from pieces of any size, as they come from the network.
// Nothing is allocated for what has not arrived.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

#include "index/store/clickhouse/native_format.h"

namespace pliant::clickhouse {

struct NativeLimits {
  std::uint64_t rows = 1 << 22;         // of a block; ClickHouse's have 65 536, or 1 048 576
  std::uint64_t block_bytes = 1 << 30;  // of the values of a block
};

// Not thread-safe. After an exception it must not be used again.
class NativeReader {
 public:
  // Every block must have just these columns.
  explicit NativeReader(std::vector<NativeField> fields, NativeLimits limits = {});

  // Throws kCorrupt "answer_corrupt" when this cannot be part of such blocks.
  void Take(std::string_view piece);
  // True: `block` is the next one that is complete.
  bool Next(NativeBlock& block);
  // Throws kCorrupt "answer_corrupt" when a block is cut short.
  void Finish() const;

 private:
  enum class State { kCounts, kField, kEnds, kValues };

  bool Step();  // false: more bytes are needed
  bool ReadCounts();
  bool ReadField();
  bool ReadEnds();
  bool ReadValues();
  bool ReadStrings(std::vector<std::string>& values);
  void FinishColumn();
  void Charge(std::uint64_t count, std::uint64_t each);
  bool PeekVarint(std::size_t& at, std::uint64_t& value) const;
  bool PeekText(std::size_t& at, std::uint64_t most, std::string_view& text) const;

  std::vector<NativeField> fields_;
  NativeLimits limits_;
  State state_ = State::kCounts;
  std::string buffer_;
  std::size_t at_ = 0;  // of what is not read yet, in buffer_
  NativeBlock block_;
  std::uint64_t values_left_ = 0;  // of the column at hand
  std::uint64_t bytes_left_ = 0;   // of the block's limit
  std::deque<NativeBlock> ready_;
};

}  // namespace pliant::clickhouse
