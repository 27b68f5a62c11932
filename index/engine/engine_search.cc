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
  const CollectionView view = View(options.collection);
  CheckVocabulary(view, options);  // before any work
  ExtractionTimings timings;
  const FeatureExtractor& extractor = query_extractor();
  const Features features =
      options.region ? extractor.ExtractPart(encoded, *options.region, options.threads, &timings)
                     : extractor.Extract(encoded, options.threads, &timings);
  return Answer(view, InStoredPrecision(features), options, timings, [&](ExtractionTimings* more) {
    return extractor.LookCloser(encoded, features, options.region, options.threads, more);
  });
}

SearchResult Engine::Impl::SearchStored(const std::string& image_id, const SearchOptions& options) {
  Validate(options);
  const CollectionView view = View(options.collection);
  return Answer(view, GetFeatures({view.collection, image_id}, options.collection), options, {});
}

SearchResult Engine::Impl::SearchFeatures(const Features& features, const SearchOptions& options,
                                          const SecondPass& second) {
  Validate(options);
  const std::string& model_id = store_->model().info.model_id;
  if (features.model_id != model_id) {
    throw Error(ErrorCode::kConflict, "model_mismatch",
                "the features are of " + features.model_id + ", the database holds " + model_id);
  }
  return Answer(View(options.collection), InStoredPrecision(features), options, {}, second);
}

SearchResult Engine::Impl::Answer(const CollectionView& view, Features features,
                                  const SearchOptions& options, const ExtractionTimings& timings,
                                  const SecondPass& second) {
  CheckVocabulary(view, options);
  const auto of_region = [&](Features all) {
    if (!options.region) return all;
    return Subset(all, [&](const Keypoint& k) { return Contains(*options.region, k.x, k.y); });
  };
  features = of_region(std::move(features));
  CheckQuery(features, options.region);
  SearchRun run(ranker_.get(), &catalogue(), view, features, options);
  SearchResult result = run.Run(features);
  std::size_t keypoints = features.keypoints.size();
  ExtractionTimings extraction = timings;
  const bool found_nothing = result.found == std::size_t{0} && !result.undecided;
  if (second && options.second_pass && found_nothing) {
    if (std::optional<Features> finer = second(&extraction)) {
      const Features verified = of_region(InStoredPrecision(*std::move(finer)));
      SearchResult again = run.Run(verified);
      // Without evidence the first order is the better one: fine key points resemble much by
      // chance.
      if (again.evidence > result.evidence) {
        result = std::move(again);
        keypoints = verified.keypoints.size();
      } else {
        result.timings = again.timings;
      }
      result.second_pass = true;
    }
  }
  result.timings.extraction = extraction;
  result.vocabulary = view.vocabulary;
  result.words = view.quantizer->vocabulary().size();
  result.keypoints = static_cast<std::uint32_t>(keypoints);
  result.query_width = features.width;
  result.query_height = features.height;
  return result;
}

}  // namespace pliant
