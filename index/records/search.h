// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Options and results of searches (EngineSearch). Plain values.
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
  // Votes of the query's descriptors for images with descriptors near them: 1 = a copy that is
  // like nothing else, 0 = nothing nearer than usual.
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

inline constexpr int kMostExpansions = 20;

inline constexpr std::size_t kMaxExcluded = 1000;
inline constexpr std::size_t kMaxExamples = 16;

// A hit that is at least so probable is said to be found.
inline constexpr double kFoundProbability = 0.9;

struct SearchOptions {
  std::string collection = kDefaultCollection;
  std::size_t limit = 10;  // hits returned; 0 = all
  std::size_t offset = 0;
  RankMethod rank = RankMethod::kNeighbours;
  GroupBy group_by = GroupBy::kObject;
  // kTps: the best images must agree with the query on one smooth warp; inliers lift their scores
  // (index/verify/verification.h, LiftScore), so the order changes but no score falls.
  Verification verify = Verification::kAuto;
  // Images verified. 0 = 30, and more until it is twice as far down the ranking as the last that
  // agrees, up to 100 or sqrt(images) where that is more; twice that where none agrees.
  std::size_t verify_depth = 0;
  // Query expansion (index/verify/expansion.h), only with verification: the region of the object in
  // this many of the best verified images is used as a further query, and images that agree
  // with them rise. 0 to kMostExpansions. Absent: 3 by image, 0 by object, where further images
  // of an object that was found add nothing.
  std::optional<int> expand;
  int max_instances = 4;  // of one object in the query image that are looked for; at least 1
  // Of Engine::Search, with probabilities: where nothing is found, a second pass at high resolution
  // describes the query image once more (FeatureExtractor::ExtractSecondPass), and the answer is
  // the one whose first hit has more evidence.
  bool second_pass = true;
  std::optional<Region> region;  // of the query, in pixels of the upright original: only this part
  double min_score = 0;
  std::optional<std::string> object;  // only images of this object
  Filter filter;                      // only images whose metadata pass
  std::vector<std::string> without;   // ids of images that are left out; at most kMaxExcluded
  bool explain = false;               // fill Hit::explanation
  int threads = 0;                    // for the description of the query; 0 = all cores
};

// One place in the query image where the object is.
struct Instance {
  int inliers = 0;
  double independent = 0;      // of these (index/verify/verification.h)
  std::vector<Point> polygon;  // outline in the query image
};

struct Hit {
  std::size_t rank = 0;  // 1-based, counts from the first hit of all, not of the page
  std::string object;
  std::string image_id;  // the best image of the object
  std::string source;    // its file's name as given; may be empty
  double score = 0;      // 0..1, see RankMethod; when verified, LiftScore
  // That the hit is right (index/verify/verification.h, Probability). Absent when the search does
  // not verify, and for other rankings than kNeighbours.
  std::optional<double> probability;
  int inliers = 0;             // verified matches; 0 when not verified
  std::vector<Point> polygon;  // outline of the object in the query image; empty when unknown
  // Where the object is, most inliers first; the first is `inliers` and `polygon` once more. Empty
  // when not verified. More inliers in more places do not make the score higher.
  std::vector<Instance> instances;
  // The id of the intermediate hit found by query expansion (SearchOptions::expand): this image
  // agrees with that one, which agrees with the query. Empty when its own words and inliers give at
  // least as much evidence.
  std::string via;
  // Of a search by several examples: the one that this hit agrees with best, whose pixels all
  // places are in.
  std::string example;
  std::string metadata = "{}";
  std::optional<Explanation> explanation;  // with SearchOptions::explain
};

// A stored image that was searched with beside others.
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
  double database_ms = 0;  // reading the images that are verified or shown
};

struct SearchResult {
  std::vector<Hit> hits;
  std::size_t total = 0;  // number of hits, over all pages
  // Of these, the hits with kFoundProbability or more: 0 = what the image shows is not in the
  // collection, unless `undecided`. Absent where hits have no probability.
  std::optional<std::size_t> found;
  // Nothing is found, as objects that are alike share a probability that would do for one.
  bool undecided = false;
  double evidence = 0;       // of the first hit of all, not of the page (VerifiedImage)
  bool second_pass = false;  // SearchOptions::second_pass was made, whichever answer this is
  RankMethod rank = RankMethod::kNeighbours;  // that was used
  std::int64_t vocabulary = 0;                // id of the vocabulary that answered
  std::size_t words = 0;                      // its size
  std::uint32_t keypoints = 0;                // of the query, after the region
  int query_width = 0;                        // of the original upright query image, in pixels
  int query_height = 0;
  std::vector<SearchExample> examples;  // of a search by several; then query_* are 0
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
  // As a search by the second explains a hit that is the first: the query is the second image,
  // the reference the first. ranking_score is kNoResemblance: there is nothing to rank among.
  Explanation explanation;
  std::vector<Point> outline;  // of the first's object, in the second image; empty: unknown
  // That both show the same object: what a search would say of a hit with these inliers that its
  // ranking gives no reason for (index/verify/verification.h, Probability).
  double probability = 0;
  ExtractionTimings timings;  // of both images
  double verify_ms = 0;

  bool found() const { return probability >= kFoundProbability; }
};

}  // namespace pliant
