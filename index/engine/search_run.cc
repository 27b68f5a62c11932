// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/search_run.h"

#include <algorithm>
#include <iterator>
#include <unordered_set>
#include <utility>

#include "descriptor/base/stopwatch.h"
#include "descriptor/features/keypoints.h"
#include "index/store/blob_codec.h"
#include "index/verify/suppression.h"
#include "index/verify/verification.h"

namespace pliant {
namespace {

bool IsAdmitted(const Admission& admission, const ImageRecord& record) {
  const auto& without = admission.without;
  return std::find(without.begin(), without.end(), record.id) == without.end() &&
         (!admission.object || *admission.object == record.object) &&
         Passes(admission.filter, record.metadata);
}

// Number of images whose features are in memory at a time.
constexpr std::size_t kImagesABatch = 256;
// Number of images that are verified before the depth is checked.
constexpr std::size_t kFirstImages = 30;

// Factor of the depth of an undecided search.
constexpr std::size_t kDeeper = 2;

bool Verifies(const SearchOptions& options) {
  if (options.verify == Verification::kAuto) return options.rank != RankMethod::kHistogram;
  return options.verify == Verification::kTps;
}

// Why there is nothing to say about a hit.
Explanation NotLookedAt(const SearchOptions& options, double ranking_score) {
  Explanation explanation;
  explanation.ranking_score = ranking_score;
  explanation.failure = Verifies(options)
                            ? "The image was not verified: the search verifies only the best "
                              "candidates. Raise the verification depth to verify more."
                            : "This search does not use verification.";
  return explanation;
}

}  // namespace

// Verifies what was ranked, a batch of it at a time.
class CandidateVerifier {
 public:
  // All must outlive it. Times are added to `timings`.
  CandidateVerifier(const Features& query, std::size_t usual_keypoints,
                    const SearchOptions& options, CandidateCache* cache, SearchTimings* timings)
      : query_(query),
        usual_keypoints_(usual_keypoints),
        options_(options),
        cache_(*cache),
        timings_(*timings) {}

  // Those of the candidates that are surely verified: worth reading with the first batch.
  std::span<const RankedImage> FirstBatch(std::span<const RankedImage> candidates) const {
    return candidates.first(std::min(candidates.size(), BatchAfter(0)));
  }

  // In their order, the verified ones first: as many as it takes (IsEnough), or all where the
  // search names its depth. The others as they were ranked.
  std::vector<VerifiedImage> Verify(std::vector<RankedImage> candidates) {
    return Run(std::move(candidates), /*all=*/options_.verify_depth != 0);
  }

  std::vector<VerifiedImage> VerifyAll(std::vector<RankedImage> candidates) {
    return Run(std::move(candidates), /*all=*/true);
  }

 private:
  // Size of the next batch, after `looked_at` images.
  std::size_t BatchAfter(std::size_t looked_at) const {
    if (options_.verify_depth != 0) return kImagesABatch;
    return std::clamp(looked_at, kFirstImages, kImagesABatch);
  }

  void VerifyBatch(std::vector<RankedImage> batch, std::vector<VerifiedImage>* verified) {
    {
      const ScopedStopwatch watch(&timings_.database_ms);
      if (!verified->empty()) cache_.DropFeatures();
      cache_.Fetch(batch, Load::kRecordsAndFeatures);  // nothing to do for the first
    }
    const ScopedStopwatch watch(&timings_.verify_ms);
    auto hits = Rerank(query_, std::move(batch),
                       {.max_instances = options_.max_instances,
                        .usual_keypoints = usual_keypoints_,
                        .explain = options_.explain,
                        .threads = options_.threads},
                       [&](std::int64_t version) { return cache_.LoadFeatures(version); });
    std::move(hits.begin(), hits.end(), std::back_inserter(*verified));
  }

  std::vector<VerifiedImage> Run(std::vector<RankedImage> candidates, bool all) {
    std::vector<VerifiedImage> verified;
    while (verified.size() < candidates.size()) {
      const auto begin = candidates.begin() + static_cast<std::ptrdiff_t>(verified.size());
      const auto left = static_cast<std::size_t>(candidates.end() - begin);
      const auto end =
          begin + static_cast<std::ptrdiff_t>(std::min(left, BatchAfter(verified.size())));
      VerifyBatch({std::make_move_iterator(begin), std::make_move_iterator(end)}, &verified);
      if (!all && IsEnough(verified)) break;
    }
    for (std::size_t i = verified.size(); i < candidates.size(); ++i) {
      const double score = candidates[i].score;
      verified.push_back({.image = std::move(candidates[i]), .ranking_score = score});
    }
    return verified;
  }

