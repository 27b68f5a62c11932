// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/rerank.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <unordered_set>
#include <utility>

#include "descriptor/base/parallel.h"
#include "index/verify/appearance.h"
#include "index/verify/warp_geometry.h"

namespace pliant {
namespace {

// Fitted to real packages and banknotes. Only the ratio to other images' factors matters.
float ColourFactor(const std::optional<double>& difference) {
  return difference ? static_cast<float>(std::sqrt(kVerify.chroma_noise + *difference)) : 0.0F;
}

void AddInstance(const FoundInstance& found, VerifiedImage* image) {
  Instance instance{static_cast<int>(found.inliers.size()), found.effective_inliers, {}};
  for (const Vec2 p : found.outline) instance.polygon.push_back({p.x, p.y});
  image->instances.push_back(std::move(instance));
  const float factor = ColourFactor(found.colour_difference);
  for (std::size_t i = 0; i < found.inliers.size(); ++i) {
    image->matches.push_back({found.inliers[i].query, found.distances[i], factor});
  }
}

bool HasEvidence(const VerifiedImage& image) { return image.evidence > 0; }

void Compare(const Features& query, const Features& reference, const VerificationResult& result,
             VerifiedImage* image) {
  const auto add = [&](const FoundInstance& found) {
    const auto appearance = CompareAppearance(query, reference, found);
    if (!image->explanations.empty()) {
      image->explanations[image->likeness.size()].appearance = appearance;
    }
    image->likeness.push_back(Likeness(appearance, found.effective_inliers));
  };
  add(result);
  std::ranges::for_each(result.others, add);
}

}  // namespace

std::size_t DefaultVerifyDepth(std::size_t images) {
  return std::max(kVerify.least_depth,
                  static_cast<std::size_t>(std::sqrt(static_cast<double>(images))));
}

std::vector<VerifiedImage> Rerank(
    const Features& query, std::vector<RankedImage> ranking, const RerankOptions& options,
    const std::function<std::optional<Features>(std::int64_t version)>& load) {
  std::vector<VerifiedImage> images;
  images.reserve(ranking.size());
  for (RankedImage& image : ranking) {
    const double score = image.score;
    images.push_back({.image = std::move(image), .ranking_score = score});
  }
  const Verifier verifier(
      query, {.max_instances = options.max_instances, .usual_keypoints = options.usual_keypoints});
  ParallelFor(images.size(), options.threads, [&](std::size_t i) {
    VerifiedImage& candidate = images[i];
    const auto features = load(candidate.image.ref.version);
    if (!features) return;
    const VerificationResult result = verifier.Verify(*features);
    if (options.explain) {
      candidate.explanations = ExplainInstances(query, *features, result);
      for (Explanation& explanation : candidate.explanations) {
        explanation.ranking_score = candidate.image.score;
      }
    }
    if (result.verified()) AddInstance(result, &candidate);
    for (const FoundInstance& other : result.others) AddInstance(other, &candidate);
    candidate.by_chance =
        InliersByChance(query.keypoints.size(), result.distinctness, result.agreeing);
    candidate.evidence = Evidence(result.effective_inliers, candidate.by_chance);
    candidate.image.score = LiftScore(candidate.ranking_score, candidate.evidence);
    if (HasEvidence(candidate)) Compare(query, *features, result, &candidate);
  });
  return images;
}

bool IsDecided(const std::vector<VerifiedImage>& images) {
  return std::ranges::any_of(images, HasEvidence);
}

bool IsEnough(const std::vector<VerifiedImage>& verified) {
  const auto last = std::find_if(verified.rbegin(), verified.rend(), HasEvidence);
  return last != verified.rend() && 2 * (verified.rend() - last) <= std::ssize(verified);
}

NearestMatches::Distances NearestMatches::Of(const QueryMatch& match) {
  return {.plain = match.distance,
          .with_colours = match.colour_factor > 0
                              ? (kVerify.least_distance + match.distance) * match.colour_factor
                              : std::numeric_limits<float>::infinity()};
}

NearestMatches::NearestMatches(const std::vector<VerifiedImage>& images) {
  for (const VerifiedImage& image : images) {
    if (image.image.object == 0) continue;
    for (const QueryMatch& match : image.matches) {
      const Distances distances = Of(match);
      const auto [at, is_new] = nearest_[match.keypoint].try_emplace(image.image.object, distances);
      if (is_new) continue;
      at->second.plain = std::min(at->second.plain, distances.plain);
      at->second.with_colours = std::min(at->second.with_colours, distances.with_colours);
    }
  }
}

bool NearestMatches::Keeps(std::int64_t object, const QueryMatch& match) const {
  const auto& objects = nearest_.at(match.keypoint);
  const Distances own = objects.at(object);
  return std::all_of(objects.begin(), objects.end(), [&](const auto& entry) {
    const Distances& other = entry.second;
    const bool both = std::isfinite(own.with_colours) && std::isfinite(other.with_colours);
    return both ? own.with_colours <= kVerify.as_near * other.with_colours
                : own.plain <= kVerify.as_near * other.plain;
  });
}

void KeepExclusiveMatches(std::vector<VerifiedImage>* images) {
  const NearestMatches nearest(*images);
  for (VerifiedImage& image : *images) {
    const std::int64_t object = image.image.object;
    if (object == 0 || image.matches.empty()) continue;
    const auto kept = std::ranges::count_if(
        image.matches, [&](const QueryMatch& match) { return nearest.Keeps(object, match); });
    const double share = static_cast<double>(kept) / static_cast<double>(image.matches.size());
    image.evidence = Evidence(image.effective_inliers(), image.by_chance, share);
    image.image.score = LiftScore(image.ranking_score, image.evidence);
  }
}

void SortByProbability(std::vector<VerifiedImage>* images) {
  std::sort(images->begin(), images->end(), [](const VerifiedImage& a, const VerifiedImage& b) {
    // Equally probable: by score.
    if (a.probability != b.probability) return a.probability > b.probability;
    if (a.image.score != b.image.score) return a.image.score > b.image.score;
    return a.image.ref.id < b.image.ref.id;
  });
}

void KeepBestOfObjects(std::vector<VerifiedImage>* images) {
  std::unordered_set<std::int64_t> seen;
  std::erase_if(*images, [&](const VerifiedImage& p) {
    return p.image.object != 0 && !seen.insert(p.image.object).second;
  });
}

}  // namespace pliant
