// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Verification of the best images of a ranking, and their order by the combined scores. Private to
// index/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <unordered_map>
#include <vector>

#include "descriptor/features/features.h"
#include "index/rank/ranking.h"
#include "index/records/search.h"
#include "index/verify/judgement.h"
#include "index/verify/verification.h"

namespace pliant {

// A keypoint of the query that matches an image.
struct QueryMatch {
  std::uint32_t keypoint = 0;  // of the query
  float distance = 0;          // between the two descriptors
  float colour_factor = 0;     // the larger, the more the colours there differ; 0 = unknown
};

struct VerifiedImage {
  RankedImage image;                           // score: the ranking's, lifted by `evidence`
  std::vector<Instance> instances = {};        // as in Hit
  std::vector<Explanation> explanations = {};  // as `instances`, or one; when asked for
  double ranking_score = 0;
  std::vector<double> likeness = {};             // as `instances`; empty without evidence
  double by_chance = kVerify.inliers_by_chance;  // InliersByChance of the pair
  double probability = 0;                        // that the hit is correct (SuppressNonMaxima)
  double evidence = 0;                           // of the inliers
  std::vector<QueryMatch> matches = {};          // of the inliers of all instances

  int inliers() const { return instances.empty() ? 0 : instances.front().inliers; }
  double effective_inliers() const { return instances.empty() ? 0 : instances.front().independent; }
};

// Largest number of verified images by default: 100, or the square root of the collection's size if
// that is more, so that correct images stay within the depth as the collection grows.
std::size_t DefaultVerifyDepth(std::size_t images);

struct RerankOptions {
  int max_instances = 1;
  std::size_t usual_keypoints = 0;  // as VerificationOptions
  bool explain = false;
  int threads = 1;  // images at a time; 0 = all cores
};

// Verifies the images of `ranking`, in its order. `load` returns an image's features by its
// ImageRef::version, or nothing for a removed image, which stays unverified; it is called from
// several threads. Deterministic.
std::vector<VerifiedImage> Rerank(
    const Features& query, std::vector<RankedImage> ranking, const RerankOptions& options,
    const std::function<std::optional<Features>(std::int64_t version)>& load);

// Whether one of the images has evidence, as hardly any wrong one has.
bool IsDecided(const std::vector<VerifiedImage>& images);

// Whether the verified images, in the ranking's order, reach twice as far as the last one with
// evidence: correct images, or those of another object in the query, are hardly ever further
// down.
bool IsEnough(const std::vector<VerifiedImage>& verified);

// Which objects match the keypoints of the query, and how near they are.
class NearestMatches {
 public:
  explicit NearestMatches(const std::vector<VerifiedImage>& images);

  // Whether no other named object is clearly nearer. `match`: of one of the images of this object.
  bool Keeps(std::int64_t object, const QueryMatch& match) const;

 private:
  struct Distances {
    float plain = 0;
    float with_colours = 0;  // infinite if the colours are unknown
  };
  static Distances Of(const QueryMatch& match);

  // The nearest distances by keypoint and object.
  std::unordered_map<std::uint32_t, std::unordered_map<std::int64_t, Distances>> nearest_;
};

// Exclusive assignment of matches: of the named objects whose images match a keypoint of the query,
// the one with the nearest descriptor keeps the match (if several are nearly equally near, each
// does). If the colours of both are known, distances count more where the colours differ
// (index/verify/colour_difference.h). The evidence of an image is multiplied by the square root of
// the share of its matches that its object keeps, and its score follows. This tells apart objects
// with common parts (notes of one series, packages of one brand): all of them match the common
// part, and where they differ the correct one is nearer. Images of one object, and images without a
// name, do not compete.
void KeepExclusiveMatches(std::vector<VerifiedImage>* images);

// By probability, then score, then id.
void SortByProbability(std::vector<VerifiedImage>* images);

// Keeps the best image of each object, and all images without object.
void KeepBestOfObjects(std::vector<VerifiedImage>* images);

}  // namespace pliant
