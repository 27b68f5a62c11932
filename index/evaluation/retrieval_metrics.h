// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Accuracy metrics of search results.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace pliant {

// The result of one query, best first, and the number of correct images that exist.
struct RetrievalAnswer {
  std::vector<bool> right;   // per rank: whether the image shows the query's object
  std::size_t possible = 0;  // correct images in the gallery, found or not; 1 or more
  bool found = false;        // the first image counts as found (SearchResult::found)
};

inline constexpr std::size_t kAccuracyRanks = 20;
inline constexpr std::size_t kNsRanks = 4;

struct RetrievalMetrics {
  // [K - 1]: correct images among the first K, divided by K (the paper, section 4.3); missing
  // ranks count as wrong.
  std::array<double, kAccuracyRanks> accuracy_at = {};
  double map = 0;          // mean average precision; right images that are missing count as 0
  double top1 = 0;         // the first image is right
  double mrr = 0;          // 1 / rank of the first right image; 0 when there is none
  double ns = 0;           // right images among the first four, 0..4 (UKBench's N-S score)
  double found_right = 0;  // the first image counts as found and is correct
  double found_wrong = 0;  // the first image counts as found and is wrong
};

// Of one query. Throws kInvalidArgument when nothing is possible, or more is right than possible.
RetrievalMetrics MeasureAnswer(const RetrievalAnswer& answer);

// Field by field. All zero for nothing.
RetrievalMetrics Mean(std::span<const RetrievalMetrics> all);

// Sample standard deviation, field by field; zero for fewer than two.
RetrievalMetrics Spread(std::span<const RetrievalMetrics> all);

}  // namespace pliant
