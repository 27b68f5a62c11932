// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Vocabularies: train, list, switch.
#include <charconv>
#include <limits>

#include "index/json/record_json.h"
#include "server/http/problem.h"
#include "server/jobs/training.h"
#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

// More images than these that lack words of a vocabulary make its activation a job.
constexpr std::uint64_t kQuantizedAtOnce = 200;
constexpr auto kMostWords = static_cast<std::int64_t>(kMaxWords);
constexpr auto kLargestSample = static_cast<std::int64_t>(kMaxVocabularySamples);

Response List(Service& service, const Request& request) {
  Json items = Json::array();
  for (const auto& vocabulary : service.engine().ListVocabularies(CollectionOf(service, request))) {
    items.push_back(VocabularyJson(vocabulary));
  }
  return JsonResponse({{"vocabularies", items}});
}

Response Train(Service& service, const Request& request, const Parameters& parameters) {
  TrainOptions options;
  options.collection = CollectionOf(service, request);
  options.words = static_cast<int>(parameters.Integer("words").value_or(options.words));
  options.sample = static_cast<int>(parameters.Integer("sample").value_or(options.sample));
  options.seed = static_cast<std::uint64_t>(
      parameters.Integer("seed").value_or(static_cast<std::int64_t>(options.seed)));
  const bool activate = parameters.Flag("activate").value_or(true);
  service.engine().GetCollection(options.collection);  // or it is not found
  return JobResponse(AddTrainingJob(*service.jobs, options, activate));
}

VocabularyRecord RequireVocabulary(Service& service, const std::string& collection,
                                   std::int64_t id) {
  for (const auto& vocabulary : service.engine().ListVocabularies(collection)) {
    if (vocabulary.id == id) return vocabulary;
  }
  throw ProblemError("vocabulary_not_found",
                     "There is no vocabulary '" + std::to_string(id) + "'.");
}

Response Activate(Service& service, const Request& request) {
  const std::string collection = CollectionOf(service, request);
  const std::string& text = request.captures.at("v");
  std::int64_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw ProblemError("vocabulary_not_found", "There is no vocabulary '" + text + "'.");
  }
  if (service.engine().CountUnquantized(collection, id) > kQuantizedAtOnce) {
    RequireVocabulary(service, collection, id);
    return JobResponse(AddActivationJob(*service.jobs, collection, id));
  }
  service.engine().UseVocabulary(collection, id);
  return JsonResponse(VocabularyJson(RequireVocabulary(service, collection, id)));
}

}  // namespace

void AddVocabularyRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "vocabularies.train",
       .method = "POST",
       .pattern = "/v1/collections/{c}/vocabularies",
       .summary = "Train a vocabulary from the stored images, in the background",
       .scope = Scope::kWrite,
       .body = BodyKind::kJson,
       .parameters =
           {Parameter("words", "number of words; a tenth of the sample by default")
                .Integer(2, kMostWords),
            Parameter("sample", "descriptors to train on; by default ten per word, at least 10000")
                .Integer(2, kLargestSample),
            Parameter("seed", "same seed and images, same vocabulary")
                .Integer(0, std::numeric_limits<std::int64_t>::max())
                .Default("1"),
            Parameter("activate", "activate it when it is done").Boolean().Default("true")},
       .answers = {{202, "the job; Location has its address", "Job"}},
       .codes = {"busy"},
       .example = R"(curl -H "Content-Type: application/json" -d '{"words": 20}' )"
                  R"("$PLIANT/v1/collections/default/vocabularies")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return Train(service, request, parameters);
       }});
  routes.push_back({.name = "vocabularies.list",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/vocabularies",
                    .summary = "Vocabularies, oldest first",
                    .answers = {{200, "all of them", "VocabularyList"}},
                    .example = R"(curl "$PLIANT/v1/collections/default/vocabularies")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return List(service, request);
                    }});
  routes.push_back({.name = "vocabularies.activate",
                    .method = "PUT",
                    .pattern = "/v1/collections/{c}/vocabularies/{v}/active",
                    .summary = "Use this vocabulary from now on",
                    .scope = Scope::kWrite,
                    .answers = {{200, "in use", "Vocabulary"},
                                {202, "many images must be quantised first: the job", "Job"}},
                    .codes = {"vocabulary_not_found", "model_mismatch"},
                    .example =
                        R"(curl -X PUT )"
                        R"("$PLIANT/v1/collections/default/vocabularies/$VOCABULARY/active")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Activate(service, request);
                    }});
}

}  // namespace pliant::server
