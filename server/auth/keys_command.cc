// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/auth/keys_command.h"

#include <cstdio>
#include <functional>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "descriptor/base/error.h"
#include "index/engine/engine.h"
#include "index/files/text.h"
#include "index/store/database_url.h"
#include "index/store/open_store.h"
#include "index/usage/usage.h"
#include "server/auth/api_keys.h"
#include "server/http/json.h"

namespace pliant::server {

namespace {

struct Options {
  EngineOptions engine;
  std::string scope = "read";
  std::string name;
  std::vector<std::string> keys;
  bool json = false;
};

// A key can be created before the server first starts. The message shows a mistyped name.
void MakeDatabase(const Options& options) {
  EngineOptions engine = options.engine;
  engine.load_index = false;
  engine.load_descriptor = false;
  engine.create = false;
  try {
    const Engine there(engine);
    return;
  } catch (const Error& error) {
    if (error.reason() != "database_not_found") throw;
  }
  engine.create = true;
  const Engine made(engine);
  const std::string name = engine.database.string();
  if (IsDatabaseUrl(name)) {  // may hold a password
    fmt::print(stderr, "Created Pliant's tables in the database\n");
  } else {
    fmt::print(stderr, "Created a new database: {}\n",
               ToDisplayText(std::filesystem::absolute(name).string()));
  }
}

int Create(const Options& options) {
  CheckKeyName(options.name);
  MakeDatabase(options);
  const auto store = OpenServiceStore(options.engine.database);
  const NewKey made = MakeApiKey(options.name, ScopeFromName(options.scope).value());
  store->AddKey(made.record);
  if (options.json) {
    fmt::print("{}\n", ToText(Json{{"id", made.record.id},
                                   {"name", made.record.name},
                                   {"scope", made.record.scope},
                                   {"key", made.key}}));
  } else {
    fmt::print("{}\n", made.key);
    fmt::print(stderr, "Copy the key \"{}\" (id {}, scope {}) now. It will not be shown again.\n",
               made.record.name, made.record.id, made.record.scope);
  }
  return 0;
}

int List(const Options& options) {
  const std::vector<ApiKeyRecord> keys = OpenServiceStore(options.engine.database)->Keys();
  Json list = Json::array();
  for (const ApiKeyRecord& key : keys) list.push_back(KeyJson(key));
  if (options.json) {
    fmt::print("{}\n", ToText(Json{{"keys", list}}));
    return 0;
  }
  if (keys.empty()) fmt::print("no keys\n");
  for (const ApiKeyRecord& key : keys) {
    fmt::print("{}  {:<5}  {}  {}{}\n", key.id, key.scope, IsoTime(key.created_ms), key.name,
               key.revoked_ms == 0 ? "" : "  (revoked " + IsoTime(key.revoked_ms) + ")");
  }
  return 0;
}

int Revoke(const Options& options) {
  const auto store = OpenServiceStore(options.engine.database);
  int status = 0;
  for (const std::string& key : options.keys) {
    if (store->RevokeKey(key)) {
      fmt::print("revoked {}\n", key);
    } else {
      fmt::print(stderr, "no valid key has the id or name \"{}\"\n", ToDisplayText(key));
      status = 1;
    }
  }
  return status;
}

int Purge(const Options& options) {
  fmt::print("deleted {} revoked keys\n",
             OpenServiceStore(options.engine.database)->ForgetRevokedKeys());
  return 0;
}

void Define(CLI::App& app, Options& options, std::function<int()>& command) {
  app.require_subcommand(1);
  app.failure_message(cli::UsageError);
  app.footer("Example:  pliant-server keys create --db my.db --name shop --scope read");
  const auto add = [&](const char* name, const char* help, int (*run)(const Options&),
                       const std::string& example) {
    CLI::App* sub = app.add_subcommand(name, help);
    sub->footer("Example:  pliant-server keys " + example);
    sub->add_option("--db", options.engine.database, "the database: a file, or a PostgreSQL URL")
        ->required()
        ->envname("PLIANT_DB");
    sub->callback(
        [&options, &command, run] { command = [&options, run] { return run(options); }; });
    return sub;
  };
  CLI::App* create = add("create", "Create a key and print it once", Create,
                         "create --db my.db --name shop --scope read");
  create->add_option("--name", options.name, "name of the key, such as the program that uses it")
      ->required();
  create
      ->add_option("--scope", options.scope,
                   "read, write (and read), admin (everything), or peer (other servers)")
      ->check(cli::OneOf({"read", "write", "admin", "peer"}))
      ->capture_default_str();
  create->add_option("--descriptor", options.engine.descriptor, "descriptor for a new database");
  create->add_option("--model", options.engine.descriptor_options.model_path,
                     "weight file of deal or deal-small for a new database");
  create->add_flag("--json", options.json, "print one JSON document");
  add("list", "List the keys: id, scope, creation time, name", List, "list --db my.db")
      ->add_flag("--json", options.json, "print one JSON document");
  add("revoke", "Revoke keys; takes effect immediately on a running server", Revoke,
      "revoke shop --db my.db")
      ->add_option("KEY", options.keys, "ids or names of keys")
      ->required();
  add("purge", "Delete revoked keys; if no key remains, the server on loopback needs none", Purge,
      "purge --db my.db");
}

}  // namespace

int RunKeysCommand(int argc, const char* const* argv) {
  Options options;
  std::function<int()> command;
  CLI::App app("API keys of a database", "pliant-server keys");
  app.formatter(std::make_shared<cli::HelpFormatter>());
  Define(app, options, command);
  try {
    app.parse(argc, argv);
    return command();
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "pliant-server: {}\n", error.what());
    const auto* const known = dynamic_cast<const Error*>(&error);
    return static_cast<int>(cli::ToExitStatus(known ? known->code() : ErrorCode::kInternal));
  }
}

}  // namespace pliant::server
