// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/keeper_hosts.h"

#include <condition_variable>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include <netdb.h>
#include <sys/socket.h>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/keeper_probe.h"

namespace pliant::clickhouse {
namespace {

using Addresses = std::vector<KeeperAddress>;

Addresses Find(const HostPort& host, int flags) {
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  wanted.ai_flags = flags | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  Addresses addresses;
  if (getaddrinfo(host.host.c_str(), std::to_string(host.port).c_str(), &wanted, &found) != 0)
    return addresses;
  for (const addrinfo* one = found; one != nullptr; one = one->ai_next) {
    char text[NI_MAXHOST];
    if (one->ai_addrlen > sizeof(sockaddr_storage) ||
        getnameinfo(one->ai_addr, one->ai_addrlen, text, sizeof(text), nullptr, 0,
                    NI_NUMERICHOST) != 0) {
      continue;
    }
    KeeperAddress& address = addresses.emplace_back();
    address.text = std::string(text) + ":" + std::to_string(host.port);
    std::memcpy(&address.socket, one->ai_addr, one->ai_addrlen);
    address.length = one->ai_addrlen;
  }
  freeaddrinfo(found);
  return addresses;
}

// Shared with threads that nobody can stop while they wait for a name server.
struct Search {
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<std::optional<Addresses>> found;  // by host
  std::size_t missing = 0;
};

void FindNames(const std::vector<HostPort>& hosts, const std::shared_ptr<Search>& search,
               std::chrono::steady_clock::time_point until) {
  for (std::size_t i = 0; i < hosts.size(); ++i) {
    if (search->found[i]) continue;
    std::thread([search, i, host = hosts[i]] {
      Addresses addresses = Find(host, AI_ADDRCONFIG);
      const std::lock_guard lock(search->mutex);
      search->found[i] = std::move(addresses);
      --search->missing;
      search->changed.notify_all();
    }).detach();
  }
  std::unique_lock lock(search->mutex);
  search->changed.wait_until(lock, until, [&] { return search->missing == 0; });
}

}  // namespace

std::string ListHosts(const std::vector<HostPort>& hosts) {
  std::string text;
  for (const HostPort& host : hosts) text += (text.empty() ? "" : ", ") + host.Text();
  return text;
}

std::string FindAddresses(const std::vector<HostPort>& hosts,
                          std::chrono::steady_clock::time_point until) {
  const auto search = std::make_shared<Search>();
  search->found.resize(hosts.size());
  for (std::size_t i = 0; i < hosts.size(); ++i) {
    Addresses numeric = Find(hosts[i], AI_NUMERICHOST);
    if (numeric.empty()) {
      ++search->missing;
    } else {
      search->found[i] = std::move(numeric);
    }
  }
  if (search->missing > 0) FindNames(hosts, search, until);
  Addresses all;
  {
    const std::lock_guard lock(search->mutex);
    for (const std::optional<Addresses>& addresses : search->found) {
      if (addresses) all.insert(all.end(), addresses->begin(), addresses->end());
    }
  }
  SortByAnswer(all, until);
  std::string text;
  for (const KeeperAddress& address : all) text += (text.empty() ? "" : ",") + address.text;
  if (text.empty()) {
    throw Error(ErrorCode::kUnavailable, "keeper_unavailable",
                "no Keeper's name has an address: " + ListHosts(hosts));
  }
  return text;
}

}  // namespace pliant::clickhouse
