// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/options.h"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <regex>
#include <sstream>
#include <vector>

#include <CLI/CLI.hpp>
#include <netdb.h>
#include <netinet/in.h>
#include <nlohmann/json.hpp>
#include <sys/socket.h>

#include "descriptor/error.h"

namespace pliant::server {

namespace {

constexpr std::size_t kKiB = 1024;
constexpr std::size_t kMiB = 1024 * kKiB;

std::string EnvironmentName(const std::string& flag) {
  std::string name = "PLIANT_" + flag.substr(2);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return c == '-' ? '_' : static_cast<char>(toupper(c)); });
  return name;
}

void AddNumber(CLI::App& app, const std::string& flag, int& value, int lowest, int highest,
               const std::string& help) {
  app.add_option(flag, value, help)
      ->check(CLI::Range(lowest, highest))
      ->envname(EnvironmentName(flag))
      ->capture_default_str();
}

void AddText(CLI::App& app, const std::string& flag, std::string& value, const std::string& help) {
  app.add_option(flag, value, help)->envname(EnvironmentName(flag))->capture_default_str();
}

void AddSwitch(CLI::App& app, const std::string& flag, bool& value, const std::string& help) {
  app.add_option(flag, value, help)
      ->envname(EnvironmentName(flag))
      ->default_str(value ? "true" : "false")
      ->type_name("BOOL");
}

void DefineBasics(CLI::App& app, ServerOptions& options) {
  app.add_option("--db", options.database, "Database file; made when it does not exist")
      ->required()
      ->envname("PLIANT_DB");
  AddText(app, "--listen", options.listen, "HOST:PORT to listen on; port 0 takes any free one");
  AddSwitch(app, "--allow-anonymous", options.allow_anonymous,
            "Listen beyond loopback although there are no API keys and anyone can do everything");
  AddText(app, "--descriptor", options.descriptor,
          "Descriptor of a new database; empty = deal, or what the database was made with");
  AddText(app, "--model", options.model, "Weight file of deal; empty = the one that is installed");
  AddSwitch(app, "--keep-originals", options.keep_originals,
            "Store uploaded pictures, for content and thumbnails");
  AddText(
      app, "--originals-dir", options.originals_dir,
      "Directory for uploaded pictures, or `database`; empty = as before, the database for a new "
      "one");
  AddSwitch(app, "--auto-train", options.auto_train,
            "Train vocabularies in the background without being asked");
  AddText(app, "--log-level", options.log_level, "debug, info, warn or error");
  app.get_option("--log-level")->check(CLI::IsMember({"debug", "info", "warn", "error"}));
  AddText(app, "--log-format", options.log_format, "text, or json: an object a line");
  app.get_option("--log-format")->check(CLI::IsMember({"text", "json"}));
}

void DefineDoors(CLI::App& app, ServerOptions& options) {
  AddText(app, "--import-dir", options.import_dir,
          "Directory whose folders may be imported over HTTP; empty = none");
  AddText(app, "--backup-dir", options.backup_dir,
          "Directory that backups over HTTP go to; empty = none");
  AddText(app, "--tls-cert", options.tls_cert,
          "PEM file with the certificate and those above it; then HTTPS is spoken");
  AddText(app, "--tls-key", options.tls_key, "PEM file with the certificate's private key");
  AddText(app, "--cors-origins", options.cors_origins,
          "Origins whose pages may ask, with commas between, or *; empty = only the own page");
}

