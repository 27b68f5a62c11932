// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Vocabularies: train, list, switch.
#include <charconv>
#include <limits>

#include "server/problem.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response List(Service& service, const Request& request) {
  Json items = Json::array();
  for (const auto& vocabulary : service.engine().ListVocabularies(CollectionOf(request))) {
    items.push_back(VocabularyJson(vocabulary));
  }
  return JsonResponse({{"vocabularies", items}});
}

Response Train(Service& service, const Request& request, const Parameters& parameters) {
  TrainOptions options;
  options.collection = CollectionOf(request);
  options.words =
      static_cast<int>(parameters.Integer("words", 2, kMaxWords).value_or(options.words));
  options.sample = static_cast<int>(
      parameters.Integer("sample", 2, kMaxVocabularySamples).value_or(options.sample));
  options.seed = static_cast<std::uint64_t>(
      parameters.Integer("seed", 0, std::numeric_limits<std::int64_t>::max())
          .value_or(static_cast<std::int64_t>(options.seed)));
  const bool activate =
      parameters.Choice<bool>("activate", {{"true", true}, {"false", false}}).value_or(true);
  const JobStatus job =
      AddTrainingJob(service.engine(), service.pool, *service.jobs, options, activate);
  Response response = JsonResponse(JobJson(job), 202);
  response.headers.emplace_back("Location", "/v1/jobs/" + job.id);
  return response;
}

Response Activate(Service& service, const Request& request) {
  const std::string collection = CollectionOf(request);
  const std::string& text = request.captures.at("v");
  std::int64_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw ProblemError("vocabulary_not_found", "There is no vocabulary '" + text + "'.");
  }
  service.engine().UseVocabulary(collection, id);
  for (const auto& vocabulary : service.engine().ListVocabularies(collection)) {
    if (vocabulary.id == id) return JsonResponse(VocabularyJson(vocabulary));
  }
  throw ProblemError("vocabulary_not_found", "There is no vocabulary '" + text + "'.");
}

}  // namespace

void AddVocabularyRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "vocabularies.train",
                    .method = "POST",
                    .pattern = "/v1/collections/{c}/vocabularies",
                    .scope = Scope::kWrite,
                    .body = BodyKind::kJson,
                    .parameters = {"words", "sample", "seed", "activate"},
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Train(service, request, parameters);
                    }});
  routes.push_back({.name = "vocabularies.list",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/vocabularies",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return List(service, request);
                    }});
  routes.push_back({.name = "vocabularies.activate",
                    .method = "PUT",
                    .pattern = "/v1/collections/{c}/vocabularies/{v}/active",
                    .scope = Scope::kWrite,
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Activate(service, request);
                    }});
}

}  // namespace pliant::server
