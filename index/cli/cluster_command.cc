// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant cluster init | status | check | quorum | purge
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>

#include "index/cli/cluster_output.h"
#include "index/cli/command.h"
#include "index/cli/output.h"
#include "index/files/text.h"
#include "index/store/clickhouse/cluster.h"
#include "index/store/clickhouse/cluster_purge.h"
#include "index/store/clickhouse/cluster_quorum.h"

namespace pliant::cli {
namespace {

constexpr std::int64_t kMostSeconds = 10LL * 366 * 24 * 3600;

struct Options {
  std::string database;
  std::string password_file;
  bool quick = false;
  std::string quorum;  // empty: show it
  std::int64_t older_than = 3600;
  std::int64_t log_older_than = 604800;
  std::int64_t wait = 60;
  bool json = false;
};

void RequireUrl(const std::string& database) {
  if (database.find("://") != std::string::npos) return;
  throw Error(ErrorCode::kInvalidArgument, "database_is_a_file",
              ToDisplayText(database) +
                  " is a file's name, and a cluster is named by a URL such as "
                  "clickhouse://host:8123/pliant?keeper=host:2181; for a file there is pliant db");
}

std::unique_ptr<clickhouse::Cluster> Open(const Options& options) {
  RequireUrl(options.database);
  return std::make_unique<clickhouse::Cluster>(
      clickhouse::ParseDatabaseUrl(options.database),
      clickhouse::ReadDatabasePassword(options.password_file));
}

ExitStatus Init(const Options& options) {
  auto cluster = Open(options);
  const clickhouse::InitReport report = cluster->Init();
  if (options.json) {
    PrintJson(InitDocument(report));
  } else {
    Print(InitText(report));
  }
  return ExitStatus::kDone;
}

ExitStatus Status(const Options& options) {
  auto cluster = Open(options);
  const clickhouse::ClusterState state = cluster->Read();
  if (options.json) {
    PrintJson(StatusDocument(state));
  } else {
    Print(StatusText(state));
  }
  return ExitStatus::kDone;
}

ExitStatus Check(const Options& options) {
  auto cluster = Open(options);
  clickhouse::ClusterState state = cluster->Read();
  if (!options.quick) cluster->ReadChecksums(state);
  const std::vector<std::string> problems = clickhouse::FindProblems(state);
  if (options.json) {
    Json list = Json::array();
    for (const std::string& problem : problems) list.push_back(ToDisplayText(problem));
    PrintJson({{"ok", problems.empty()}, {"problems", std::move(list)}});
  } else if (problems.empty()) {
    Print("ok");
  } else {
    for (const std::string& problem : problems) Print(ToDisplayText(problem));
  }
  return problems.empty() ? ExitStatus::kDone : ExitStatus::kFailed;
}

std::size_t ToQuorum(const std::string& text) {
  if (text == "auto") return 0;
  if (text.size() == 1 && text[0] >= '1' && text[0] <= '9') {
    return static_cast<std::size_t>(text[0] - '0');
  }
  throw Error(ErrorCode::kInvalidArgument, "quorum_invalid",
              "the quorum is auto or a number of replicas, 1 to 9, not " + ToDisplayText(text));
}

ExitStatus Quorum(const Options& options) {
  RequireUrl(options.database);
  const std::optional<std::size_t> chosen =
      options.quorum.empty() ? std::nullopt : std::optional(ToQuorum(options.quorum));
  clickhouse::ClusterAccess cluster(options.database, options.password_file);
  const clickhouse::QuorumReport report =
      chosen ? clickhouse::SetQuorum(cluster, *chosen, std::chrono::seconds(options.wait))
             : clickhouse::ReadQuorum(cluster);
  if (options.json) {
    PrintJson(QuorumDocument(report));
  } else {
    Print(QuorumText(report));
  }
  return ExitStatus::kDone;
}

ExitStatus RunPurge(const Options& options) {
  RequireUrl(options.database);
  clickhouse::ClusterAccess cluster(options.database, options.password_file);
  clickhouse::PurgeOptions purge;
  purge.states_after = std::chrono::seconds(options.older_than);
  purge.log_after = std::chrono::seconds(options.log_older_than);
  purge.wait = std::chrono::seconds(options.wait);
  const clickhouse::PurgeReport report = clickhouse::Purge(cluster, purge);
  if (options.json) {
    PrintJson(PurgeDocument(report));
  } else {
    Print(PurgeText(report));
  }
  return ExitStatus::kDone;
}

}  // namespace

void AddClusterCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = program.add_subcommand("cluster", "Prepare and inspect a ClickHouse cluster");
  app->require_subcommand(1);
  app->add_option("--db", options->database, "the cluster: clickhouse://HOST:PORT,.../DATABASE")
      ->required()
      ->type_name("URL");
  app->add_option("--password-file", options->password_file,
                  "file with the database's password (default: PLIANT_DB_PASSWORD)")
      ->type_name("FILE");
  app->add_flag("--json", options->json, "print one JSON document");
  constexpr const char* kUrl = " --db 'clickhouse://ch1:8123,ch2:8123/pliant?keeper=zk1:2181'";
  app->footer("Example:  pliant cluster init" + std::string(kUrl));
  const auto add = [&](const std::string& name, const char* help,
                       ExitStatus (*run)(const Options&)) {
    CLI::App* sub = app->add_subcommand(name, help);
    sub->fallthrough();
    sub->footer("Example:  pliant cluster " + name + kUrl);
    sub->callback([options, run, &status] { status = run(*options); });
    return sub;
  };
  add("init", "Make the tables that are not there yet, on every node", Init);
  add("status", "List every table on every node: rows, bytes, parts, replicas, lag", Status);
  add("check", "Verify that all nodes have the same tables, settings and rows", Check)
      ->add_flag("--quick", options->quick, "without reading and comparing all rows");
  CLI::App* quorum =
      add("quorum",
          "Show or choose how many replicas of a shard must have a write before it is acknowledged",
          Quorum);
  quorum
      ->add_option("REPLICAS", options->quorum,
                   "auto (two, or the one there is), or a number; 1: writes go on while one of two "
                   "replicas is down, and are lost with the other one. Without it: shows it")
      ->option_text("");
  quorum
      ->add_option("--wait", options->wait,
                   "seconds at most, where more are to acknowledge than before, until all have "
                   "what fewer have acknowledged")
      ->check(CLI::Range(std::int64_t{0}, kMostSeconds))
      ->capture_default_str();
  CLI::App* purge =
      add("purge",
          "Remove what nobody can read any more: old states of pictures, features and "
          "words of none, the beginning of the log",
          RunPurge);
  purge->add_option("--older-than", options->older_than, "seconds since a state was replaced")
      ->check(CLI::Range(std::int64_t{0}, kMostSeconds))
      ->capture_default_str();
  purge
      ->add_option("--log-older-than", options->log_older_than,
                   "seconds; a server that has not looked at the log for so long loads all anew")
      ->check(CLI::Range(std::int64_t{0}, kMostSeconds))
      ->capture_default_str();
  purge->add_option("--wait", options->wait, "seconds at most, for those who still read old states")
      ->check(CLI::Range(std::int64_t{0}, kMostSeconds))
      ->capture_default_str();
}

}  // namespace pliant::cli