void DefineLimits(CLI::App& app, ServerOptions& options) {
  AddNumber(app, "--cores", options.cores, 0, 1024, "Cores for describing and ranking; 0 = all");
  AddNumber(app, "--http-threads", options.http_threads, 1, 4096, "Connections served at once");
  AddNumber(app, "--connection-queue", options.connection_queue, 1, 65536,
            "Connections that may wait for a thread; more get 503");
  AddNumber(app, "--queue-length", options.queue_length, 1, 65536,
            "Searches, and as many uploads, that may wait for a core; more get 503");
  AddNumber(app, "--queue-timeout", options.queue_timeout_s, 1, 3600,
            "Longest wait for a core in seconds; then 503");
  AddNumber(app, "--max-body-mb", options.max_body_mb, 1, 1024, "Largest body of a request in MiB");
  AddNumber(app, "--max-inflight-mb", options.max_inflight_mb, 1, 1048576,
            "Bodies of all requests at once in MiB; more get 503");
  AddNumber(app, "--max-header-kb", options.max_header_kb, 1, 1024,
            "Largest headers of a request in KiB");
  AddNumber(app, "--max-megapixels", options.max_megapixels, 1, 10000,
            "Largest picture in megapixels, checked before decoding");
  AddNumber(app, "--max-keypoints", options.max_keypoints, 0, 4096,
            "Key points a picture, at least 16; 0 = as the database was made, 1024 for a new one");
  AddNumber(
      app, "--max-side", options.max_side_px, 0, 16384,
      "Longer side in pixels to which larger pictures are scaled before description, at least "
      "64; 0 = as the database was made, 1024 for a new one");
}

void DefineRates(CLI::App& app, ServerOptions& options) {
  AddNumber(app, "--rate-limit", options.rate_limit, 0, 1'000'000,
            "Requests a second of one key (without keys: of one address); more get 429; 0 = any");
  AddNumber(app, "--rate-burst", options.rate_burst, 1, 1'000'000,
            "Requests that may come at once before --rate-limit counts");
}

void DefineTimes(CLI::App& app, ServerOptions& options) {
  AddNumber(app, "--idle-timeout", options.idle_timeout_s, 1, 3600,
            "Seconds an idle connection is kept");
  AddNumber(app, "--header-timeout", options.header_timeout_s, 1, 3600,
            "Seconds for the headers of a request to arrive");
  AddNumber(app, "--body-timeout", options.body_timeout_s, 1, 3600,
            "Seconds for the body of a request to arrive");
  AddNumber(app, "--write-timeout", options.write_timeout_s, 1, 3600,
            "Seconds a client may take to accept a piece of the answer");
  AddNumber(app, "--shutdown-timeout", options.shutdown_timeout_s, 0, 3600,
            "Seconds for running requests to finish after SIGTERM");
}

void Define(CLI::App& app, ServerOptions& options) {
  DefineBasics(app, options);
  DefineDoors(app, options);
  DefineLimits(app, options);
  DefineRates(app, options);
  DefineTimes(app, options);
  app.set_config("--config", "", "Configuration file (TOML): the flags' names without dashes");
  app.add_flag("--print-config")
      ->description("Print what is in force, as a configuration file, and end");
  app.set_version_flag("--version", std::string("pliant-server ") + PLIANT_VERSION);
}

// CLI11 lets the file win over the environment. Operators expect the opposite, so what the
// environment sets is handed over as flags, unless the flag is given anyway.
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
    if (value != nullptr && !given) from_environment.push_back(flag + "=" + value);
  }
  arguments.insert(arguments.end(), from_environment.begin(), from_environment.end());
  std::reverse(arguments.begin(), arguments.end());  // as CLI11 wants it
  return arguments;
}

// What is in force, in the form that --config reads. There are no secrets among it: keys of
// clients are in the database, and --tls-key is the name of a file.
std::string ConfigText(const CLI::App& app) {
  std::string text = "# pliant-server --config THIS\n";
  for (const CLI::Option* option : app.get_options()) {
    const std::string flag = option->get_name();
    if (option->get_envname().empty() || !flag.starts_with("--")) continue;
    std::string value = option->count() > 0 ? option->as<std::string>() : option->get_default_str();
    const bool bare =
        option->get_type_name() == "BOOL" || option->get_type_name().starts_with("INT");
    if (!bare) value = nlohmann::json(value).dump();  // TOML's basic strings escape alike
    text += flag.substr(2) + " = " + value + "\n";
  }
  return text;
}

std::vector<std::string> SplitAtCommas(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
  return parts;
}

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
                "--listen: the host '" + host + "' is not known here");
  }
  bool all = true;
  for (const addrinfo* address = found; address != nullptr; address = address->ai_next) {
    all = all && IsLoopback(address->ai_addr);
  }
  freeaddrinfo(found);
  return all;
}

}  // namespace

