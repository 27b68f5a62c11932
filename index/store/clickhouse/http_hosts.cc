// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/http_hosts.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace pliant::clickhouse {
namespace {

constexpr std::size_t kMostKept = 16;  // of a host
// ClickHouse closes idle connections after 3 seconds, later versions after 10 or 30. One that it
// closes at the moment of a request would leave open whether that was done.
constexpr std::chrono::milliseconds kKeptFor{2000};
constexpr std::int64_t kAvoidedForMs = 5000;

std::int64_t NowMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

HttpHosts::HttpHosts(const HttpPoolOptions& options)
    : options_(options), hosts_(options.hosts.size()) {}

std::vector<std::size_t> HttpHosts::Order() const {
  const std::int64_t since = NowMs() - kAvoidedForMs;
  std::vector<std::size_t> order(hosts_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_partition(order.begin(), order.end(),
                        [&](std::size_t i) { return hosts_[i].failed_at_ms.load() < since; });
  return order;
}

void HttpHosts::Failed(std::size_t host) { hosts_[host].failed_at_ms = NowMs(); }
void HttpHosts::Answered(std::size_t host) { hosts_[host].failed_at_ms = INT64_MIN; }

HttpHosts::Connection HttpHosts::Take(std::size_t host) {
  std::vector<Kept> old;  // closed after the lock is gone
  Connection connection;
  {
    Host& place = hosts_[host];
    const std::lock_guard lock(place.mutex);
    const Clock::time_point since = Clock::now() - kKeptFor;
    if (!place.kept.empty() && place.kept.back().since >= since) {
      connection = std::move(place.kept.back().connection);
      place.kept.pop_back();
    } else {
      old.swap(place.kept);
    }
  }
  return connection ? std::move(connection) : Make(host);
}

void HttpHosts::Give(std::size_t host, Connection connection) {
  Host& place = hosts_[host];
  const std::lock_guard lock(place.mutex);
  if (place.kept.size() < kMostKept) place.kept.push_back({std::move(connection), Clock::now()});
}

HttpHosts::Connection HttpHosts::Make(std::size_t host) const {
  const HostPort& where = options_.hosts[host];
  Connection connection;
  if (options_.tls) {
    auto secure = std::make_unique<httplib::SSLClient>(where.host, where.port);
    secure->enable_server_certificate_verification(true);
    if (!options_.ca_file.empty()) secure->set_ca_cert_path(options_.ca_file);
    connection = std::move(secure);
  } else {
    connection = std::make_unique<httplib::ClientImpl>(where.host, where.port);
  }
  connection->set_keep_alive(true);
  connection->set_tcp_nodelay(true);
  connection->set_url_encode(false);  // ToMessage did it
  return connection;
}

}  // namespace pliant::clickhouse
