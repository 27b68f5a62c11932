// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/app/command_line.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "index/usage/usage.h"

namespace pliant::server {

namespace {

struct NumberFlag {
  const char* flag;
  int ServerOptions::* value;
  int lowest, highest;
  const char* help;
};

// In the order of --help.
constexpr NumberFlag kNumbers[] = {
    {"--cores", &ServerOptions::cores, 0, 1024, "Cores for describing and ranking; 0 = all"},
    {"--http-threads", &ServerOptions::http_threads, 1, 4096, "Requests served at once"},
    {"--connection-queue", &ServerOptions::connection_queue, 1, 65536,
     "Requests that may wait for a thread; more get 503"},
    {"--max-connections", &ServerOptions::max_connections, 1, 1'000'000,
     "Connections open at once; more get 503"},
    {"--connections-per-address", &ServerOptions::connections_per_address, 0, 1'000'000,
     "Connections of one address open at once; more get 503; 0 = no limit"},
    {"--queue-length", &ServerOptions::queue_length, 1, 65536,
     "Searches, and as many uploads, that may wait for a core; more get 503"},
    {"--queue-timeout", &ServerOptions::queue_timeout_s, 1, 3600,
     "Longest wait for a core in seconds; then 503"},
    {"--max-body-mb", &ServerOptions::max_body_mb, 1, 1024, "Largest body of a request in MiB"},
    {"--max-import-mb", &ServerOptions::max_import_mb, 0, 1'000'000'000,
     "Largest body of an import (images:import) in MiB; 0 = what the disk has room for beside "
     "--reserve-mb"},
    {"--max-inflight-mb", &ServerOptions::max_inflight_mb, 1, 1048576,
     "Bodies of all requests at once in MiB, with what clients have not yet taken of answers; more "
     "get 503"},
    {"--max-header-kb", &ServerOptions::max_header_kb, 1, 1024,
     "Largest headers of a request in KiB"},
    {"--max-megapixels", &ServerOptions::max_megapixels, 1, 10000,
     "Largest image in megapixels, checked before decoding"},
    {"--max-decode-mb", &ServerOptions::max_decode_mb, 16, 65536,
     "Memory for decoding one image in MiB, checked before decoding"},
    {"--decode-timeout", &ServerOptions::decode_timeout_s, 1, 3600,
     "Seconds that decoding one image may take (with --decoder process)"},
    {"--reserve-mb", &ServerOptions::reserve_mb, 0, 1'048'576,
     "Free space in MiB that uploads leave on the disk, so that images can be removed"},
    {"--max-keypoints", &ServerOptions::max_keypoints, 0, 4096,
     "Keypoints per image and size it is described at, at least 16; 0 = that of the database, "
     "1024 for a new one"},
    {"--max-side", &ServerOptions::max_side_px, 0, 16384,
     "Longer side in pixels to which larger images are scaled before description, at least "
     "64; 0 = that of the database, 1024 for a new one"},
    {"--rate-limit", &ServerOptions::rate_limit, 0, 1'000'000,
     "Requests per second of one key (without keys: of one address); more get 429; 0 = no limit"},
    {"--rate-burst", &ServerOptions::rate_burst, 1, 1'000'000,
     "Requests allowed at once before --rate-limit applies"},
    {"--fetch-timeout", &ServerOptions::fetch_timeout_s, 1, 300,
     "Seconds that fetching one image may take, with all redirections"},
    {"--idle-timeout", &ServerOptions::idle_timeout_s, 1, 3600,
     "Seconds an idle connection is kept open"},
    {"--header-timeout", &ServerOptions::header_timeout_s, 1, 3600,
     "Seconds for the headers of a request to arrive"},
    {"--body-timeout", &ServerOptions::body_timeout_s, 1, 3600,
     "Seconds for the body of a request to arrive"},
    {"--write-timeout", &ServerOptions::write_timeout_s, 1, 3600,
     "Seconds a client may take to accept a piece of the answer"},
    {"--shutdown-timeout", &ServerOptions::shutdown_timeout_s, 0, 3600,
     "Seconds for running requests to finish after SIGTERM"},
};

std::string EnvironmentName(const std::string& flag) {
  std::string name = "PLIANT_" + flag.substr(2);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return c == '-' ? '_' : static_cast<char>(toupper(c)); });
  return name;
}

