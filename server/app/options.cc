// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/app/options.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <regex>
#include <tuple>
#include <variant>
#include <vector>

#include <CLI/CLI.hpp>
#include <netdb.h>
#include <nlohmann/json.hpp>
#include <sys/socket.h>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/strings.h"
#include "index/store/database_url.h"
#include "index/usage/usage.h"
#include "server/http/forwarded.h"
#include "server/http/network.h"

namespace pliant::server {

namespace {

using O = ServerOptions;

struct Flag {
  const char* name;
  std::variant<int O::*, bool O::*, std::string O::*> value;
  const char* help;
  int lowest = 0, highest = 0;  // of a number
  const char* words = "";       // that a text can be, separated by commas; empty = any
};

// In the order of --help.
const Flag kFlags[] = {
    {"--db", &O::database, "Database: a file, created if it does not exist, or a PostgreSQL URL"},
    {"--listen", &O::listen, "HOST:PORT to listen on; port 0 = any free port"},
    {"--allow-anonymous", &O::allow_anonymous,
     "Allow listening beyond loopback without API keys; anyone can then do everything"},
    {"--descriptor", &O::descriptor,
     "Descriptor of the database; default: the stored one, deal for a new database"},
    {"--model", &O::model, "Weight file of deal or deal-small; default: the installed one"},
    {"--keep-originals", &O::keep_originals, "Store uploaded images, for content and thumbnails"},
    {"--originals-dir", &O::originals_dir,
     "Directory for uploaded images, or `database`; default: keep the current location"},
    {"--auto-train", &O::auto_train, "Train vocabularies in the background"},
    {"--decoder", &O::decoder,
     "Decode images in sandboxed child processes (process), or in the server (inside)", 0, 0,
     "process,inside"},
    {"--log-level", &O::log_level, "debug, info, warn or error", 0, 0, "debug,info,warn,error"},
    {"--log-format", &O::log_format, "text, or json: one object per line", 0, 0, "text,json"},
    {"--index-dir", &O::index_dir,
     "Directory where the index of a PostgreSQL database is saved, so that starts are fast; "
     "default: none"},
    {"--part", &O::part,
     "Part of the index that this server holds, for example 1/4; needs --peers; default: all"},
    {"--peers", &O::peers, "File (TOML) with the servers of all parts"},
    {"--import-dir", &O::import_dir,
     "Directory whose folders can be imported over HTTP; default: none"},
    {"--backup-dir", &O::backup_dir, "Directory for backups over HTTP; default: none"},
    {"--tls-cert", &O::tls_cert, "PEM file with the certificate chain; enables HTTPS"},
    {"--tls-key", &O::tls_key, "PEM file with the private key"},
    {"--cors-origins", &O::cors_origins,
     "Comma-separated origins whose pages can send requests, or *; default: only the server's "
     "page"},
    {"--allowed-hosts", &O::allowed_hosts,
     "Comma-separated further host names of the server, or *"},
    {"--base-path", &O::base_path,
     "Path like /pliant below which a reverse proxy serves Pliant; default: none"},
    {"--trusted-proxies", &O::trusted_proxies,
     "Comma-separated addresses and networks (CIDR) of reverse proxies whose Forwarded and "
     "X-Forwarded-* headers count; default: none"},
    {"--fetch-hosts", &O::fetch_hosts,
     "Comma-separated hosts for image_url: NAME or *.SUFFIX, with or without :PORT, or *; default: "
     "none"},
    {"--fetch-private", &O::fetch_private,
     "Also fetch from loopback and private addresses of --fetch-hosts"},
    {"--cores", &O::cores, "Cores for describing and ranking; 0 = all", 0, 1024},
    {"--http-threads", &O::http_threads, "Requests served at once", 1, 4096},
    {"--connection-queue", &O::connection_queue, "Requests that wait for a thread; others get 503",
     1, 65536},
    {"--max-connections", &O::max_connections, "Open connections; others get 503", 1, 1'000'000},
    {"--connections-per-address", &O::connections_per_address,
     "Open connections of one address; others get 503; 0 = no limit", 0, 1'000'000},
    {"--queue-length", &O::queue_length,
     "Searches that wait for a core, and the same number of uploads; others get 503", 1, 65536},
    {"--queue-timeout", &O::queue_timeout_s, "Seconds to wait for a core; then 503", 1, 3600},
    {"--max-body-mb", &O::max_body_mb, "Largest body of a request in MiB", 1, 1024},
    {"--max-import-mb", &O::max_import_mb,
     "Largest body of an images:import in MiB; 0 = the free disk space less --reserve-mb", 0,
     1'000'000'000},
    {"--max-inflight-mb", &O::max_inflight_mb,
     "MiB of request bodies and unsent answers held at once; others get 503", 1, 1048576},
    {"--max-header-kb", &O::max_header_kb, "Largest headers of a request in KiB", 1, 1024},
    {"--max-megapixels", &O::max_megapixels, "Largest image in megapixels, checked before decoding",
     1, 10000},
    {"--max-decode-mb", &O::max_decode_mb,
     "Memory to decode one image in MiB, checked before decoding", 16, 65536},
    {"--decode-timeout", &O::decode_timeout_s,
     "Seconds to decode one image (with --decoder process)", 1, 3600},
    {"--reserve-mb", &O::reserve_mb,
     "Disk space in MiB that uploads leave free, so that images can still be removed", 0,
     1'048'576},
    {"--max-keypoints", &O::max_keypoints,
     "Keypoints per indexed image, at least 16, and half of a query's; 0 = the database's value, "
     "512 "
     "for a new one",
     0, 4096},
    {"--max-side", &O::max_side_px,
     "Longer side in pixels to which larger images are scaled, at least 64; 0 = the database's "
     "value, 1024 for a new one",
     0, 16384},
    {"--rate-limit", &O::rate_limit,
     "Requests per second of one key (without keys: of one address); others get 429; 0 = no limit",
     0, 1'000'000},
    {"--rate-burst", &O::rate_burst, "Requests allowed at once before --rate-limit applies", 1,
     1'000'000},
    {"--fetch-timeout", &O::fetch_timeout_s, "Seconds to fetch one image, with all redirects", 1,
     300},
    {"--idle-timeout", &O::idle_timeout_s, "Seconds until the server closes an idle connection", 1,
     3600},
    {"--header-timeout", &O::header_timeout_s, "Seconds to receive the headers of a request", 1,
     3600},
    {"--body-timeout", &O::body_timeout_s, "Seconds to receive the body of a request", 1, 3600},
    {"--write-timeout", &O::write_timeout_s,
     "Seconds for a client to accept the next part of the answer", 1, 3600},
    {"--shutdown-timeout", &O::shutdown_timeout_s,
     "Seconds for running requests to finish after SIGTERM", 0, 3600},
};

std::string EnvironmentName(const std::string& flag) {
  std::string name = "PLIANT_" + flag.substr(2);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return c == '-' ? '_' : static_cast<char>(toupper(c)); });
  return name;
}

void Define(CLI::App& app, ServerOptions& options) {
  for (const Flag& flag : kFlags) {
    CLI::Option* option = std::visit(
        [&](auto member) { return app.add_option(flag.name, options.*member, flag.help); },
        flag.value);
    option->envname(EnvironmentName(flag.name))->capture_default_str();
    if (const auto* member = std::get_if<bool O::*>(&flag.value)) {
      option->default_str(options.**member ? "true" : "false")->type_name("BOOL");
    }
    if (flag.highest > 0) option->check(cli::Between(flag.lowest, flag.highest));
    if (*flag.words != '\0') option->check(cli::OneOf(Split(flag.words, ',')));
  }
  app.get_option("--db")->required();
  app.set_config("--config", "", "Configuration file (TOML), for example `http-threads = 32`");
  app.allow_config_extras(CLI::config_extras_mode::error);  // refuse unknown names
  app.add_flag("--print-config")
      ->description("Print the effective configuration as a file for --config, and exit");
  app.set_version_flag("--version", std::string("pliant-server ") + PLIANT_VERSION);
  app.failure_message(cli::UsageError);
  app.footer(
      "API keys: pliant-server keys create|list|revoke|purge\n"
      "Example:  pliant-server --db my.db --listen 127.0.0.1:8080\n"
      "          pliant-server keys create --db my.db --name shop --scope write");
}

// CLI11 lets the file override the environment. Operators expect the opposite: this turns variables
// into flags, unless the flag is given.
std::vector<std::string> WithEnvironment(const CLI::App& app, int argc, const char* const* argv) {
  std::vector<std::string> arguments(argv + 1, argv + argc);
  std::vector<std::string> from_environment;
  for (const CLI::Option* option : app.get_options()) {
    const std::string flag = option->get_name();
    const std::string name = option->get_envname();
    const char* value = name.empty() ? nullptr : std::getenv(name.c_str());
    const bool given = std::any_of(arguments.begin(), arguments.end(), [&](const auto& argument) {
      return argument == flag || argument.starts_with(flag + "=");
    });
    if (value == nullptr || given) continue;
    from_environment.push_back(flag);  // apart from its value, which may be empty
    from_environment.emplace_back(value);
  }
  arguments.insert(arguments.end(), from_environment.begin(), from_environment.end());
  std::reverse(arguments.begin(), arguments.end());  // as CLI11 wants it
  return arguments;
}

// The effective configuration, in the form that --config reads. It has no secrets: keys of clients
// are in the database, and --tls-key is the name of a file.
std::string ConfigText(const CLI::App& app) {
  std::string text = "# pliant-server --config THIS\n";
  for (const CLI::Option* option : app.get_options()) {
    const std::string flag = option->get_name();
    if (option->get_envname().empty() || !flag.starts_with("--")) continue;
    std::string value = option->count() > 0 ? option->as<std::string>() : option->get_default_str();
    const bool bare =
        option->get_type_name() == "BOOL" || option->get_type_name().starts_with("INT");
    if (!bare) value = nlohmann::json(value).dump();  // TOML escapes strings as JSON does
    text += flag.substr(2) + " = " + value + "\n";
  }
  return text;
}

constexpr std::size_t kKiB = 1024;
constexpr std::size_t kMiB = 1024 * kKiB;

bool IsLoopback(const sockaddr* address) {
  const auto bytes = IpAddressOf(address);
  return bytes && (IpNetworkOf("127.0.0.0/8")->Contains(*bytes) || bytes == IpAddressOf("::1"));
}

bool AllLoopback(const std::string& host) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), nullptr, &hints, &found) != 0) {
    throw Error(ErrorCode::kInvalidArgument, "invalid_listen",
                "--listen: cannot resolve the host '" + host + "'");
  }
  bool all = true;
  for (const addrinfo* address = found; address != nullptr; address = address->ai_next) {
    all = all && IsLoopback(address->ai_addr);
  }
  freeaddrinfo(found);
  return all;
}

