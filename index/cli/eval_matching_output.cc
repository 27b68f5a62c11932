// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/eval_matching_output.h"

#include "index/cli/output.h"

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
                      "key points", "true pairs", "us / key point"},
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

}  // namespace

std::string MatchingReportText(const MatchingReport& report) {
  std::string text = std::to_string(report.pairs) + " pairs (" + ToString(report.layout) + "), " +
                     std::to_string(report.left_out) +
                     " excluded for lack of common key points\n\n" + ResultTable(report.results);
  for (const Subset& group : report.groups) {
    text += "\n\n" + (group.name.empty() ? "other" : group.name) + ", " +
            std::to_string(group.results.front().pairs) + " pairs\n" + ResultTable(group.results);
  }
  if (!report.curve.empty()) text += "\n\nMS over " + report.sweep + "\n" + CurveTable(report);
  return text;
}

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

}  // namespace pliant::cli
