// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant query IMAGE --db FILE
#include <memory>

#include "descriptor/base/stopwatch.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/image_input.h"
#include "index/cli/output.h"
#include "index/cli/query_images.h"
#include "index/cli/write_file.h"
#include "index/json/result_json.h"
#include "index/records/filter.h"

namespace pliant::cli {
namespace {

struct Options {
  EngineOptions engine;
  SearchOptions search;
  std::filesystem::path image;
  std::vector<double> region;
  std::string filter;
  QueryImageOptions images;
  bool json = false;
};

void PrintText(const SearchResult& result, double took_ms) {
  std::vector<std::vector<std::string>> rows;
  for (const Hit& hit : result.hits) {
    rows.push_back({std::to_string(hit.rank), FormatFixed(hit.score, 4),
                    hit.probability ? FormatFixed(*hit.probability, 3) : "-",
                    std::to_string(hit.inliers), hit.object.empty() ? "-" : hit.object,
                    hit.image_id, hit.source});
  }
  if (rows.empty()) {
    Print(result.total == 0 ? "nothing found"
                            : "nothing on this page: --offset is past the last of " +
                                  std::to_string(result.total) + " hits");
  } else {
    if (result.undecided) {
      Print("undecided: one of several objects that look alike, see their probabilities");
    } else if (result.found == std::size_t{0}) {
      Print("not in the collection: no hit has a probability of " +
            FormatFixed(kFoundProbability, 1) + " or more");
    }
    Print(
        FormatTable({"rank", "score", "probability", "inliers", "object", "image", "file"}, rows));
  }
  Message(std::to_string(result.hits.size()) + " of " + std::to_string(result.total) + " hits, " +
          std::to_string(result.keypoints) + " keypoints, vocabulary " +
          std::to_string(result.vocabulary) + " of " + std::to_string(result.words) + " words, " +
          FormatFixed(took_ms, 0) + " ms");
}

void PrintExplanations(const SearchResult& result) {
  for (const Hit& hit : result.hits) {
    if (!hit.explanation) continue;
    const Explanation& e = *hit.explanation;
    std::string line = std::to_string(hit.rank) + ". " + hit.image_id + ": words alone score " +
                       FormatFixed(e.ranking_score, 4);
    if (e.verified) {
      line += "; " + std::to_string(e.inliers.size()) + " of " + std::to_string(e.matches) +
              " matches agree on one warp";
    } else {
      line += ". " + e.failure;
    }
    Print(line);
  }
}

ExitStatus Run(Options& options) {
  if (!options.region.empty()) {
    options.search.region =
        Region{options.region[0], options.region[1], options.region[2], options.region[3]};
  }
  if (!options.filter.empty()) options.search.filter = ParseFilter(options.filter);
  if (!options.images.draw.empty()) CheckImageName(options.images.draw);
  CheckNotInput(options.images.draw, {options.image});
  CheckNotInput(options.images.unwarp, {options.image});
  if (options.images.draw == kStandardOutput) ClaimStandardOutput("--draw", options.json);
  if (options.images.unwarp == kStandardOutput) ClaimStandardOutput("--unwarp", options.json);
  const ImageInput image = ReadImage(options.image, options.engine.extraction.decode.max_bytes);
  options.engine.read_only = true;
  options.engine.create = false;
  Engine engine(options.engine);
  const Stopwatch watch;
  const bool explain = options.search.explain;
  if (!options.images.draw.empty() || !options.images.unwarp.empty()) options.search.explain = true;
  SearchResult result = Naming(image, [&] { return engine.Search(image.bytes, options.search); });
  const double took_ms = watch.ms();
  options.images.collection = options.search.collection;
  options.images.decode = options.engine.extraction.decode;
  const bool drawn = WriteQueryImages(engine, image.bytes, result, options.images);
  if (!explain) {  // it was for the images only
    for (Hit& hit : result.hits) hit.explanation.reset();
  }
  if (options.json) {
    PrintJson(SearchResultJson(result, took_ms));
  } else {
    PrintText(result, took_ms);
    PrintExplanations(result);
  }
  return drawn ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
}

}  // namespace

void AddQueryCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  SearchOptions& search = options->search;
  CLI::App* app = program.add_subcommand("query", "Find the object that an image shows");
  app->add_option("IMAGE", options->image, "the query image; - = standard input")->required();
  AddDatabaseFlag(*app, options->engine);
  AddCollectionFlag(*app, search.collection);
  app->add_option("--top", search.limit, "hits returned; 0 = all")
      ->capture_default_str()
      ->check(AtLeast(0));
  app->add_option("--offset", search.offset, "number of hits to skip at the start")
      ->capture_default_str()
      ->check(AtLeast(0));
  AddChoice<GroupBy>(*app, "--group-by", search.group_by,
                     "one hit for each object, or for each image (default: object)",
                     {{"object", GroupBy::kObject}, {"image", GroupBy::kImage}});
  AddChoice<RankMethod>(
      *app, "--rank", search.rank,
      "how images are compared: votes of nearest neighbours, or the paper's "
      "histogram of words (default: neighbours)",
      {{"neighbours", RankMethod::kNeighbours}, {"histogram", RankMethod::kHistogram}});
  AddChoice<Verification>(
      *app, "--verify", search.verify,
      "check the best hits for one smooth warp (default: tps; none with --rank histogram)",
      {{"none", Verification::kNone}, {"tps", Verification::kTps}});
  app->add_option("--verify-depth", search.verify_depth,
                  "how many of the best images are verified (default: 30, and up to 100, or the "
                  "square root of the collection's size, as far as there are some that agree; "
                  "twice that where none agrees)")
      ->check(AboveZero())
      ->option_text("N");
  app->add_option(
         "--expand", search.expand,
         "query expansion: use this many of the best verified images as further queries, for "
         "views that the query alone does not reach (default: 3 by image, 0 by object)")
      ->check(Between(0, kMostExpansions))
      ->option_text("N");
  app->add_option("--instances", search.max_instances,
                  "maximum number of instances of one object in the query image")
      ->capture_default_str()
      ->check(Between(1, 100));
  app->add_flag("--closer-look,!--no-closer-look", search.second_pass,
                "where nothing is found, describe the image once more at a finer scale, and give "
                "the surer answer (default: yes)");
  app->add_option("--region", options->region,
                  "look at this rectangle of the query image only, in its own pixels: X,Y,W,H")
      ->delimiter(',')
      ->expected(4)
      ->type_name("X,Y,W,H");
  app->add_option("--object", search.object, "only images of this object");
  app->add_option(
         "--filter", options->filter,
         "only images whose metadata match: JSON such as '{\"shop\": \"east\", \"year\": "
         "{\"gte\": 2020}}'; tests are in, ne, gt, gte, lt, lte, exists; filters join by and, or, "
         "not")
      ->option_text("JSON");
  app->add_option("--min-score", search.min_score, "drop hits below this score, 0 to 1")
      ->capture_default_str();
  AddExtractionFlags(*app, options->engine);
  app->add_flag("--explain", search.explain,
                "explain every hit: its score, the matched points and the warp of its surface");
  app->add_option("--draw", options->images.draw,
                  "draw the query and its hits with outlines and matching points to this PNG file; "
                  "- = standard output")
      ->type_name("FILE");
  app->add_option(
         "--unwarp", options->images.unwarp,
         "draw the flattened object beside the hit: the best verified hit to a PNG file (- = "
         "standard output), or all of them into a folder")
      ->type_name("FILE|DIR");
  app->add_flag("--json", options->json, "print one JSON document");
  app->footer(
      "Example:  pliant query PHOTO.jpg --db my.db --top 3 --draw found.png\n"
      "          curl -s https://example.org/a.jpg | pliant query - --db my.db --json");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