[[noreturn]] void Fail(const std::string& flag, const std::string& why) {
  throw Error(ErrorCode::kInvalidArgument, "invalid_option", "--" + flag + " " + why);
}

IndexShare ParsePart(const std::string& text) {
  if (text.empty()) return {};
  IndexShare share{.part = 0};
  std::smatch numbers;
  if (std::regex_match(text, numbers, std::regex("([0-9]{1,4})/([0-9]{1,4})"))) {
    share = {.part = std::stoi(numbers[1]), .parts = std::stoi(numbers[2])};
  }
  if (share.part < 1 || share.part > share.parts || share.parts > kMostParts) {
    Fail("part", "must be like 1/4, not '" + text + "'");
  }
  return share;
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
  engine.index_dir = options.index_dir;
  engine.share = ParsePart(options.part);
  if (options.max_keypoints > 0) engine.max_keypoints = options.max_keypoints;
  if (options.max_side_px > 0) engine.max_side_px = options.max_side_px;
  return engine;
}

void CheckDirectories(const ServerOptions& options) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  for (const auto& [flag, directory] :
       {std::pair{"import-dir", options.import_dir}, std::pair{"backup-dir", options.backup_dir},
        std::pair{"index-dir", options.index_dir}}) {
    if (!directory.empty() && !fs::is_directory(directory, ignored)) {
      Fail(flag, "is not a directory: " + directory);
    }
  }
  if (options.backup_dir.empty() || IsDatabaseUrl(options.database)) return;
  // Clients download and delete backups by name, so the database must have no name there. A link
  // to the database is not in the directory of the file and its log.
  const fs::path database = fs::absolute(options.database, ignored);
  for (const fs::path& name : {database, fs::weakly_canonical(database, ignored)}) {
    if (!fs::equivalent(name.parent_path(), options.backup_dir, ignored)) continue;
    Fail("backup-dir", options.backup_dir +
                           " contains the database: clients could download and delete it as a "
                           "backup. Use another directory, such as " +
                           (fs::path(options.backup_dir) / "backups").string());
  }
}

