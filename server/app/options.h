// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What an operator can set, and what that means for the parts of the server. The flags are in
// command_line.
#pragma once

#include <cstdint>
#include <string>

#include "index/engine/engine.h"
#include "server/http/http_server.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

struct ServerOptions {
  std::string database;
  std::string listen = "127.0.0.1:8080";  // HOST:PORT; port 0 = any free one
  bool allow_anonymous = false;           // also beyond loopback, as long as there are no API keys
  int rate_limit = 0;                     // requests a second and key; 0 = no limit
  int rate_burst = 100;
  std::string descriptor;      // empty: what the database was made with, deal for a new one
  std::string model;           // weight file; empty = the default one
  bool keep_originals = true;  // store uploaded bytes, for content and thumbnails
  std::string originals_dir;   // as ParseOriginalsDir reads it
  bool auto_train = true;      // make vocabularies without being asked, see AutoTrainer

  int cores = 0;          // for describing and ranking; 0 = all
  int http_threads = 64;  // connections served at once
  int connection_queue = 256;
  int queue_length = 64;  // searches, and uploads, that may wait
  int queue_timeout_s = 30;

  int max_body_mb = 32;
  int max_inflight_mb = 512;  // of bodies, over all requests
  int max_header_kb = 32;
  int max_megapixels = 100;
  int max_keypoints = 0;  // 0 = as the database was made
  int max_side_px = 0;    // 0 = as the database was made

  int idle_timeout_s = 5;
  int header_timeout_s = 10;
  int body_timeout_s = 60;
  int write_timeout_s = 10;
  int shutdown_timeout_s = 30;

  std::string log_level = "info";   // debug, info, warn, error
  std::string log_format = "text";  // text, json

  std::string import_dir;     // pictures may be imported from below it; empty = off
  std::string backup_dir;     // backups over HTTP go there; empty = off
  std::string tls_cert;       // PEM file; empty = no TLS
  std::string tls_key;        // PEM file
  std::string cors_origins;   // "https://a.example,https://b.example", "*"; empty = none
  std::string allowed_hosts;  // "pictures.example,shop.example", "*"; empty = own names only
};

// Throws Error kInvalidArgument naming the flag: a directory that is none, a certificate without
// key, an origin that cannot be one.
void CheckOptions(const ServerOptions& options);

// Splits "HOST:PORT" and checks the whole. Throw Error kInvalidArgument naming the flag.
HttpOptions MakeHttpOptions(const ServerOptions& options);
EngineOptions MakeEngineOptions(const ServerOptions& options);
WorkerPoolOptions MakeWorkerPoolOptions(const ServerOptions& options);

// Whether everybody may do everything as long as there are no API keys: on loopback, or because
// --allow-anonymous says so.
bool OpenWithoutKeys(const ServerOptions& options);

// Throws Error kInvalidArgument "no_keys" when the server would be open to other machines, has no
// API keys, and was not told that this is meant.
void CheckExposure(const ServerOptions& options, bool has_keys);

}  // namespace pliant::server
