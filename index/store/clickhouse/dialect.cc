// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/dialect.h"

#include "descriptor/base/error.h"
#include "index/store/clickhouse/query.h"

namespace pliant::clickhouse {
namespace {

constexpr const char* kFeatures =
    "SELECT version() AS version,"
    " toUInt64((SELECT count() FROM system.functions WHERE name = 'bitCount')) AS bit_count,"
    " toUInt64((SELECT count() FROM system.table_functions WHERE name = 'remoteSecure')) AS secure,"
    " toUInt64((SELECT count() FROM system.merge_tree_settings"
    " WHERE name = 'min_compress_block_size')) AS block_size,"
    " toUInt64((SELECT count() FROM system.merge_tree_settings"
    " WHERE name = 'index_granularity_bytes')) AS granularity_bytes";

}  // namespace

Dialect DetectDialect(HttpPool& pool) {
  DatabaseRequest request;
  request.statement = kFeatures;
  request.repeatable = true;
  const NativeBlock rows = ReadRows(pool, request,
                                    {{"version", "String"},
                                     {"bit_count", "UInt64"},
                                     {"secure", "UInt64"},
                                     {"block_size", "UInt64"},
                                     {"granularity_bytes", "UInt64"}});
  if (rows.rows != 1) {
    throw Error(ErrorCode::kCorrupt, "answer_corrupt", "ClickHouse does not say what it can do");
  }
  const auto has = [&rows](std::size_t column) {
    return rows.columns[column].Of<std::uint64_t>()[0] > 0;
  };
  Dialect dialect;
  dialect.version = rows.columns[0].Of<std::string>()[0];
  dialect.has_bit_count = has(1);
  dialect.has_remote_secure = has(2);
  // A word's rows are read without what stands beside them; in 18.16 a setting of the profile.
  if (has(3)) dialect.more_table_settings += ", min_compress_block_size = 8192";
  // Granules have as many rows as the table says, however long they are.
  if (has(4)) dialect.more_table_settings += ", index_granularity_bytes = 0";
  return dialect;
}

}  // namespace pliant::clickhouse
