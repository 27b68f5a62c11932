// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/rows.h"

#include "descriptor/base/error.h"
#include "index/store/clickhouse/query.h"

namespace pliant::clickhouse {

RowWriter::RowWriter(const std::vector<TableColumn>& columns) {
  for (const TableColumn& column : columns) {
    const NativeType type = ParseNativeType(column.type);
    block_.columns.push_back({{column.name, type}, NoValues(type), {}});
  }
}

void RowWriter::Put(NativeColumn& column, std::string_view text) {
  if (auto* texts = std::get_if<std::vector<std::string>>(&column.values)) {
    texts->emplace_back(text);
    return;
  }
  auto* bytes = std::get_if<std::vector<std::uint8_t>>(&column.values);
  if (bytes == nullptr || text.size() != column.field.type.width) {
    throw Error(ErrorCode::kInternal, "database_error",
                "a text does not fit the column " + column.field.name);
  }
  bytes->insert(bytes->end(), text.begin(), text.end());
}

std::uint64_t Row::Number(std::size_t column) const {
  return std::visit(
      [this](const auto& values) -> std::uint64_t {
        using Value = typename std::decay_t<decltype(values)>::value_type;
        if constexpr (std::is_arithmetic_v<Value>) {
          return static_cast<std::uint64_t>(values.at(row_));
        } else {
          throw Error(ErrorCode::kInternal, "database_error", "a text is no number");
        }
      },
      block_.columns.at(column).values);
}

std::int64_t Row::Signed(std::size_t column) const {
  return static_cast<std::int64_t>(Number(column));
}

const std::string& Row::Text(std::size_t column) const {
  return block_.columns.at(column).Of<std::string>().at(row_);
}

std::string_view Row::Fixed(std::size_t column) const {
  const NativeColumn& of = block_.columns.at(column);
  const auto& bytes = of.Of<std::uint8_t>();
  const std::size_t width = of.field.type.width;
  return {reinterpret_cast<const char*>(bytes.data()) + row_ * width, width};
}

std::string LiteralList(const std::vector<std::string>& texts) {
  std::string list;
  for (const std::string& text : texts) list += (list.empty() ? "" : ",") + Literal(text);
  return list;
}

std::string LiteralList(const std::vector<std::uint64_t>& numbers) {
  std::string list;
  for (const std::uint64_t number : numbers) {
    list += (list.empty() ? "" : ",") + std::to_string(number);
  }
  return list;
}

}  // namespace pliant::clickhouse
