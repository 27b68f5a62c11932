// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Options and results of searches (Engine). Plain values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "descriptor/features/descriptor.h"
#include "index/records/explanation.h"
#include "index/records/filter.h"

namespace pliant {

inline constexpr const char* kDefaultCollection = "default";

enum class RankMethod {
  // Votes of the query's descriptors for images with similar descriptors: 1 = a copy that resembles
  // no other image, 0 = nothing nearer than usual.
  kNeighbours,
  kHistogram,  // the paper's: normalised word frequencies, 1 - Euclidean distance / sqrt(2)
};
enum class GroupBy { kObject, kImage };
enum class Verification {
  kAuto,  // kTps for neighbours; kNone for the paper's histogram, whose protocol has none
  kNone,
  kTps,  // one smooth warp, a thin-plate spline
};

struct Point {
  double x = 0, y = 0;
};

inline constexpr std::size_t kMaxExcluded = 1000;
inline constexpr std::size_t kMaxExamples = 16;

// A hit with at least this probability counts as found, unless its collection says otherwise.
inline constexpr double kFoundProbability = 0.9;
// Collections can have another limit (CollectionRecord::found_from), in this range.
inline constexpr double kLeastFoundFrom = 0.5;
inline constexpr double kMostFoundFrom = 0.99;
// With at least this probability, but less than kFoundProbability, it perhaps shows the object.
inline constexpr double kPerhapsProbability = 0.2;

struct SearchOptions {
  std::string collection = kDefaultCollection;
  std::size_t limit = 10;  // hits returned; 0 = all
  std::size_t offset = 0;
  RankMethod rank = RankMethod::kNeighbours;
  GroupBy group_by = GroupBy::kObject;
  // kTps: the query and each of the best images must fit one smooth warp. Inliers raise an image's
  // score (index/verify/verification.h, LiftScore): the order changes, but no score falls.
  Verification verify = Verification::kAuto;
  // Number of verified images. 0 = adaptive: at least 30, and twice the rank of the last image with
  // strong evidence, but at most 100 or sqrt(images), whichever is more. Twice that if none has
  // strong evidence.
  std::size_t verify_depth = 0;
  int max_instances = 20;  // of one object in the query image; at least 1
  // For Engine::Search with probabilities. If nothing is found, a second pass describes the query
  // image at high resolution (FeatureExtractor::ExtractSecondPass). The result is that of the pass
  // whose first hit has more evidence. If little evidence is found, and without a region, a third
  // one looks for mirrored objects.
  bool second_pass = true;
  std::optional<Region> region;  // only this part of the query, in pixels of the upright original
  double min_score = 0;
  std::optional<std::string> object;  // only images of this object
  Filter filter;                      // only images whose metadata pass
  std::vector<std::string> without;   // ids of excluded images; at most kMaxExcluded
  bool explain = false;               // fill Hit::explanation
  bool partial = false;               // also if some parts of the index do not answer
  int threads = 0;                    // to describe the query; 0 = all cores
};

// One instance of the object in the query image.
struct Instance {
  int inliers = 0;
  double independent = 0;      // effective inlier count (EffectiveInliers)
  std::vector<Point> polygon;  // outline in the query image
};

struct Hit {
  std::size_t rank = 0;  // 1-based, over all pages
  std::string object;
  std::string image_id;  // the best image of the object
  std::string source;    // its file name as given; can be empty
  double score = 0;      // 0..1, see RankMethod; when verified, LiftScore
  // Probability that the hit is correct (index/verify/verification.h, Probability). Absent without
  // verification, and for rankings other than kNeighbours.
  std::optional<double> probability;
  int inliers = 0;             // verified matches; 0 when not verified
  std::vector<Point> polygon;  // outline of the object in the query image; empty when unknown
  // All instances of the object, most inliers first. The first repeats `inliers` and `polygon`.
  // Empty if not verified. Further instances do not raise the score.
  std::vector<Instance> instances;
  // In a search by several examples: this hit's best example. All positions are in its pixels.
  std::string example;
  std::string metadata = "{}";
  std::optional<Explanation> explanation;  // with SearchOptions::explain
};

// A stored image as one of several queries.
struct SearchExample {
  std::string image_id;
  std::uint32_t keypoints = 0;
  int width = 0;  // of the original upright image, in pixels
  int height = 0;
};

struct SearchTimings {
  ExtractionTimings extraction;
  double quantize_ms = 0;
  double rank_ms = 0;
  double verify_ms = 0;
  double database_ms = 0;  // reading verified and returned images
};

struct SearchResult {
  std::vector<Hit> hits;
  std::size_t total = 0;  // number of hits, over all pages
  // Number of hits with a probability of `found_from` or more. 0 = the object is not in the
  // collection, unless `perhaps`. Absent if hits have no probability.
  std::optional<std::size_t> found;
  double found_from = kFoundProbability;  // CollectionRecord::found_from
  // Nothing is found, but the first hit has kPerhapsProbability or more: similar objects share the
  // probability, or little of the object is visible.
  bool perhaps = false;
  double searched = 1;       // share of the index that was ranked (SearchOptions::partial)
  double evidence = 0;       // of the first hit over all pages (VerifiedImage)
  bool second_pass = false;  // a second pass was made; this can be either pass's result
  bool mirrored = false;     // the query shows the first hit mirrored, as a selfie does
  RankMethod rank = RankMethod::kNeighbours;  // the method used
  std::int64_t vocabulary = 0;                // id of the vocabulary used
  std::size_t words = 0;                      // its size
  std::uint32_t keypoints = 0;                // of the query, after the region
  int query_width = 0;                        // of the original upright query image, in pixels
  int query_height = 0;
  std::vector<SearchExample> examples;  // of a search by several examples; then query_* are 0
  SearchTimings timings;
};

// Whether two images show the same object (Engine::Compare).
struct ComparedImage {
  int width = 0;  // original, upright, in pixels
  int height = 0;
  std::uint32_t keypoints = 0;
};

struct Comparison {
  ComparedImage first;
  ComparedImage second;
  // As in a search by the second image with the first as a hit: the second is the query, the first
  // the reference. ranking_score is kVerify.most_of_ranking, since nothing is ranked.
  Explanation explanation;
  std::vector<Point> outline;  // of the first image's object, in the second image; empty = unknown
  // Probability that both show the same object: that of a hit with these inliers and no support by
  // the ranking (index/verify/verification.h, Probability).
  double probability = 0;
  ExtractionTimings timings;  // of both images
  double verify_ms = 0;

  bool found() const { return probability >= kFoundProbability; }
  bool perhaps() const { return !found() && probability >= kPerhapsProbability; }
};

}  // namespace pliant
