// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: search.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "descriptor/base/error.h"
#include "index/engine/engine_impl.h"
#include "index/rank/ranking.h"
#include "index/store/blob_codec.h"
#include "index/verify/expansion.h"
#include "index/verify/features_subset.h"
#include "index/verify/rerank.h"

namespace pliant {
namespace {

using Clock = std::chrono::steady_clock;

double MsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

[[noreturn]] void ThrowInvalid(const std::string& field, const std::string& message) {
  throw Error(ErrorCode::kInvalidArgument, field + "_invalid", field + " " + message);
}

void Validate(const SearchOptions& options) {
  if (!std::isfinite(options.min_score) || options.min_score < 0 || options.min_score > 1) {
    ThrowInvalid("min_score", "must be 0 to 1");
  }
  if (options.threads < 0) ThrowInvalid("threads", "must not be negative");
  if (options.max_instances < 1) ThrowInvalid("max_instances", "must be 1 or more");
  if (options.tuning.assignments < 1 || options.tuning.assignments > 16) {
    ThrowInvalid("tuning.assignments", "must be 1 to 16");
  }
  if (options.expand && (*options.expand < 0 || *options.expand > kMostExpansions)) {
    ThrowInvalid("expand", "must be 0 to " + std::to_string(kMostExpansions));
  }
  CheckFilter(options.filter);
  if (!options.region) return;
  const Region& r = *options.region;
  for (const double value : {r.x, r.y, r.width, r.height}) {
    if (!std::isfinite(value)) ThrowInvalid("region", "must be four finite numbers");
  }
  if (r.width <= 0 || r.height <= 0) ThrowInvalid("region", "must have a width and height above 0");
}

bool Verifies(const SearchOptions& options) {
  if (options.verify == Verification::kAuto) return options.rank == RankMethod::kTfIdf;
  return options.verify == Verification::kTps;
}

// Another picture of an object that was found by one adds nothing where each object stands once.
int ExpansionsOf(const SearchOptions& options) {
  constexpr int kByPicture = 3;
  return options.expand.value_or(options.group_by == GroupBy::kImage ? kByPicture : 0);
}

RankOptions ToRankOptions(const SearchOptions& options) {
  RankOptions rank;
  rank.method = options.rank;
  rank.group_by = options.group_by;
  rank.keep = options.limit == 0 ? 0 : options.offset + options.limit;
  rank.min_score = options.min_score;
  rank.threads = options.threads;
  rank.signatures = options.tuning.signatures;
  return rank;
}

// Why there is nothing to say about a hit.
Explanation NotLookedAt(const SearchOptions& options, double ranking_score) {
  Explanation explanation;
  explanation.ranking_score = ranking_score;
  explanation.failure = Verifies(options)
                            ? "The picture was not looked at: only the best of the ranking are "
                              "verified. Raise the depth of verification to look at more."
                            : "The search does not verify.";
  return explanation;
}

Bow QueryBow(const Quantizer& quantizer, const Descriptors& descriptors,
             const SearchOptions& options) {
  const int several = options.tuning.assignments;
  if (several == 1) {
    return quantizer.BowOf(descriptors, 0, quantizer.Assign(descriptors, options.threads));
  }
  const auto words = quantizer.AssignSeveral(descriptors, several, options.threads);
  return quantizer.BowOf(descriptors, 0, words, static_cast<int>(words.size() / descriptors.rows));
}

bool Contains(const Region& region, const Keypoint& k) {
  return k.x >= region.x && k.x < region.x + region.width && k.y >= region.y &&
         k.y < region.y + region.height;
}

void CheckVocabulary(const CollectionView& view, const SearchOptions& options) {
  if (view.quantizer) return;
  throw Error(ErrorCode::kConflict, "no_vocabulary",
              "collection \"" + options.collection +
                  "\" has no vocabulary yet; add pictures and train one: pliant vocab train");
}

void CheckQuery(const Features& features, bool has_region) {
  if (features.keypoints.size() >= kMinKeypoints) return;
  throw Error(ErrorCode::kUnprocessable, "too_few_features",
              std::string(has_region ? "the region of the query picture" : "the query picture") +
                  " has " + std::to_string(features.keypoints.size()) + " key points, " +
                  std::to_string(kMinKeypoints) + " are the least");
}

}  // namespace

SearchResult Engine::Impl::Search(Bytes encoded, const SearchOptions& options) {
  Validate(options);
  CheckVocabulary(CurrentView(options.collection), options);  // before any work
  ExtractionTimings timings;
  Features features = extractor().Extract(encoded, options.threads, &timings);
  return Answer(InStoredPrecision(features), options, timings);
}

SearchResult Engine::Impl::SearchStored(const std::string& image_id, const SearchOptions& options) {
  Validate(options);
  return Answer(GetFeatures(options.collection, image_id), options, {});
}

SearchResult Engine::Impl::SearchFeatures(const Features& features, const SearchOptions& options) {
  Validate(options);
  if (features.model_id != model_.info.model_id) {
    throw Error(ErrorCode::kConflict, "model_mismatch",
                "the features are of " + features.model_id + ", the database holds " +
                    model_.info.model_id);
  }
  return Answer(InStoredPrecision(features), options, {});
}

SearchResult Engine::Impl::Answer(Features features, const SearchOptions& options,
                                  const ExtractionTimings& timings) {
  const CollectionView view = CurrentView(options.collection);
  CheckVocabulary(view, options);
  if (options.region) {
    features = Subset(features, [&](const Keypoint& k) { return Contains(*options.region, k); });
  }
  CheckQuery(features, options.region.has_value());

  SearchResult result;
  result.timings.extraction = timings;
  result.vocabulary = view.vocabulary;
  result.words = view.quantizer->vocabulary().size();
  result.keypoints = static_cast<std::uint32_t>(features.keypoints.size());
  result.query_width = features.width;
  result.query_height = features.height;

  Clock::time_point start = Clock::now();
  const Bow bow = QueryBow(*view.quantizer, features.descriptors, options);
  result.timings.quantize_ms = MsSince(start);

  start = Clock::now();
  const bool verify = Verifies(options);
  RankOptions rank = ToRankOptions(options);
  rank.accept = Admitted(options, view.collection);
  if (verify) {
    // Does not depend on the page, so that pages fit together.
    rank.candidates = options.verify_depth != 0 ? options.verify_depth
                                                : DefaultVerifyDepth(view.snapshot->pictures);
  }
  Ranking ranking = Rank(*view.snapshot, bow, rank);
  result.timings.rank_ms = MsSince(start);

  std::vector<VerifiedPicture> hits;
  if (verify) {
    start = Clock::now();
    hits = Verify(features, options, std::move(ranking.candidates));
    if (ExpansionsOf(options) > 0) ExpandBy(view, features, bow, options, rank, &hits, &ranking);
    SortByScore(&hits);
    std::erase_if(hits,
                  [&](const VerifiedPicture& p) { return p.picture.score < options.min_score; });
    if (options.group_by == GroupBy::kObject) KeepBestOfObjects(&hits);
    result.timings.verify_ms = MsSince(start);
  }
  result.total = hits.size() + ranking.total;
  for (RankedPicture& picture : ranking.best) hits.push_back({.picture = std::move(picture)});
  start = Clock::now();
  AddHits(hits, options, &result);
  result.timings.database_ms = MsSince(start);
  return result;
}

// Lifts the pictures that agree with the best verified ones, and takes those that were not looked
// at before out of the ranking's other hits.
void Engine::Impl::ExpandBy(const CollectionView& view, const Features& query, const Bow& bow,
                            const SearchOptions& options, const RankOptions& rank,
                            std::vector<VerifiedPicture>* hits, Ranking* ranking) {
  const auto nearest = [&](const Features& part, std::size_t depth) {
    RankOptions of_part = rank;
    of_part.group_by = GroupBy::kImage;
    of_part.candidates = depth;
    of_part.keep = 1;
    return Rank(*view.snapshot, QueryBow(*view.quantizer, part.descriptors, options), of_part)
        .candidates;
  };
  auto supports = Expand(*hits, {.sources = ExpansionsOf(options), .threads = options.threads},
                         Loader(query.model_id), nearest);
  std::unordered_set<Key> looked_at;
  for (const VerifiedPicture& hit : *hits) looked_at.insert(hit.picture.key);
  std::unordered_set<Key> found;
  for (const auto& [key, support] : supports) {
    if (!looked_at.contains(key)) found.insert(key);
  }
  if (!found.empty()) {
    RankOptions again = rank;
    again.also = &found;
    *ranking = Rank(*view.snapshot, bow, again);
    std::erase_if(ranking->candidates,
                  [&](const RankedPicture& picture) { return !found.contains(picture.key); });
    for (VerifiedPicture& hit : Verify(query, options, std::move(ranking->candidates))) {
      hits->push_back(std::move(hit));
    }
  }
  for (VerifiedPicture& hit : *hits) {
    const auto support = supports.find(hit.picture.key);
    if (support == supports.end() || support->second.evidence <= hit.evidence) continue;
    hit.evidence = support->second.evidence;
    hit.via = support->second.via;
    hit.picture.score = LiftScore(hit.ranking_score, hit.evidence);
  }
}

std::function<bool(Key, Key)> Engine::Impl::Admitted(const SearchOptions& options, Key collection) {
  if (!options.object && options.filter.empty()) return {};
  Key wanted = 0;
  bool any = true;  // of the objects
  if (options.object) {
    wanted = Read([&](Connection& db) { return FindObject(db, collection, *options.object); });
    if (wanted == 0 && !options.object->empty()) {
      return [](Key, Key) { return false; };  // there is no such object
    }
    any = false;
  }
  if (options.filter.empty()) return [wanted](Key, Key object) { return object == wanted; };
  const auto passing = std::make_shared<const std::vector<Key>>(
      Read([&](Connection& db) { return PicturesPassing(db, collection, options.filter); }));
  return [wanted, any, passing](Key key, Key object) {
    return (any || object == wanted) && std::binary_search(passing->begin(), passing->end(), key);
  };
}

std::function<std::optional<Features>(Key)> Engine::Impl::Loader(const std::string& model_id) {
  return [this, model_id](Key key) {
    return Read([&](Connection& db) -> std::optional<Features> {
      if (!FindPictureByKey(db, key)) return std::nullopt;  // removed since the snapshot
      Features features = DecodeFeatures(ReadFeaturesBlob(db, key));
      features.model_id = model_id;
      return features;
    });
  };
}

std::vector<VerifiedPicture> Engine::Impl::Verify(const Features& query,
                                                  const SearchOptions& options,
                                                  std::vector<RankedPicture> candidates) {
  return Rerank(query, std::move(candidates),
                {.max_instances = options.max_instances,
                 .explain = options.explain,
                 .threads = options.threads},
                Loader(query.model_id));
}

// The page of hits that `options` ask for.
void Engine::Impl::AddHits(std::vector<VerifiedPicture>& best, const SearchOptions& options,
                           SearchResult* result) {
  const std::size_t end =
      options.limit == 0 ? best.size() : std::min(best.size(), options.offset + options.limit);
  Read([&](Connection& db) {
    for (std::size_t i = options.offset; i < end; ++i) {
      const auto picture = FindPictureByKey(db, best[i].picture.key);
      if (!picture) continue;  // removed since the snapshot
      Hit hit;
      hit.rank = i + 1;
      hit.object = picture->record.object;
      hit.image_id = picture->record.id;
      hit.score = best[i].picture.score;
      hit.inliers = best[i].inliers();
      hit.instances = std::move(best[i].instances);
      hit.via = best[i].via;
      if (!hit.instances.empty()) hit.polygon = hit.instances.front().polygon;
      hit.metadata = picture->record.metadata;
      if (options.explain) {
        hit.explanation = best[i].explanation ? std::move(best[i].explanation)
                                              : NotLookedAt(options, best[i].picture.score);
      }
      result->hits.push_back(std::move(hit));
    }
    return 0;
  });
}

}  // namespace pliant