void CheckParts(const ServerOptions& options) {
  const bool on_server = IsDatabaseUrl(options.database);
  for (const auto& [flag, value] :
       {std::pair{"index-dir", options.index_dir}, std::pair{"part", options.part},
        std::pair{"peers", options.peers}}) {
    if (!value.empty() && !on_server) Fail(flag, "needs a database on PostgreSQL");
  }
  if (options.part.empty() != options.peers.empty()) Fail("part", "and --peers go together");
  ParsePart(options.part);
}

void CheckFetching(const ServerOptions& options) {
  try {
    const FetchHosts hosts(Split(options.fetch_hosts, ','));
    if (!options.fetch_private || !hosts.AllowsAny()) return;
  } catch (const Error& error) {
    Fail("fetch-hosts", "is invalid: " + std::string(error.what()));
  }
  Fail("fetch-private",
       "needs named hosts. With --fetch-hosts *, any client could reach every service of this "
       "machine and its network.");
}

// Each of the values, which commas separate, must match `form`.
void CheckEach(const std::string& flag, const std::string& values, const char* form,
               const std::string& rule) {
  for (const std::string& one : Split(values, ',')) {
    if (!std::regex_match(one, std::regex(form))) Fail(flag, rule + ", not '" + one + "'");
  }
}

// A request holds a thread while it fetches an image; the others are for other requests.
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

