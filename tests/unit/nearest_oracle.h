// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What nearest neighbours must be, by sorting all distances.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "descriptor/match/distance.h"
#include "tests/unit/random_descriptors.h"

namespace pliant::testing {

// The nearest rows of `b` to each of `a`, and of `a` to each of `b`, with the tie rule: for values
// on which both sides are exact.
inline void ExpectNearest(const Descriptors& a, const Descriptors& b,
                          const std::vector<NearestTwo>& nearest,
                          const std::vector<NearestOne>& back) {
  for (std::size_t i = 0; i < a.rows; ++i) {
    std::vector<std::pair<double, std::size_t>> all;
    for (std::size_t j = 0; j < b.rows; ++j) all.emplace_back(PlainDistance(a, i, b, j), j);
    std::sort(all.begin(), all.end());
    ASSERT_EQ(nearest[i].index, all[0].second) << "row " << i << " of " << a.dim << " components";
    ASSERT_FLOAT_EQ(nearest[i].distance, static_cast<float>(all[0].first));
    if (b.rows > 1) {
      ASSERT_FLOAT_EQ(nearest[i].second, static_cast<float>(all[1].first));
    } else {
      ASSERT_EQ(nearest[i].second, std::numeric_limits<float>::infinity());
    }
  }
  for (std::size_t j = 0; j < b.rows; ++j) {
    std::pair<double, std::size_t> best{1e30, 0};
    for (std::size_t i = 0; i < a.rows; ++i) {
      best = std::min(best, {PlainDistance(a, i, b, j), i});
    }
    ASSERT_EQ(back[j].index, best.second) << "column " << j;
    ASSERT_FLOAT_EQ(back[j].distance, static_cast<float>(best.first));
  }
}

}  // namespace pliant::testing
