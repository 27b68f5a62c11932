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
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"
#include "index/evaluation/results_json.h"
#include "index/evaluation/retrieval_evaluation.h"
#include "index/files/image_files.h"
#include "index/files/read_npz.h"
#include "index/json/json.h"
#include "index/json/record_csv.h"

namespace pliant::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMaxPeersBytes = 16LL << 20;

// The row of a peer: the fields that it must give, and its optional ones.
Json PeerJson(const Json& peer) {
  Json row = ResultJson({});
  const auto accuracy = peer.at("accuracy_at").get<std::vector<double>>();
  if (accuracy.size() != kAccuracyRanks) {
    throw Error(ErrorCode::kUnprocessable, "peers_invalid",
                fmt::format("accuracy_at has {} values, not {}", accuracy.size(), kAccuracyRanks));
  }
  row["accuracy_at"] = accuracy;
  for (const char* name : {"descriptor", "protocol"}) row[name] = peer.at(name).get<std::string>();
  for (const char* name : {"map", "top1", "mrr"}) row[name] = peer.at(name).get<double>();
  row["words"] = peer.value("words", std::size_t{0});
  row["ns_score"] = peer.value("ns_score", Json());
  row["seconds_per_query"] = peer.value("seconds_per_query", 0.0);
  row["milliseconds"]["rank"] = 1000 * peer.value("seconds_per_query", 0.0);  // not told by stage
  return row;
}

// The columns after those that name the row.
std::vector<Column> Named(const std::vector<Column>& figures) {
  std::vector<Column> columns = {
      {"/descriptor", "descriptor"}, {"/protocol", "protocol"}, {"/words", "words"}};
  columns.insert(columns.end(), figures.begin(), figures.end());
  return columns;
}

// Accuracy, what is found (probability 0.9 or more), and times: a row per descriptor and protocol.
std::string RetrievalReportText(const Json& report) {
  Json rows = report["results"];
  Json finders = Json::array();
  for (Json& row : rows) {
    row["ms"] = 1000 * row["seconds_per_query"].get<double>();
    if (row["words"] == 0) row["words"] = nullptr;  // unknown
    if (row["found_right"] != 0 || row["found_wrong"] != 0 || row["false_alarms"] != 0) {
      finders.push_back(row);
    }
  }
  std::string text = fmt::format(
      "{} queries, {} images of {} objects, {} of them distractors (layout {}), mean of {} "
      "seeds\n\n",
      report["queries"].dump(), report["pictures"].dump(), report["objects"].dump(),
      report["distractors"].dump(), report["layout"].get<std::string>(), report["seeds"].dump());
  text += TableOf(rows, Named({{"/accuracy_at/0", "@1"},
                               {"/accuracy_at/1", "@2"},
                               {"/accuracy_at/2", "@3"},
                               {"/accuracy_at/4", "@5"},
                               {"/accuracy_at/9", "@10"},
                               {"/accuracy_at/19", "@20"},
                               {"/spread/accuracy_at/0", "+-@1"},
                               {"/spread/accuracy_at/9", "+-@10"},
                               {"/map", "mAP"},
                               {"/spread/map", "+-mAP"},
                               {"/mrr", "MRR"},
                               {"/ns_score", "N-S"},
                               {"/object_top1", "object@1"}}));
  if (!finders.empty()) {
    text +=
        "\n\nfound: share of the queries; and false alarms of queries that show no known object, "
        "and "
        "of all queries when their object is left out\n" +
        TableOf(finders, Named({{"/found_right", "right"},
                                {"/found_wrong", "wrong"},
                                {"/absent_queries", "absent"},
                                {"/false_alarms", "false alarms"},
                                {"/left_out_queries", "object left out"},
                                {"/left_out_alarms", "false alarms"}}));
  }
  return text + "\n\nmilliseconds per query by stage, and bytes per image\n" +
         TableOf(rows, Named({{"/milliseconds/decode", "decode", 1},
                              {"/milliseconds/detect", "detect", 1},
                              {"/milliseconds/describe", "describe", 1},
                              {"/milliseconds/quantize", "quantize", 1},
                              {"/milliseconds/rank", "rank", 1},
                              {"/milliseconds/verify", "verify", 1},
                              {"/ms", "ms per query", 1},
                              {"/bytes_per_image/stored", "stored bytes", 0},
                              {"/bytes_per_image/index", "index bytes", 0}}));
}

