// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which object is this?
#include <algorithm>
#include <chrono>
#include <utility>

#include <spdlog/spdlog.h>

#include "descriptor/base/base64.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/stopwatch.h"
#include "index/json/result_json.h"
#include "server/http/json.h"
#include "server/http/problem.h"
#include "server/routes/lists.h"
#include "server/routes/request_body.h"
#include "server/routes/routes.h"
#include "server/routes/search_drawing.h"

namespace pliant::server {
namespace {

// How long the first search after the first uploads waits for the vocabulary.
constexpr std::chrono::milliseconds kVocabularyWait{15'000};
constexpr std::size_t kMostSearches = 100;  // in one batch
constexpr int kPreviewSidePx = 1280;        // of the query image

constexpr std::int64_t kLargestOffset = 1'000'000;
constexpr std::int64_t kLargestLimit = 1'000;
constexpr std::int64_t kLargestDepth = 10'000;
constexpr std::int64_t kMostInstances = 100;
constexpr double kLargestCoordinate = 1e6;

const Choices<GroupBy> kGroupings = {{"object", GroupBy::kObject}, {"image", GroupBy::kImage}};
const Choices<RankMethod> kRankings = {{"neighbours", RankMethod::kNeighbours},
                                       {"histogram", RankMethod::kHistogram}};
const Choices<Verification> kVerifications = {{"none", Verification::kNone},
                                              {"tps", Verification::kTps}};

// The query is an uploaded image, a stored one, or several stored ones.
struct SearchQuery {
  UploadedImage image;  // without the other two
  std::optional<std::string> image_id;
  std::vector<std::string> image_ids;  // empty = absent
  SearchOptions options;
};

std::vector<Parameter> SearchParameters() {
  return {
      {"image_id", "use this stored image as the query"},
      Parameter("exclude_self", "with image_id: leave that image out of the hits")
          .Boolean()
          .Default("true"),
      Parameter("image_ids",
                "use these stored images as the query, at most 16: hits are similar to any of "
                "them; hits similar to several come first; the images themselves are not hits")
          .JsonList(),
      Parameter("limit", "hits per page; 0: all").Integer(0, kLargestLimit).Default("10"),
      Parameter("offset", "hits to skip before the page").Integer(0, kLargestOffset).Default("0"),
      Parameter("group_by", "object: each object once, with its best image; or image")
          .Choice(NamesOf(kGroupings))
          .Default("object"),
      Parameter(
          "rank",
          "neighbours: votes of nearest neighbours; histogram: the paper's histogram distance")
          .Choice(NamesOf(kRankings))
          .Default("neighbours"),
      Parameter("verify",
                "tps: verify that the matches of the best hits fit one smooth warp; none: no "
                "verification. Default: tps, or none if rank is histogram")
          .Choice(NamesOf(kVerifications)),
      Parameter("verify_depth",
                "number of candidates to verify. Default: adaptive, 30 to 100 or the square root "
                "of the collection's size, while candidates match; twice that if none matches")
          .Integer(1, kLargestDepth),
      Parameter("instances", "maximum number of instances of one object in the photo")
          .Integer(1, kMostInstances)
          .Default("20"),
      Parameter(
          "closer_look",
          "if nothing is found, search again in a second pass at high resolution and return the "
          "better answer; takes three to four times as long; if little is found, look for mirrored "
          "objects; not with image_id or image_ids")
          .Boolean()
          .Default("true"),
      Parameter("region",
                "x,y,width,height in pixels of the photo: search with this part only, at the "
                "resolution of a whole photo")
          .Numbers(4),
      Parameter("min_score", "drop hits with a lower score").Number(0, 1).Default("0"),
      OfObjectParameter(),
      FilterParameter(),
      Parameter("explain", "add an explanation to every hit").Boolean().Default("false"),
      Parameter("partial",
                "if no server answers for a part of the index, search the other parts; then the "
                "answer has searched, their share")
          .Boolean()
          .Default("false")};
}

Region RegionOf(const std::vector<double>& numbers) {
  const Region region{numbers[0], numbers[1], numbers[2], numbers[3]};
  for (const double number : numbers) {
    if (number < -kLargestCoordinate || number > kLargestCoordinate) {
      ThrowInvalid("region", "region must have coordinates of at most 1000000 pixels.");
    }
  }
  if (region.width <= 0 || region.height <= 0) {
    ThrowInvalid("region",
                 "region must be x,y,width,height in pixels, with width and height above 0.");
  }
  return region;
}

SearchOptions OptionsOf(const Parameters& parameters, const std::string& collection) {
  SearchOptions options;
  options.collection = collection;
  options.limit = parameters.Value<std::size_t>("limit");
  options.offset = parameters.Value<std::size_t>("offset");
  options.group_by = parameters.Choice("group_by", kGroupings).value_or(options.group_by);
  options.rank = parameters.Choice("rank", kRankings).value_or(options.rank);
  options.verify = parameters.Choice("verify", kVerifications).value_or(options.verify);
  options.min_score = parameters.Value<double>("min_score");
  options.object = parameters.Text("object");
  options.verify_depth =
      static_cast<std::size_t>(parameters.Get<std::int64_t>("verify_depth").value_or(0));
  options.max_instances = parameters.Value<int>("instances");
  if (const auto filter = parameters.Text("filter")) options.filter = ParseFilter(*filter);
  options.explain = parameters.Value<bool>("explain");
  options.partial = parameters.Value<bool>("partial");
  options.second_pass = parameters.Value<bool>("closer_look");
  if (const auto numbers = parameters.Get<std::vector<double>>("region"))
    options.region = RegionOf(*numbers);
  return options;
}

std::vector<std::string> ExamplesOf(const Parameters& parameters) {
  std::vector<std::string> ids;
  const auto list = parameters.Get<Json>("image_ids");
  if (!list) return ids;
  if (list->empty() || list->size() > kMaxExamples) {
    ThrowInvalid("image_ids",
                 "image_ids must have 1 to " + std::to_string(kMaxExamples) + " image ids.");
  }
  for (const Json& id : *list) {
    if (!id.is_string()) ThrowInvalid("image_ids", "image_ids must be an array of text.");
    ids.push_back(id.get<std::string>());
    if (std::count(ids.begin(), ids.end(), ids.back()) > 1) {
      ThrowInvalid("image_ids", "image_ids must not contain an id twice.");
    }
  }
  return ids;
}

// Throws ProblemError that names the parameter, and what ImageOf throws.
SearchQuery SearchQueryOf(const Request& request, const Parameters& parameters,
                          const std::string& collection, Fetcher& fetcher, Fetcher::For whom) {
  SearchQuery query;
  query.options = OptionsOf(parameters, collection);
  query.image_id = parameters.Text("image_id");
  query.image_ids = ExamplesOf(parameters);
  const bool has_image = HasImage(request, parameters);
  if (query.image_id && has_image) {
    ThrowInvalid("image_id", "image_id and an image cannot be combined.");
  }
  if (!query.image_ids.empty() && (query.image_id || has_image)) {
    ThrowInvalid("image_ids", "image_ids cannot be combined with image_id or an image.");
  }
  if (!query.image_ids.empty() && query.options.region) {
    ThrowInvalid("region", "region cannot be combined with image_ids.");
  }
  if (query.image_id) {
    if (parameters.Value<bool>("exclude_self")) query.options.without = {*query.image_id};
  } else if (parameters.has("exclude_self")) {
    ThrowInvalid("exclude_self", "exclude_self needs image_id.");
  }
  if (!query.image_id && query.image_ids.empty()) {
    query.image = ImageOf(request, parameters, fetcher, whom);
  }
  return query;
}

ProblemError NoVocabulary(const std::string& why, int retry_after_s = 0) {
  return {"no_vocabulary",
          "The collection has no vocabulary yet" + why,
          {.retry_after_s = retry_after_s}};
}

// Waits for the first vocabulary if a job trains it. Throws ProblemError "no_vocabulary".
void AwaitVocabulary(Service& service, const std::string& collection) {
  const std::string path = "/v1/collections/" + collection;
  AutoTrainer* trainer = service.auto_trainer();
  if (trainer == nullptr) {
    throw NoVocabulary(", and --auto-train is off. POST to " + path +
                       "/vocabularies to train one.");
  }
  std::optional<JobStatus> job;
  try {
    job = trainer->TrainIfDue(collection);
  } catch (const Error& error) {
    // A search stores nothing: its problem is not the full disk, but the missing vocabulary.
    if (error.code() != ErrorCode::kNoSpace && error.code() != ErrorCode::kReadOnly) throw;
    spdlog::warn("no vocabulary for '{}': {}", collection, error.what());
    throw NoVocabulary(error.code() == ErrorCode::kNoSpace
                           ? ", and the server's disk is too full to store one. Free some space, "
                             "then search again."
                           : ", and the server cannot write to its database.");
  }
  if (!job) throw NoVocabulary(" and no images. Add images: POST to " + path + "/images.");
  if (!service.jobs->WaitFor(job->id, kVocabularyWait)) {
    throw NoVocabulary(": the server is training the first vocabulary, see /v1/jobs/" + job->id +
                           ". Search again when the job is done.",
                       5);
  }
}

SearchResult SearchOnPool(Service& service, const SearchQuery& query) {
  SearchResult result;
  const auto search = [&](int cores) {
    SearchOptions options = query.options;
    options.threads = cores;
    Engine& engine = service.engine();
    result = query.image_id             ? engine.SearchStored(*query.image_id, options)
             : !query.image_ids.empty() ? engine.SearchExamples(query.image_ids, options)
                                        : engine.Search(query.image.bytes, options);
  };
  try {
    service.pool.Run(WorkerPool::Lane::kSearch, search);
  } catch (const Error& error) {
    if (error.reason() != "no_vocabulary") throw;
    AwaitVocabulary(service, service.engine().CollectionName(query.options.collection));
    service.pool.Run(WorkerPool::Lane::kSearch, search);
  }
  service.metrics.OnSearch(result.timings, query.options.collection);
  return result;
}

// The query image's bytes; `stored` keeps those of a stored one.
Bytes QueryBytes(Service& service, const SearchQuery& query, std::vector<std::uint8_t>& stored) {
  if (!query.image_id) return query.image.bytes;
  stored = service.engine().GetContent(query.options.collection, *query.image_id);
  return stored;
}

// The query image with the outlines and names of the hits.
Response Drawing(Service& service, const Request& request, const SearchQuery& query,
                 const SearchResult& result) {
  std::vector<std::uint8_t> stored;
  const Bytes bytes = QueryBytes(service, query, stored);
  const bool png = PrefersPng(request.header("Accept"));
  std::string drawing;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int) {
    drawing =
        DrawSearch(bytes, service.options.engine.extraction.decode, service.decode(), result, png);
  });
  return {.content_type = png ? "image/png" : "image/jpeg",
          .body = std::move(drawing),
          .headers = {{"Cache-Control", "no-store"}}};
}

// The query image for a browser: a fetched one, or one of a type that the browser cannot read.
std::string Preview(Service& service, const SearchQuery& query) {
  std::vector<std::uint8_t> stored;
  const std::string jpeg = service.Shrink(QueryBytes(service, query, stored), kPreviewSidePx);
  return "data:image/jpeg;base64," + Base64(jpeg.data(), jpeg.size());
}

Response Search(Service& service, const Request& request, const Parameters& parameters) {
  const Stopwatch watch;
  const bool draws = parameters.Value<bool>("draw");
  const bool previews = parameters.Value<bool>("preview");
  // The search resolves the name. A stored query image is read after it, from the same collection.
  const bool reads_stored = parameters.has("image_id") && (draws || previews);
  const SearchQuery query = SearchQueryOf(
      request, parameters, reads_stored ? CollectionOf(service, request) : request.captures.at("c"),
      service.fetcher, Fetcher::For::kRequest);
  if ((draws || previews) && !query.image_ids.empty()) {
    const std::string name = draws ? "draw" : "preview";
    ThrowInvalid(name, name + " cannot be combined with image_ids.");
  }
  if (draws && previews) {
    ThrowInvalid("preview", "preview and draw cannot be combined.");
  }
  const SearchResult result = SearchOnPool(service, query);
  if (draws) return Drawing(service, request, query, result);
  Json answer = SearchResultJson(result, watch.ms());
  if (previews) answer["query"]["preview"] = Preview(service, query);
  return JsonResponse(answer);
}

Json ResultOf(Service& service, const Request& batch, const std::string& collection,
              const Json& item) {
  static const Route single{.name = "search",
                            .method = "POST",
                            .pattern = "/v1/collections/{c}/search",
                            .body = BodyKind::kImageOrJson,
                            .parameters = SearchParameters(),
                            .handler = {}};
  const Stopwatch watch;
  try {
    if (!item.is_object()) ThrowInvalid("searches", "A search must be a JSON object.");
    Request request;
    request.id = batch.id;
    request.content_type = "application/json";
    request.body = ToText(item);
    request.has_body = true;
    const Parameters parameters(single, request);
    const SearchQuery query =
        SearchQueryOf(request, parameters, collection, service.fetcher, Fetcher::For::kBatch);
    const SearchResult found = SearchOnPool(service, query);
    return {{"status", 200}, {"answer", SearchResultJson(found, watch.ms())}};
  } catch (...) {
    const Problem problem = CurrentProblem();
    if (!problem.internal.empty()) spdlog::warn("{}: {}", problem.code, problem.internal);
    return {{"status", problem.status}, {"problem", ProblemSummary(problem)}};
  }
}

// All searches of a batch use the same collection, even if its alias moves meanwhile.
Response SearchBatch(Service& service, const Request& request, const Parameters& parameters) {
  const std::string collection = CollectionOf(service, request);
  const Json searches = parameters.Get<Json>("searches").value_or(Json::array());
  if (searches.empty() || searches.size() > kMostSearches) {
    ThrowInvalid("searches",
                 "searches must have 1 to " + std::to_string(kMostSearches) + " searches.");
  }
  std::vector<Json> results(searches.size());
  ParallelFor(searches.size(), service.pool.cores(), [&](std::size_t i) {
    results[i] = {{"index", i}};
    results[i].update(ResultOf(service, request, collection, searches[i]));
  });
  const auto failed = std::count_if(results.begin(), results.end(),
                                    [](const Json& result) { return result.contains("problem"); });
  return JsonResponse({{"failed", failed}, {"results", std::move(results)}}, 207);
}

}  // namespace

