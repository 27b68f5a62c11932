// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Vocabularies: train, list, activate.
#include <limits>

#include "descriptor/base/strings.h"
#include "index/json/record_json.h"
#include "server/http/problem.h"
#include "server/jobs/training.h"
#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

// If more images than these lack words of a vocabulary, a job activates it.
constexpr std::uint64_t kQuantizedAtOnce = 200;
constexpr auto kMostWords = static_cast<std::int64_t>(kMaxWords);
constexpr auto kLargestSample = static_cast<std::int64_t>(kMaxVocabularySamples);

Response List(Service& service, const Request& request, const Parameters&) {
  Json items = Json::array();
  for (const auto& vocabulary : service.engine().ListVocabularies(request.captures.at("c"))) {
    items.push_back(VocabularyJson(vocabulary));
  }
  return JsonResponse({{"vocabularies", items}});
}

Response Train(Service& service, const Request& request, const Parameters& parameters) {
  TrainOptions options;
  options.collection = CollectionOf(service, request);
  options.words = static_cast<int>(parameters.Get<std::int64_t>("words").value_or(options.words));
  options.sample =
      static_cast<int>(parameters.Get<std::int64_t>("sample").value_or(options.sample));
  options.seed = parameters.Value<std::uint64_t>("seed");
  return JobResponse(
      AddTrainingJob(*service.jobs, options, /*activate=*/parameters.Value<bool>("activate")));
}

[[noreturn]] void ThrowNoVocabulary(const std::string& id) {
  throw ProblemError("vocabulary_not_found", "No vocabulary has the number '" + id + "'.");
}

VocabularyRecord RequireVocabulary(Service& service, const std::string& collection,
                                   std::int64_t id) {
  for (const auto& vocabulary : service.engine().ListVocabularies(collection)) {
    if (vocabulary.id == id) return vocabulary;
  }
  ThrowNoVocabulary(std::to_string(id));
}

Response Activate(Service& service, const Request& request, const Parameters&) {
  const std::string collection = CollectionOf(service, request);
  const std::string& text = request.captures.at("v");
  const auto id = NumberOf<std::int64_t>(text);
  if (!id) ThrowNoVocabulary(text);
  if (service.engine().CountUnquantized(collection, *id) > kQuantizedAtOnce) {
    RequireVocabulary(service, collection, *id);
    return JobResponse(AddActivationJob(*service.jobs, collection, *id));
  }
  service.engine().UseVocabulary(collection, *id);
  return JsonResponse(VocabularyJson(RequireVocabulary(service, collection, *id)));
}

}  // namespace

void AddVocabularyRoutes(RouteTable& table) {
  table.Add("POST /v1/collections/{c}/vocabularies", "vocabularies.train", Train)
      .Summary("Train a vocabulary from the stored images, in the background")
      .Takes(
          {Parameter("words", "number of visual words; by default a tenth of the sample")
               .Integer(2, kMostWords),
           Parameter("sample",
                     "number of descriptors to train on; by default ten per word, at least 10000")
               .Integer(2, kLargestSample),
           Parameter("seed", "the same seed and images give the same vocabulary")
               .Integer(0, std::numeric_limits<std::int64_t>::max())
               .Default("1"),
           Parameter("activate", "activate the vocabulary after the training")
               .Boolean()
               .Default("true")})
      .Answers(202, "the job; Location has its address", "Job")
      .ExampleBody(R"({"words": 20})");
  table.Add("GET /v1/collections/{c}/vocabularies", "vocabularies.list", List)
      .Summary("List the vocabularies of a collection, oldest first")
      .Answers(200, "all vocabularies", "VocabularyList");
  table.Add("PUT /v1/collections/{c}/vocabularies/{v}/active", "vocabularies.activate", Activate)
      .Summary("Activate this vocabulary")
      .Answers(200, "the vocabulary, now active", "Vocabulary")
      .Answers(202, "the job, if many images need their visual words first", "Job")
      .Codes({"model_mismatch"});
}

}  // namespace pliant::server
