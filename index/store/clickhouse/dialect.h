// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What differs between ClickHouse 18.16 (Debian 12) and later versions. Asked for once, by feature
// and not by version.
#pragma once

#include <string>

#include "index/store/clickhouse/http_pool.h"

namespace pliant::clickhouse {

struct Dialect {
  std::string version;              // "18.16.1"
  bool has_bit_count = false;       // else Hamming distances are summed by hand
  bool has_remote_secure = false;   // reading another node over TLS
  std::string more_table_settings;  // ", NAME = VALUE", behind those that every version knows
};

// Throws what HttpPool throws.
Dialect DetectDialect(HttpPool& pool);

}  // namespace pliant::clickhouse
