// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/app/options.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <regex>
#include <vector>

#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "descriptor/base/error.h"
#include "descriptor/base/strings.h"
#include "index/store/database_url.h"

namespace pliant::server {

namespace {

constexpr std::size_t kKiB = 1024;
constexpr std::size_t kMiB = 1024 * kKiB;

bool IsLoopback(const sockaddr* address) {
  if (address->sa_family == AF_INET) {
    const auto* v4 = reinterpret_cast<const sockaddr_in*>(address);
    return (ntohl(v4->sin_addr.s_addr) >> 24) == 127;
  }
  if (address->sa_family == AF_INET6) {
    const auto* v6 = reinterpret_cast<const sockaddr_in6*>(address);
    return IN6_IS_ADDR_LOOPBACK(&v6->sin6_addr) != 0;
  }
  return false;
}

bool AllLoopback(const std::string& host) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), nullptr, &hints, &found) != 0) {
    throw Error(ErrorCode::kInvalidArgument, "invalid_listen",
                "--listen: the host '" + host + "' cannot be resolved");
  }
  bool all = true;
  for (const addrinfo* address = found; address != nullptr; address = address->ai_next) {
    all = all && IsLoopback(address->ai_addr);
  }
  freeaddrinfo(found);
  return all;
}

EngineOptions MakeEngineOptions(const ServerOptions& options) {
  EngineOptions engine;
  engine.database = options.database;
  engine.descriptor = options.descriptor;
  engine.descriptor_options.model_path = options.model;
  engine.keep_originals = options.keep_originals;
  engine.originals_dir = ParseOriginalsDir(options.originals_dir);
  engine.extraction.decode.max_pixels = std::int64_t{options.max_megapixels} * 1'000'000;
  engine.reserve_bytes = static_cast<std::uint64_t>(options.reserve_mb) * kMiB;
  engine.extraction.decode.max_decode_bytes =
      std::int64_t{options.max_decode_mb} * std::int64_t{kMiB};
  engine.extraction.decode.max_bytes = std::int64_t{options.max_body_mb} * std::int64_t{kMiB};
  if (options.max_keypoints > 0) engine.max_keypoints = std::max(16, options.max_keypoints);
  if (options.max_side_px > 0) engine.max_side_px = std::max(64, options.max_side_px);
  return engine;
}

[[noreturn]] void Fail(const std::string& flag, const std::string& why) {
  throw Error(ErrorCode::kInvalidArgument, "invalid_option", "--" + flag + " " + why);
}

void CheckDirectories(const ServerOptions& options) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  for (const auto& [flag, directory] :
       {std::pair{"import-dir", options.import_dir}, std::pair{"backup-dir", options.backup_dir}}) {
    if (!directory.empty() && !fs::is_directory(directory, ignored)) {
      Fail(flag, "is not a directory: " + directory);
    }
  }
  if (options.backup_dir.empty() || IsDatabaseUrl(options.database)) return;
  // A backup is downloaded and deleted by its name: the database must have none there. A link to
  // the database lies elsewhere than the file and its log.
  const fs::path database = fs::absolute(options.database, ignored);
  for (const fs::path& name : {database, fs::weakly_canonical(database, ignored)}) {
    if (!fs::equivalent(name.parent_path(), options.backup_dir, ignored)) continue;
    Fail("backup-dir", options.backup_dir +
                           " holds the database itself, which could be downloaded and deleted as "
                           "one of its backups; name a directory of its own, such as " +
                           (fs::path(options.backup_dir) / "backups").string());
  }
}

void CheckFetching(const ServerOptions& options) {
  const auto fail = [](const std::string& why) {
    throw Error(ErrorCode::kInvalidArgument, "invalid_option", "--fetch-" + why);
  };
  try {
    const FetchHosts hosts(Split(options.fetch_hosts, ','));
    if (options.fetch_private && hosts.AllowsAny()) {
      fail(
          "private needs named hosts: with --fetch-hosts * whoever may search could reach every "
          "service of this machine and its network");
    }
  } catch (const Error& error) {
    if (error.reason() != "fetch_hosts_invalid") throw;
    fail("hosts: " + std::string(error.what()));
  }
}

// Requests hold a thread while an image is fetched for them; the others are for other requests.
FetchOptions MakeFetchOptions(const ServerOptions& options) {
  constexpr int kShareOfThreads = 4;
  return {.hosts = Split(options.fetch_hosts, ','),
          .allow_private = options.fetch_private,
          .timeout = std::chrono::seconds(options.fetch_timeout_s),
          .max_bytes = static_cast<std::size_t>(options.max_body_mb) * kMiB,
          .most_at_once = std::max(1, options.http_threads / kShareOfThreads),
          .user_agent = "Pliant/" PLIANT_VERSION};
}

}  // namespace

