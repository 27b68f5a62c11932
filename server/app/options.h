// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The options of the server, from flags, environment and configuration file, in this order of
// precedence, and the options of its parts derived from them.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "server/http/http_server.h"
#include "server/routes/service.h"

namespace pliant::server {

struct ServerOptions {
  ServerOptions() {
    service.engine.extraction.decode.max_decode_bytes = std::int64_t{256} * 1024 * 1024;
  }

  std::string listen = "127.0.0.1:8080";  // HOST:PORT; port 0 = any free one
  bool allow_anonymous = false;           // listen beyond loopback without API keys
  int rate_limit = 0;                     // requests per second and key; 0 = no limit
  int rate_burst = 100;
  int shutdown_timeout_s = 30;
  std::string decoder = "process";                   // where images are decoded: process, inside
  std::chrono::milliseconds decode_timeout{30'000};  // for one image
  std::string part;  // "1/4": the part of the index that this server holds; empty = all
  std::string log_level = "info";   // debug, info, warn, error
  std::string log_format = "text";  // text, json
  // Without what MakeHttpOptions and MakeServiceOptions derive.
  HttpOptions http;
  ServiceOptions service;
};

struct ParsedCommandLine {
  ServerOptions options;
  bool finished = false;        // after help, version or a usage error: exit with exit_status
  bool printed_config = false;  // finished, by --print-config
  int exit_status = 0;
};

// Prints help, version, or a usage error (exit status 2).
ParsedCommandLine ParseCommandLine(int argc, const char* const* argv);

// Throws Error kInvalidArgument naming the flag: a path that is not a directory, a directory of
// backups that holds the database, a certificate without key, an invalid origin.
void CheckOptions(const ServerOptions& options);

// Splits "HOST:PORT". Throws Error kInvalidArgument naming the flag.
HttpOptions MakeHttpOptions(const ServerOptions& options);
ServiceOptions MakeServiceOptions(const ServerOptions& options);

// Whether all requests are allowed as long as there are no API keys: on loopback, or with
// --allow-anonymous.
bool OpenWithoutKeys(const ServerOptions& options);

// Throws Error kInvalidArgument "no_keys" if the server would be reachable from other machines
// without API keys and without --allow-anonymous.
void CheckExposure(const ServerOptions& options, bool has_keys);

}  // namespace pliant::server
