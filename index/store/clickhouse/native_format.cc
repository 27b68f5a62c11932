// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/native_format.h"

#include <array>
#include <bit>
#include <charconv>
#include <utility>

#include "descriptor/base/error.h"
#include "index/files/text.h"

namespace pliant::clickhouse {
namespace {

static_assert(std::endian::native == std::endian::little, "values are copied as they are");

struct KindName {
  NativeKind kind;
  std::string_view name;
  std::size_t bytes;
};

constexpr std::array<KindName, 7> kKinds = {{{NativeKind::kUInt8, "UInt8", 1},
                                             {NativeKind::kInt16, "Int16", 2},
                                             {NativeKind::kUInt32, "UInt32", 4},
                                             {NativeKind::kUInt64, "UInt64", 8},
                                             {NativeKind::kInt64, "Int64", 8},
                                             {NativeKind::kFloat64, "Float64", 8},
                                             {NativeKind::kString, "String", 0}}};
constexpr std::string_view kArray = "Array(";
constexpr std::string_view kFixed = "FixedString(";
constexpr std::uint32_t kMaxFixedBytes = 1 << 20;

[[noreturn]] void ThrowUnknownType(std::string_view name) {
  throw Error(ErrorCode::kInvalidArgument, "native_type_unknown",
              "the type " + ToDisplayText(name.substr(0, 100)) +
                  " of ClickHouse is none that Pliant's tables have");
}

[[noreturn]] void ThrowInvalid(const NativeColumn& column, const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, "native_block_invalid",
              "the column " + ToDisplayText(column.field.name) + " " + what);
}

void PutVarint(std::string& out, std::uint64_t value) {
  for (; value >= 128; value >>= 7) out.push_back(static_cast<char>(value | 128));
  out.push_back(static_cast<char>(value));
}

void PutText(std::string& out, std::string_view text) {
  PutVarint(out, text.size());
  out += text;
}

template <typename T>
void PutAll(std::string& out, const std::vector<T>& values) {
  out.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

void PutAll(std::string& out, const std::vector<std::string>& values) {
  for (const std::string& value : values) PutText(out, value);
}

// The number of values; of bytes for FixedString.
std::size_t SizeOf(const NativeValues& values) {
  return std::visit([](const auto& vector) { return vector.size(); }, values);
}

void CheckColumn(const NativeColumn& column, std::uint64_t rows) {
  const NativeType& type = column.field.type;
  if (column.values.index() != NoValues(type).index()) {
    ThrowInvalid(column, "does not hold values of its type");
  }
  if (column.ends.size() != (type.array ? rows : 0)) {
    ThrowInvalid(column, "does not have as many arrays as the block has rows");
  }
  std::uint64_t count = type.array ? 0 : rows;
  for (const std::uint64_t end : column.ends) {
    if (end < count) ThrowInvalid(column, "has an array that ends before it begins");
    count = end;
  }
  const std::size_t each = type.kind == NativeKind::kFixedString ? type.width : 1;
  if (each == 0 || SizeOf(column.values) % each != 0 || SizeOf(column.values) / each != count) {
    ThrowInvalid(column, "does not have as many values as it has rows");
  }
}

}  // namespace

std::string NativeType::Name() const {
  std::string name;
  if (kind == NativeKind::kFixedString) {
    name = std::string(kFixed) + std::to_string(width) + ")";
  } else {
    for (const KindName& known : kKinds) {
      if (known.kind == kind) name = known.name;
    }
  }
  return array ? std::string(kArray) + name + ")" : name;
}

NativeType ParseNativeType(std::string_view name) {
  NativeType type;
  std::string_view inner = name;
  if (inner.substr(0, kArray.size()) == kArray && inner.back() == ')') {
    type.array = true;
    inner = inner.substr(kArray.size(), inner.size() - kArray.size() - 1);
  }
  if (inner.substr(0, kFixed.size()) == kFixed && inner.back() == ')') {
    type.kind = NativeKind::kFixedString;
    const char* end = inner.data() + inner.size() - 1;
    const auto [stop, error] = std::from_chars(inner.data() + kFixed.size(), end, type.width);
    if (error != std::errc() || stop != end || type.width == 0 || type.width > kMaxFixedBytes) {
      ThrowUnknownType(name);
    }
    return type;
  }
  for (const KindName& known : kKinds) {
    if (known.name != inner) continue;
    type.kind = known.kind;
    return type;
  }
  ThrowUnknownType(name);
}

NativeValues NoValues(const NativeType& type) {
  switch (type.kind) {
    case NativeKind::kUInt8:
    case NativeKind::kFixedString:
      return std::vector<std::uint8_t>();
    case NativeKind::kInt16:
      return std::vector<std::int16_t>();
    case NativeKind::kUInt32:
      return std::vector<std::uint32_t>();
    case NativeKind::kUInt64:
      return std::vector<std::uint64_t>();
    case NativeKind::kInt64:
      return std::vector<std::int64_t>();
    case NativeKind::kFloat64:
      return std::vector<double>();
    case NativeKind::kString:
      break;
  }
  return std::vector<std::string>();
}

std::size_t ValueBytes(const NativeType& type) {
  if (type.kind == NativeKind::kFixedString) return type.width;
  for (const KindName& known : kKinds) {
    if (known.kind == type.kind) return known.bytes;
  }
  return 0;
}

std::string EncodeNative(const NativeBlock& block) {
  std::string out;
  PutVarint(out, block.columns.size());
  PutVarint(out, block.rows);
  for (const NativeColumn& column : block.columns) {
    CheckColumn(column, block.rows);
    PutText(out, column.field.name);
    PutText(out, column.field.type.Name());
    PutAll(out, column.ends);
    std::visit([&out](const auto& values) { PutAll(out, values); }, column.values);
  }
  return out;
}

}  // namespace pliant::clickhouse
