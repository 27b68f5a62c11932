// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant index DIR... --db FILE
#include <algorithm>
#include <memory>

#include "descriptor/base/stopwatch.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/engine/training_policy.h"
#include "index/import/folder_import.h"
#include "index/json/record_json.h"

namespace pliant::cli {
namespace {

struct Options {
  EngineOptions engine;
  FolderImportOptions job;
  std::vector<std::filesystem::path> inputs;
  ObjectFrom object_from = ObjectFrom::kAuto;
  bool json = false;
};

struct Outcome {
  FolderImportResult job;
  std::optional<VocabularyRecord> vocabulary;
  bool trained = false;
  double seconds = 0;
};

const char* NamedBy(const ImageFiles& files) {
  if (files.by_folder) {
    return files.by_stem ? "objects named by folder, or by file name outside folders"
                         : "objects named by folder";
  }
  return files.by_stem ? "objects named by file name" : "no object names";
}

// The first vocabulary is trained automatically, so that one command makes an index that answers;
// another one when the collection has outgrown it.
void TrainIfDue(Engine& engine, const Options& options, const Interrupt& interrupt,
                Outcome& outcome) {
  const CollectionRecord record = engine.GetCollection(options.job.collection);
  outcome.vocabulary = record.vocabulary;
  if (outcome.job.interrupted || !AutomaticTrainingIsDue(record)) return;
  Message(record.vocabulary ? "the collection has outgrown its vocabulary: training another one"
                            : "no vocabulary yet: training one from the stored images");
  TrainOptions train;
  train.automatic = true;
  train.collection = options.job.collection;
  train.threads = options.job.threads;
  train.stop = interrupt.token();
  Progress progress("training the vocabulary");
  train.progress = [&](double done, double) { progress.Share(done); };
  const VocabularyRecord made = engine.TrainVocabulary(train);
  if (!made.active) {
    UseOptions use;
    use.threads = options.job.threads;
    use.stop = interrupt.token();
    use.automatic = true;
    engine.UseVocabulary(options.job.collection, made.id, use);
  }
  outcome.vocabulary = made;
  outcome.trained = true;
}

std::string LeftOut(std::uint64_t files) {
  return files == 0 ? ""
                    : fmt::format(", {} {} of system folders left out", files,
                                  files == 1 ? "file" : "files");
}

void PrintText(const Outcome& outcome, const ImageFiles& files) {
  const FolderImportResult& job = outcome.job;
  ReportSkipped(job.skipped);
  if (std::ranges::find(job.skipped, "same_bytes", &SkippedFile::code) != job.skipped.end()) {
    Message(
        "a stored image keeps its object: remove the image first (pliant db rm --object NAME), or "
        "rename the object on the web page");
  }
  Print("indexed {}, unchanged {}, skipped {} images{} in {:.1f} s ({})", job.indexed,
        job.unchanged, job.skipped.size(), LeftOut(job.system_files), outcome.seconds,
        NamedBy(files));
  if (outcome.vocabulary) {
    Print("{} vocabulary {} of {} words", outcome.trained ? "trained" : "using",
          outcome.vocabulary->id, outcome.vocabulary->words);
  }
}

Json ToJson(const Outcome& outcome) {
  Json vocabulary = nullptr;
  if (outcome.vocabulary) {
    vocabulary = VocabularyJson(*outcome.vocabulary);
    vocabulary["trained"] = outcome.trained;
  }
  return {{"indexed", outcome.job.indexed},
          {"unchanged", outcome.job.unchanged},
          {"skipped", SkippedJson(outcome.job.skipped)},
          {"system_files", outcome.job.system_files},
          {"vocabulary", std::move(vocabulary)},
          {"seconds", outcome.seconds},
          {"interrupted", outcome.job.interrupted}};
}

ExitStatus Run(Options& options) {
  const Stopwatch watch;
  const Interrupt interrupt;
  const ImageFiles files = FindImages(options.inputs, options.object_from);
  Engine engine(options.engine);
  if (options.job.collection != kDefaultCollection) engine.CreateCollection(options.job.collection);
  Outcome outcome;
  options.job.max_bytes = options.engine.extraction.decode.max_bytes;
  options.job.stop = interrupt.token();
  Progress progress("images");
  options.job.progress = progress.Counter();
  outcome.job = ImportImages(engine, files, options.job);
  try {
    TrainIfDue(engine, options, interrupt, outcome);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCancelled) throw;
    outcome.job.interrupted = true;
  }
  outcome.seconds = watch.seconds();
  if (options.json) {
    PrintJson(ToJson(outcome));
  } else {
    PrintText(outcome, files);
  }
  if (files.images.empty()) Message("no images found");
  if (outcome.job.interrupted) {
    Message("stopped on request; indexed images are kept: run the same command again to resume");
    return ExitStatus::kFailed;  // of which main makes 130 or 143
  }
  return outcome.job.skipped.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
}

}  // namespace

void AddIndexCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = program.add_subcommand("index", "Add the images of folders to a database");
  app->add_option("DIR", options->inputs, "folders, searched recursively, or image files")
      ->required();
  AddDatabaseFlag(*app, options->engine);
  AddCollectionFlag(*app, options->job.collection);
  AddChoice<ObjectFrom>(
      *app, "--object-from", options->object_from,
      "the name of an image's object: its folder below DIR (\"coat/front\"), its file name without "
      "extension (stem), or none (default: folder; stem for image files on the command line, and "
      "for images directly in a single DIR)",
      {{"folder", ObjectFrom::kFolder}, {"stem", ObjectFrom::kStem}, {"none", ObjectFrom::kNone}});
  AddJobsFlag(*app, options->job.threads, "threads, one image each");
  app->add_flag("--keep-originals,!--no-originals", options->engine.keep_originals,
                "also store the image files, for the web page (default: yes)");
  AddOriginalsFlag(
      *app, options->engine,
      "store the image files in this directory, or in the `database` (default: keep the "
      "current location)")
      ->type_name("DIR|database");
  AddExtractionFlags(*app, options->engine, /*of_database=*/true);
  AddJsonFlag(*app, options->json);
  app->footer(
      "Example:  pliant index shirts/ --db my.db         one folder per object\n"
      "          pliant index more/ --db my.db --json    run again to continue after a stop");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