  const Features& query_;
  const std::size_t usual_keypoints_;  // of the query; more come from the second pass
  const SearchOptions& options_;
  CandidateCache& cache_;
  SearchTimings& timings_;
};

void CandidateCache::Fetch(std::span<const RankedImage> images, Load what) {
  std::vector<ImageRef> wanted;
  for (const RankedImage& image : images) {
    const auto here = images_.find(image.ref.version);
    const bool enough = here != images_.end() && (what == Load::kRecords || !here->second ||
                                                  !here->second->features.empty());
    if (!enough) wanted.push_back(image.ref);
  }
  if (wanted.empty()) return;
  std::vector<std::optional<StoredImage>> loaded = source_.LoadImages(wanted, what);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const bool other = loaded[i] && loaded[i]->version != wanted[i].version;
    if (other && !IsAdmitted(admission_, loaded[i]->record)) loaded[i].reset();
    images_[wanted[i].version] = std::move(loaded[i]);
  }
}

void CandidateCache::DropFeatures() {
  for (auto& [version, image] : images_) {
    if (image) image->features = {};
  }
}

const ImageRecord* CandidateCache::Record(std::int64_t version) const {
  const auto here = images_.find(version);
  return here != images_.end() && here->second ? &here->second->record : nullptr;
}

std::optional<Features> CandidateCache::LoadFeatures(std::int64_t version) const {
  const auto here = images_.find(version);
  if (here == images_.end() || !here->second) return std::nullopt;
  Features features = DecodeFeatures(here->second->features);
  features.model_id = model_id_;
  return features;
}

SearchRun::SearchRun(EngineCore* core, const CollectionView& view, const Features& query,
                     const SearchOptions& options)
    : core_(*core),
      view_(view),
      query_(query),
      options_(options),
      ranked_by_(ToRankQuery()),
      rank_([&] {
        const ScopedStopwatch watch(&timings_.rank_ms);
        return ToRankOptions();
      }()),
      cache_(&core->catalogue(), &rank_.admission, query.model_id),
      ranking_(Rank(rank_)),
      found_from_(core->catalogue().RequireCollection(options.collection).found_from) {}

Ranking SearchRun::Rank(const RankOptions& options) {
  const ScopedStopwatch watch(&timings_.rank_ms);
  return core_.Rank(view_, ranked_by_, options);
}

SearchResult SearchRun::Run(const Features& features) {
  Ranking ranking = ranking_;
  std::vector<VerifiedImage> hits = Verified(features, &ranking);
  SearchResult result;
  result.rank = options_.rank;
  result.searched = ranking.searched;
  result.found_from = found_from_;
  result.total = hits.size() + ranking.total;
  if (!hits.empty()) result.evidence = hits.front().evidence;
  if (KnowsProbabilities()) {
    Judge(hits, &result);
    undecided_ = result.found == std::size_t{0} && std::ranges::any_of(hits, [&](const auto& hit) {
                   return Probability(hit.ranking_score, hit.evidence) >= found_from_;
                 });
  }
  // Images that were not verified are no more probable than those that were: these ranked higher.
  double most = hits.empty() ? 1 : hits.back().probability;
  for (RankedImage& image : ranking.best) {
    most = std::min(most, Rounded(Probability(image.score, /*evidence=*/0)));
    hits.push_back({.image = std::move(image), .probability = most});
  }
  result.hits = PageOf(std::move(hits));
  result.timings = timings_;
  return result;
}

std::vector<VerifiedImage> SearchRun::Verified(const Features& features, Ranking* ranking) {
  CandidateVerifier verifier(features, query_.keypoints.size(), options_, &cache_, &timings_);
  depth_ = ranking->depth;
  Fetch(verifier);
  if (!Verifies(options_)) return {};
  std::vector<VerifiedImage> hits = verifier.Verify(std::move(ranking->candidates));
  VerifyDeeper(&verifier, &hits, ranking);
  KeepExclusiveMatches(&hits);
  SuppressNonMaxima(features, &hits);
  SortByProbability(&hits);
  std::erase_if(hits, [&](const auto& hit) { return hit.image.score < options_.min_score; });
  if (options_.group_by == GroupBy::kObject) KeepBestOfObjects(&hits);
  return hits;
}

bool SearchRun::KnowsProbabilities() const {
  return Verifies(options_) && options_.rank == RankMethod::kNeighbours;
}

