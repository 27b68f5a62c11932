// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/app/options.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <regex>
#include <string>
#include <tuple>
#include <type_traits>
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

using Texts = std::vector<std::string>;

// An option in another unit than its flag: `unit` = 1 of the flag.
template <typename T>
struct Scaled {
  T* value;
  std::type_identity_t<T> unit;
};

struct Flag {
  const char* name;
  std::variant<int*, bool*, std::string*, std::filesystem::path*, std::optional<int>*,
               std::optional<std::filesystem::path>*, Texts*, Scaled<std::size_t>,
               Scaled<std::int64_t>, Scaled<std::chrono::milliseconds>>
      value;
  const char* help;
  int lowest = 0, highest = 0;  // of a number
  const char* words = "";       // that a text can be, separated by commas; empty = any
};

constexpr std::size_t kKiB = 1024;
constexpr std::size_t kMiB = 1024 * kKiB;
constexpr std::chrono::seconds kSecond{1};

// In the order of --help.
std::vector<Flag> Flags(ServerOptions& options) {
  HttpOptions& http = options.http;
  ServiceOptions& service = options.service;
  EngineOptions& engine = service.engine;
  DecodeOptions& decode = engine.extraction.decode;
  return {
      {"--db", &engine.database,
       "Database: a file, created if it does not exist, or a PostgreSQL URL"},
      {"--listen", &options.listen, "HOST:PORT to listen on; port 0 = any free port"},
      {"--allow-anonymous", &options.allow_anonymous,
       "Allow listening beyond loopback without API keys; anyone can then do everything"},
      {"--descriptor", &engine.descriptor,
       "Descriptor of the database; default: the stored one, deal for a new database"},
      {"--model", &engine.descriptor_options.model_path,
       "Weight file of deal or deal-small; default: the installed one"},
      {"--keep-originals", &engine.keep_originals,
       "Store uploaded images, for content and thumbnails"},
      {"--originals-dir", &engine.originals_dir,
       "Directory for uploaded images, or `database`; default: keep the current location"},
      {"--auto-train", &service.auto_train, "Train vocabularies in the background"},
      {"--decoder", &options.decoder,
       "Decode images in sandboxed child processes (process), or in the server (inside)", 0, 0,
       "process,inside"},
      {"--log-level", &options.log_level, "debug, info, warn or error", 0, 0,
       "debug,info,warn,error"},
      {"--log-format", &options.log_format, "text, or json: one object per line", 0, 0,
       "text,json"},
      {"--index-dir", &engine.index_dir,
       "Directory where the index of a PostgreSQL database is saved, so that starts are fast; "
       "default: none"},
      {"--part", &options.part,
       "Part of the index that this server holds, for example 1/4; needs --peers; default: all"},
      {"--peers", &service.peers, "File (TOML) with the servers of all parts"},
      {"--import-dir", &service.import_dir,
       "Directory whose folders can be imported over HTTP; default: none"},
      {"--backup-dir", &service.backup_dir, "Directory for backups over HTTP; default: none"},
      {"--tls-cert", &http.tls_certificate, "PEM file with the certificate chain; enables HTTPS"},
      {"--tls-key", &http.tls_key, "PEM file with the private key"},
      {"--cors-origins", &http.allowed_origins,
       "Comma-separated origins whose pages can send requests, or *; default: only the server's "
       "page"},
      {"--allowed-hosts", &http.allowed_hosts,
       "Comma-separated further host names of the server, or *"},
      {"--base-path", &http.base_path,
       "Path like /pliant below which a reverse proxy serves Pliant; default: none"},
      {"--trusted-proxies", &http.trusted_proxies,
       "Comma-separated addresses and networks (CIDR) of reverse proxies whose Forwarded and "
       "X-Forwarded-* headers count; default: none"},
      {"--fetch-hosts", &service.fetch.hosts,
       "Comma-separated hosts for image_url: NAME or *.SUFFIX, with or without :PORT, or *; "
       "default: none"},
      {"--fetch-private", &service.fetch.allow_private,
       "Also fetch from loopback and private addresses of --fetch-hosts"},
      {"--cores", &service.pool.cores, "Cores for describing and ranking; 0 = all", 0, 1024},
      {"--http-threads", &http.threads, "Requests served at once", 1, 4096},
      {"--connection-queue", &http.connection_queue,
       "Requests that wait for a thread; others get 503", 1, 65536},
      {"--max-connections", &http.max_connections, "Open connections; others get 503", 1,
       1'000'000},
      {"--connections-per-address", &http.connections_per_address,
       "Open connections of one address; others get 503; 0 = no limit", 0, 1'000'000},
      {"--queue-length", &service.pool.queue_length,
       "Searches that wait for a core, and the same number of uploads; others get 503", 1, 65536},
      {"--queue-timeout", Scaled{&service.pool.queue_timeout, kSecond},
       "Seconds to wait for a core; then 503", 1, 3600},
      {"--max-body-mb", Scaled{&http.max_body_bytes, kMiB}, "Largest body of a request in MiB", 1,
       1024},
      {"--max-import-mb", Scaled{&service.bulk.max_bytes, kMiB},
       "Largest body of an images:import in MiB; 0 = the free disk space less --reserve-mb", 0,
       1'000'000'000},
      {"--max-inflight-mb", Scaled{&http.max_inflight_bytes, kMiB},
       "MiB of request bodies and unsent answers held at once; others get 503", 1, 1048576},
      {"--max-header-kb", Scaled{&http.max_header_bytes, kKiB},
       "Largest headers of a request in KiB", 1, 1024},
      {"--max-megapixels", Scaled{&decode.max_pixels, 1'000'000},
       "Largest image in megapixels, checked before decoding", 1, 10000},
      {"--max-decode-mb", Scaled{&decode.max_decode_bytes, kMiB},
       "Memory to decode one image in MiB, checked before decoding", 16, 65536},
      {"--decode-timeout", Scaled{&options.decode_timeout, kSecond},
       "Seconds to decode one image (with --decoder process)", 1, 3600},
      {"--reserve-mb", Scaled{&engine.reserve_bytes, kMiB},
       "Disk space in MiB that uploads leave free, so that images can still be removed", 0,
       1'048'576},
      {"--max-keypoints", &engine.max_keypoints,
       "Keypoints per indexed image, at least 16, and half of a query's; 0 = the database's value, "
       "512 "
       "for a new one",
       0, 4096},
      {"--max-side", &engine.max_side_px,
       "Longer side in pixels to which larger images are scaled, at least 64; 0 = the database's "
       "value, 1024 for a new one",
       0, 16384},
      {"--rate-limit", &options.rate_limit,
       "Requests per second of one key (without keys: of one address); others get 429; 0 = no "
       "limit",
       0, 1'000'000},
      {"--rate-burst", &options.rate_burst, "Requests allowed at once before --rate-limit applies",
       1, 1'000'000},
      {"--fetch-timeout", Scaled{&service.fetch.timeout, kSecond},
       "Seconds to fetch one image, with all redirects", 1, 300},
      {"--idle-timeout", Scaled{&http.idle_timeout, kSecond},
       "Seconds until the server closes an idle connection", 1, 3600},
      {"--header-timeout", Scaled{&http.header_timeout, kSecond},
       "Seconds to receive the headers of a request", 1, 3600},
      {"--body-timeout", Scaled{&http.body_timeout, kSecond},
       "Seconds to receive the body of a request", 1, 3600},
      {"--write-timeout", Scaled{&http.write_timeout, kSecond},
       "Seconds for a client to accept the next part of the answer", 1, 3600},
      {"--shutdown-timeout", &options.shutdown_timeout_s,
       "Seconds for running requests to finish after SIGTERM", 0, 3600},
  };
}

// Defines the option that a flag sets.
struct Definer {
  CLI::App& app;
  const Flag& flag;

  template <typename T>
  CLI::Option* operator()(T* value) const {
    return app.add_option(flag.name, *value, flag.help)->capture_default_str();
  }
  CLI::Option* operator()(Texts* value) const {
    const auto set = [value](const std::string& text) { *value = Split(text, ','); };
    return app.add_option_function<std::string>(flag.name, set, flag.help);
  }
  CLI::Option* operator()(std::optional<std::filesystem::path>* value) const {
    const auto set = [value](const std::string& text) { *value = ParseOriginalsDir(text); };
    return app.add_option_function<std::string>(flag.name, set, flag.help);
  }
  CLI::Option* operator()(std::optional<int>* value) const {
    const auto set = [value](int number) {
      *value = number > 0 ? std::optional(number) : std::nullopt;
    };
    return app.add_option_function<int>(flag.name, set, flag.help)->default_str("0");
  }
  template <typename T>
  CLI::Option* operator()(Scaled<T> scaled) const {
    const auto set = [scaled](int number) { *scaled.value = scaled.unit * number; };
    return app.add_option_function<int>(flag.name, set, flag.help)
        ->default_str(std::to_string(*scaled.value / scaled.unit));
  }
};

std::string EnvironmentName(const std::string& flag) {
  std::string name = "PLIANT_" + flag.substr(2);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return c == '-' ? '_' : static_cast<char>(toupper(c)); });
  return name;
}

