// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which object is this?
#include <array>
#include <chrono>
#include <memory>
#include <utility>

#include <spdlog/spdlog.h>

#include "descriptor/base/base64.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/stopwatch.h"
#include "index/json/result_json.h"
#include "server/http/json.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/routes.h"
#include "server/routes/search_drawing.h"
#include "server/routes/search_options.h"
#include "server/routes/uploaded_image.h"

namespace pliant::server {
namespace {

// How long the first search after the first uploads waits for the vocabulary.
constexpr std::chrono::milliseconds kVocabularyWait{15'000};
constexpr std::size_t kMostSearches = 100;  // of one batch

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
                       "There is nothing to find yet: the collection has no images. POST some to "
                       "/v1/collections/" +
                           collection + "/images.");
  }
  if (!service.jobs->WaitFor(job->id, kVocabularyWait)) {
    throw ProblemError("no_vocabulary", "The first vocabulary is being trained, see /v1/jobs/" +
                                            job->id + ". Search again when that is done.")
        .RetryAfter(5);
  }
}

SearchResult SearchOnPool(Service& service, const SearchQuery& query) {
  const std::string& collection = query.options.collection;
  // Or 404, whatever else lacks.
  if (query.image_id) service.engine().Get(collection, *query.image_id);
  for (const std::string& id : query.image_ids) service.engine().Get(collection, id);
  if (!service.engine().HasVocabulary(collection)) AwaitVocabulary(service, collection);
  SearchResult result;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int cores) {
    SearchOptions options = query.options;
    options.threads = cores;
    Engine& engine = service.engine();
    result = query.image_id             ? engine.SearchStored(*query.image_id, options)
             : !query.image_ids.empty() ? engine.SearchExamples(query.image_ids, options)
                                        : engine.Search(query.image.bytes, options);
  });
  service.metrics.OnSearch(result.timings);
  return result;
}

// An image in place of the JSON: the query with the outlines and names of the hits.
Response Drawing(Service& service, const Request& request, const SearchQuery& query,
                 const SearchResult& result) {
  std::vector<std::uint8_t> stored;
  if (query.image_id) {
    stored = service.engine().GetContent(query.options.collection, *query.image_id);
  }
  const bool png = PrefersPng(request.header("Accept"));
  std::string image;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int) {
    image = DrawSearch(query.image_id ? Bytes(stored) : Bytes(query.image.bytes),
                       service.options.engine.extraction.decode, service.decode(), result, png);
  });
  Response response;
  response.content_type = png ? "image/png" : "image/jpeg";
  response.body = std::move(image);
  response.headers.emplace_back("Cache-Control", "no-store");
  return response;
}

// The query as a browser shows it: what was fetched, for example, or is of a type it cannot read.
std::string Preview(Service& service, const SearchQuery& query) {
  std::vector<std::uint8_t> stored;
  if (query.image_id) {
    stored = service.engine().GetContent(query.options.collection, *query.image_id);
  }
  std::string jpeg;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int) {
    jpeg =
        MakeThumbnail(query.image_id ? Bytes(stored) : Bytes(query.image.bytes),
                      service.options.engine.extraction.decode, service.decode(), kPreviewSidePx);
  });
  return "data:image/jpeg;base64," + Base64(jpeg.data(), jpeg.size());
}

// Parameters that say what the answer is made of, and need one query image.
void CheckImages(const SearchQuery& query, bool draws, bool previews) {
  if (draws && !query.image_ids.empty()) {
    ThrowInvalid("draw", "draw needs one query image, and image_ids are several.");
  }
  if (previews && !query.image_ids.empty()) {
    ThrowInvalid("preview", "preview needs one query image, and image_ids are several.");
  }
  if (draws && previews) {
    ThrowInvalid("preview", "preview is a part of the JSON that draw has an image in place of.");
  }
}

Response Search(Service& service, const Request& request, const Parameters& parameters) {
  const Stopwatch watch;
  const SearchQuery query =
      SearchQueryOf(request, parameters, CollectionOf(service, request), service.fetcher);
  const bool draws = parameters.Flag("draw").value_or(false);
  const bool previews = parameters.Flag("preview").value_or(false);
  CheckImages(query, draws, previews);
  const SearchResult result = SearchOnPool(service, query);
  if (draws) return Drawing(service, request, query, result);
  Json answer = SearchResultJson(result, watch.ms());
  if (previews) answer["query"]["preview"] = Preview(service, query);
  return JsonResponse(answer);
}

