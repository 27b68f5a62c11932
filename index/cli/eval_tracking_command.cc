// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant eval tracking DIR
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"
#include "index/json/json.h"
#include "index/tracking/tracking_benchmark.h"

namespace pliant::cli {
namespace {

constexpr int kSteps = 10;  // of the curves over time

int StepOf(const TrackedView& view) {
  return std::min(kSteps - 1, static_cast<int>(view.time * kSteps));
}

std::vector<TrackingResult> AtStep(const TrackingReport& report, int step) {
  return SummarizeViews(report.views, report.results,
                        [step](const TrackedView& view) { return StepOf(view) == step; });
}

Json ResultsJson(const std::vector<TrackingResult>& results) {
  Json json = Json::array();
  for (const TrackingResult& r : results) {
    json.push_back({{"descriptor", r.descriptor},
                    {"inlier_rate", r.inlier_rate},
                    {"ssim", r.ssim},
                    {"error_px", r.found_share > 0 ? Json(r.error_px) : Json(nullptr)},
                    {"tracked_share", r.tracked_share},
                    {"found_share", r.found_share},
                    {"frames", r.frames},
                    {"model_id", r.model_id}});
  }
  return json;
}

std::string Table(const std::vector<TrackingResult>& results) {
  return TableOf(ResultsJson(results), {{"/descriptor", "descriptor"},
                                        {"/inlier_rate", "inlier rate"},
                                        {"/ssim", "SSIM"},
                                        {"/error_px", "error px", 2},
                                        {"/tracked_share", "tracked"},
                                        {"/found_share", "found"}});
}

// A table, then one per group.
std::string TrackingReportText(const TrackingReport& report) {
  std::string text = fmt::format(
      "{} sequences, {} frames{}\n{}", report.sequences.size(), report.frames,
      report.unseen > 0 ? fmt::format(", {} excluded (object not visible)", report.unseen) : "",
      Table(report.results));
  for (const TrackingReport::Subset& group : report.groups) {
    text += fmt::format("\n\n{}: {} sequences, {} frames\n{}", group.name, group.sequences,
                        group.frames, Table(group.results));
  }
  return text;
}

// {"frames", "unseen", "sequences": [...], "results": [{"descriptor", "inlier_rate", "ssim",
// "error_px", "tracked_share", ...}], "groups": [...], "over_time": [...]}. "error_px" is
// null where nothing was found.
Json TrackingReportJson(const TrackingReport& report) {
  Json json = {{"frames", report.frames},       {"unseen", report.unseen},
               {"sequences", report.sequences}, {"results", ResultsJson(report.results)},
               {"groups", Json::array()},       {"over_time", Json::array()}};
  for (const TrackingReport::Subset& group : report.groups) {
    json["groups"].push_back({{"name", group.name},
                              {"sequences", group.sequences},
                              {"frames", group.frames},
                              {"results", ResultsJson(group.results)}});
  }
  for (int step = 0; step < kSteps; ++step) {
    json["over_time"].push_back(
        {{"time", (step + 0.5) / kSteps}, {"results", ResultsJson(AtStep(report, step))}});
  }
  return json;
}

// One row per view and descriptor.
std::string TrackingReportCsv(const TrackingReport& report) {
  std::string csv =
      "sequence,view,descriptor,found,reason,matches,inliers,inlier_rate,error_px,size_px,tracked,"
      "ssim\n";
  for (const TrackedView& view : report.views) {
    csv += fmt::format(
        "{},{},{},{:d},{},{},{},{:.4f},{},{:.1f},{:d},{:.4f}\n", report.sequences[view.sequence],
        view.view, report.results[view.descriptor].descriptor, view.found, ToString(view.reason),
        view.matches, view.inliers, view.inlier_rate,
        view.found ? FormatFixed(view.error_px, 3) : "", view.size_px, view.tracked, view.ssim);
  }
  return csv;
}

struct Options {
  TrackingBenchmarkOptions benchmark;
  std::filesystem::path folder;
  std::filesystem::path csv;
  bool json = false;
};

ExitStatus Run(Options& options) {
  CheckOutput(options.csv, "--csv", options.json);
  const std::vector<TrackingSequence> sequences = OpenTrackingSequences(options.folder);
  const Interrupt interrupt;
  Progress progress("frames");
  options.benchmark.progress = progress.CounterUntil(interrupt);
  const TrackingReport report = RunTrackingBenchmark(sequences, options.benchmark);
  if (!options.csv.empty()) WriteFile(options.csv, TrackingReportCsv(report));
  Report(options.json, TrackingReportJson(report), "{}", TrackingReportText(report));
  return ExitStatus::kDone;
}

}  // namespace

void AddEvalTracking(CLI::App& eval, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  TrackingBenchmarkOptions& benchmark = options->benchmark;
  CLI::App* app = eval.add_subcommand("tracking", kEvalTracking);
  app->add_option("DIR", options->folder, "folder of scenes, or a folder of such folders (groups)")
      ->required();
  app->add_option("--descriptor", benchmark.descriptors, "comma-separated rows of the table")
      ->delimiter(',')
      ->check(OneOf(DescriptorNames()))
      ->type_name("NAME,...");
  AddModelFlag(*app, benchmark.model);
  app->add_option("--max-keypoints", benchmark.max_keypoints,
                  "keypoints of the object and of each frame, strongest first")
      ->check(Between(1, 4096));
  AddTrackingFlags(*app, benchmark.every, benchmark.locate);
  AddJobsFlag(*app, benchmark.jobs, "threads, one sequence each");
  AddCsvFlag(*app, options->csv, "write one row per frame and descriptor");
  AddJsonFlag(*app, options->json);
  app->footer("Example:  pliant eval tracking scenes");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
