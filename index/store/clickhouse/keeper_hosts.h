// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The addresses of the Keepers' names.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "index/store/clickhouse/database_url.h"

namespace pliant::clickhouse {

// "zk1:2181, zk2:2181", for messages.
std::string ListHosts(const std::vector<HostPort>& hosts);

// As the C library reads them: "10.0.0.1:2181,::1:2181". Names that have no address, or none in
// time, are left out; those that serve requests come first. Throws kUnavailable
// "keeper_unavailable" when nothing is left.
std::string FindAddresses(const std::vector<HostPort>& hosts,
                          std::chrono::steady_clock::time_point until);

}  // namespace pliant::clickhouse