ParsedCommandLine ParseCommandLine(int argc, const char* const* argv) {
  ParsedCommandLine parsed;
  if (argc > 1 && argv[1][0] != '-' && argv[1][0] != '\0') {
    std::fprintf(
        stderr,
        "pliant-server has no command %s%s\nRun pliant-server --help for more information.\n",
        argv[1], cli::DidYouMean(argv[1], {"keys"}).c_str());
    parsed.finished = true;
    parsed.exit_status = 2;
    return parsed;
  }
  CLI::App app("Pliant's HTTP server: find the same object again, however it is bent.",
               "pliant-server");
  app.formatter(std::make_shared<cli::HelpFormatter>());
  Define(app, parsed.options);
  try {
    app.parse(WithEnvironment(app, argc, argv));
    if (app.count("--print-config") > 0) {
      std::fputs(ConfigText(app).c_str(), stdout);
      parsed.finished = parsed.printed_config = true;
    }
  } catch (const CLI::ParseError& error) {
    parsed.finished = true;
    parsed.exit_status = app.exit(error) == 0 ? 0 : 2;
  }
  return parsed;
}

void CheckOptions(const ServerOptions& options) {
  for (const auto& [flag, value, least] : {std::tuple{"max-keypoints", options.max_keypoints, 16},
                                           std::tuple{"max-side", options.max_side_px, 64}}) {
    if (value == 0 || value >= least) continue;
    Fail(flag,
         "must be 0, or at least " + std::to_string(least) + ", not " + std::to_string(value));
  }
  CheckDirectories(options);
  if (options.tls_cert.empty() != options.tls_key.empty()) {
    Fail(options.tls_cert.empty() ? "tls-cert" : "tls-key",
         "is missing: HTTPS needs both --tls-cert and --tls-key");
  }
  CheckFetching(options);
  CheckParts(options);
  CheckEach("allowed-hosts", options.allowed_hosts, R"(\*|[A-Za-z0-9._\-]+)",
            "must be comma-separated names like images.example, without scheme and port, or *");
  CheckEach("cors-origins", options.cors_origins, R"(\*|https?://[A-Za-z0-9.\-\[\]:]+)",
            "must be comma-separated origins like https://shop.example, or *");
  if (!IsBasePath(options.base_path)) {
    Fail("base-path", "must be a path like /pliant, not '" + options.base_path + "'");
  }
  try {
    const TrustedProxies proxies(Split(options.trusted_proxies, ','));
  } catch (const Error& error) {
    Fail("trusted-proxies", "is invalid: " + std::string(error.what()));
  }
}

