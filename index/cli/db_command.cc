// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant db init | stats | check | backup | restore | copy | export | originals | rm
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "descriptor/base/format_bytes.h"
#include "index/cli/command.h"
#include "index/cli/db_check.h"
#include "index/cli/db_stats.h"
#include "index/cli/engine_flags.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"
#include "index/engine/collection_npz.h"
#include "index/engine/copy_database.h"
#include "index/engine/engine.h"
#include "index/files/text.h"
#include "index/json/record_json.h"
#include "index/store/open_store.h"

namespace pliant::cli {
namespace {

// pliant db copy
struct CopyCommandOptions {
  std::filesystem::path from;
  std::filesystem::path to;
  std::uint64_t compare = 100;  // rankings, afterwards
  int commit_every = 250;
  bool json = false;
};

// pliant db export
struct ExportOptions {
  // .npz (engine/collection_npz.h): features, by ids; .ndjson: the records, a line of JSON each.
  std::filesystem::path out;
  std::string collection;
  std::optional<std::string> object;  // only its images
  std::string filter;                 // only those whose metadata pass
  bool json = false;
};

// What the rankings of both say, as a list of differences.
RankingsCompared Compare(const CopyOptions& copy, std::uint64_t count) {
  const auto open = [](const std::filesystem::path& database) {
    EngineOptions engine;
    engine.database = database;
    engine.descriptor.clear();
    engine.create = false;
    engine.load_descriptor = false;
    engine.read_only = true;
    return Engine(engine);
  };
  Engine from = open(copy.from);
  Engine to = open(copy.to);
  return CompareRankings(from, to, count);
}

ExitStatus RunCopy(const CopyCommandOptions& options) {
  CopyOptions copy;
  copy.from = options.from;
  copy.to = options.to;
  copy.commit_every = options.commit_every;
  Interrupt interrupt;
  copy.stop = interrupt.token();
  CopyResult result;
  {
    Progress progress("images");
    copy.progress = [&](std::uint64_t done, std::uint64_t total) { progress.Count(done, total); };
    result = CopyDatabase(copy);
  }
  const RankingsCompared compared = Compare(copy, options.compare);
  if (options.json) {
    PrintJson({{"collections", result.collections},
               {"copied", result.copied},
               {"unchanged", result.unchanged},
               {"extra", result.extra},
               {"without_content", result.without_content},
               {"vocabularies", result.vocabularies},
               {"keys", result.keys},
               {"rankings_compared", compared.compared},
               {"differences", compared.differences}});
  } else {
    Print("copied " + std::to_string(result.copied) + " images, " +
          std::to_string(result.unchanged) + " were there, of " +
          std::to_string(result.collections) + " collections; " +
          std::to_string(result.vocabularies) + " vocabularies, " + std::to_string(result.keys) +
          " API keys");
    Print("compared " + std::to_string(compared.compared) + " rankings: " +
          (compared.differences.empty() ? "all the same"
                                        : std::to_string(compared.differences.size()) + " differ"));
    for (const std::string& difference : compared.differences) Print(difference);
  }
  if (result.extra > 0) {
    Message(std::to_string(result.extra) +
            " images are in the copy and not, or not any more, in what was copied");
  }
  if (result.without_content > 0) {
    Message("of " + std::to_string(result.without_content) +
            " images there are no uploaded bytes to copy");
  }
  return compared.differences.empty() ? ExitStatus::kDone : ExitStatus::kFailed;
}

constexpr int kRecordsAtOnce = 500;

std::int64_t ExportNpz(Engine& engine, ImageListing list, const std::filesystem::path& out) {
  NewFile file(out);
  const std::int64_t images = WriteFeaturesNpz(
      engine, std::move(list), [](std::uint64_t) {},
      [&file](std::uint64_t offset, std::string_view bytes) { file.Write(offset, bytes); });
  file.Publish();
  return images;
}

std::int64_t ExportRecords(Engine& engine, ImageListing list, const std::filesystem::path& out) {
  list.limit = kRecordsAtOnce;
  std::optional<NewFile> file;
  if (out != kStandardOutput) file.emplace(out);
  std::uint64_t written = 0;
  std::int64_t images = 0;
  engine.ForEachPage(list, [&](const ImagePage& page) {
    std::string lines;
    for (const ImageRecord& record : page.records) lines += ToText(ImageJson(record)) + '\n';
    file ? file->Write(written, lines) : WriteFile(out, lines);
    written += lines.size();
    images += static_cast<std::int64_t>(page.records.size());
  });
  if (file) file->Publish();
  return images;
}

// Throws kInvalidArgument "bad_export_name" for another extension.
void CheckExportName(const std::filesystem::path& out) {
  if (out == kStandardOutput || out.extension() == ".npz" || out.extension() == ".ndjson") return;
  throw Error(
      ErrorCode::kInvalidArgument, "bad_export_name",
      ToDisplayText(out.string()) +
          ": features are exported as .npz (NumPy), records as .ndjson; end the name in one "
          "of them, or give - for records on standard output");
}

// Replaces the file, by images that are all of one state of the database.
ExitStatus RunExport(Engine& engine, const ExportOptions& options) {
  ImageListing list;
  list.which.collection = options.collection;
  list.which.object = options.object;
  if (!options.filter.empty()) list.which.filter = ParseFilter(options.filter);
  const auto write = options.out.extension() == ".npz" ? ExportNpz : ExportRecords;
  if (options.out == kStandardOutput) ClaimStandardOutput("FILE", options.json);
  const std::int64_t images = write(engine, list, options.out);
  if (options.out == kStandardOutput) {
    Message("wrote " + std::to_string(images) + " records");
    return ExitStatus::kDone;
  }
  const std::string file = ToDisplayText(options.out.string());
  const std::uintmax_t bytes = std::filesystem::file_size(options.out);
  if (options.json) {
    PrintJson({{"file", file}, {"images", images}, {"bytes", bytes}});
  } else {
    Print("wrote " + file + ", " + FormatBytes(bytes) + " of " + std::to_string(images) +
          " images");
  }
  return ExitStatus::kDone;
}

struct Options {
  EngineOptions engine;
  std::string collection;
  std::string only_collection;  // of `stats`; empty = all
  std::filesystem::path backup;
  std::string place;
  CopyCommandOptions copy;
  ExportOptions exporting;
  std::vector<std::string> ids;
  std::vector<std::string> objects;
  bool sweep = false;
  bool replace = false;
  bool json = false;
};

Engine OpenEngine(Options& options, Access access) { return OpenForCare(options.engine, access); }

ExitStatus Initialize(Options& options) {
  InitializeDatabase(options.engine.database.string());
  if (options.json) {
    PrintJson({{"database", ToDisplayText(options.engine.database.string())}});
  } else {
    Print("the database has Pliant's tables");
  }
  return ExitStatus::kDone;
}

ExitStatus Stats(Options& options) {
  return RunStats(options.engine, {.collection = options.only_collection, .json = options.json});
}

ExitStatus Check(Options& options) {
  return RunCheck(options.engine, {.sweep = options.sweep, .json = options.json});
}

ExitStatus Backup(Options& options) {
  Engine engine = OpenEngine(options, Access::kRead);
  const Interrupt interrupt;
  engine.Backup(options.backup, interrupt.token());
  const auto originals = engine.DescribeOriginals();
  const std::uintmax_t bytes = std::filesystem::file_size(options.backup);
  if (options.json) {
    PrintJson({{"file", ToDisplayText(options.backup.string())},
               {"bytes", bytes},
               {"originals", OriginalsJson(originals)}});
  } else {
    Print("wrote " + options.backup.string() + ", " + FormatBytes(bytes));
    if (originals && originals->files > 0) {
      Message("the originals of " + std::to_string(originals->files) +
              " images are not in the backup: copy the directory " + originals->directory.string() +
              " now");
    }
  }
  return ExitStatus::kDone;
}

ExitStatus Restore(Options& options) {
  const RestoreResult result =
      RestoreDatabase(options.backup, options.engine.database, options.replace);
  if (options.json) {
    PrintJson({{"file", ToDisplayText(options.engine.database.string())},
               {"images", result.images},
               {"before", result.before.empty() ? Json(nullptr)
                                                : Json(ToDisplayText(result.before.string()))}});
    return ExitStatus::kDone;
  }
  Print("restored " + options.engine.database.string() + ", " + std::to_string(result.images) +
        " images");
  if (!result.before.empty()) Print("what was there is now " + result.before.string());
  Message("API keys are those of the backup: revoke again what was revoked since");
  return ExitStatus::kDone;
}

ExitStatus CopyAll(Options& options) {
  options.copy.from = options.engine.database;
  options.copy.json = options.json;
  return RunCopy(options.copy);
}

ExitStatus Export(Options& options) {
  CheckExportName(options.exporting.out);
  CheckWritable(options.exporting.out);
  options.exporting.collection = options.collection;
  options.exporting.json = options.json;
  Engine engine = OpenEngine(options, Access::kRead);
  return RunExport(engine, options.exporting);
}

ExitStatus MoveOriginals(Options& options) {
  Engine engine = OpenEngine(options, Access::kWrite);
  MoveOriginalsResult result;
  {
    Progress progress("moving originals");
    result = engine.MoveOriginals(ParseOriginalsDir(options.place).value_or(""),
                                  [&](double done) { progress.Share(done); });
  }
  if (options.json) {
    PrintJson({{"moved", result.moved}, {"left", result.left}});
  } else {
    Print("moved the originals of " + std::to_string(result.moved) + " images");
  }
  if (result.left == 0) return ExitStatus::kDone;
  Message("skipped " + std::to_string(result.left) +
          ": their files are missing or damaged; `pliant db check` names them");
  return ExitStatus::kSomeSkipped;
}

ExitStatus Remove(Options& options) {
  if (options.ids.empty() && options.objects.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "nothing_named", "give image ids or --object");
  }
  Engine engine = OpenEngine(options, Access::kWrite);
  std::uint64_t removed = 0;
  Json missing = Json::array();
  for (const std::string& id : options.ids) {
    if (engine.Remove(options.collection, id)) {
      ++removed;
    } else {
      missing.push_back(ToDisplayText(id));
    }
  }
  for (const std::string& object : options.objects) {
    const std::uint64_t images = engine.RemoveObject(options.collection, object);
    removed += images;
    if (images == 0) missing.push_back(ToDisplayText(object));
  }
  if (options.json) {
    PrintJson({{"removed", removed}, {"missing", missing}});
  } else {
    for (const auto& id : missing)
      Message("skipped " + id.get<std::string>() + ": it is not in the index");
    Print("removed " + std::to_string(removed));
  }
  return missing.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
}

}  // namespace

void AddDbCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = program.add_subcommand("db", "Inspect and maintain a database");
  app->require_subcommand(1);
  app->footer(
      "Example:  pliant db backup my-backup.db --db my.db\n"
      "          pliant db check --db my.db");
  const auto add = [&](const char* name, const char* help, ExitStatus (*run)(Options&),
                       const std::string& example) {
    CLI::App* sub = app->add_subcommand(name, help);
    AddDatabaseFlag(*sub, options->engine);
    sub->add_option_function<std::string>(
           "--originals-dir",
           [options](const std::string& text) {
             options->engine.originals_dir = ParseOriginalsDir(text);
           },
           "directory of the originals (default: the one that the database records)")
        ->type_name("DIR");
    sub->add_flag("--json", options->json, "print one JSON document");
    sub->footer("Example:  pliant db " + example);
    sub->callback([=, &status] { status = run(*options); });
    return sub;
  };
  add("init", "Make the tables of a database on a PostgreSQL server, if they are missing",
      Initialize, "init --db postgresql://pliant@host/pliant");
  add("stats", "Show the number of images, sizes, the vocabulary and the collections", Stats,
      "stats --db my.db --collection shirts")
      ->add_option("--collection", options->only_collection, "only this collection")
      ->type_name("NAME");
  add("check", "Verify the integrity of the database", Check, "check --db my.db")
      ->add_flag("--sweep", options->sweep,
                 "also remove files from the originals' directory that no image refers to");
  add("backup", "Copy the database to a new file, also while it is in use", Backup,
      "backup monday.db --db my.db")
      ->add_option("FILE", options->backup, "the new file")
      ->required();
  CLI::App* restore = add("restore", "Put a backup in place of the database", Restore,
                          "restore monday.db --db my.db --replace");
  restore->add_option("FILE", options->backup, "the backup; it stays as it is")->required();
  restore->add_flag("--replace", options->replace,
                    "also over an existing database, which is kept under another name");
  CLI::App* copy = add("copy", "Copy everything into another database, a file or a URL", CopyAll,
                       "copy postgresql://pliant@host/pliant --db my.db");
  copy->add_option("TO", options->copy.to,
                   "the other database; a copy that was stopped goes on there")
      ->required();
  copy->add_option("--compare", options->copy.compare, "rankings of both to compare afterwards")
      ->capture_default_str();
  copy->add_option("--commit-every", options->copy.commit_every,
                   "images written in one commit; fewer where 64 MiB are reached before")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  CLI::App* exporting =
      add("export", "Write the features of a collection, or its records, to a file", Export,
          "export features.npz --db my.db");
  exporting
      ->add_option(
          "FILE", options->exporting.out,
          "the file to write: features as .npz (NumPy), or records as .ndjson; - = standard "
          "output, records")
      ->required();
  AddCollectionFlag(*exporting, options->collection);
  exporting->add_option("--object", options->exporting.object, "only images of this object")
      ->type_name("NAME");
  exporting
      ->add_option("--filter", options->exporting.filter,
                   "only images whose metadata match, as of `pliant query`")
      ->option_text("JSON");
  add("originals", "Move the uploaded files into a directory, or back", MoveOriginals,
      "originals images/ --db my.db")
      ->add_option("DIR|database", options->place, "the new location of the files")
      ->required();
  CLI::App* remove =
      add("rm", "Remove images permanently", Remove, "rm --object 'red shirt' --db my.db");
  AddCollectionFlag(*remove, options->collection);
  remove->add_option("ID", options->ids, "image ids");
  remove->add_option("--object", options->objects, "all images of this object")->type_name("NAME");
}

}  // namespace pliant::cli
