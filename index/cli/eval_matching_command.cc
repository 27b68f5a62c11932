// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant eval matching DIR
#include <memory>
#include <string>

#include "descriptor/evaluation/matching_benchmark.h"
#include "index/cli/command.h"
#include "index/cli/eval_files.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"
#include "index/json/json.h"

namespace pliant::cli {
namespace {

using evaluation::DescriptorResult;
using evaluation::MatchingReport;
using evaluation::Subset;
std::string ResultTable(const std::vector<DescriptorResult>& results) {
  std::vector<std::vector<std::string>> rows;
  for (const DescriptorResult& r : results) {
    rows.push_back({r.label, FormatFixed(r.ms, 3), FormatFixed(r.ms_error, 3),
                    FormatFixed(r.mma, 3), FormatFixed(r.mutual_precision, 3),
                    FormatFixed(r.correct_matches, 0), FormatFixed(r.ms_ratio_to_sift, 2),
                    FormatFixed(r.keypoints, 0), FormatFixed(r.true_pairs, 0),
                    FormatFixed(r.describe_us, 0)});
  }
  return FormatTable({"descriptor", "MS", "+-", "MMA", "mutual precision", "correct", "MS / SIFT's",
                      "keypoints", "true pairs", "us / keypoint"},
                     rows);
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
  std::vector<std::string> flatness = {"lowest / highest", ""};
  for (std::size_t row = 0; row < report.results.size(); ++row)
    flatness.push_back(FormatFixed(evaluation::CurveFlatness(report, row), 2));
  rows.push_back(std::move(flatness));
  return FormatTable(header, rows);
}

Json ResultsJson(const std::vector<DescriptorResult>& results) {
  Json list = Json::array();
  for (const DescriptorResult& r : results) {
    list.push_back({{"descriptor", r.label},
                    {"model_id", r.model_id},
                    {"ms", r.ms},
                    {"ms_error", r.ms_error},
                    {"mma", r.mma},
                    {"mutual_precision", r.mutual_precision},
                    {"correct_matches", r.correct_matches},
                    {"ms_ratio_to_sift", r.ms_ratio_to_sift},
                    {"keypoints", r.keypoints},
                    {"true_pairs", r.true_pairs},
                    {"describe_us", r.describe_us}});
  }
  return list;
}

// One series a descriptor over the values of the sweep.
Json CurveJson(const MatchingReport& report) {
  Json values = Json::array();
  Json pairs = Json::array();
  for (const Subset& point : report.curve) {
    values.push_back(point.value);
    pairs.push_back(point.results.front().pairs);
  }
  Json series = Json::array();
  for (std::size_t row = 0; row < report.results.size(); ++row) {
    Json ms = Json::array();
    Json mma = Json::array();
    for (const Subset& point : report.curve) {
      ms.push_back(point.results[row].ms);
      mma.push_back(point.results[row].mma);
    }
    series.push_back({{"descriptor", report.results[row].label},
                      {"ms", std::move(ms)},
                      {"mma", std::move(mma)},
                      {"lowest_over_highest", evaluation::CurveFlatness(report, row)}});
  }
  return {{"over", report.sweep},
          {"values", std::move(values)},
          {"pairs", std::move(pairs)},
          {"series", std::move(series)}};
}

void AddCsvRows(const std::string& set, const std::string& value,
                const std::vector<DescriptorResult>& results, std::string& csv) {
  for (const DescriptorResult& r : results) {
    csv += CsvField(set) + ',' + value + ',' + CsvField(r.label) + ',' + CsvField(r.model_id) +
           ',' + std::to_string(r.pairs);
    for (const double figure : {r.ms, r.ms_error, r.mma, r.mutual_precision, r.ms_ratio_to_sift})
      csv += ',' + FormatFixed(figure, 6);
    csv += ',' + FormatFixed(r.correct_matches, 1) + ',' + FormatFixed(r.keypoints, 1) + ',' +
           FormatFixed(r.true_pairs, 1) + ',' + FormatFixed(r.describe_us, 1) + '\n';
  }
}

// Tables for people: all pairs, then each group, then the curve.
std::string MatchingReportText(const MatchingReport& report) {
  std::string text = std::to_string(report.pairs) + " pairs (" + ToString(report.layout) + "), " +
                     std::to_string(report.left_out) +
                     " excluded for lack of common keypoints\n\n" + ResultTable(report.results);
  for (const Subset& group : report.groups) {
    text += "\n\n" + (group.name.empty() ? "other" : group.name) + ", " +
            std::to_string(group.results.front().pairs) + " pairs\n" + ResultTable(group.results);
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
  std::string csv =
      "set,value,descriptor,model_id,pairs,ms,ms_error,mma,mutual_precision,ms_ratio_to_sift,"
      "correct_matches,keypoints,true_pairs,describe_us\n";
  AddCsvRows("all", "", report.results, csv);
  for (const Subset& group : report.groups) AddCsvRows(group.name, "", group.results, csv);
  for (const Subset& point : report.curve)
    AddCsvRows(report.sweep, FormatFixed(point.value, 6), point.results, csv);
  return csv;
}

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
                 "number of keypoints per image, strongest first")
      ->capture_default_str();
  app.add_flag("--enlarge", matching.enlarge,
               "also use faint keypoints and those of the images enlarged, as queries of the "
               "service do");
  app.add_option("--tolerance", matching.tolerance_px,
                 "distance from the true position, in pixels, up to which a match is correct")
      ->capture_default_str();
  app.add_option("--min-true-pairs", matching.min_true_pairs,
                 "exclude pairs with fewer common keypoints")
      ->capture_default_str();
  app.add_option("--jobs,-j", matching.jobs, "threads, one scene each; 0 = one per core")
      ->capture_default_str()
      ->check(Between(0, 1024));
}

}  // namespace

void AddEvalMatching(CLI::App& eval, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = eval.add_subcommand(
      "matching", "Compare descriptors at the same keypoints of images with ground truth");
  app->add_option("DIR", options->folder, "the data set")->required();
  AddSelectionFlags(*app, *options);
  AddCsvFlag(*app, options->csv, "write the tables to this file");
  app->add_flag("--json", options->json, "print one JSON document");
  app->footer("Example:  pliant eval matching dev --pairs 40");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
