// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/eval_retrieval_output.h"

#include "descriptor/base/error.h"
#include "index/cli/output.h"
#include "index/files/picture_files.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

constexpr std::int64_t kMaxPeersBytes = 16LL << 20;

std::string FormatNs(const RetrievalResult& row) {
  return row.ns_score ? FormatFixed(*row.ns_score, 3) : "-";
}

std::string FormatObject(const RetrievalResult& row) {
  return row.object ? FormatFixed(row.object->top1, 3) : "-";
}

std::string FormatWords(const RetrievalResult& row) {
  return row.words > 0 ? std::to_string(row.words) : "-";
}

std::string AccuracyTable(const RetrievalReport& report) {
  std::vector<std::vector<std::string>> rows;
  for (const RetrievalResult& row : report.results) {
    std::vector<std::string> cells = {row.descriptor, row.protocol, FormatWords(row)};
    for (const std::size_t k : {1, 2, 3, 5, 10, 20}) {
      cells.push_back(FormatFixed(row.mean.accuracy_at[k - 1], 3));
    }
    for (const double value : {row.spread.accuracy_at[0], row.spread.accuracy_at[9], row.mean.map,
                               row.spread.map, row.mean.mrr}) {
      cells.push_back(FormatFixed(value, 3));
    }
    cells.push_back(FormatNs(row));
    cells.push_back(FormatObject(row));
    rows.push_back(std::move(cells));
  }
  return FormatTable({"descriptor", "protocol", "words", "@1", "@2", "@3", "@5", "@10", "@20",
                      "+-@1", "+-@10", "mAP", "+-mAP", "MRR", "N-S", "object@1"},
                     rows);
}

std::string CostTable(const RetrievalReport& report) {
  std::vector<std::vector<std::string>> rows;
  for (const RetrievalResult& row : report.results) {
    const RetrievalTimes& t = row.times;
    std::vector<std::string> cells = {row.descriptor, row.protocol, FormatWords(row)};
    for (const double ms :
         {t.decode, t.detect, t.describe, t.quantize, t.rank, t.verify, t.total()})
      cells.push_back(FormatFixed(ms, 1));
    cells.push_back(FormatFixed(row.stored_bytes_per_picture, 0));
    cells.push_back(FormatFixed(row.index_bytes_per_picture, 0));
    rows.push_back(std::move(cells));
  }
  return FormatTable({"descriptor", "protocol", "words", "decode", "detect", "describe", "quantize",
                      "rank", "verify", "ms a query", "stored bytes", "index bytes"},
                     rows);
}

// What answers say is found (probability 0.9 or more); empty where nothing is.
std::string FoundTable(const RetrievalReport& report) {
  std::vector<std::vector<std::string>> rows;
  for (const RetrievalResult& row : report.results) {
    const double found = row.mean.found_right + row.mean.found_wrong;
    if (found == 0 && row.absent.alarms == 0) continue;
    rows.push_back({row.descriptor, row.protocol, FormatWords(row),
                    FormatFixed(row.mean.found_right, 3), FormatFixed(row.mean.found_wrong, 3),
                    std::to_string(row.absent.asked), std::to_string(row.absent.alarms)});
  }
  if (rows.empty()) return "";
  return "\n\nsaid to be found: share of the queries; and queries that show none of the objects\n" +
         FormatTable(
             {"descriptor", "protocol", "words", "right", "wrong", "absent", "false alarms"}, rows);
}

Json AccuracyJson(const RetrievalMetrics& metrics) {
  Json list = Json::array();
  for (const double value : metrics.accuracy_at) list.push_back(value);
  return list;
}

