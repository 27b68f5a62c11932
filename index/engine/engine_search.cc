// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: search.
#include <optional>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/features/closer_keypoints.h"
#include "index/engine/engine_impl.h"
#include "index/engine/search_run.h"
#include "index/store/feature_codec.h"
#include "index/verify/features_subset.h"

namespace pliant {
namespace {

void CheckVocabulary(const CollectionView& view, const SearchOptions& options) {
  if (view.has_vocabulary()) return;
  throw Error(
      ErrorCode::kConflict, "no_vocabulary",
      "collection \"" + options.collection +
          "\" has no vocabulary yet: `pliant index` makes one when it has added its pictures, and "
          "`pliant vocab train` at any time");
}

void CheckQuery(const Features& features, const std::optional<Region>& region) {
  if (features.keypoints.size() >= kMinKeypoints) return;
  if (region && LongerSide(*region, features.width, features.height) == 0) {
    throw Error(ErrorCode::kUnprocessable, "too_few_features",
                "the region lies outside of the query picture, which has " +
                    std::to_string(features.width) + " x " + std::to_string(features.height) +
                    " pixels");
  }
  throw Error(ErrorCode::kUnprocessable, "too_few_features",
              std::string(region ? "the region of the query picture" : "the query picture") +
                  " has " + std::to_string(features.keypoints.size()) + " key points, " +
                  std::to_string(kMinKeypoints) + " are the least");
}

}  // namespace

SearchResult Engine::Impl::Search(Bytes encoded, const SearchOptions& options) {
  Validate(options);
  CheckVocabulary(View(options.collection), options);  // before any work
  ExtractionTimings timings;
  const FeatureExtractor& extractor = query_extractor();
  const Features features =
      options.region ? extractor.ExtractPart(encoded, *options.region, options.threads, &timings)
                     : extractor.Extract(encoded, options.threads, &timings);
  const Features stored = InStoredPrecision(features);
  return LookCloser(
      Answer(stored, options, timings), stored, options, [&](ExtractionTimings* more) {
        return extractor.LookCloser(encoded, features, options.region, options.threads, more);
      });
}

SearchResult Engine::Impl::SearchStored(const std::string& image_id, const SearchOptions& options) {
  Validate(options);
  return Answer(GetFeatures(options.collection, image_id), options, {});
}

SearchResult Engine::Impl::SearchFeatures(const Features& features, const SearchOptions& options,
                                          const CloserLook& closer) {
  Validate(options);
  const std::string& model_id = store_->model().info.model_id;
  if (features.model_id != model_id) {
    throw Error(ErrorCode::kConflict, "model_mismatch",
                "the features are of " + features.model_id + ", the database holds " + model_id);
  }
  const Features stored = InStoredPrecision(features);
  SearchResult first = Answer(stored, options, {});
  return closer ? LookCloser(std::move(first), stored, options, closer) : first;
}

SearchResult Engine::Impl::LookCloser(SearchResult first, const Features& query,
                                      const SearchOptions& options, const CloserLook& closer) {
  const bool found_nothing = first.found == std::size_t{0} && !first.undecided;
  if (!options.closer_look || !found_nothing) return first;
  ExtractionTimings extraction = first.timings.extraction;
  std::optional<Features> features = closer(&extraction);
  if (!features) return first;
  const Features seen = InStoredPrecision(*std::move(features));
  SearchResult second = Answer(query, options, extraction, &seen);
  SearchTimings timings = second.timings;
  timings.quantize_ms += first.timings.quantize_ms;
  timings.rank_ms += first.timings.rank_ms;
  timings.verify_ms += first.timings.verify_ms;
  timings.database_ms += first.timings.database_ms;
  // Without evidence the first order is the better one: fine key points resemble much by chance.
  SearchResult& surer = second.evidence > first.evidence ? second : first;
  surer.timings = timings;
  surer.looked_closer = true;
  return std::move(surer);
}

SearchResult Engine::Impl::Answer(Features features, const SearchOptions& options,
                                  const ExtractionTimings& timings, const Features* closer) {
  const CollectionView view = View(options.collection);
  CheckVocabulary(view, options);
  const auto in_region = [&](const Keypoint& k) { return Contains(*options.region, k.x, k.y); };
  if (options.region) features = Subset(features, in_region);
  CheckQuery(features, options.region);
  Features verified = closer != nullptr ? *closer : features;
  if (closer != nullptr && options.region) verified = Subset(verified, in_region);
  SearchResult result =
      SearchRun(ranker_.get(), &catalogue(), view, features, verified, options).Run();
  result.timings.extraction = timings;
  result.vocabulary = view.vocabulary;
  result.words = view.quantizer->vocabulary().size();
  result.keypoints = static_cast<std::uint32_t>(verified.keypoints.size());
  result.query_width = features.width;
  result.query_height = features.height;
  return result;
}

}  // namespace pliant
