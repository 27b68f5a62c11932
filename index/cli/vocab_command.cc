// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant vocab train | list | use
#include <memory>

#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"

namespace pliant::cli {
namespace {

struct Options {
  EngineOptions engine;
  TrainOptions train;  // its collection is that of all three
  std::int64_t id = 0;
  bool use_at_once = false;
  bool json = false;
};

// Vocabularies are made from stored descriptors: no weights are needed.
Engine OpenEngine(Options& options, bool read_only) {
  options.engine.descriptor.clear();
  options.engine.create = false;
  options.engine.load_descriptor = false;
  options.engine.load_index = false;
  options.engine.read_only = read_only;
  return Engine(options.engine);
}

ExitStatus Train(Options& options) {
  Engine engine = OpenEngine(options, false);
  const Interrupt interrupt;
  options.train.stop = interrupt.token();
  VocabularyRecord record;
  {
    Progress progress("training the vocabulary");
    options.train.progress = [&](double done, double) { progress.Share(done); };
    record = engine.TrainVocabulary(options.train);
  }
  if (options.use_at_once && !record.active) {
    engine.UseVocabulary(options.train.collection, record.id);
    record.active = true;
  }
  if (options.json) {
    PrintJson(VocabularyDocument(record));
    return ExitStatus::kDone;
  }
  Print("vocabulary " + std::to_string(record.id) + ": " + std::to_string(record.words) +
        " words from " + std::to_string(record.origin.sampled) + " of " +
        std::to_string(record.origin.available) + " descriptors, mean distance " +
        FormatFixed(record.origin.loss, 4));
  if (!record.active) {
    Print("it is not in use yet: pliant vocab use " + std::to_string(record.id) + " --db " +
          options.engine.database.string());
  }
  return ExitStatus::kDone;
}

ExitStatus List(Options& options) {
  Engine engine = OpenEngine(options, true);
  const std::vector<VocabularyRecord> records = engine.ListVocabularies(options.train.collection);
  if (options.json) {
    Json all = Json::array();
    for (const VocabularyRecord& record : records) all.push_back(VocabularyDocument(record));
    PrintJson({{"vocabularies", std::move(all)}});
    return ExitStatus::kDone;
  }
  if (records.empty()) {
    Print("no vocabulary yet; make one: pliant vocab train --db " +
          options.engine.database.string());
    return ExitStatus::kDone;
  }
  std::vector<std::vector<std::string>> rows;
  for (const VocabularyRecord& r : records) {
    rows.push_back({std::to_string(r.id), r.active ? "in use" : "", std::to_string(r.words),
                    std::to_string(r.origin.sampled), std::to_string(r.origin.seed),
                    FormatFixed(r.origin.loss, 4), FormatTime(r.created_ms)});
  }
  Print(FormatTable({"id", "", "words", "sampled", "seed", "mean distance", "made (UTC)"}, rows));
  return ExitStatus::kDone;
}

ExitStatus Use(Options& options) {
  Engine engine = OpenEngine(options, false);
  engine.UseVocabulary(options.train.collection, options.id);
  if (options.json) {
    PrintJson({{"vocabulary", options.id}});
  } else {
    Print("vocabulary " + std::to_string(options.id) + " is in use");
  }
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
    sub->add_flag("--json", options->json, "print one JSON document");
    sub->footer("Example:  pliant vocab " + example);
    sub->callback([=, &status] { status = run(*options); });
    return sub;
  };

  CLI::App* train = add("train", "Train a new vocabulary on the stored images", Train,
                        "train --db my.db --words 4000 --use");
  train->add_option("--words", options->train.words, "number of words; 0 = a tenth of the sample")
      ->capture_default_str()
      ->check(Between(0, static_cast<int>(kMaxWords)));
  train
      ->add_option("--sample", options->train.sample,
                   "descriptors drawn at random; 0 = 40000, or ten per word if --words is given "
                   "(10000 at least)")
      ->capture_default_str()
      ->check(Between(0, static_cast<int>(kMaxVocabularySamples)));
  train->add_option("--seed", options->train.seed, "same seed and images, same vocabulary")
      ->capture_default_str();
  train->add_option("--jobs,-j", options->train.threads, "threads; 0 = one per core")
      ->capture_default_str()
      ->check(Between(0, 1024));
  train->add_flag("--use", options->use_at_once, "activate it when it is ready");

  add("list", "List the vocabularies", List, "list --db my.db");
  add("use", "Switch to another vocabulary", Use, "use 2 --db my.db")
      ->add_option("ID", options->id, "its number in `vocab list`")
      ->required();
}

}  // namespace pliant::cli