template <typename Value>
Json OrNull(const std::optional<Value>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json ResultJson(const RetrievalResult& row) {
  const RetrievalTimes& t = row.times;
  return {{"descriptor", row.descriptor},
          {"protocol", row.protocol},
          {"words", row.words},
          {"accuracy_at", AccuracyJson(row.mean)},
          {"map", row.mean.map},
          {"top1", row.mean.top1},
          {"mrr", row.mean.mrr},
          {"ns_score", OrNull(row.ns_score)},
          {"object_top1", row.object ? Json(row.object->top1) : Json(nullptr)},
          {"object_mrr", row.object ? Json(row.object->mrr) : Json(nullptr)},
          {"refused_queries", row.refused},
          {"found_right", row.mean.found_right},
          {"found_wrong", row.mean.found_wrong},
          {"absent_queries", row.absent.asked},
          {"false_alarms", row.absent.alarms},
          {"spread",
           {{"accuracy_at", AccuracyJson(row.spread)},
            {"map", row.spread.map},
            {"mrr", row.spread.mrr},
            {"ns_score", row.ns_score ? Json(row.spread.ns) : Json(nullptr)}}},
          {"seconds_per_query", t.total() / 1000},
          {"milliseconds",
           {{"decode", t.decode},
            {"detect", t.detect},
            {"describe", t.describe},
            {"quantize", t.quantize},
            {"rank", t.rank},
            {"verify", t.verify}}},
          {"bytes_per_picture",
           {{"stored", row.stored_bytes_per_picture}, {"index", row.index_bytes_per_picture}}}};
}

// The fields of ResultJson that a peer must give, and those that it may.
RetrievalResult ReadResult(const Json& json) {
  RetrievalResult row;
  row.descriptor = json.at("descriptor").get<std::string>();
  row.protocol = json.at("protocol").get<std::string>();
  row.words = json.value("words", std::size_t{0});
  const auto accuracy = json.at("accuracy_at").get<std::vector<double>>();
  if (accuracy.size() != kAccuracyRanks) {
    throw Error(ErrorCode::kUnprocessable, "peers_invalid",
                "accuracy_at has " + std::to_string(accuracy.size()) + " values, not " +
                    std::to_string(kAccuracyRanks));
  }
  std::copy(accuracy.begin(), accuracy.end(), row.mean.accuracy_at.begin());
  row.mean.map = json.at("map").get<double>();
  row.mean.top1 = json.at("top1").get<double>();
  row.mean.mrr = json.at("mrr").get<double>();
  if (json.contains("ns_score") && !json["ns_score"].is_null()) {
    row.ns_score = json["ns_score"].get<double>();
  }
  row.times.rank = 1000 * json.value("seconds_per_query", 0.0);  // not told by stage
  return row;
}

std::string FileField(const std::filesystem::path& file) {
  return CsvField(ToDisplayText(file.string()));
}

}  // namespace

std::string RetrievalReportText(const RetrievalReport& report) {
  std::string text =
      std::to_string(report.queries) + " queries, " + std::to_string(report.pictures) +
      " pictures of " + std::to_string(report.objects) + " objects, " +
      std::to_string(report.distractors) + " of them distractors (layout " +
      ToString(report.layout) + "), mean of " + std::to_string(report.seeds) + " seeds\n\n";
  text += AccuracyTable(report) + FoundTable(report);
  return text + "\n\nmilliseconds a query by stage, and bytes a picture\n" + CostTable(report);
}

Json RetrievalReportJson(const RetrievalReport& report) {
  Json results = Json::array();
  for (const RetrievalResult& row : report.results) results.push_back(ResultJson(row));
  Json skipped = Json::array();
  for (const SkippedFile& file : report.skipped) {
    skipped.push_back({{"file", file.file}, {"reason", file.reason}, {"code", file.code}});
  }
  return {{"layout", ToString(report.layout)},
          {"pictures", report.pictures},
          {"distractors", report.distractors},
          {"queries", report.queries},
          {"absent", report.absent},
          {"objects", report.objects},
          {"seeds", report.seeds},
          {"results", std::move(results)},
          {"skipped", std::move(skipped)},
          {"seconds", report.seconds}};
}