// One document: {"layout", "pictures", "distractors", "queries", "objects", "seeds", "results":
// [{"descriptor", "protocol", "words", "accuracy_at": [20], "map", "top1", "mrr", "ns_score",
// "object_top1", "object_mrr", "spread": {...}, "seconds_per_query", "milliseconds": {...},
// "bytes_per_image": {...}}], "skipped": [{"file", "reason", "code"}], "seconds"}.
Json RetrievalReportJson(const RetrievalReport& report) {
  Json results = Json::array();
  for (const RetrievalResult& row : report.results) results.push_back(ResultJson(row));
  return {{"layout", WordOf(report.layout, kRetrievalLayouts)},
          {"pictures", report.images},
          {"distractors", report.distractors},
          {"queries", report.queries},
          {"absent", report.absent},
          {"objects", report.objects},
          {"seeds", report.seeds},
          {"results", std::move(results)},
          {"skipped", SkippedJson(report.skipped)},
          {"seconds", report.seconds}};
}

// A row for each descriptor and protocol: figures, then accuracy_at_1 .. accuracy_at_20.
std::string RetrievalReportCsv(const Json& report) {
  std::vector<Column> columns = Named({{"/map", "map", 6},
                                       {"/spread/map", "map_spread", 6},
                                       {"/top1", "top1", 6},
                                       {"/mrr", "mrr", 6},
                                       {"/ns_score", "ns_score", 6},
                                       {"/object_top1", "object_top1", 6},
                                       {"/seconds_per_query", "seconds_per_query", 6},
                                       {"/bytes_per_image/stored", "stored_bytes_per_image", 0},
                                       {"/bytes_per_image/index", "index_bytes_per_image", 0}});
  for (std::size_t k = 0; k < kAccuracyRanks; ++k) {
    columns.push_back({fmt::format("/accuracy_at/{}", k), fmt::format("accuracy_at_{}", k + 1), 6});
  }
  return CsvOf(report["results"], columns);
}

