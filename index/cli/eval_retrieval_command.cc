// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant eval retrieval DIR
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "descriptor/base/error.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/eval_files.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"
#include "index/evaluation/retrieval_evaluation.h"
#include "index/files/image_files.h"
#include "index/files/text.h"
#include "index/json/json.h"

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
    cells.push_back(FormatFixed(row.stored_bytes_per_image, 0));
    cells.push_back(FormatFixed(row.index_bytes_per_image, 0));
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
          {"bytes_per_image",
           {{"stored", row.stored_bytes_per_image}, {"index", row.index_bytes_per_image}}}};
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

// Accuracy and times, a row for each descriptor and protocol.
std::string RetrievalReportText(const RetrievalReport& report) {
  std::string text = std::to_string(report.queries) + " queries, " + std::to_string(report.images) +
                     " images of " + std::to_string(report.objects) + " objects, " +
                     std::to_string(report.distractors) + " of them distractors (layout " +
                     ToString(report.layout) + "), mean of " + std::to_string(report.seeds) +
                     " seeds\n\n";
  text += AccuracyTable(report) + FoundTable(report);
  return text + "\n\nmilliseconds a query by stage, and bytes an image\n" + CostTable(report);
}

// One document: {"layout", "pictures", "distractors", "queries", "objects", "seeds", "results":
// [{"descriptor", "protocol", "words", "accuracy_at": [20], "map", "top1", "mrr", "ns_score",
// "object_top1", "object_mrr", "spread": {...}, "seconds_per_query", "milliseconds": {...},
// "bytes_per_image": {...}}], "skipped": [{"file", "reason", "code"}], "seconds"}.
Json RetrievalReportJson(const RetrievalReport& report) {
  Json results = Json::array();
  for (const RetrievalResult& row : report.results) results.push_back(ResultJson(row));
  Json skipped = Json::array();
  for (const SkippedFile& file : report.skipped) {
    skipped.push_back({{"file", file.file}, {"reason", file.reason}, {"code", file.code}});
  }
  return {{"layout", ToString(report.layout)},
          {"pictures", report.images},
          {"distractors", report.distractors},
          {"queries", report.queries},
          {"absent", report.absent},
          {"objects", report.objects},
          {"seeds", report.seeds},
          {"results", std::move(results)},
          {"skipped", std::move(skipped)},
          {"seconds", report.seconds}};
}

// A row for each descriptor and protocol: figures, then accuracy_at_1 .. accuracy_at_20.
std::string RetrievalReportCsv(const RetrievalReport& report) {
  std::string csv =
      "descriptor,protocol,words,map,map_spread,top1,mrr,ns_score,object_top1,"
      "seconds_per_query,stored_bytes_per_image,index_bytes_per_image";
  for (std::size_t k = 1; k <= kAccuracyRanks; ++k) csv += ",accuracy_at_" + std::to_string(k);
  csv += '\n';
  for (const RetrievalResult& row : report.results) {
    csv += row.descriptor + ',' + row.protocol + ',' + std::to_string(row.words);
    for (const double value : {row.mean.map, row.spread.map, row.mean.top1, row.mean.mrr})
      csv += ',' + FormatFixed(value, 6);
    csv += ',' + (row.ns_score ? FormatFixed(*row.ns_score, 6) : "");
    csv += ',' + (row.object ? FormatFixed(row.object->top1, 6) : "");
    csv += ',' + FormatFixed(row.times.total() / 1000, 6);
    csv += ',' + FormatFixed(row.stored_bytes_per_image, 0);
    csv += ',' + FormatFixed(row.index_bytes_per_image, 0);
    for (const double value : row.mean.accuracy_at) csv += ',' + FormatFixed(value, 6);
    csv += '\n';
  }
  return csv;
}

// A row for each query and hit (ten at most; a query without hits has one row with empty fields):
// descriptor, protocol, words, query, object, rank, hit, hit_object, right, score, probability,
// inliers. With the answers that RetrievalOptions::keep_answers keeps.
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

// The set to be measured, for scripts that run other programs on it: {"layout", "counts_itself",
// "pictures": [{"file", "object" or null, "query", "searched"}]}.
Json RetrievalSetJson(const RetrievalSet& set) {
  Json images = Json::array();
  for (const RetrievalImage& image : set.images) {
    images.push_back({{"file", ToDisplayText(image.path.string())},
                      {"object", image.object.empty() ? Json(nullptr) : Json(image.object)},
                      {"query", image.is_query},
                      {"searched", image.is_searched},
                      {"absent", image.is_absent}});
  }
  return {{"layout", ToString(set.layout)},
          {"counts_itself", set.counts_itself},
          {"pictures", std::move(images)}};
}

// Adds the results in a file of the form above (written by the scripts of tests/accuracy for other
// programs). Throws kNotFound, kUnprocessable "peers_invalid" for a file that is not of that form,
// and kConflict "peers_differ" when they were measured with other numbers of images or queries.
void AddPeers(const std::filesystem::path& file, RetrievalReport* report) {
  const std::vector<std::uint8_t> bytes = ReadFile(file, kMaxPeersBytes);
  const std::string name = ToDisplayText(file.string());
  try {
    const Json json = Json::parse(bytes);
    if (json.at("pictures") != report->images || json.at("queries") != report->queries) {
      throw Error(ErrorCode::kConflict, "peers_differ",
                  name + " was measured with " + json.at("queries").dump() + " queries and " +
                      json.at("pictures").dump() + " images, not " +
                      std::to_string(report->queries) + " and " + std::to_string(report->images));
    }
    for (const Json& row : json.at("results")) report->results.push_back(ReadResult(row));
  } catch (const Json::exception& error) {
    throw Error(ErrorCode::kUnprocessable, "peers_invalid",
                name + " is no report of `pliant eval retrieval --json`: " + error.what());
  }
}

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

// Images are counted; the steps after them, each short, are named by the line's unit.
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
  app.add_option("DIR", options.folder, "the images")->required();
  AddChoice<RetrievalLayout>(
      app, "--layout", options.layout,
      "how DIR names objects and queries; default: detect from the file names",
      {{"auto", RetrievalLayout::kAuto},
       {"objects", RetrievalLayout::kObjects},
       {"ukbench", RetrievalLayout::kUkbench},
       {"pairs", RetrievalLayout::kPairs},
       {"labels", RetrievalLayout::kLabels}});
  app.add_option("--distractors", options.distractors,
                 "folder of images that show none of the objects; may be given more than once")
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
                 "images verified per query; 0 = as query does")
      ->capture_default_str()
      ->check(Between(0, 1'000'000));
  app.add_option("--jobs,-j", retrieval.jobs, "threads that describe images; 0 = one a core")
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
      "retrieval", "Query a gallery with images of known objects, and measure the accuracy");
  AddSetFlags(*app, *options);
  AddDescriptorListFlags(*app, retrieval.descriptors, retrieval.descriptor_options,
                         retrieval.extraction);
  AddRunFlags(*app, retrieval);
  app->add_option("--peers", options->peers,
                  "results of another program on the same images, to be listed too; may be given "
                  "more than once")
      ->allow_extra_args(false)
      ->type_name("FILE");
  AddCsvFlag(*app, options->csv, "write the table to this file");
  app->add_option("--answers", options->answers,
                  "write the first ten hits of every query to this CSV file; - = standard output")
      ->type_name("FILE");
  app->add_flag("--list", options->list, "only print the queries and the searched images, as JSON");
  app->add_flag("--json", options->json, "print one JSON document");
  app->footer("Example:  pliant eval retrieval dev --descriptor deal,rootsift --protocol default");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
