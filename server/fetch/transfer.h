// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One request for an image that somebody else keeps, with all its limits. Redirections are not
// followed: the caller decides.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/fetch/web_address.h"

namespace pliant::server {

struct TransferOptions {
  std::chrono::steady_clock::time_point deadline;  // of all of it, however slowly bytes drip
  std::size_t max_bytes = 0;                       // of the body
  bool allow_private = false;                      // AddressKind::kPrivate may be connected to
  std::string user_agent;
  std::function<bool()> stop = [] { return false; };  // asked about every second; true ends it
  std::string ca_file;                                // PEM; empty = the system's certificates
  std::vector<std::string> resolve = {};  // "host:port:address" in place of the system's resolver
};

struct TransferResult {
  enum class End {
    kAnswered,   // with `status`
    kForbidden,  // the host has no address that may be connected to
    kUnknown,    // its name cannot be resolved
    kUnreachable,
    kUntrusted,  // its certificate
    kTimeout,
    kTooLarge,
    kStopped,
    kBroken,  // what came is no complete answer of HTTP
  };
  End end = End::kBroken;
  int status = 0;
  std::string location;            // as sent; of a redirection
  std::vector<std::uint8_t> body;  // when the status is 200
  std::string internal;            // for the log
};

// The address that is connected to is looked at when the socket is made, after all resolving: no
// name can mean another address than the one that was allowed. No cookies, proxies, keys or
// passwords of the environment are used, nothing is decompressed, certificates are verified.
TransferResult Transfer(const WebAddress& address, const TransferOptions& options);

// To be called before the first Transfer() of the process. Thread-safe.
void PrepareTransfers();

}  // namespace pliant::server
