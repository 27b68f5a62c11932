// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Rows of Native blocks, one at a time. Plain values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "index/store/clickhouse/native_format.h"
#include "index/store/clickhouse/statements.h"

namespace pliant::clickhouse {

// Collects rows to insert.
class RowWriter {
 public:
  explicit RowWriter(const std::vector<TableColumn>& columns);

  // A value for each column, in their order: a number, or a text (of its width for FixedString).
  template <typename... Values>
  void Add(const Values&... values) {
    std::size_t column = 0;
    (Put(block_.columns.at(column++), values), ...);
    ++block_.rows;
  }
  bool empty() const { return block_.rows == 0; }
  // EncodeNative throws for a row that had too few values.
  const NativeBlock& block() const { return block_; }

 private:
  template <typename Number>
  requires std::is_arithmetic_v<Number>
  static void Put(NativeColumn& column, Number number) {
    std::visit(
        [number](auto& values) {
          using Value = typename std::decay_t<decltype(values)>::value_type;
          if constexpr (std::is_arithmetic_v<Value>) {
            values.push_back(static_cast<Value>(number));
          } else {
            values.push_back(std::to_string(number));
          }
        },
        column.values);
  }
  static void Put(NativeColumn& column, std::string_view text);

  NativeBlock block_;
};

// One row of an answer. Must not outlive the block.
class Row {
 public:
  Row(const NativeBlock& block, std::size_t row) : block_(block), row_(row) {}

  // Of a column of any whole numbers.
  std::uint64_t Number(std::size_t column) const;
  std::int64_t Signed(std::size_t column) const;
  const std::string& Text(std::size_t column) const;
  std::string_view Fixed(std::size_t column) const;

 private:
  const NativeBlock& block_;
  std::size_t row_;
};

// 'a', 'b', ... or 1, 2, ... for IN (...).
std::string LiteralList(const std::vector<std::string>& texts);
std::string LiteralList(const std::vector<std::uint64_t>& numbers);

}  // namespace pliant::clickhouse