void AddSearchRoutes(RouteTable& table) {
  std::vector<Parameter> parameters = SearchParameters();
  parameters.push_back(Parameter("draw",
                                 "return the photo with the outline and name of every found "
                                 "object: a JPEG, or a PNG if Accept prefers it")
                           .Boolean()
                           .Default("false"));
  parameters.push_back(Parameter("preview",
                                 "add the photo as a JPEG of at most 1280 pixels to query.preview, "
                                 "as a data: URL; not with draw")
                           .Boolean()
                           .Default("false"));
  table.Add("POST /v1/collections/{c}/search", "search", Search)
      .Summary("Find the object that an image shows")
      .Needs(Scope::kRead)
      .Body(BodyKind::kImageOrJson)
      .Takes(std::move(parameters))
      .Answers(200, "hits, best first", "SearchAnswer")
      .Sends("image/jpeg", "with draw: the photo")
      .Sends("image/png", "with draw: the photo")
      .Codes({"image_not_found", "no_vocabulary", "content_not_kept", "part_unavailable"})
      .Example(R"(-F image=@mug.png -F limit=3)");
  table.Add("POST /v1/collections/{c}/search:batch", "search.batch", SearchBatch)
      .Summary("Run several searches; each gets its own answer or problem")
      .Needs(Scope::kRead)
      .Takes({Parameter("searches",
                        "up to 100 objects, each with the parameters of a search, and image_id, "
                        "image_ids, image (base64) or image_url")
                  .JsonList()
                  .Required()})
      .Answers(207, "one result for each search, in the same order", "SearchBatchAnswer")
      .Example(R"(-H "Content-Type: application/json" )"
               R"(-d "{\"searches\": [{\"image_id\": \"$IMAGE\", \"limit\": 3}]}")");
}

}  // namespace pliant::server
