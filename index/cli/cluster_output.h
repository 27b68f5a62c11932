// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What `pliant cluster` prints.
#pragma once

#include <string>

#include "index/json/json.h"
#include "index/store/clickhouse/cluster.h"
#include "index/store/clickhouse/cluster_purge.h"
#include "index/store/clickhouse/cluster_quorum.h"

namespace pliant::cli {

std::string InitText(const clickhouse::InitReport& report);
Json InitDocument(const clickhouse::InitReport& report);

std::string StatusText(const clickhouse::ClusterState& state);
Json StatusDocument(const clickhouse::ClusterState& state);

std::string QuorumText(const clickhouse::QuorumReport& report);
Json QuorumDocument(const clickhouse::QuorumReport& report);
std::string PurgeText(const clickhouse::PurgeReport& report);
Json PurgeDocument(const clickhouse::PurgeReport& report);

}  // namespace pliant::cli
