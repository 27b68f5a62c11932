// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rerank.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>
#include <utility>

#include "descriptor/parallel.h"

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

}  // namespace

std::vector<VerifiedPicture> Rerank(
    const Features& query, std::vector<RankedPicture> ranking, const RerankOptions& options,
    const std::function<std::optional<Features>(std::int64_t key)>& load) {
  std::vector<VerifiedPicture> pictures;
  pictures.reserve(ranking.size());
  for (RankedPicture& picture : ranking) pictures.push_back({std::move(picture), {}, {}});
  const Verifier verifier(query, {.max_instances = options.max_instances});
  ParallelFor(pictures.size(), options.threads, [&](std::size_t i) {
    VerifiedPicture& candidate = pictures[i];
    const auto features = load(candidate.picture.key);
    if (!features) return;
    const VerificationResult result = verifier.Verify(*features);
    if (options.explain) {
      candidate.explanation = Explain(query, *features, result);
      candidate.explanation->ranking_score = candidate.picture.score;
    }
    candidate.instances = InstancesOf(result);
    candidate.picture.score = CombineScores(
        candidate.picture.score, static_cast<int>(result.inliers.size()), result.inlier_fraction);
  });
  std::sort(pictures.begin(), pictures.end(),
            [](const VerifiedPicture& a, const VerifiedPicture& b) {
              if (a.picture.score != b.picture.score) return a.picture.score > b.picture.score;
              return a.picture.id < b.picture.id;
            });
  return pictures;
}

void KeepBestOfObjects(std::vector<VerifiedPicture>* pictures) {
  std::unordered_set<std::int64_t> seen;
  std::erase_if(*pictures, [&](const VerifiedPicture& p) {
    return p.picture.object != 0 && !seen.insert(p.picture.object).second;
  });
}

}  // namespace pliant