void CheckOptions(const ServerOptions& options) {
  CheckDirectories(options);
  if (options.tls_cert.empty() != options.tls_key.empty()) {
    Fail(options.tls_cert.empty() ? "tls-cert" : "tls-key", "is missing: TLS needs both files");
  }
  CheckFetching(options);
  const std::regex host(R"(\*|[A-Za-z0-9._\-]+)");
  for (const std::string& one : Split(options.allowed_hosts, ',')) {
    if (!std::regex_match(one, host)) {
      Fail("allowed-hosts",
           "must be names like images.example without scheme and port, with "
           "commas between, or *, not '" +
               one + "'");
    }
  }
  const std::regex origin(R"(\*|https?://[A-Za-z0-9.\-\[\]:]+)");
  for (const std::string& one : Split(options.cors_origins, ',')) {
    if (!std::regex_match(one, origin)) {
      Fail("cors-origins",
           "must be like https://shop.example, separated by commas, or *, not '" + one + "'");
    }
  }
}

HttpOptions MakeHttpOptions(const ServerOptions& options) {
  HttpOptions http;
  http.tls_certificate = options.tls_cert;
  http.tls_key = options.tls_key;
  http.allowed_origins = Split(options.cors_origins, ',');
  http.allowed_hosts = Split(options.allowed_hosts, ',');
  const std::size_t colon = options.listen.rfind(':');
  const std::string port = colon == std::string::npos ? "" : options.listen.substr(colon + 1);
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), http.port);
  if (error != std::errc() || end != port.data() + port.size() || http.port < 0 ||
      http.port > 65535 || colon == 0) {
    throw Error(
        ErrorCode::kInvalidArgument, "invalid_listen",
        "--listen must be HOST:PORT, for example 127.0.0.1:8080, not '" + options.listen + "'");
  }
  http.host = options.listen.substr(0, colon);
  if (http.host.front() == '[' && http.host.back() == ']') {  // [::1]:8080
    http.host = http.host.substr(1, http.host.size() - 2);
  }
  http.threads = options.http_threads;
  http.connection_queue = options.connection_queue;
  http.max_connections = options.max_connections;
  http.connections_per_address = options.connections_per_address;
  http.max_inflight_bytes = static_cast<std::size_t>(options.max_inflight_mb) * kMiB;
  http.limits.idle_timeout = std::chrono::seconds(options.idle_timeout_s);
  http.limits.header_timeout = std::chrono::seconds(options.header_timeout_s);
  http.limits.body_timeout = std::chrono::seconds(options.body_timeout_s);
  http.limits.write_timeout = std::chrono::seconds(options.write_timeout_s);
  http.limits.max_header_bytes = static_cast<std::size_t>(options.max_header_kb) * kKiB;
  http.limits.max_body_bytes = static_cast<std::size_t>(options.max_body_mb) * kMiB;
  return http;
}

std::optional<DecoderOptions> MakeDecoderOptions(const ServerOptions& options) {
  if (options.decoder != "process") return std::nullopt;
  constexpr std::int64_t kLibrariesMb = 64;
  DecoderOptions decoder;
  // The file comes twice: as sent, and without its metadata.
  decoder.memory_bytes =
      (options.max_decode_mb + 2 * options.max_body_mb + kLibrariesMb) * std::int64_t{kMiB};
  decoder.timeout = std::chrono::seconds(options.decode_timeout_s);
  return decoder;
}

ServiceOptions MakeServiceOptions(const ServerOptions& options) {
  return {.engine = MakeEngineOptions(options),
          .decoder = MakeDecoderOptions(options),
          .pool = {.cores = options.cores,
                   .queue_length = options.queue_length,
                   .queue_timeout = std::chrono::seconds(options.queue_timeout_s)},
          .auto_train = options.auto_train,
          .import_dir = options.import_dir,
          .backup_dir = options.backup_dir,
          .bulk = {.database = IsDatabaseUrl(options.database)
                                   ? FolderOf(options.database) / "pliant-server"
                                   : std::filesystem::path(options.database),
                   .max_bytes = static_cast<std::uint64_t>(options.max_import_mb) * kMiB,
                   .reserve_bytes = static_cast<std::uint64_t>(options.reserve_mb) * kMiB,
                   .max_item_bytes = static_cast<std::size_t>(options.max_body_mb) * kMiB},
          .fetch = MakeFetchOptions(options)};
}

bool OpenWithoutKeys(const ServerOptions& options) {
  if (options.allow_anonymous) return true;
  const std::string host = MakeHttpOptions(options).host;
  // RFC 6761, 6.3: this name is loopback whatever the resolver says.
  return host == "localhost" || AllLoopback(host);
}

void CheckExposure(const ServerOptions& options, bool has_keys) {
  if (has_keys || OpenWithoutKeys(options)) return;
  throw Error(
      ErrorCode::kInvalidArgument, "no_keys",
      "--listen " + options.listen +
          " is reachable from other machines, and there are no API keys: anyone who reaches the "
          "port could read, add and delete everything. Make a key with: pliant-server keys "
          "create --scope admin --name NAME --db " +
          options.database +
          "; or listen on 127.0.0.1, or use --allow-anonymous true if that is intended.");
}

}  // namespace pliant::server