void Define(CLI::App& app, ServerOptions& options) {
  for (const Flag& flag : Flags(options)) {
    CLI::Option* option = std::visit(Definer{app, flag}, flag.value);
    option->envname(EnvironmentName(flag.name));
    if (const auto* value = std::get_if<bool*>(&flag.value)) {
      option->default_str(**value ? "true" : "false")->type_name("BOOL");
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

void CheckDirectories(const ServiceOptions& service) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  for (const auto& [flag, directory] :
       {std::pair{"import-dir", service.import_dir}, std::pair{"backup-dir", service.backup_dir},
        std::pair{"index-dir", service.engine.index_dir}}) {
    if (!directory.empty() && !fs::is_directory(directory, ignored)) {
      Fail(flag, "is not a directory: " + directory.string());
    }
  }
  if (service.backup_dir.empty() || IsDatabaseUrl(service.engine.database.string())) return;
  // Clients download and delete backups by name, so the database must have no name there. A link
  // to the database is not in the directory of the file and its log.
  const fs::path database = fs::absolute(service.engine.database, ignored);
  for (const fs::path& name : {database, fs::weakly_canonical(database, ignored)}) {
    if (!fs::equivalent(name.parent_path(), service.backup_dir, ignored)) continue;
    Fail("backup-dir", service.backup_dir.string() +
                           " contains the database: clients could download and delete it as a "
                           "backup. Use another directory, such as " +
                           (service.backup_dir / "backups").string());
  }
}

void CheckParts(const ServerOptions& options) {
  const std::filesystem::path& peers = options.service.peers;
  const bool on_server = IsDatabaseUrl(options.service.engine.database.string());
  for (const auto& [flag, value] :
       {std::pair{"index-dir", options.service.engine.index_dir.string()},
        std::pair{"part", options.part}, std::pair{"peers", peers.string()}}) {
    if (!value.empty() && !on_server) Fail(flag, "needs a database on PostgreSQL");
  }
  if (options.part.empty() != peers.empty()) Fail("part", "and --peers go together");
  ParsePart(options.part);
}

void CheckFetching(const FetchOptions& fetch) {
  try {
    const FetchHosts hosts(fetch.hosts);
    if (!fetch.allow_private || !hosts.AllowsAny()) return;
  } catch (const Error& error) {
    Fail("fetch-hosts", "is invalid: " + std::string(error.what()));
  }
  Fail("fetch-private",
       "needs named hosts. With --fetch-hosts *, any client could reach every service of this "
       "machine and its network.");
}

// Each of the values must match `form`.
void CheckEach(const std::string& flag, const Texts& values, const char* form,
               const std::string& rule) {
  for (const std::string& one : values) {
    if (!std::regex_match(one, std::regex(form))) Fail(flag, rule + ", not '" + one + "'");
  }
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
  const HttpOptions& http = options.http;
  const EngineOptions& engine = options.service.engine;
  for (const auto& [flag, value, least] : {std::tuple{"max-keypoints", engine.max_keypoints, 16},
                                           std::tuple{"max-side", engine.max_side_px, 64}}) {
    if (!value || *value >= least) continue;
    Fail(flag,
         "must be 0, or at least " + std::to_string(least) + ", not " + std::to_string(*value));
  }
  CheckDirectories(options.service);
  if (http.tls_certificate.empty() != http.tls_key.empty()) {
    Fail(http.tls_certificate.empty() ? "tls-cert" : "tls-key",
         "is missing: HTTPS needs both --tls-cert and --tls-key");
  }
  CheckFetching(options.service.fetch);
  CheckParts(options);
  CheckEach("allowed-hosts", http.allowed_hosts, R"(\*|[A-Za-z0-9._\-]+)",
            "must be comma-separated names like images.example, without scheme and port, or *");
  CheckEach("cors-origins", http.allowed_origins, R"(\*|https?://[A-Za-z0-9.\-\[\]:]+)",
            "must be comma-separated origins like https://shop.example, or *");
  if (!IsBasePath(http.base_path)) {
    Fail("base-path", "must be a path like /pliant, not '" + http.base_path + "'");
  }
  try {
    const TrustedProxies proxies(http.trusted_proxies);
  } catch (const Error& error) {
    Fail("trusted-proxies", "is invalid: " + std::string(error.what()));
  }
}

HttpOptions MakeHttpOptions(const ServerOptions& options) {
  HttpOptions http = options.http;
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
  http.peer_threads = ResolveThreads(options.service.pool.cores);
  return http;
}

ServiceOptions MakeServiceOptions(const ServerOptions& options) {
  constexpr std::size_t kLibrariesBytes = 64 * kMiB;
  // A request holds a thread while it fetches an image; the others are for other requests.
  constexpr int kShareOfThreads = 4;
  const std::size_t max_body_bytes = options.http.max_body_bytes;
  ServiceOptions service = options.service;
  EngineOptions& engine = service.engine;
  engine.share = ParsePart(options.part);
  DecodeOptions& decode = engine.extraction.decode;
  decode.max_bytes = static_cast<std::int64_t>(max_body_bytes);
  if (options.decoder == "process") {
    DecoderOptions& decoder = service.decoder.emplace();
    // The file comes twice: as sent, and without its metadata.
    decoder.memory_bytes =
        decode.max_decode_bytes + static_cast<std::int64_t>(2 * max_body_bytes + kLibrariesBytes);
    decoder.timeout = options.decode_timeout;
  }
  service.bulk.database = IsDatabaseUrl(engine.database.string())
                              ? FolderOf(engine.database) / "pliant-server"
                              : engine.database;
  service.bulk.reserve_bytes = engine.reserve_bytes;
  service.bulk.max_item_bytes = max_body_bytes;
  service.fetch.max_bytes = max_body_bytes;
  service.fetch.most_at_once = std::max(1, options.http.threads / kShareOfThreads);
  service.fetch.user_agent = "Pliant/" PLIANT_VERSION;
  return service;
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
                  options.service.engine.database.string() +
                  ". Or listen on 127.0.0.1, or use --allow-anonymous true.");
}

}  // namespace pliant::server
