// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/query.h"

#include <iterator>
#include <type_traits>
#include <utility>

namespace pliant::clickhouse {
namespace {

void Append(NativeBlock& all, NativeBlock block) {
  all.rows += block.rows;
  for (std::size_t i = 0; i < block.columns.size(); ++i) {
    NativeColumn& to = all.columns[i];
    const std::uint64_t before = to.ends.empty() ? 0 : to.ends.back();
    for (const std::uint64_t end : block.columns[i].ends) to.ends.push_back(before + end);
    std::visit(
        [&to](auto& values) {
          auto& target = std::get<std::decay_t<decltype(values)>>(to.values);
          target.insert(target.end(), std::make_move_iterator(values.begin()),
                        std::make_move_iterator(values.end()));
        },
        block.columns[i].values);
  }
}

}  // namespace

NativeBlock ReadRows(HttpPool& pool, DatabaseRequest request,
                     const std::vector<TableColumn>& columns) {
  NativeBlock all;
  std::vector<NativeField> fields;
  for (const TableColumn& column : columns) {
    fields.push_back({column.name, ParseNativeType(column.type)});
    all.columns.push_back({fields.back(), NoValues(fields.back().type), {}});
  }
  NativeReader reader(fields);
  request.statement += " FORMAT Native";
  pool.Stream(
      request,
      [&](std::string_view piece) {
        reader.Take(piece);
        for (NativeBlock block; reader.Next(block);) Append(all, std::move(block));
      },
      [&reader] { reader.Finish(); });
  return all;
}

std::string Literal(std::string_view text) {
  std::string literal = "'";
  for (const char c : text) {
    if (c == '\'' || c == '\\') literal += '\\';
    literal += c;
  }
  return literal + "'";
}

}  // namespace pliant::clickhouse
