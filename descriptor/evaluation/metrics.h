// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The metrics of one image pair.
//
// Keypoint i of the first image corresponds to j of the second if the true position of i lies
// within the tolerance of j, each used once, nearest first: G such pairs. The match of i is its
// nearest neighbour over all keypoints of the second image; it is correct when it lies within
// the tolerance of i's true position.
//   matching score MS = correct / min(n1, n2)
//   mean matching accuracy MMA = correct among the G / G
//   mutual precision = correct mutual nearest neighbours / mutual nearest neighbours
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/match/matching.h"
#include "descriptor/warp/tps.h"

namespace pliant::evaluation {

struct TruePair {
  std::uint32_t first = 0;  // keypoint numbers
  std::uint32_t second = 0;
  double distance_px = 0;  // of the true position of `first` from `second`
};

// One-to-one, nearest first; of equal distances the lower numbers. `positions[i]`: where the first
// image's keypoint i is seen in the second. O(n1 n2).
std::vector<TruePair> FindTruePairs(std::span<const std::optional<Vec2>> positions,
                                    std::span<const Keypoint> second, double tolerance_px);

// Whether the match lies within the tolerance of the true position.
bool IsCorrect(const Match& match, std::span<const std::optional<Vec2>> positions,
               std::span<const Keypoint> second, double tolerance_px);

struct PairFigures {
  int first = 0;           // n1
  int second = 0;          // n2
  int true_pairs = 0;      // G
  int correct = 0;         // of all matches
  int correct_true = 0;    // among the G
  int mutual = 0;          // mutual nearest neighbours
  int correct_mutual = 0;  // the right ones among them

  double ms() const;                // 0 when an image has no keypoints
  double mma() const;               // 0 without true pairs
  double mutual_precision() const;  // 0 without mutual matches
};

// `matches`: one for each keypoint of the first image (MatchDescriptors with no ratio;
// Match::reference is the first image's keypoint, Match::query the second's).
PairFigures CountMatches(std::span<const Match> matches,
                         std::span<const std::optional<Vec2>> positions,
                         std::span<const TruePair> true_pairs, std::span<const Keypoint> second,
                         double tolerance_px);

}  // namespace pliant::evaluation
