// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant eval matching DIR
#include <memory>
#include <string>

#include "descriptor/evaluation/matching_benchmark.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"
#include "index/evaluation/results_json.h"
#include "index/files/read_npz.h"
#include "index/json/json.h"

namespace pliant::cli {
namespace {

using evaluation::DescriptorResult;
using evaluation::MatchingReport;
using evaluation::Subset;

std::string ResultTable(const std::vector<DescriptorResult>& results) {
  return TableOf(ResultsJson(results), {{"/descriptor", "descriptor"},
                                        {"/ms", "MS"},
                                        {"/ms_error", "+-"},
                                        {"/mma", "MMA"},
                                        {"/mutual_precision", "mutual precision"},
                                        {"/correct_matches", "correct", 0},
                                        {"/ms_ratio_to_sift", "MS / SIFT's", 2},
                                        {"/keypoints", "keypoints", 0},
                                        {"/true_pairs", "true pairs", 0},
                                        {"/describe_us", "us / keypoint", 0}});
}

std::string CurveTable(const MatchingReport& report) {
  std::vector<std::string> header = {report.sweep, "pairs"};
  for (const DescriptorResult& r : report.results) header.push_back(r.label);
  std::vector<std::vector<std::string>> rows;
  for (const Subset& point : report.curve) {
    std::vector<std::string> row = {FormatFixed(point.value, report.sweep == "scale" ? 3 : 0),
                                    std::to_string(point.results.front().pairs)};
    for (const DescriptorResult& r : point.results) row.push_back(FormatFixed(r.ms, 3));
    rows.push_back(std::move(row));
  }
  rows.push_back({"lowest / highest", ""});
  for (std::size_t row = 0; row < report.results.size(); ++row) {
    rows.back().push_back(FormatFixed(evaluation::CurveFlatness(report, row), 2));
  }
  return FormatTable(header, rows);
}

// One series a descriptor over the values of the sweep.
Json CurveJson(const MatchingReport& report) {
  Json curve = {{"over", report.sweep}, {"values", {}}, {"pairs", {}}, {"series", {}}};
  for (const Subset& point : report.curve) {
    curve["values"].push_back(point.value);
    curve["pairs"].push_back(point.results.front().pairs);
  }
  for (std::size_t row = 0; row < report.results.size(); ++row) {
    Json series = {{"descriptor", report.results[row].label}, {"ms", {}}, {"mma", {}}};
    for (const Subset& point : report.curve) {
      series["ms"].push_back(point.results[row].ms);
      series["mma"].push_back(point.results[row].mma);
    }
    series["lowest_over_highest"] = evaluation::CurveFlatness(report, row);
    curve["series"].push_back(std::move(series));
  }
  return curve;
}

// Tables for people: all pairs, then each group, then the curve.
std::string MatchingReportText(const MatchingReport& report) {
  std::string text =
      fmt::format("{} pairs ({}), {} excluded for lack of common keypoints\n\n{}", report.pairs,
                  ToString(report.layout), report.left_out, ResultTable(report.results));
  for (const Subset& group : report.groups) {
    text += fmt::format("\n\n{}, {} pairs\n{}", group.name.empty() ? "other" : group.name,
                        group.results.front().pairs, ResultTable(group.results));
  }
  if (!report.curve.empty()) text += "\n\nMS over " + report.sweep + "\n" + CurveTable(report);
  return text;
}

// One document: {"pairs", "left_out", "layout", "keypoints", "tolerance_px", "results": [...],
// "groups": [...], "curves": [...]}.
Json MatchingReportJson(const MatchingReport& report, const evaluation::MatchingOptions& options) {
  Json json = {{"pairs", report.pairs},
               {"left_out", report.left_out},
               {"layout", ToString(report.layout)},
               {"keypoints", options.max_keypoints},
               {"enlarge", options.enlarge},
               {"tolerance_px", options.tolerance_px},
               {"min_true_pairs", options.min_true_pairs},
               {"seed", options.seed},
               {"results", ResultsJson(report.results)},
               {"groups", Json::array()},
               {"curves", Json::array()}};
  for (const Subset& group : report.groups) {
    json["groups"].push_back({{"name", group.name},
                              {"pairs", group.results.front().pairs},
                              {"results", ResultsJson(group.results)}});
  }
  if (!report.curve.empty()) json["curves"].push_back(CurveJson(report));
  return json;
}

// Columns set (all, a group's name, or the sweep's), value (of the sweep), descriptor, figures.
std::string MatchingReportCsv(const MatchingReport& report) {
  Json rows = Json::array();
  const auto add = [&rows](const std::string& set, const std::string& value,
                           const std::vector<DescriptorResult>& results) {
    for (Json row : ResultsJson(results)) {
      row["set"] = set;
      row["value"] = value;
      rows.push_back(std::move(row));
    }
  };
  add("all", "", report.results);
  for (const Subset& group : report.groups) add(group.name, "", group.results);
  for (const Subset& point : report.curve) {
    add(report.sweep, FormatFixed(point.value, 6), point.results);
  }
  std::vector<Column> columns;
  for (const std::string name : {"set", "value", "descriptor", "model_id", "pairs", "ms",
                                 "ms_error", "mma", "mutual_precision", "ms_ratio_to_sift"}) {
    columns.push_back({"/" + name, name, 6});
  }
  for (const std::string name : {"correct_matches", "keypoints", "true_pairs", "describe_us"}) {
    columns.push_back({"/" + name, name, 1});
  }
  return CsvOf(rows, columns);
}

struct Options {
  evaluation::MatchingOptions matching;
  std::filesystem::path folder;
  std::string layout = "auto";
  std::vector<std::string> descriptors;
  std::vector<std::string> features;
  std::filesystem::path csv;
  bool json = false;
};

ExitStatus Run(Options& options) {
  CheckOutput(options.csv, "--csv", options.json);
  for (const std::string& text : options.descriptors)
    options.matching.descriptors.push_back(evaluation::ParseDescriptorChoice(text));
  for (const std::string& text : options.features)
    options.matching.features.push_back(ParseFeatureSource(text, options.folder));
  const evaluation::Dataset dataset =
      evaluation::OpenDataset(options.folder, evaluation::ParseLayout(options.layout));
  const Interrupt interrupt;
  Progress progress("pairs");
  options.matching.progress = progress.CounterUntil(interrupt);
  const MatchingReport report = evaluation::RunMatchingBenchmark(dataset, options.matching);
  if (!options.csv.empty()) WriteFile(options.csv, MatchingReportCsv(report));
  if (options.matching.pairs > report.pairs) {
    Message("only {} of {} pairs: the set has no more measurable pairs", report.pairs,
            options.matching.pairs);
  }
  Report(options.json, MatchingReportJson(report, options.matching), "{}",
         MatchingReportText(report));
  return ExitStatus::kDone;
}

std::string KnownDescriptors() {
  std::vector<std::string> names;
  for (const auto& choice : evaluation::AllDescriptorChoices()) names.push_back(choice.label);
  return CLI::detail::join(names, ", ");
}

// A row of the table, [LABEL:]NAME[=WEIGHTS]. The error suggests the most similar descriptor.
CLI::Validator KnownDescriptorChoice() {
  std::vector<std::string> known = DescriptorNames();
  known.emplace_back("sift+repeats");
  const CLI::Validator one = OneOf(std::move(known));
  return CLI::Validator(
      [one](std::string& text) {
        std::string name = text.substr(0, text.find('='));
        name.erase(0, name.find(':') + 1);  // npos + 1 is 0
        return one(name);
      },
      "");
}

void AddSelectionFlags(CLI::App& app, Options& options) {
  evaluation::MatchingOptions& matching = options.matching;
  app.add_option(
         "--layout", options.layout,
         "tensors or folders (pliant simulate), hpatches, nonrigid; auto: detect from the files")
      ->check(OneOf({"auto", "tensors", "folders", "hpatches", "nonrigid"}))
      ->type_name("NAME");
  app.add_option("--descriptor", options.descriptors,
                 "comma-separated rows of the table, [LABEL:]NAME[=WEIGHTS] (default: all of " +
                     KnownDescriptors() + ")")
      ->delimiter(',')
      ->check(KnownDescriptorChoice())
      ->type_name("NAME,...");
  AddFeaturesFlag(app, options.features);
  AddModelFlag(app, matching.model);
  app.add_option("--pairs", matching.pairs, "number of pairs, chosen by --seed; 0 = all")
      ->check(AtLeast(0));
  AddSeedFlag(app, matching.seed, "same seed, same pairs");
  app.add_option("--keypoints", matching.max_keypoints, "keypoints per image, strongest first")
      ->check(Between(1, 4096));
  app.add_flag("--enlarge", matching.enlarge,
               "also use low-contrast keypoints and keypoints of the enlarged images, like "
               "`pliant query`");
  app.add_option("--tolerance", matching.tolerance_px,
                 "largest distance of a correct match from the true position, in pixels")
      ->check(AboveZero(100));
  app.add_option("--min-true-pairs", matching.min_true_pairs,
                 "exclude pairs with fewer common keypoints")
      ->check(AtLeast(1));
  AddJobsFlag(app, matching.jobs, "threads, one scene each");
}

}  // namespace

void AddEvalMatching(CLI::App& eval, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = eval.add_subcommand(
      "matching", "Compare descriptors at the same keypoints of images with ground truth");
  app->add_option("DIR", options->folder, "the data set")->required();
  AddSelectionFlags(*app, *options);
  AddCsvFlag(*app, options->csv, "write the tables to this file");
  AddJsonFlag(*app, options->json);
  app->footer("Example:  pliant eval matching dev --pairs 40");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
