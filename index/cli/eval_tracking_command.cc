// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant eval tracking DIR
#include <memory>

#include "index/cli/command.h"
#include "index/cli/eval_files.h"
#include "index/cli/eval_tracking_output.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/track_flags.h"
#include "index/cli/write_file.h"

namespace pliant::cli {
namespace {

struct Options {
  TrackingBenchmarkOptions benchmark;
  std::filesystem::path folder;
  std::filesystem::path csv;
  bool json = false;
};

ExitStatus Run(Options& options) {
  CheckCsv(options.csv, options.json);
  const std::vector<TrackingSequence> sequences = OpenTrackingSequences(options.folder);
  const Interrupt interrupt;
  TrackingReport report;
  {
    Progress progress("frames");
    options.benchmark.progress = [&](std::uint64_t done, std::uint64_t total) {
      progress.Count(done, total);
      return !interrupt.requested();
    };
    report = RunTrackingBenchmark(sequences, options.benchmark);
  }
  if (!options.csv.empty()) WriteFile(options.csv, TrackingReportCsv(report));
  if (options.json) {
    PrintJson(TrackingReportJson(report));
  } else {
    Print(TrackingReportText(report));
  }
  return ExitStatus::kDone;
}

}  // namespace

void AddEvalTracking(CLI::App& eval, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  TrackingBenchmarkOptions& benchmark = options->benchmark;
  CLI::App* app = eval.add_subcommand(
      "tracking", "Track simulated objects with ground truth (simulate --preset sequence)");
  app->add_option("DIR", options->folder, "scenes, or a folder of such folders (groups)")
      ->required();
  app->add_option("--descriptor", benchmark.descriptors,
                  "rows of the table, separated by commas (default: deal, deal-fixed, rootsift, "
                  "sift, orb)")
      ->delimiter(',')
      ->check(OneOf(DescriptorNames()))
      ->type_name("NAME,...");
  app->add_option("--model", benchmark.model, "weight file for deal and its variants")
      ->type_name("FILE");
  app->add_option("--max-keypoints", benchmark.max_keypoints,
                  "number of key points of the object and of each frame, strongest first")
      ->capture_default_str()
      ->check(Between(1, 4096));
  app->add_option("--every", benchmark.every, "use every N-th frame only")
      ->capture_default_str()
      ->check(Between(1, 1'000'000));
  AddTrackingFlags(*app, benchmark.locate);
  app->add_option("--jobs,-j", benchmark.jobs, "threads, one sequence each; 0 = one per core")
      ->capture_default_str()
      ->check(Between(0, 1024));
  AddCsvFlag(*app, options->csv, "write one row per frame and descriptor");
  app->add_flag("--json", options->json, "print one JSON document");
  app->footer("Example:  pliant eval tracking scenes");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
