// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant db init | stats | check | backup | restore | copy | export | originals | rm
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <unistd.h>

#include "descriptor/base/format_bytes.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"
#include "index/engine/collection_npz.h"
#include "index/engine/copy_database.h"
#include "index/engine/engine.h"
#include "index/files/text.h"
#include "index/json/record_csv.h"
#include "index/json/record_json.h"
#include "index/store/open_store.h"

namespace pliant::cli {
namespace {

struct Options {
  EngineOptions engine;
  std::string collection;
  std::string only_collection;  // of `stats`; empty = all
  std::filesystem::path backup;
  std::string place;
  CopyOptions copy;             // `from` is the database
  std::uint64_t compare = 100;  // rankings, after the copy
  // .npz (engine/collection_npz.h): features, by ids; .ndjson: the records, a line of JSON each;
  // .csv: names and labels.
  std::filesystem::path out;
  std::optional<std::string> object;  // only its images are exported
  std::string filter;                 // only images whose metadata match
  std::vector<std::string> ids;
  std::vector<std::string> objects;
  bool sweep = false;
  bool replace = false;
  bool json = false;
};

ExitStatus Initialize(Options& options) {
  InitializeDatabase(options.engine.database.string());
  Report(options.json, {{"database", PathText(options.engine.database)}}, "{}",
         "the database has all tables");
  return ExitStatus::kDone;
}

Json OriginalsJson(const std::optional<OriginalsRecord>& originals) {
  if (!originals) return nullptr;
  return {{"directory", PathText(originals->directory)},
          {"files", originals->files},
          {"owned", originals->owned}};
}

// `only`: the name of one; empty = all.
std::vector<CollectionRecord> Collections(Engine& engine, const std::string& only) {
  if (!only.empty()) return {engine.GetCollection(only)};
  std::vector<CollectionRecord> list;
  for (const std::string& name : engine.ListCollections()) {
    try {
      list.push_back(engine.GetCollection(name));
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;  // removed meanwhile
    }
  }
  return list;
}

// Of a collection, or of all.
std::string CountsOf(const auto& c) {
  return fmt::format("{} images, {} objects, {} descriptors", c.images, c.objects, c.descriptors);
}

void PrintStats(const EngineStats& stats, const std::optional<OriginalsRecord>& originals,
                const std::vector<CollectionRecord>& collections) {
  Print("on disk      {}", FormatBytes(stats.database_bytes));
  Print("in memory    {}", FormatBytes(stats.index_bytes));
  if (originals) {
    Print("originals    {} files in {}", originals->files, originals->directory.string());
  }
  Print("descriptor   {} ({})", stats.descriptor, stats.model_id);
  for (const CollectionRecord& c : collections) {
    Print("collection   {}: {}, {}", ToDisplayText(c.name), CountsOf(c),
          c.vocabulary
              ? fmt::format("vocabulary {} of {} words", c.vocabulary->id, c.vocabulary->words)
              : "no vocabulary yet");
  }
  if (collections.size() > 1) {
    Print("together     {}", CountsOf(stats));
  }
}

ExitStatus Stats(Options& options) {
  Engine engine = OpenExisting(options.engine, /*read_only=*/true, /*with_index=*/true);
  const EngineStats stats = engine.Stats();
  const auto originals = engine.DescribeOriginals();
  const auto collections = Collections(engine, options.only_collection);
  if (!options.json) {
    PrintStats(stats, originals, collections);
    return ExitStatus::kDone;
  }
  Json json = {{"images", stats.images},           {"objects", stats.objects},
               {"descriptors", stats.descriptors}, {"database_bytes", stats.database_bytes},
               {"index_bytes", stats.index_bytes}, {"descriptor", stats.descriptor},
               {"model_id", stats.model_id},       {"originals", OriginalsJson(originals)},
               {"collections", Json::array()}};
  for (const CollectionRecord& c : collections) json["collections"].push_back(CollectionJson(c));
  PrintJson(json);
  return ExitStatus::kDone;
}

void RequireOwnOriginals(const std::optional<OriginalsRecord>& originals) {
  if (originals && originals->owned) return;
  throw Error(ErrorCode::kConflict, "originals_foreign",
              originals ? "the directory " + originals->directory.string() +
                              " does not belong to this database (yet): nothing was removed"
                        : "the originals are in the database: there is no directory to sweep");
}

// What to do about the problems. A backup does not hold the files of the originals' directory.
void Advise(const std::optional<OriginalsRecord>& originals,
            const std::vector<std::string>& problems) {
  const std::string directory = originals ? originals->directory.string() : "";
  const auto of_files = std::ranges::count_if(problems, [&](const std::string& problem) {
    return !directory.empty() && problem.find(directory) != std::string::npos;
  });
  if (of_files > 0) {
    Message(
        "a backup does not contain the originals in {}: mount that directory, restore a copy of "
        "it, or name another directory with --originals-dir",
        directory);
  }
  if (of_files == std::ssize(problems)) return;
  Message("to restore a backup: pliant db restore BACKUP --db FILE --replace");
}

ExitStatus Check(Options& options) {
  // A file that this user may not write is checked as it is.
  const std::string database = options.engine.database.string();
  const bool is_file = access(database.c_str(), F_OK) == 0;
  const bool read = is_file && !options.sweep && access(database.c_str(), W_OK) != 0;
  Engine engine = OpenExisting(options.engine, read);
  const std::vector<std::string> problems = engine.Check();
  Json answer{{"ok", problems.empty()}, {"problems", Json::array()}};
  for (const std::string& problem : problems) answer["problems"].push_back(ToDisplayText(problem));
  if (options.sweep) {
    RequireOwnOriginals(engine.DescribeOriginals());
    answer["swept"] = engine.SweepOriginals();
    if (!options.json) Print("removed {} unreferenced files", answer["swept"].get<std::uint64_t>());
  }
  if (options.json) {
    PrintJson(answer);
  } else if (problems.empty()) {
    Print("ok");
  } else {
    for (const std::string& problem : problems) {  // the store tells several things in one text
      std::istringstream lines(problem);
      for (std::string line; std::getline(lines, line);) Print(ToDisplayText(line));
    }
    Advise(engine.DescribeOriginals(), problems);
  }
  return problems.empty() ? ExitStatus::kDone : ExitStatus::kFailed;
}

ExitStatus Backup(Options& options) {
  Engine engine = OpenExisting(options.engine, /*read_only=*/true);
  const Interrupt interrupt;
  engine.Backup(options.backup, interrupt.token());
  const auto originals = engine.DescribeOriginals();
  const std::uintmax_t bytes = std::filesystem::file_size(options.backup);
  Report(options.json,
         {{"file", PathText(options.backup)},
          {"bytes", bytes},
          {"originals", OriginalsJson(originals)}},
         "wrote {}, {}", options.backup.string(), FormatBytes(bytes));
  if (!options.json && originals && originals->files > 0) {
    Message("the originals of {} images are not in the backup: copy the directory {} now",
            originals->files, originals->directory.string());
  }
  return ExitStatus::kDone;
}

ExitStatus Restore(Options& options) {
  const RestoreResult result =
      RestoreDatabase(options.backup, options.engine.database, options.replace);
  Report(options.json,
         {{"file", PathText(options.engine.database)},
          {"images", result.images},
          {"before", TextOrNull(PathText(result.before))}},
         "restored {}, {} images", options.engine.database.string(), result.images);
  if (options.json) return ExitStatus::kDone;
  if (!result.before.empty()) Print("the previous database is now {}", result.before.string());
  Message("the API keys are now the keys of the backup: revoke again the keys revoked since");
  return ExitStatus::kDone;
}

ExitStatus Copy(Options& options) {
  CopyOptions& copy = options.copy;
  copy.from = options.engine.database;
  Interrupt interrupt;
  copy.stop = interrupt.token();
  Progress progress("images");
  copy.progress = progress.Counter();
  const CopyResult result = CopyDatabase(copy);
  const auto open = [](const std::filesystem::path& database) {
    EngineOptions engine;
    engine.database = database;
    return OpenExisting(engine, /*read_only=*/true, /*with_index=*/true);
  };
  Engine from = open(copy.from);
  Engine to = open(copy.to);
  const RankingsCompared compared = CompareRankings(from, to, options.compare);
  const std::vector<std::string>& differences = compared.differences;
  if (options.json) {
    PrintJson({{"collections", result.collections},
               {"copied", result.copied},
               {"unchanged", result.unchanged},
               {"extra", result.extra},
               {"without_content", result.without_content},
               {"vocabularies", result.vocabularies},
               {"keys", result.keys},
               {"rankings_compared", compared.compared},
               {"differences", differences}});
  } else {
    Print("copied {} images ({} already there) of {} collections, {} vocabularies, {} API keys",
          result.copied, result.unchanged, result.collections, result.vocabularies, result.keys);
    Print("compared {} rankings: {}", compared.compared,
          differences.empty() ? "all the same" : fmt::format("{} differ", differences.size()));
    for (const std::string& difference : differences) Print(difference);
  }
  if (result.extra > 0) {
    Message("{} images of the copy are not in the source", result.extra);
  }
  if (result.without_content > 0) {
    Message("{} images have no original to copy", result.without_content);
  }
  return differences.empty() ? ExitStatus::kDone : ExitStatus::kFailed;
}

std::int64_t ExportNpz(Engine& engine, ImageListing list, const std::filesystem::path& out) {
  NewFile file(out);
  const std::int64_t images = WriteFeaturesNpz(
      engine, std::move(list), [](std::uint64_t) {},
      [&file](std::uint64_t offset, std::string_view bytes) { file.Write(offset, bytes); });
  file.Publish();
  return images;
}

std::int64_t ExportRecords(Engine& engine, ImageListing list, const std::filesystem::path& out) {
  constexpr int kRecordsAtOnce = 500;
  list.limit = kRecordsAtOnce;
  std::optional<NewFile> file;
  if (out != kStandardOutput) file.emplace(out);
  const bool csv = out.extension() == ".csv";
  std::uint64_t written = 0;
  std::int64_t images = 0;
  if (csv && file) {
    file->Write(0, kCsvHeader);
    written = std::string_view(kCsvHeader).size();
  }
  engine.ForEachPage(list, [&](const ImagePage& page) {
    std::string lines;
    for (const ImageRecord& record : page.records) {
      lines += csv ? CsvRow(record) : ToText(ImageJson(record)) + '\n';
    }
    file ? file->Write(written, lines) : WriteFile(out, lines);
    written += lines.size();
    images += static_cast<std::int64_t>(page.records.size());
  });
  if (file) file->Publish();
  return images;
}

// Replaces the file, by images that are all of one state of the database.
ExitStatus Export(Options& options) {
  const bool to_output = options.out == kStandardOutput;
  const bool npz = options.out.extension() == ".npz";
  const std::string file = PathText(options.out);
  if (!to_output && !npz && options.out.extension() != ".ndjson" &&
      options.out.extension() != ".csv") {
    throw Error(
        ErrorCode::kInvalidArgument, "bad_export_name",
        file +
            ": unknown type of export; end the name in .npz (features, NumPy), .ndjson "
            "(records) or .csv (names and labels), or give - for records on standard output");
  }
  CheckWritable(options.out);
  Engine engine = OpenExisting(options.engine, /*read_only=*/true);
  ImageListing list;
  list.which.collection = options.collection;
  list.which.object = options.object;
  if (!options.filter.empty()) list.which.filter = ParseFilter(options.filter);
  if (to_output) ClaimStandardOutput("FILE", options.json);
  const std::int64_t images = (npz ? ExportNpz : ExportRecords)(engine, list, options.out);
  if (to_output) {
    Message("wrote {} records", images);
    return ExitStatus::kDone;
  }
  const std::uintmax_t bytes = std::filesystem::file_size(options.out);
  Report(options.json, {{"file", file}, {"images", images}, {"bytes", bytes}},
         "wrote {}, {} of {} images", file, FormatBytes(bytes), images);
  return ExitStatus::kDone;
}

ExitStatus MoveOriginals(Options& options) {
  Engine engine = OpenExisting(options.engine, /*read_only=*/false);
  Progress progress("moving originals");
  const MoveOriginalsResult result = engine.MoveOriginals(
      ParseOriginalsDir(options.place).value_or(""), [&](double done) { progress.Share(done); });
  Report(options.json, {{"moved", result.moved}, {"left", result.left}},
         "moved the originals of {} images", result.moved);
  if (result.left == 0) return ExitStatus::kDone;
  Message("skipped {} images: their files are missing or damaged; `pliant db check` names them",
          result.left);
  return ExitStatus::kSomeSkipped;
}

ExitStatus Remove(Options& options) {
  if (options.ids.empty() && options.objects.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "nothing_named",
                "specify which images to remove: image ids or --object");
  }
  Engine engine = OpenExisting(options.engine, /*read_only=*/false);
  std::uint64_t removed = 0;
  std::vector<std::string> missing;
  const auto skip = [&](const std::string& name, const char* why) {
    missing.push_back(ToDisplayText(name));
    if (!options.json) Message("skipped {}: {}", missing.back(), why);
  };
  for (const std::string& id : options.ids) {
    if (engine.Remove(options.collection, id)) {
      ++removed;
    } else {
      skip(id, "no image has this id");
    }
  }
  for (const std::string& object : options.objects) {
    const std::uint64_t images = engine.RemoveObject(options.collection, object);
    removed += images;
    if (images == 0) skip(object, "no object has this name");
  }
  Report(options.json, {{"removed", removed}, {"missing", missing}}, "removed {}", removed);
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
    AddJsonFlag(*sub, options->json);
    sub->footer("Example:  pliant db " + example);
    sub->callback([=, &status] { status = run(*options); });
    return sub;
  };
  // Of the commands that open the database with its originals.
  const auto add_opening = [&](const char* name, const char* help, ExitStatus (*run)(Options&),
                               const std::string& example) {
    CLI::App* sub = add(name, help, run, example);
    AddOriginalsFlag(
        *sub, options->engine,
        "directory of the originals (default: the directory recorded in the database)");
    return sub;
  };
  add("init", "Create the missing tables of a database on a PostgreSQL server", Initialize,
      "init --db postgresql://pliant@host/pliant");
  add_opening("stats", "Show the number of images, sizes, the vocabulary and the collections",
              Stats, "stats --db my.db --collection shirts")
      ->add_option("--collection", options->only_collection, "only this collection")
      ->type_name("NAME");
  add_opening("check", "Verify the integrity of the database", Check, "check --db my.db")
      ->add_flag("--sweep", options->sweep,
                 "also remove unreferenced files from the directory of the originals");
  add_opening("backup", "Copy the database to a new file, even while it is in use", Backup,
              "backup monday.db --db my.db")
      ->add_option("FILE", options->backup, "the new file")
      ->required();
  CLI::App* restore = add("restore", "Replace the database with a backup", Restore,
                          "restore monday.db --db my.db --replace");
  restore->add_option("FILE", options->backup, "the backup, which stays unchanged")->required();
  restore->add_flag("--replace", options->replace,
                    "replace an existing database, and keep it under another name");
  CLI::App* copy = add("copy", "Copy everything into another database, a file or a URL", Copy,
                       "copy postgresql://pliant@host/pliant --db my.db");
  copy->add_option("TO", options->copy.to, "the other database; run again to resume a stopped copy")
      ->required();
  copy->add_option("--compare", options->compare, "number of rankings to compare afterwards")
      ->check(AtLeast(0));
  CLI::App* exporting =
      add_opening("export", "Write the features of a collection, or its records, to a file", Export,
                  "export features.npz --db my.db");
  exporting
      ->add_option("FILE", options->out,
                   "the file to write: features as .npz (NumPy), records as .ndjson, or names and "
                   "labels as .csv; - = records to standard output")
      ->required();
  AddCollectionFlag(*exporting, options->collection);
  exporting->add_option("--object", options->object, "only images of this object")
      ->type_name("NAME");
  AddFilterFlag(*exporting, options->filter,
                "only images whose metadata match; see `pliant query --help`");
  add_opening("originals", "Move the originals, the stored image files, into a directory, or back",
              MoveOriginals, "originals images/ --db my.db")
      ->add_option("DIR|database", options->place,
                   "the new location: a directory, or `database` for inside the database")
      ->required()
      ->check(CLI::Validator(
          [](const std::string& place) {
            return std::string(place.empty() ? "must not be empty" : "");
          },
          ""));
  CLI::App* remove =
      add_opening("rm", "Remove images permanently", Remove, "rm --object 'red shirt' --db my.db");
  AddCollectionFlag(*remove, options->collection);
  remove->add_option("ID", options->ids, "image ids");
  remove->add_option("--object", options->objects, "all images of this object")->type_name("NAME");
}

}  // namespace pliant::cli
