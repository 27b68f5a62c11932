// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/matching.h"

#include <algorithm>
#include <limits>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"

namespace pliant {
namespace {

constexpr std::size_t kRowsATask = 256;

float Ratio(const NearestTwo& n) {
  if (n.second == std::numeric_limits<float>::infinity()) return 0;
  return n.second > 0 ? n.distance / n.second : 1;
}

}  // namespace

std::vector<Match> MatchDescriptors(const PackedDescriptors& query, const Descriptors& reference,
                                    const MatchOptions& options) {
  if (!(options.max_ratio > 0 && options.max_ratio <= 1)) {
    throw Error(ErrorCode::kInvalidArgument, "bad_max_ratio",
                "max_ratio must be above 0 and at most 1.");
  }
  const std::size_t n = reference.rows;
  if (n == 0 || query.rows() == 0) return {};
  const std::size_t tasks = (n + kRowsATask - 1) / kRowsATask;
  std::vector<NearestTwo> nearest(n);
  std::vector<std::vector<NearestOne>> back(tasks);
  ParallelFor(tasks, options.threads, [&](std::size_t t) {
    const std::size_t first = t * kRowsATask;
    back[t].resize(query.rows());
    query.FindNearest(reference, first, std::min(kRowsATask, n - first), nearest.data() + first,
                      back[t].data());
  });
  // Of equally near references the lowest, which is in the first task that has one.
  for (std::size_t t = 1; t < tasks; ++t) {
    for (std::size_t j = 0; j < query.rows(); ++j) {
      if (back[t][j].distance < back[0][j].distance) back[0][j] = back[t][j];
    }
  }
  std::vector<Match> matches;
  for (std::uint32_t i = 0; i < n; ++i) {
    Match match{nearest[i].index, i, nearest[i].distance, Ratio(nearest[i]), false};
    match.mutual = back[0][match.query].index == i;
    if (match.ratio > options.max_ratio || (options.mutual_only && !match.mutual)) continue;
    matches.push_back(match);
  }
  return matches;
}

}  // namespace pliant
