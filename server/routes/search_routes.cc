// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which object is this?
#include <chrono>

#include <spdlog/spdlog.h>

#include "index/json/result_json.h"
#include "server/http/problem.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

constexpr std::int64_t kLargestOffset = 1'000'000;
constexpr std::int64_t kLargestLimit = 1'000;
constexpr std::int64_t kLargestDepth = 10'000;
constexpr std::int64_t kMostInstances = 100;
constexpr double kLargestCoordinate = 1e6;
// How long the first search after the first uploads waits for the vocabulary.
constexpr std::chrono::milliseconds kVocabularyWait{15'000};

Region RegionOf(const std::vector<double>& numbers) {
  const Region region{numbers[0], numbers[1], numbers[2], numbers[3]};
  for (const double number : numbers) {
    if (number < -kLargestCoordinate || number > kLargestCoordinate) {
      ThrowInvalid("region", "region lies outside any picture.");
    }
  }
  if (region.width <= 0 || region.height <= 0) {
    ThrowInvalid("region", "region is x,y,width,height in pixels; width and height must be > 0.");
  }
  return region;
}

Filter FilterOf(const std::string& text) {
  try {
    return ParseFilter(text);
  } catch (const Error& error) {
    ThrowInvalid("filter", error.what());
  }
}

SearchOptions OptionsOf(const Request& request, const Parameters& parameters) {
  SearchOptions options;
  options.collection = CollectionOf(request);
  options.limit = static_cast<std::size_t>(parameters.Integer("limit").value_or(10));
  options.offset = static_cast<std::size_t>(parameters.Integer("offset").value_or(0));
  options.group_by =
      parameters
          .Choice<GroupBy>("group_by", {{"object", GroupBy::kObject}, {"image", GroupBy::kImage}})
          .value_or(options.group_by);
  options.rank = parameters
                     .Choice<RankMethod>("rank", {{"neighbours", RankMethod::kNeighbours},
                                                  {"tfidf", RankMethod::kTfIdf},
                                                  {"histogram", RankMethod::kHistogram}})
                     .value_or(options.rank);
  options.verify = parameters
                       .Choice<Verification>(
                           "verify", {{"none", Verification::kNone}, {"tps", Verification::kTps}})
                       .value_or(options.verify);
  options.min_score = parameters.Number("min_score").value_or(0);
  options.object = parameters.Text("object");
  options.verify_depth = static_cast<std::size_t>(parameters.Integer("verify_depth").value_or(0));
  if (const auto expand = parameters.Integer("expand")) {
    options.expand = static_cast<int>(*expand);
  }
  options.max_instances =
      static_cast<int>(parameters.Integer("instances").value_or(options.max_instances));
  if (const auto filter = parameters.Text("filter")) options.filter = FilterOf(*filter);
  options.explain = parameters.Flag("explain").value_or(options.explain);
  if (const auto numbers = parameters.Numbers("region")) options.region = RegionOf(*numbers);
  return options;
}

// A search stores nothing, so it is not told that nothing can be stored but what follows from that.
std::optional<JobStatus> TrainingOf(AutoTrainer& trainer, const std::string& collection) {
  try {
    return trainer.TrainIfDue(collection);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNoSpace && error.code() != ErrorCode::kReadOnly) throw;
    spdlog::warn("no vocabulary for '{}': {}", collection, error.what());
    throw ProblemError("no_vocabulary",
                       error.code() == ErrorCode::kNoSpace
                           ? "There is no vocabulary yet, and none can be stored: the server's "
                             "disk is full. Free some of it, then search again."
                           : "There is no vocabulary yet, and none can be stored: the server may "
                             "not write its database.");
  }
}

// Waits for the first vocabulary where one is on its way. Throws ProblemError "no_vocabulary".
void AwaitVocabulary(Service& service, const std::string& collection) {
  AutoTrainer* trainer = service.auto_trainer();
  if (trainer == nullptr) {
    throw ProblemError(
        "no_vocabulary",
        "There is no vocabulary yet, and --auto-train is off. POST to /v1/collections/" +
            collection + "/vocabularies to train one.");
  }
  const std::optional<JobStatus> job = TrainingOf(*trainer, collection);
  if (!job) {
    throw ProblemError("no_vocabulary",
                       "There is nothing to find yet: the collection has no pictures. POST some to "
                       "/v1/collections/" +
                           collection + "/images.");
  }
  if (!service.jobs->WaitFor(job->id, kVocabularyWait)) {
    throw ProblemError("no_vocabulary", "The first vocabulary is being trained, see /v1/jobs/" +
                                            job->id + ". Search again when that is done.")
        .RetryAfter(5);
  }
}

