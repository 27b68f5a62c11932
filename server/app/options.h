// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The options of the server, from flags, environment and configuration file, in this order of
// precedence, and the options of its parts derived from them.
#pragma once

#include <optional>
#include <string>

#include "server/decoder/decoder_process.h"
#include "server/http/http_server.h"
#include "server/routes/service.h"

namespace pliant::server {

struct ServerOptions {
  std::string database;
  std::string listen = "127.0.0.1:8080";  // HOST:PORT; port 0 = any free one
  bool allow_anonymous = false;           // listen beyond loopback without API keys
  int rate_limit = 0;                     // requests per second and key; 0 = no limit
  int rate_burst = 100;
  std::string descriptor;      // empty: the database's own, deal for a new one
  std::string model;           // weight file; empty = the default one
  bool keep_originals = true;  // store uploaded bytes, for content and thumbnails
  std::string originals_dir;   // parsed by ParseOriginalsDir
  bool auto_train = true;      // train vocabularies automatically, see AutoTrainer

  int cores = 0;          // for describing and ranking; 0 = all
  int http_threads = 64;  // requests served at once
  int connection_queue = 256;
  int max_connections = 2048;
  int connections_per_address = 512;
  int queue_length = 64;  // searches, and uploads, that may wait
  int queue_timeout_s = 30;

  int max_body_mb = 32;
  int max_import_mb = 0;      // one body; 0 = as the disk has room
  int max_inflight_mb = 512;  // of bodies, over all requests
  int max_header_kb = 32;
  int max_megapixels = 100;
  int max_decode_mb = 256;  // of memory, per image
  int decode_timeout_s = 30;
  int reserve_mb = 64;    // of the disk, which uploads cannot use
  int max_keypoints = 0;  // 0 = as the database was made
  int max_side_px = 0;    // 0 = as the database was made

  int idle_timeout_s = 5;
  int header_timeout_s = 10;
  int body_timeout_s = 60;
  int write_timeout_s = 10;
  int shutdown_timeout_s = 30;

  std::string decoder = "process";  // where images are decoded: process, inside

  std::string log_level = "info";   // debug, info, warn, error
  std::string log_format = "text";  // text, json

  std::string index_dir;  // of a database on PostgreSQL: where its index is saved; empty = nowhere
  std::string part;       // "1/4": the part of the index that this server holds; empty = all
  std::string peers;      // file with the servers of all parts (PeerLayout); empty = none

  std::string import_dir;     // images can be imported from below it; empty = off
  std::string backup_dir;     // backups over HTTP go there; empty = off
  std::string tls_cert;       // PEM file; empty = no TLS
  std::string tls_key;        // PEM file
  std::string cors_origins;   // "https://a.example,https://b.example", "*"; empty = none
  std::string allowed_hosts;  // "images.example,shop.example", "*"; empty = own names only

  std::string base_path;        // "/pliant": behind a proxy that serves Pliant there; empty = none
  std::string trusted_proxies;  // "127.0.0.1,10.0.0.0/8", see TrustedProxies; empty = none

  std::string fetch_hosts;  // for image_url, see FetchHosts; empty = none
  int fetch_timeout_s = 10;
  bool fetch_private = false;  // also if they have private addresses
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

// Splits "HOST:PORT" and checks the whole. Throw Error kInvalidArgument naming the flag.
HttpOptions MakeHttpOptions(const ServerOptions& options);
// Nothing with --decoder inside.
std::optional<DecoderOptions> MakeDecoderOptions(const ServerOptions& options);
ServiceOptions MakeServiceOptions(const ServerOptions& options);

// Whether all requests are allowed as long as there are no API keys: on loopback, or with
// --allow-anonymous.
bool OpenWithoutKeys(const ServerOptions& options);

// Throws Error kInvalidArgument "no_keys" if the server would be reachable from other machines
// without API keys and without --allow-anonymous.
void CheckExposure(const ServerOptions& options, bool has_keys);

}  // namespace pliant::server
