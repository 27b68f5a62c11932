// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant eval retrieval DIR
#include <memory>

#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/eval_files.h"
#include "index/cli/eval_retrieval_output.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"

namespace pliant::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
  RetrievalOptions retrieval;
  fs::path folder;
  RetrievalLayout layout = RetrievalLayout::kAuto;
  std::vector<fs::path> distractors;
  std::vector<fs::path> absent;
  std::vector<fs::path> peers;
  fs::path csv;      // empty = none; - = standard output
  fs::path answers;  // the same
  bool json = false;
  bool list = false;
};

// Pictures are counted; the steps after them, each short, are named by the line's unit.
class Steps {
 public:
  void Tell(const std::string& what, std::size_t done, std::size_t total) {
    const std::lock_guard lock(mutex_);
    if (what != what_) {
      line_.reset();  // two at once would overwrite each other
      line_ = std::make_unique<Progress>(what);
      what_ = what;
    }
    line_->Count(done, total);
  }

 private:
  std::mutex mutex_;  // guards the rest
  std::string what_;
  std::unique_ptr<Progress> line_;
};

ExitStatus Run(Options& options) {
  CheckCsv(options.csv, options.json);
  if (options.answers == kStandardOutput) ClaimStandardOutput("--answers", options.json);
  if (!options.answers.empty()) CheckWritable(options.answers);
  options.retrieval.keep_answers = !options.answers.empty();
  const RetrievalSet set =
      ReadRetrievalSet(options.folder, options.layout, options.distractors, options.absent);
  if (options.list) {
    for (const SkippedFile& file : set.skipped)
      Message("skipped " + file.file + ": " + file.reason);
    PrintJson(RetrievalSetJson(set));
    return set.skipped.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
  }
  const Interrupt interrupt;
  options.retrieval.stop = interrupt.token();
  RetrievalReport report;
  {
    Steps steps;
    options.retrieval.progress = [&](const std::string& what, std::size_t done, std::size_t total) {
      steps.Tell(what, done, total);
    };
    report = EvaluateRetrieval(set, options.retrieval);
  }
  for (const fs::path& file : options.peers) AddPeers(file, &report);
  for (const SkippedFile& file : report.skipped) {
    Message("skipped " + file.file + ": " + file.reason);
  }
  if (!options.csv.empty()) WriteFile(options.csv, RetrievalReportCsv(report));
  if (!options.answers.empty()) WriteFile(options.answers, RetrievalAnswersCsv(report));
  if (options.json) {
    PrintJson(RetrievalReportJson(report));
  } else {
    Print(RetrievalReportText(report));
  }
  return report.skipped.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
}

void AddSetFlags(CLI::App& app, Options& options) {
  app.add_option("DIR", options.folder, "the pictures")->required();
  AddChoice<RetrievalLayout>(
      app, "--layout", options.layout,
      "how DIR names objects and queries; default: detect from the file names",
      {{"auto", RetrievalLayout::kAuto},
       {"objects", RetrievalLayout::kObjects},
       {"ukbench", RetrievalLayout::kUkbench},
       {"pairs", RetrievalLayout::kPairs},
       {"labels", RetrievalLayout::kLabels}});
  app.add_option("--distractors", options.distractors,
                 "folder of pictures that show none of the objects; may be given more than once")
      ->allow_extra_args(false)
      ->type_name("DIR");
  app.add_option(
         "--absent", options.absent,
         "folder of further queries that show none of the objects, so that whatever is found "
         "is a false alarm; may be given more than once")
      ->allow_extra_args(false)
      ->type_name("DIR");
}

void AddRunFlags(CLI::App& app, RetrievalOptions& retrieval) {
  AddChoices<RetrievalProtocol>(
      app, "--protocol", retrieval.protocols,
      "paper: 10 words, histograms; default: as query does; unexpanded: the same "
      "with --expand 0; unverified: the same without verification (default: paper,default)",
      {{"paper", RetrievalProtocol::kPaper},
       {"default", RetrievalProtocol::kDefault},
       {"unexpanded", RetrievalProtocol::kUnexpanded},
       {"unverified", RetrievalProtocol::kUnverified}});
  app.add_option("--seeds", retrieval.seeds, "number of vocabularies trained for each row")
      ->capture_default_str()
      ->check(Between(1, 1000));
  app.add_option("--words", retrieval.words,
                 "vocabulary sizes, one row each (not for paper); 0 = the default of index")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str()
      ->check(AtLeast(0));
  app.add_option("--sample", retrieval.sample,
                 "descriptors used to train vocabularies (not for paper); 0 = the default of index")
      ->capture_default_str()
      ->check(AtLeast(0));
  AddChoice<RankMethod>(
      app, "--rank", retrieval.rank,
      "ranking of all protocols but the paper's; histogram has no verification "
      "(default: neighbours)",
      {{"neighbours", RankMethod::kNeighbours}, {"histogram", RankMethod::kHistogram}});
  app.add_option("--verify-depth", retrieval.verify_depth,
                 "pictures verified per query; 0 = as query does")
      ->capture_default_str()
      ->check(Between(0, 1'000'000));
  app.add_option("--jobs,-j", retrieval.jobs, "threads that describe pictures; 0 = one a core")
      ->capture_default_str()
      ->check(Between(0, 1024));
  app.add_option("--cache", retrieval.cache,
                 "keep the features in this folder, so that the next run is faster")
      ->type_name("DIR");
}

}  // namespace

void AddEvalRetrieval(CLI::App& eval, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  RetrievalOptions& retrieval = options->retrieval;
  CLI::App* app = eval.add_subcommand(
      "retrieval", "Query a gallery with pictures of known objects, and measure the accuracy");
  AddSetFlags(*app, *options);
  AddDescriptorListFlags(*app, retrieval.descriptors, retrieval.descriptor_options,
                         retrieval.extraction);
  AddRunFlags(*app, retrieval);
  app->add_option("--peers", options->peers,
                  "results of another program on the same pictures, to be listed too; may be given "
                  "more than once")
      ->allow_extra_args(false)
      ->type_name("FILE");
  AddCsvFlag(*app, options->csv, "write the table to this file");
  app->add_option("--answers", options->answers,
                  "write the first ten hits of every query to this CSV file; - = standard output")
      ->type_name("FILE");
  app->add_flag("--list", options->list,
                "only print the queries and the searched pictures, as JSON");
  app->add_flag("--json", options->json, "print one JSON document");
  app->footer("Example:  pliant eval retrieval dev --descriptor deal,rootsift --protocol default");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