RankQuery SearchRun::ToRankQuery() {
  if (options_.rank == RankMethod::kHistogram) {
    const ScopedStopwatch watch(&timings_.quantize_ms);
    return {.method = RankMethod::kHistogram,
            .bow = MakeBow(view_.quantizer->Assign(query_.descriptors, options_.threads))};
  }
  const ScopedStopwatch watch(&timings_.rank_ms);
  return NeighboursOf(query_.descriptors, ContrastWeights(query_.keypoints), *view_.quantizer,
                      options_.threads);
}

RankOptions SearchRun::ToRankOptions() const {
  RankOptions rank;
  rank.group_by = options_.group_by;
  rank.keep = options_.limit == 0 ? 0 : options_.offset + options_.limit;
  rank.min_score = options_.min_score;
  rank.threads = options_.threads;
  rank.partial = options_.partial;
  rank.admission =
      core_.catalogue().Admit(view_.collection, options_.object, options_.filter, options_.without);
  if (Verifies(options_)) {
    // Does not depend on the page, so that pages fit together.
    rank.candidates = [depth = options_.verify_depth](std::size_t images) {
      return depth != 0 ? depth : DefaultVerifyDepth(images);
    };
  }
  return rank;
}

// The first batch: what is verified, or else the page. Only a page that reaches behind the verified
// images reads once more (PageOf).
void SearchRun::Fetch(const CandidateVerifier& verifier) {
  const ScopedStopwatch watch(&timings_.database_ms);
  const std::span<const RankedImage> candidates = ranking_.candidates;
  if (!candidates.empty()) {
    cache_.Fetch(verifier.FirstBatch(candidates), Load::kRecordsAndFeatures);
  } else {
    const std::span<const RankedImage> best = ranking_.best;
    cache_.Fetch(best.subspan(std::min(options_.offset, best.size())), Load::kRecords);
  }
}

// Verifies more of the ranking where no image agrees with the query and the depth is left to the
// search. Depends on nothing but the query and the collection, so that pages fit together.
void SearchRun::VerifyDeeper(CandidateVerifier* verifier, std::vector<VerifiedImage>* hits,
                             Ranking* ranking) {
  if (IsDecided(*hits) || options_.verify_depth != 0 || hits->size() < depth_) return;
  depth_ *= kDeeper;
  if (!deeper_) {
    RankOptions deeper = rank_;
    deeper.candidates = [depth = depth_](std::size_t) { return depth; };
    deeper_ = Rank(deeper);
  }
  *ranking = *deeper_;
  // By id: an image may have been replaced since.
  std::unordered_set<std::string> looked_at;
  for (const VerifiedImage& hit : *hits) looked_at.insert(hit.image.ref.id);
  for (auto* images : {&ranking->candidates, &ranking->best}) {
    std::erase_if(*images,
                  [&](const RankedImage& image) { return looked_at.contains(image.ref.id); });
  }
  for (VerifiedImage& hit : verifier->VerifyAll(std::move(ranking->candidates))) {
    hits->push_back(std::move(hit));
  }
}

// The page of hits that the options ask for.
std::vector<Hit> SearchRun::PageOf(std::vector<VerifiedImage> hits) {
  const std::size_t begin = std::min(options_.offset, hits.size());
  const std::size_t end =
      options_.limit == 0 ? hits.size() : std::min(hits.size(), options_.offset + options_.limit);
  std::vector<RankedImage> shown;
  for (std::size_t i = begin; i < end; ++i) shown.push_back(hits[i].image);
  const ScopedStopwatch watch(&timings_.database_ms);
  cache_.Fetch(shown, Load::kRecords);
  std::vector<Hit> page;
  for (std::size_t i = begin; i < end; ++i) {
    VerifiedImage& found = hits[i];
    const ImageRecord* record = cache_.Record(found.image.ref.version);
    if (record == nullptr) continue;  // removed since it was ranked
    Hit hit;
    hit.rank = i + 1;
    hit.object = record->object;
    hit.image_id = record->id;
    hit.score = found.image.score;
    if (KnowsProbabilities()) hit.probability = found.probability;
    hit.inliers = found.inliers();
    hit.instances = std::move(found.instances);
    if (!hit.instances.empty()) hit.polygon = hit.instances.front().polygon;
    hit.metadata = record->metadata;
    hit.source = record->source;
    if (options_.explain) {
      hit.explanation = found.explanations.empty() ? NotLookedAt(options_, found.image.score)
                                                   : std::move(found.explanations.front());
    }
    page.push_back(std::move(hit));
  }
  return page;
}

}  // namespace pliant
