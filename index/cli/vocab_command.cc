// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant vocab train | list | use
#include <memory>

#include "descriptor/base/unix_time.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/json/record_json.h"

namespace pliant::cli {
namespace {

struct Options {
  EngineOptions engine;
  TrainOptions train;  // its collection is that of all three
  std::int64_t id = 0;
  bool use_at_once = false;
  bool json = false;
};

ExitStatus Train(Options& options) {
  Engine engine = OpenExisting(options.engine, /*read_only=*/false);
  const Interrupt interrupt;
  options.train.stop = interrupt.token();
  Progress progress("training the vocabulary");
  options.train.progress = [&](double done, double) { progress.Share(done); };
  VocabularyRecord record = engine.TrainVocabulary(options.train);
  if (options.use_at_once && !record.active) {
    engine.UseVocabulary(options.train.collection, record.id);
    record.active = true;
  }
  Report(options.json, VocabularyJson(record),
         "vocabulary {}: {} words from {} of {} descriptors, mean distance {:.4f}", record.id,
         record.words, record.origin.sampled, record.origin.available, record.origin.loss);
  if (!options.json && !record.active) {
    Print("not in use yet; to use it: pliant vocab use {} --db {}", record.id,
          options.engine.database.string());
  }
  return ExitStatus::kDone;
}

ExitStatus List(Options& options) {
  Engine engine = OpenExisting(options.engine, /*read_only=*/true);
  Json rows = Json::array();
  for (const VocabularyRecord& record : engine.ListVocabularies(options.train.collection)) {
    rows.push_back(VocabularyJson(record));
    if (options.json) continue;
    rows.back()["state"] = record.active ? "in use" : "";
    rows.back()["trained"] = FormatUtc(record.created_ms, "%Y-%m-%d %H:%M:%S");
  }
  if (options.json) {
    PrintJson({{"vocabularies", std::move(rows)}});
  } else if (rows.empty()) {
    Print("no vocabulary yet; train one: pliant vocab train --db {}",
          options.engine.database.string());
  } else {
    Print(TableOf(rows, {{"/id", "id"},
                         {"/state", "state"},
                         {"/words", "words"},
                         {"/sampled", "sampled"},
                         {"/seed", "seed"},
                         {"/loss", "mean distance", 4},
                         {"/trained", "trained (UTC)"}}));
  }
  return ExitStatus::kDone;
}

ExitStatus Use(Options& options) {
  Engine engine = OpenExisting(options.engine, /*read_only=*/false);
  engine.UseVocabulary(options.train.collection, options.id);
  Report(options.json, {{"vocabulary", options.id}}, "vocabulary {} is in use", options.id);
  return ExitStatus::kDone;
}

}  // namespace

void AddVocabCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = program.add_subcommand("vocab", "Train, list and switch vocabularies");
  app->require_subcommand(1);
  app->footer(
      "Example:  pliant vocab train --db my.db --words 4000\n"
      "          pliant vocab list --db my.db");
  const auto add = [&](const char* name, const char* help, ExitStatus (*run)(Options&),
                       const std::string& example) {
    CLI::App* sub = app->add_subcommand(name, help);
    AddDatabaseFlag(*sub, options->engine);
    AddCollectionFlag(*sub, options->train.collection);
    AddJsonFlag(*sub, options->json);
    sub->footer("Example:  pliant vocab " + example);
    sub->callback([=, &status] { status = run(*options); });
    return sub;
  };

  CLI::App* train = add("train", "Train a new vocabulary on the stored images", Train,
                        "train --db my.db --words 4000 --use");
  train
      ->add_option("--words", options->train.words,
                   "number of visual words; 0 = a tenth of the sample")
      ->check(Between(0, static_cast<int>(kMaxWords)));
  train
      ->add_option("--sample", options->train.sample,
                   "descriptors drawn at random; 0 = 40000, or with --words ten per word, at least "
                   "10000")
      ->check(Between(0, static_cast<int>(kMaxVocabularySamples)));
  AddSeedFlag(*train, options->train.seed, "same seed and images, same vocabulary");
  AddJobsFlag(*train, options->train.threads);
  train->add_flag("--use", options->use_at_once, "use the vocabulary when training ends");

  add("list", "List the vocabularies", List, "list --db my.db");
  add("use", "Switch to another vocabulary", Use, "use 2 --db my.db")
      ->add_option("ID", options->id, "number of the vocabulary in `vocab list`")
      ->required();
}

}  // namespace pliant::cli