std::string RetrievalReportCsv(const RetrievalReport& report) {
  std::string csv =
      "descriptor,protocol,words,map,map_spread,top1,mrr,ns_score,object_top1,"
      "seconds_per_query,stored_bytes_per_picture,index_bytes_per_picture";
  for (std::size_t k = 1; k <= kAccuracyRanks; ++k) csv += ",accuracy_at_" + std::to_string(k);
  csv += '\n';
  for (const RetrievalResult& row : report.results) {
    csv += row.descriptor + ',' + row.protocol + ',' + std::to_string(row.words);
    for (const double value : {row.mean.map, row.spread.map, row.mean.top1, row.mean.mrr})
      csv += ',' + FormatFixed(value, 6);
    csv += ',' + (row.ns_score ? FormatFixed(*row.ns_score, 6) : "");
    csv += ',' + (row.object ? FormatFixed(row.object->top1, 6) : "");
    csv += ',' + FormatFixed(row.times.total() / 1000, 6);
    csv += ',' + FormatFixed(row.stored_bytes_per_picture, 0);
    csv += ',' + FormatFixed(row.index_bytes_per_picture, 0);
    for (const double value : row.mean.accuracy_at) csv += ',' + FormatFixed(value, 6);
    csv += '\n';
  }
  return csv;
}

std::string RetrievalAnswersCsv(const RetrievalReport& report) {
  std::string csv =
      "descriptor,protocol,words,query,object,rank,hit,hit_object,right,score,probability,"
      "inliers\n";
  for (const RetrievalResult& row : report.results) {
    for (const NamedAnswer& answer : row.answers) {
      const std::string asked = row.descriptor + ',' + row.protocol + ',' +
                                std::to_string(row.words) + ',' + FileField(answer.file) + ',' +
                                CsvField(answer.object) + ',';
      if (answer.hits.empty()) csv += asked + ",,,,,,\n";
      for (std::size_t i = 0; i < answer.hits.size(); ++i) {
        const NamedHit& hit = answer.hits[i];
        csv += asked + std::to_string(i + 1) + ',' + FileField(hit.file) + ',' +
               CsvField(hit.object) + ',' + (hit.is_right ? '1' : '0') + ',' +
               FormatFixed(hit.score, 6) + ',' +
               (hit.probability ? FormatFixed(*hit.probability, 6) : "") + ',' +
               std::to_string(hit.inliers) + '\n';
      }
    }
  }
  return csv;
}

Json RetrievalSetJson(const RetrievalSet& set) {
  Json pictures = Json::array();
  for (const RetrievalPicture& picture : set.pictures) {
    pictures.push_back({{"file", ToDisplayText(picture.path.string())},
                        {"object", picture.object.empty() ? Json(nullptr) : Json(picture.object)},
                        {"query", picture.is_query},
                        {"searched", picture.is_searched},
                        {"absent", picture.is_absent}});
  }
  return {{"layout", ToString(set.layout)},
          {"counts_itself", set.counts_itself},
          {"pictures", std::move(pictures)}};
}

void AddPeers(const std::filesystem::path& file, RetrievalReport* report) {
  const std::vector<std::uint8_t> bytes = ReadFile(file, kMaxPeersBytes);
  const std::string name = ToDisplayText(file.string());
  try {
    const Json json = Json::parse(bytes);
    if (json.at("pictures") != report->pictures || json.at("queries") != report->queries) {
      throw Error(ErrorCode::kConflict, "peers_differ",
                  name + " was measured with " + json.at("queries").dump() + " queries and " +
                      json.at("pictures").dump() + " pictures, not " +
                      std::to_string(report->queries) + " and " + std::to_string(report->pictures));
    }
    for (const Json& row : json.at("results")) report->results.push_back(ReadResult(row));
  } catch (const Json::exception& error) {
    throw Error(ErrorCode::kUnprocessable, "peers_invalid",
                name + " is no report of `pliant eval retrieval --json`: " + error.what());
  }
}

}  // namespace pliant::cli