void AddNumber(CLI::App& app, const NumberFlag& number, ServerOptions& options) {
  app.add_option(number.flag, options.*number.value, number.help)
      ->check(cli::Between(number.lowest, number.highest))
      ->envname(EnvironmentName(number.flag))
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
  app.add_option("--db", options.database,
                 "Database: a file, created if it does not exist, or a PostgreSQL URL")
      ->required()
      ->envname("PLIANT_DB");
  AddText(app, "--listen", options.listen, "HOST:PORT to listen on; port 0 takes any free one");
  AddSwitch(app, "--allow-anonymous", options.allow_anonymous,
            "Allow listening beyond loopback without API keys: anyone can then do everything");
  AddText(app, "--descriptor", options.descriptor,
          "Descriptor of a new database; empty = that of the database, deal for a new one");
  AddText(app, "--model", options.model, "Weight file of deal; empty = the installed one");
  AddSwitch(app, "--keep-originals", options.keep_originals,
            "Store uploaded images, for content and thumbnails");
  AddText(app, "--originals-dir", options.originals_dir,
          "Directory for uploaded images, or `database`; empty = as before, the database for a new "
          "one");
  AddSwitch(app, "--auto-train", options.auto_train,
            "Train vocabularies automatically in the background");
  AddSwitch(app, "--check-database", options.check_database,
            "Read the whole database file at the start and refuse a damaged one");
  AddText(app, "--decoder", options.decoder,
          "Where images are decoded: process (processes of their own, which may do nothing else), "
          "or inside the server");
  app.get_option("--decoder")->check(cli::OneOf({"process", "inside"}));
  AddText(app, "--log-level", options.log_level, "debug, info, warn or error");
  app.get_option("--log-level")->check(cli::OneOf({"debug", "info", "warn", "error"}));
  AddText(app, "--log-format", options.log_format, "text, or json: one object per line");
  app.get_option("--log-format")->check(cli::OneOf({"text", "json"}));
}

void DefineDoors(CLI::App& app, ServerOptions& options) {
  AddText(app, "--import-dir", options.import_dir,
          "Directory whose folders may be imported over HTTP; empty = none");
  AddText(app, "--backup-dir", options.backup_dir, "Directory for backups over HTTP; empty = none");
  AddText(app, "--tls-cert", options.tls_cert,
          "PEM file with the certificate chain; enables HTTPS");
  AddText(app, "--tls-key", options.tls_key, "PEM file with the certificate's private key");
  AddText(app, "--cors-origins", options.cors_origins,
          "Origins whose pages may ask, with commas between, or *; empty = only the own page");
  AddText(app, "--allowed-hosts", options.allowed_hosts,
          "Names that clients may call the server by, with commas between, or *; empty = its own");
  AddText(app, "--fetch-hosts", options.fetch_hosts,
          "Hosts that images may be fetched from (image_url), with commas between: NAME, "
          "*.SUFFIX, either with :PORT, or *; empty = none");
  AddSwitch(app, "--fetch-private", options.fetch_private,
            "Fetch also where the hosts of --fetch-hosts have loopback or private addresses");
}

void Define(CLI::App& app, ServerOptions& options) {
  DefineBasics(app, options);
  DefineDoors(app, options);
  for (const NumberFlag& number : kNumbers) AddNumber(app, number, options);
  app.set_config("--config", "", "Configuration file (TOML): the flags' names without dashes");
  app.allow_config_extras(CLI::config_extras_mode::error);  // a name that is misspelt is no flag
  app.add_flag("--print-config")
      ->description("Print the effective configuration as a configuration file, and exit");
  app.set_version_flag("--version", std::string("pliant-server ") + PLIANT_VERSION);
  app.failure_message(cli::UsageError);
  app.footer(
      "Commands: pliant-server keys create|list|revoke|purge manages API keys.\n"
      "Example:  pliant-server --db my.db --listen 127.0.0.1:8080\n"
      "          pliant-server keys create --db my.db --name shop --scope write");
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
    if (value == nullptr || given) continue;
    from_environment.push_back(flag);  // apart from its value, which may be empty
    from_environment.emplace_back(value);
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

std::string HelpText() {
  ServerOptions options;
  CLI::App app("", "pliant-server");
  Define(app, options);
  return app.help();
}

}  // namespace pliant::server
