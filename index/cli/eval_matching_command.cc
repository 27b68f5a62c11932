// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant eval matching DIR
#include <memory>

#include "descriptor/evaluation/matching_benchmark.h"
#include "index/cli/command.h"
#include "index/cli/eval_files.h"
#include "index/cli/eval_matching_output.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"

namespace pliant::cli {
namespace {

struct Options {
  evaluation::MatchingOptions matching;
  std::filesystem::path folder;
  std::string layout = "auto";
  std::vector<std::string> descriptors;
  std::filesystem::path csv;
  bool json = false;
};

ExitStatus Run(Options& options) {
  CheckCsv(options.csv, options.json);
  for (const std::string& text : options.descriptors)
    options.matching.descriptors.push_back(evaluation::ParseDescriptorChoice(text));
  const evaluation::Dataset dataset =
      evaluation::OpenDataset(options.folder, evaluation::ParseLayout(options.layout));
  const Interrupt interrupt;
  evaluation::MatchingReport report;
  {
    Progress progress("pairs");
    options.matching.progress = [&](std::uint64_t done, std::uint64_t total) {
      progress.Count(done, total);
      return !interrupt.requested();
    };
    report = evaluation::RunMatchingBenchmark(dataset, options.matching);
  }
  if (!options.csv.empty()) WriteFile(options.csv, MatchingReportCsv(report));
  if (options.matching.pairs > report.pairs) {
    Message("only " + std::to_string(report.pairs) + " of " +
            std::to_string(options.matching.pairs) + " pairs: the set has no more measurable ones");
  }
  if (options.json) {
    PrintJson(MatchingReportJson(report, options.matching));
  } else {
    Print(MatchingReportText(report));
  }
  return ExitStatus::kDone;
}

std::string KnownDescriptors() {
  std::string names;
  for (const evaluation::DescriptorChoice& choice : evaluation::AllDescriptorChoices())
    names += (names.empty() ? "" : ", ") + choice.label;
  return names;
}

void AddSelectionFlags(CLI::App& app, Options& options) {
  evaluation::MatchingOptions& matching = options.matching;
  app.add_option(
         "--layout", options.layout,
         "tensors or folders (pliant simulate), hpatches, nonrigid; auto: detect from the files")
      ->capture_default_str()
      ->check(OneOf({"auto", "tensors", "folders", "hpatches", "nonrigid"}))
      ->type_name("NAME");
  app.add_option(
         "--descriptor", options.descriptors,
         "rows of the table, [LABEL:]NAME[=WEIGHTS], separated by commas; default: all of " +
             KnownDescriptors())
      ->delimiter(',')
      ->check(KnownDescriptorChoice())
      ->type_name("NAME,...");
  app.add_option("--model", matching.model, "weight file for deal and its variants")
      ->type_name("FILE");
  app.add_option("--pairs", matching.pairs, "number of pairs, chosen by --seed; 0 = all")
      ->capture_default_str();
  app.add_option("--seed", matching.seed, "same seed, same pairs")->capture_default_str();
  app.add_option("--keypoints", matching.max_keypoints,
                 "number of key points per picture, strongest first")
      ->capture_default_str();
  app.add_flag("--enlarge", matching.enlarge,
               "also use faint key points and those of the pictures enlarged, as queries of the "
               "service do");
  app.add_option("--tolerance", matching.tolerance_px,
                 "distance from the true position, in pixels, up to which a match is correct")
      ->capture_default_str();
  app.add_option("--min-true-pairs", matching.min_true_pairs,
                 "exclude pairs with fewer common key points")
      ->capture_default_str();
  app.add_option("--jobs,-j", matching.jobs, "threads, one scene each; 0 = one per core")
      ->capture_default_str()
      ->check(Between(0, 1024));
}

}  // namespace

void AddEvalMatching(CLI::App& eval, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = eval.add_subcommand(
      "matching", "Compare descriptors at the same key points of pictures with ground truth");
  app->add_option("DIR", options->folder, "the data set")->required();
  AddSelectionFlags(*app, *options);
  AddCsvFlag(*app, options->csv, "write the tables to this file");
  app->add_flag("--json", options->json, "print one JSON document");
  app->footer("Example:  pliant eval matching dev --pairs 40");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
