// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/rerank.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>
#include <utility>

#include "descriptor/base/parallel.h"
#include "index/verify/outline.h"

namespace pliant {

std::size_t DefaultVerifyDepth(std::size_t pictures) {
  constexpr std::size_t kLeast = 100;
  return std::max(kLeast, static_cast<std::size_t>(std::sqrt(static_cast<double>(pictures))));
}

namespace {

std::vector<Instance> InstancesOf(const VerificationResult& result) {
  std::vector<Instance> instances;
  const auto add = [&](std::size_t inliers, const std::vector<Vec2>& outline) {
    Instance instance{static_cast<int>(inliers), {}};
    for (const Vec2 p : outline) instance.polygon.push_back({p.x, p.y});
    instances.push_back(std::move(instance));
  };
  if (result.verified()) add(result.inliers.size(), result.outline);
  for (const FurtherInstance& other : result.others) add(other.inliers.size(), other.outline);
  return instances;
}

std::vector<Vec2> SeenPart(const Features& features, const std::vector<MatchedPair>& inliers) {
  std::vector<Vec2> points;
  points.reserve(inliers.size());
  for (const MatchedPair& pair : inliers) {
    const Keypoint& k = features.keypoints[pair.reference];
    points.push_back({k.x, k.y});
  }
  return points.size() < 3 ? std::vector<Vec2>() : ConvexHull(std::move(points));
}

}  // namespace

std::vector<VerifiedPicture> Rerank(
    const Features& query, std::vector<RankedPicture> ranking, const RerankOptions& options,
    const std::function<std::optional<Features>(std::int64_t version)>& load) {
  std::vector<VerifiedPicture> pictures;
  pictures.reserve(ranking.size());
  for (RankedPicture& picture : ranking) {
    const double score = picture.score;
    pictures.push_back({.picture = std::move(picture), .ranking_score = score});
  }
  const Verifier verifier(query, {.max_instances = options.max_instances});
  ParallelFor(pictures.size(), options.threads, [&](std::size_t i) {
    VerifiedPicture& candidate = pictures[i];
    const auto features = load(candidate.picture.ref.version);
    if (!features) return;
    const VerificationResult result = verifier.Verify(*features);
    if (options.explain) {
      candidate.explanation = Explain(query, *features, result);
      candidate.explanation->ranking_score = candidate.picture.score;
    }
    candidate.instances = InstancesOf(result);
    candidate.seen = SeenPart(*features, result.inliers);
    candidate.evidence = Evidence(static_cast<int>(result.inliers.size()));
    candidate.picture.score = LiftScore(candidate.ranking_score, candidate.evidence);
  });
  return pictures;
}

void SortByScore(std::vector<VerifiedPicture>* pictures) {
  std::sort(pictures->begin(), pictures->end(),
            [](const VerifiedPicture& a, const VerifiedPicture& b) {
              if (a.picture.score != b.picture.score) return a.picture.score > b.picture.score;
              return a.picture.ref.id < b.picture.ref.id;
            });
}

void KeepBestOfObjects(std::vector<VerifiedPicture>* pictures) {
  std::unordered_set<std::int64_t> seen;
  std::erase_if(*pictures, [&](const VerifiedPicture& p) {
    return p.picture.object != 0 && !seen.insert(p.picture.object).second;
  });
}

}  // namespace pliant