SearchResult SearchOnPool(Service& service, const Request& request, const Parameters& parameters,
                          const SearchOptions& options) {
  const std::optional<std::string> image_id = parameters.Text("image_id");
  const bool has_picture = request.has_body && request.content_type != "application/json" &&
                           !(image_id && request.is_multipart() && request.parts.size() == 1);
  if (image_id && has_picture) {
    ThrowInvalid("image_id", "image_id and a picture exclude each other.");
  }
  const UploadedImage image = image_id ? UploadedImage{} : ImageOf(request);
  if (image_id) service.engine().Get(options.collection, *image_id);  // or 404, whatever else lacks
  if (!service.engine().HasVocabulary(options.collection)) {
    AwaitVocabulary(service, options.collection);
  }
  SearchResult result;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int cores) {
    SearchOptions with_cores = options;
    with_cores.threads = cores;
    result = image_id ? service.engine().SearchStored(*image_id, with_cores)
                      : service.engine().Search(image.bytes, with_cores);
  });
  return result;
}

Response Search(Service& service, const Request& request, const Parameters& parameters) {
  const auto start = std::chrono::steady_clock::now();
  const SearchOptions options = OptionsOf(request, parameters);
  const SearchResult result = SearchOnPool(service, request, parameters, options);
  service.metrics.OnSearch(result.timings);
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
  return JsonResponse(SearchResultJson(result, took.count()));
}

std::vector<Parameter> SearchParameters() {
  return {
      {"image_id", "a stored picture to search with, instead of sending one"},
      Parameter("limit", "hits per page; 0 = all").Integer(0, kLargestLimit).Default("10"),
      Parameter("offset", "hits to skip before the page").Integer(0, kLargestOffset).Default("0"),
      Parameter("group_by", "each object once, by its best picture, or each picture")
          .Choice({"object", "image"})
          .Default("object"),
      Parameter("rank",
                "votes of nearest neighbours, words by tf-idf, or the paper's histogram distance")
          .Choice({"neighbours", "tfidf", "histogram"})
          .Default("neighbours"),
      Parameter("verify",
                "whether the best hits must agree with the query on one smooth warp; by "
                "default tps, and none if rank is histogram")
          .Choice({"none", "tps"}),
      Parameter("verify_depth",
                "how many of the best pictures are verified; by default 100, or the square "
                "root of the collection's size if that is more")
          .Integer(1, kLargestDepth),
      Parameter("expand",
                "query expansion: how many of the best verified pictures are used as further "
                "queries, for views that the query alone does not reach; by default 3 by "
                "image and 0 by object")
          .Integer(0, kMostExpansions),
      Parameter("instances", "maximum number of instances of one object in the query picture")
          .Integer(1, kMostInstances)
          .Default("4"),
      Parameter("region", "x,y,width,height in pixels of the query picture: only this part is used")
          .Numbers(4),
      Parameter("min_score", "drop hits below it").Number(0, 1).Default("0"),
      {"object", "only pictures of this object"},
      {"filter", "only pictures whose metadata pass: a JSON object of conditions"},
      Parameter("explain", "explain every hit").Boolean().Default("false")};
}

}  // namespace

void AddSearchRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "search",
                    .method = "POST",
                    .pattern = "/v1/collections/{c}/search",
                    .summary = "Which object is this?",
                    .body = BodyKind::kImageOrJson,
                    .parameters = SearchParameters(),
                    .answers = {{200, "hits, best first", "SearchAnswer"}},
                    .codes = {"image_not_found", "no_vocabulary"},
                    .example = R"(curl -F image=@mug.png -F limit=3 )"
                               R"("$PLIANT/v1/collections/default/search")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Search(service, request, parameters);
                    }});
}

}  // namespace pliant::server
