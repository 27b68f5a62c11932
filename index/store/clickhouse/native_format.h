// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// ClickHouse's Native format: blocks of columns, little-endian. A block is
//   varint columns, varint rows, and for each column
//     varint length, name, varint length, type, then the values of all rows:
//   numbers and FixedString one after the other, String as varint length and bytes, and for Array
//   the UInt64 number of values up to the end of each row, then all values.
// Only the types of the schema (statements.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace pliant::clickhouse {

enum class NativeKind { kUInt8, kInt16, kUInt32, kUInt64, kInt64, kFloat64, kString, kFixedString };

struct NativeType {
  NativeKind kind = NativeKind::kUInt8;
  std::uint32_t width = 0;  // of a FixedString
  bool array = false;

  bool operator==(const NativeType&) const = default;
  std::string Name() const;  // "Array(FixedString(32))"
};

// Throws kInvalidArgument "native_type_unknown".
NativeType ParseNativeType(std::string_view name);

struct NativeField {
  std::string name;
  NativeType type;

  bool operator==(const NativeField&) const = default;
};

// kFixedString: the bytes of all values, one after the other.
using NativeValues =
    std::variant<std::vector<std::uint8_t>, std::vector<std::int16_t>, std::vector<std::uint32_t>,
                 std::vector<std::uint64_t>, std::vector<std::int64_t>, std::vector<double>,
                 std::vector<std::string>>;

struct NativeColumn {
  NativeField field;
  NativeValues values;
  std::vector<std::uint64_t> ends;  // of arrays: the number of values up to the end of each row

  bool operator==(const NativeColumn&) const = default;

  template <typename T>
  const std::vector<T>& Of() const {
    return std::get<std::vector<T>>(values);
  }
};

struct NativeBlock {
  std::uint64_t rows = 0;
  std::vector<NativeColumn> columns;

  bool operator==(const NativeBlock&) const = default;
};

// An empty vector of the type's values.
NativeValues NoValues(const NativeType& type);
// Bytes of one value, 0 for String.
std::size_t ValueBytes(const NativeType& type);

// Throws kInvalidArgument "native_block_invalid" when values are not of the field's type, or not as
// many as rows.
std::string EncodeNative(const NativeBlock& block);

}  // namespace pliant::clickhouse
