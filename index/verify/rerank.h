// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Verification of the best images of a ranking, and their order by the combined scores. Private
// to index/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <unordered_map>
#include <vector>

#include "descriptor/features/features.h"
#include "index/rank/ranker.h"
#include "index/records/search.h"
#include "index/verify/explain.h"
#include "index/verify/verification.h"

namespace pliant {

// A keypoint of the query that an image shows, too.
struct QueryMatch {
  std::uint32_t keypoint = 0;  // of the query
  float distance = 0;          // between the two descriptors
  float colour_factor = 0;     // larger the more the colours there differ; 0 = they are not known
};

struct VerifiedImage {
  RankedImage image;                           // score: the ranking's, lifted by `evidence`
  std::vector<Instance> instances = {};        // as in Hit
  std::vector<Explanation> explanations = {};  // as `instances`, or one; when asked for
  double ranking_score = 0;
  double by_chance = 4.5;                // InliersByChance of the query that it was verified with
  double probability = 0;                // that it is right (SuppressNonMaxima)
  double evidence = 0;                   // of its own inliers, or through `via` where that is more
  std::vector<QueryMatch> matches = {};  // of the inliers of all instances
  std::vector<Vec2> seen = {};           // hull of the inliers in this image, original pixels
  std::string via = {};  // id of the verified image that supports it (index/verify/expansion.h)

  int inliers() const { return instances.empty() ? 0 : instances.front().inliers; }
  double independent() const { return instances.empty() ? 0 : instances.front().independent; }
};

// Largest number of verified images by default: 100, or the square root of the collection's size
// if that is more, so that correct images do not fall below a fixed depth as the collection
// grows.
std::size_t DefaultVerifyDepth(std::size_t images);

struct RerankOptions {
  int max_instances = 1;
  bool explain = false;
  int threads = 1;  // images at a time; 0 = all cores
};

// Verifies the images of `ranking`, in its order. `load` gives an image's features by its
// ImageRef::version, or nothing for one that was removed meanwhile, which is left unverified; it
// is called from several threads. Deterministic.
std::vector<VerifiedImage> Rerank(
    const Features& query, std::vector<RankedImage> ranking, const RerankOptions& options,
    const std::function<std::optional<Features>(std::int64_t version)>& load);

// Whether the image, or one of them, agrees with the query as hardly any wrong one does (evidence
// of 1: 5.5 independent inliers).
bool Agrees(const VerifiedImage& image);
bool IsDecided(const std::vector<VerifiedImage>& images);

// Whether what was looked at, in the ranking's order, reaches twice as far as the last image that
// agrees: what shows the same, or something else in the query, is hardly ever further behind.
bool IsEnough(const std::vector<VerifiedImage>& looked_at);

// A few inliers are a hint where nothing better is known. In a decided search, images that have
// no more (evidence below 1, their own or through `via`) have the ranking's score again: what is
// left there is nearly all wrong, and not better ordered by what agrees by chance.
void DropWeakEvidence(std::vector<VerifiedImage>* images);

// Which objects match the keypoints of the query, and how near they are.
class NearestMatches {
 public:
  explicit NearestMatches(const std::vector<VerifiedImage>& images);

  // Whether no other named object is clearly nearer. `match`: of one of the images, of this
  // object.
  bool Keeps(std::int64_t object, const QueryMatch& match) const;

 private:
  struct Distances {
    float plain = 0;
    float with_colours = 0;  // infinite where no colours are known
  };
  static Distances Of(const QueryMatch& match);

  // The nearest distances by keypoint and object.
  std::unordered_map<std::uint32_t, std::unordered_map<std::int64_t, Distances>> nearest_;
};

// Exclusive assignment of matches: of the named objects whose images match a keypoint of the
// query, the one with the nearest descriptor has it (of nearly equally near ones each). Between two
// whose colours are both known, distances count more where the colours of what is seen differ
// (index/verify/colour_difference.h). The evidence of an image is multiplied by the square root of
// the share of its matches that its object keeps, and its score follows. Tells apart objects that
// have parts in common (notes of one series, packages of one brand): the common part agrees with
// all of them, and where they differ the right one is nearer. Images of one object, and those
// without a name, do not take from each other.
void KeepExclusiveMatches(std::vector<VerifiedImage>* images);

// By score, then id.
void SortByScore(std::vector<VerifiedImage>* images);

// Keeps the best image of each object; an image without object is a group of its own.
void KeepBestOfObjects(std::vector<VerifiedImage>* images);

}  // namespace pliant
