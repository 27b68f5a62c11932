// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The HTTP layer: sockets, framing, limits and problem answers around a Router.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/http/router.h"

namespace pliant::server {

// One answered request, for logs and metrics.
struct RequestRecord {
  std::string id;
  std::string remote_address;
  std::string key_id;        // of the API key, not the key; empty = none
  std::string method = "-";  // "-" also when the request could not be read
  std::string path = "-";    // printable, at most 256 bytes, no query
  std::string route = "-";   // Route::name, or "-"
  int status = 0;
  std::string code;      // of the problem; empty when there was none
  std::string internal;  // why, when the cause must not be told to the client
  std::size_t bytes_in = 0;
  std::size_t bytes_out = 0;
  double seconds = 0;
};

struct HttpOptions {
  std::string host = "127.0.0.1";
  int port = 8080;                    // 0 = any free one
  int threads = 64;                   // requests served at once
  int peer_threads = 1;               // for requests of other servers of the same database
  int connection_queue = 256;         // requests that wait for a thread; more get 503
  int max_connections = 2048;         // open at once; more get 503
  int connections_per_address = 512;  // likewise; 0 = no limit
  // Bodies of requests, and what clients have not yet taken of answers, over all connections.
  std::size_t max_inflight_bytes = std::size_t{512} * 1024 * 1024;
  std::chrono::milliseconds idle_timeout{5'000};      // between requests
  std::chrono::milliseconds header_timeout{10'000};   // first byte to end of headers
  std::chrono::milliseconds body_timeout{60'000};     // end of headers to end of body
  std::chrono::milliseconds write_timeout{10'000};    // for each piece of the answer
  std::chrono::milliseconds answer_timeout{120'000};  // for the whole answer
  std::size_t max_header_bytes = 32 * 1024;
  std::size_t max_body_bytes = 32 * 1024 * 1024;
  std::string tls_certificate;  // PEM file; empty = no TLS
  std::string tls_key;
  // Pages of these origins ("https://shop.example") can send requests (CORS); "*" = any.
  std::vector<std::string> allowed_origins;
  // The server's host names, in addition to those of AllowedHosts; "*" = any.
  std::vector<std::string> allowed_hosts;
  std::string base_path;  // "/pliant" = clients see the paths of the routes below it; empty = none
  std::vector<std::string> trusted_proxies;  // see TrustedProxies
  // Called after the headers of a request, before its body is read; throws to refuse it.
  std::function<void(const Route&, Request&)> admit;
  std::function<void(const RequestRecord&)> on_request;
};

class HttpServer {
 public:
  // Binds at once, so that a port in use is reported before anything else is loaded. Throws Error
  // kUnavailable "address_in_use". `router` must outlive the server.
  HttpServer(const Router& router, HttpOptions options);
  ~HttpServer();

  int port() const;
  void Start();

  // Accepts no more connections, lets running requests finish for at most `deadline`, then closes
  // the others. Returns how many it closed.
  std::size_t Drain(std::chrono::milliseconds deadline);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant::server