// A row for each query and hit (ten at most; a query without hits has one row with empty fields):
// descriptor, protocol, words, query, object, rank, hit, hit_object, right, score, probability,
// inliers, left_out (asked without its object). With the answers that
// RetrievalOptions::keep_answers keeps.
std::string RetrievalAnswersCsv(const RetrievalReport& report) {
  std::string csv =
      "descriptor,protocol,words,query,object,rank,hit,hit_object,right,score,probability,"
      "inliers,left_out\n";
  const auto file = [](const fs::path& path) { return CsvField(PathText(path)); };
  for (const RetrievalResult& row : report.results) {
    for (const NamedAnswer& answer : row.answers) {
      const std::string asked = fmt::format("{},{},{},{},{},", row.descriptor, row.protocol,
                                            row.words, file(answer.file), CsvField(answer.object));
      if (answer.hits.empty()) csv += asked + fmt::format(",,,,,,,{:d}\n", answer.left_out);
      for (std::size_t i = 0; i < answer.hits.size(); ++i) {
        const NamedHit& hit = answer.hits[i];
        csv += fmt::format("{}{},{},{},{:d},{:.6f},{},{},{:d}\n", asked, i + 1, file(hit.file),
                           CsvField(hit.object), hit.is_right, hit.score,
                           hit.probability ? FormatFixed(*hit.probability, 6) : "", hit.inliers,
                           answer.left_out);
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
    images.push_back({{"file", PathText(image.path)},
                      {"object", TextOrNull(image.object)},
                      {"query", image.is_query},
                      {"searched", image.is_searched},
                      {"absent", image.is_absent}});
  }
  return {{"layout", WordOf(set.layout, kRetrievalLayouts)},
          {"counts_itself", set.counts_itself},
          {"pictures", std::move(images)}};
}

// Adds the results in a file of the form above (written by the scripts of tests/accuracy for other
// programs). Throws kNotFound, kUnprocessable "peers_invalid" for a file that is not of that form,
// and kConflict "peers_differ" when they were measured with other numbers of images or queries.
void AddPeers(const std::filesystem::path& file, Json* report) {
  const std::vector<std::uint8_t> bytes = ReadFile(file, kMaxPeersBytes);
  const std::string name = PathText(file);
  try {
    const Json peers = Json::parse(bytes);
    for (const char* number : {"pictures", "queries"}) {
      if (peers.at(number) == report->at(number)) continue;
      throw Error(ErrorCode::kConflict, "peers_differ",
                  fmt::format("{} was measured with {} {}, not {}", name, peers.at(number).dump(),
                              number, report->at(number).dump()));
    }
    for (const Json& row : peers.at("results")) report->at("results").push_back(PeerJson(row));
  } catch (const Json::exception& error) {
    throw Error(ErrorCode::kUnprocessable, "peers_invalid",
                name + " is not a report of `pliant eval retrieval --json`: " + error.what());
  }
}

struct Options {
  RetrievalOptions retrieval;
  fs::path folder;
  RetrievalLayout layout = RetrievalLayout::kAuto;
  std::vector<fs::path> distractors;
  std::vector<fs::path> absent;
  std::vector<fs::path> peers;
  std::vector<std::string> features;
  fs::path csv;      // empty = none; - = standard output
  fs::path answers;  // the same
  bool json = false;
  bool list = false;
};

ExitStatus Run(Options& options) {
  CheckOutput(options.csv, "--csv", options.json);
  CheckOutput(options.answers, "--answers", options.json);
  for (const std::string& text : options.features)
    options.retrieval.features.push_back(ParseFeatureSource(text, options.folder));
  options.retrieval.keep_answers = !options.answers.empty();
  const RetrievalSet set =
      ReadRetrievalSet(options.folder, options.layout, options.distractors, options.absent);
  if (options.list) {
    ReportSkipped(set.skipped);
    PrintJson(RetrievalSetJson(set));
    return set.skipped.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
  }
  const Interrupt interrupt;
  options.retrieval.stop = interrupt.token();
  Progress progress("images");
  options.retrieval.progress = [&](const std::string& what, std::size_t done, std::size_t total) {
    progress.Step(what);
    progress.Count(done, total);
  };
  const RetrievalReport report = EvaluateRetrieval(set, options.retrieval);
  Json document = RetrievalReportJson(report);
  for (const fs::path& file : options.peers) AddPeers(file, &document);
  ReportSkipped(report.skipped);
  if (!options.csv.empty()) WriteFile(options.csv, RetrievalReportCsv(document));
  if (!options.answers.empty()) WriteFile(options.answers, RetrievalAnswersCsv(report));
  Report(options.json, document, "{}", RetrievalReportText(document));
  return report.skipped.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
}

void AddSetFlags(CLI::App& app, Options& options) {
  app.add_option("DIR", options.folder, "the images")->required();
  AddChoice(app, "--layout", options.layout,
            "how DIR names objects and queries (default: detect from the file names)",
            kRetrievalLayouts);
  app.add_option("--distractors", options.distractors,
                 "folder of images that show none of the objects; can be repeated")
      ->allow_extra_args(false)
      ->type_name("DIR");
  app.add_option("--absent", options.absent,
                 "folder of further queries that show none of the objects: each found hit is a "
                 "false alarm; can be repeated")
      ->allow_extra_args(false)
      ->type_name("DIR");
}

void AddRunFlags(CLI::App& app, RetrievalOptions& retrieval) {
  AddChoice(app, "--protocol", retrieval.protocols,
            "paper: 10 visual words, histograms; default: like query; unverified: the same without "
            "verification (default: paper,default)",
            kRetrievalProtocols);
  app.add_option("--seeds", retrieval.seeds, "number of vocabularies trained for each row")
      ->check(Between(1, 1000));
  app.add_option("--words", retrieval.words,
                 "vocabulary sizes, one row each (not for paper); 0 = the default of index")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(Between(0, static_cast<int>(kMaxWords)));
  app.add_option("--sample", retrieval.sample,
                 "descriptors used to train vocabularies (not for paper); 0 = the default of index")
      ->check(Between(0, static_cast<int>(kMaxVocabularySamples)));
  AddRankFlag(app, retrieval.rank,
              "ranking of all protocols except paper; histogram has no verification (default: "
              "neighbours)");
  app.add_option("--verify-depth", retrieval.verify_depth,
                 "candidates to verify per query; 0 = the default of query")
      ->check(Between(0, 1'000'000));
  AddJobsFlag(app, retrieval.jobs, "threads that describe images");
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
  AddFeaturesFlag(*app, options->features);
  AddRunFlags(*app, retrieval);
  app->add_option("--peers", options->peers,
                  "also list these results of another program on the same images; can be repeated")
      ->allow_extra_args(false)
      ->type_name("FILE");
  AddCsvFlag(*app, options->csv, "write the table to this file");
  app->add_option(
         "--answers", options->answers,
         "write the first ten hits of every query, and the first hit without its object, to this "
         "CSV file; - = standard output")
      ->type_name("FILE");
  app->add_flag("--list", options->list, "only print the queries and the searched images, as JSON");
  AddJsonFlag(*app, options->json);
  app->footer("Example:  pliant eval retrieval dev --descriptor deal,rootsift --protocol default");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