// The parameters of a single search, which those of a batch are checked against.
const Route& SingleSearch() {
  static const Route route = [] {
    Route made;
    made.name = "search";
    made.body = BodyKind::kImageOrJson;
    made.parameters = SearchParameters();
    return made;
  }();
  return route;
}

Json ResultOf(Service& service, const Request& batch, const std::string& collection,
              const Json& item) {
  const Stopwatch watch;
  try {
    if (!item.is_object()) ThrowInvalid("searches", "A search must be a JSON object.");
    Request request;
    request.id = batch.id;
    request.content_type = "application/json";
    request.body = ToText(item);
    request.has_body = true;
    const Parameters parameters(SingleSearch(), request);
    const SearchQuery query =
        SearchQueryOf(request, parameters, collection, service.fetcher, Fetcher::For::kBatch);
    const SearchResult found = SearchOnPool(service, query);
    return {{"status", 200}, {"answer", SearchResultJson(found, watch.ms())}};
  } catch (...) {
    const Problem problem = CurrentProblem();
    LogProblem(problem);
    return {{"status", problem.status}, {"problem", ProblemSummary(problem)}};
  }
}

Response SearchBatch(Service& service, const Request& request, const Parameters& parameters) {
  const std::string collection = CollectionOf(service, request);
  const Json searches = parameters.JsonList("searches").value_or(Json::array());
  if (searches.empty() || searches.size() > kMostSearches) {
    ThrowInvalid("searches",
                 "searches must be 1 to " + std::to_string(kMostSearches) + " searches.");
  }
  std::vector<Json> results(searches.size());
  ParallelFor(searches.size(), service.pool.cores(), [&](std::size_t i) {
    results[i] = ResultOf(service, request, collection, searches[i]);
  });
  Json list = Json::array();
  std::size_t failed = 0;
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (results[i].contains("problem")) ++failed;
    Json entry = {{"index", i}};
    entry.update(results[i]);
    list.push_back(std::move(entry));
  }
  return JsonResponse({{"failed", failed}, {"results", std::move(list)}}, 207);
}

constexpr std::array<const char*, 2> kNames = {"first", "second"};
using Pair = std::array<UploadedImage, kNames.size()>;

// What is said of image_url is said of the image that has it.
[[noreturn]] void ThrowFor(const char* name) {
  Problem problem = CurrentProblem();
  if (problem.parameter == "image_url") problem.parameter = name;
  throw ProblemError(std::move(problem));
}

std::vector<UploadedImage> Uploaded(const Request& request) {
  const bool none = std::none_of(request.parts.begin(), request.parts.end(),
                                 [](const Part& part) { return part.name == "image"; });
  return none ? std::vector<UploadedImage>() : ImagesOf(request);
}

// The images that are named by `first` and `second`, and in the places of those that are not, the
// form's fields 'image' in their order. Nothing is fetched before all of it is there.
Pair PairOf(const Request& request, const Parameters& parameters, Fetcher& fetcher) {
  std::vector<UploadedImage> uploaded = Uploaded(request);
  std::size_t taken = 0;
  Pair pair;
  for (std::size_t i = 0; i < pair.size(); ++i) {
    const ImageText* named = parameters.Image(kNames[i]);
    if (named != nullptr && named->base64) {
      pair[i] = ImageOfBase64(*named->base64, kNames[i]);
    } else if (named == nullptr && taken < uploaded.size()) {
      pair[i] = std::move(uploaded[taken++]);
    } else if (named == nullptr) {
      throw ProblemError("missing_parameter",
                         "Two images are required: form fields 'image', or 'first' and 'second', "
                         "each with image (base64) or image_url.")
          .Parameter(request.is_multipart() ? "image" : kNames[i]);
    }
  }
  if (taken < uploaded.size()) {
    throw ProblemError("duplicate_parameter", "There are more than two images.").Parameter("image");
  }
  std::shared_ptr<void> place;  // one for both: a request that waits for its second helps nobody
  for (std::size_t i = 0; i < pair.size(); ++i) {
    const ImageText* named = parameters.Image(kNames[i]);
    if (named == nullptr || !named->url) continue;
    try {
      FetchedImage fetched = fetcher.Fetch(*named->url, Fetcher::For::kRequest, {}, place);
      place = fetched.place;
      const Bytes bytes(*fetched.bytes);
      pair[i] = {bytes, std::move(fetched.source), std::move(fetched.bytes)};
    } catch (...) {
      ThrowFor(kNames[i]);
    }
  }
  return pair;
}