HttpOptions MakeHttpOptions(const ServerOptions& options) {
  HttpOptions http;
  http.tls_certificate = options.tls_cert;
  http.tls_key = options.tls_key;
  http.allowed_origins = Split(options.cors_origins, ',');
  http.allowed_hosts = Split(options.allowed_hosts, ',');
  http.base_path = options.base_path;
  http.trusted_proxies = Split(options.trusted_proxies, ',');
  const std::size_t colon = options.listen.rfind(':');
  const auto port =
      NumberOf<std::uint16_t>(colon == std::string::npos ? "" : options.listen.substr(colon + 1));
  if (!port || colon == 0) {
    throw Error(
        ErrorCode::kInvalidArgument, "invalid_listen",
        "--listen must be HOST:PORT, for example 127.0.0.1:8080, not '" + options.listen + "'");
  }
  http.port = *port;
  http.host = options.listen.substr(0, colon);
  if (http.host.front() == '[' && http.host.back() == ']') {  // [::1]:8080
    http.host = http.host.substr(1, http.host.size() - 2);
  }
  http.threads = options.http_threads;
  http.peer_threads = ResolveThreads(options.cores);
  http.connection_queue = options.connection_queue;
  http.max_connections = options.max_connections;
  http.connections_per_address = options.connections_per_address;
  http.max_inflight_bytes = static_cast<std::size_t>(options.max_inflight_mb) * kMiB;
  http.idle_timeout = std::chrono::seconds(options.idle_timeout_s);
  http.header_timeout = std::chrono::seconds(options.header_timeout_s);
  http.body_timeout = std::chrono::seconds(options.body_timeout_s);
  http.write_timeout = std::chrono::seconds(options.write_timeout_s);
  http.max_header_bytes = static_cast<std::size_t>(options.max_header_kb) * kKiB;
  http.max_body_bytes = static_cast<std::size_t>(options.max_body_mb) * kMiB;
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
          .peers = options.peers,
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
  throw Error(ErrorCode::kInvalidArgument, "no_keys",
              "--listen " + options.listen +
                  " is reachable from other machines, but there are no API keys. Anyone could "
                  "read, add and delete everything. Create a key: pliant-server keys create "
                  "--scope admin --name NAME --db " +
                  options.database + ". Or listen on 127.0.0.1, or use --allow-anonymous true.");
}

}  // namespace pliant::server