ParsedCommandLine ParseCommandLine(int argc, const char* const* argv) {
  ParsedCommandLine parsed;
  CLI::App app("Pliant's HTTP server: find the same object again, however it is bent.",
               "pliant-server");
  Define(app, parsed.options);
  try {
    app.parse(WithEnvironment(app, argc, argv));
    if (app.count("--print-config") > 0) {
      std::fputs(ConfigText(app).c_str(), stdout);
      parsed.finished = true;
    }
  } catch (const CLI::ParseError& error) {
    parsed.finished = true;
    parsed.exit_status = app.exit(error) == 0 ? 0 : 2;
  }
  return parsed;
}

std::string HelpText() {
  ServerOptions options;
  CLI::App app("", "pliant-server");
  Define(app, options);
  return app.help();
}

void CheckOptions(const ServerOptions& options) {
  const auto fail = [](const std::string& flag, const std::string& why) {
    throw Error(ErrorCode::kInvalidArgument, "invalid_option", "--" + flag + " " + why);
  };
  for (const auto& [flag, directory] :
       {std::pair{"import-dir", options.import_dir}, std::pair{"backup-dir", options.backup_dir}}) {
    std::error_code ignored;
    if (!directory.empty() && !std::filesystem::is_directory(directory, ignored)) {
      fail(flag, "names no directory: " + directory);
    }
  }
  if (options.tls_cert.empty() != options.tls_key.empty()) {
    fail(options.tls_cert.empty() ? "tls-cert" : "tls-key", "is missing: TLS needs both files");
  }
  const std::regex origin(R"(\*|https?://[A-Za-z0-9.\-\[\]:]+)");
  for (const std::string& one : SplitAtCommas(options.cors_origins)) {
    if (!std::regex_match(one, origin)) {
      fail("cors-origins",
           "must be like https://shop.example, with commas between, or *, not '" + one + "'");
    }
  }
}

HttpOptions MakeHttpOptions(const ServerOptions& options) {
  HttpOptions http;
  http.tls_certificate = options.tls_cert;
  http.tls_key = options.tls_key;
  http.allowed_origins = SplitAtCommas(options.cors_origins);
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
  http.max_inflight_bytes = static_cast<std::size_t>(options.max_inflight_mb) * kMiB;
  http.limits.idle_timeout = std::chrono::seconds(options.idle_timeout_s);
  http.limits.header_timeout = std::chrono::seconds(options.header_timeout_s);
  http.limits.body_timeout = std::chrono::seconds(options.body_timeout_s);
  http.limits.write_timeout = std::chrono::seconds(options.write_timeout_s);
  http.limits.max_header_bytes = static_cast<std::size_t>(options.max_header_kb) * kKiB;
  http.limits.max_body_bytes = static_cast<std::size_t>(options.max_body_mb) * kMiB;
  return http;
}

EngineOptions MakeEngineOptions(const ServerOptions& options) {
  EngineOptions engine;
  engine.database = options.database;
  engine.descriptor = options.descriptor;
  engine.descriptor_options.model_path = options.model;
  engine.keep_originals = options.keep_originals;
  engine.originals_dir = ParseOriginalsDir(options.originals_dir);
  engine.extraction.decode.max_pixels = std::int64_t{options.max_megapixels} * 1'000'000;
  engine.extraction.decode.max_bytes = std::int64_t{options.max_body_mb} * std::int64_t{kMiB};
  if (options.max_keypoints > 0) engine.max_keypoints = std::max(16, options.max_keypoints);
  if (options.max_side_px > 0) engine.max_side_px = std::max(64, options.max_side_px);
  return engine;
}

WorkerPoolOptions MakeWorkerPoolOptions(const ServerOptions& options) {
  return {.cores = options.cores,
          .queue_length = options.queue_length,
          .queue_timeout = std::chrono::seconds(options.queue_timeout_s)};
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
                  " is open to other machines, and there are no API keys: anyone who reaches the "
                  "port could read, add and delete everything. Make a key with: pliant-server keys "
                  "create --scope admin --name NAME --db " +
                  options.database +
                  "; or listen on 127.0.0.1, or say --allow-anonymous true if that is meant.");
}

}  // namespace pliant::server