Response Compare(Service& service, const Request& request, const Parameters& parameters) {
  const Stopwatch watch;
  const Pair images = PairOf(request, parameters, service.fetcher);
  Comparison comparison;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int cores) {
    comparison = service.engine().Compare(images[0].bytes, images[1].bytes, cores);
  });
  const bool explain = parameters.Flag("explain").value_or(false);
  return JsonResponse(ComparisonJson(comparison, watch.ms(), explain));
}

}  // namespace

void AddSearchRoutes(Service& service, std::vector<Route>& routes) {
  std::vector<Parameter> parameters = SearchParameters();
  parameters.push_back(Parameter("draw",
                                 "answer with the query image, outlines and names drawn into it: "
                                 "a JPEG, or a PNG where Accept prefers one")
                           .Boolean()
                           .Default("false"));
  parameters.push_back(Parameter("preview",
                                 "query.preview of the answer is the query image, a JPEG of at "
                                 "most 1280 pixels in a data: URL: to show what was fetched")
                           .Boolean()
                           .Default("false"));
  routes.push_back({.name = "search",
                    .method = "POST",
                    .pattern = "/v1/collections/{c}/search",
                    .summary = "Which object is this?",
                    .body = BodyKind::kImageOrJson,
                    .parameters = std::move(parameters),
                    .answers = {{200, "hits, best first", "SearchAnswer"},
                                {200, "with draw: the query image", "", "image/jpeg"},
                                {200, "with draw: the query image", "", "image/png"}},
                    .codes = {"image_not_found", "no_vocabulary", "content_not_kept"},
                    .example = R"(curl -F image=@mug.png -F limit=3 )"
                               R"("$PLIANT/v1/collections/default/search")",
                    .handler = [&service](const Request& request, const Parameters& given) {
                      return Search(service, request, given);
                    }});
  routes.push_back(
      {.name = "search.batch",
       .method = "POST",
       .pattern = "/v1/collections/{c}/search:batch",
       .summary = "Several searches; each has an answer or a problem of its own",
       .body = BodyKind::kJson,
       .parameters = {Parameter("searches",
                                "up to 100 objects, each with the parameters of a search, and "
                                "image_id, image_ids or an image, as base64 in image or by its "
                                "address in image_url")
                          .JsonList()
                          .Required()},
       .answers = {{207, "a result for each search, in their order", "SearchBatchAnswer"}},
       .example = R"(curl -H "Content-Type: application/json" )"
                  R"(-d "{\"searches\": [{\"image_id\": \"$IMAGE\", \"limit\": 3}]}" )"
                  R"("$PLIANT/v1/collections/default/search:batch")",
       .handler = [&service](const Request& request, const Parameters& given) {
         return SearchBatch(service, request, given);
       }});
}

void AddCompareRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "compare",
       .method = "POST",
       .pattern = "/v1/compare",
       .summary = "Do two images show the same object, and where is that of the first in the "
                  "second? Neither is stored",
       .body = BodyKind::kPair,
       .parameters =
           {Parameter("first", "the first image, where it is no form field image").Image(),
            Parameter("second", "likewise the second").Image(),
            Parameter("explain", "the matches that agree, and the warp")
                .Boolean()
                .Default("false")},
       .answers = {{200, "what the two have in common", "Comparison"}},
       .example = R"(curl -F image=@mug.png -F image=@cup.png "$PLIANT/v1/compare")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return Compare(service, request, parameters);
       }});
}

}  // namespace pliant::server
