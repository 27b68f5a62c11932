// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/evaluation/retrieval_metrics.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

// The same function of each field of some metrics.
template <typename Function>
RetrievalMetrics Fieldwise(const Function& of) {
  RetrievalMetrics result;
  for (std::size_t k = 0; k < kAccuracyRanks; ++k) {
    result.accuracy_at[k] = of([k](const RetrievalMetrics& m) { return m.accuracy_at[k]; });
  }
  using M = RetrievalMetrics;
  for (double M::* const field :
       {&M::map, &M::top1, &M::mrr, &M::ns, &M::found_right, &M::found_wrong}) {
    result.*field = of([field](const M& m) { return m.*field; });
  }
  return result;
}

}  // namespace

RetrievalMetrics MeasureAnswer(const RetrievalAnswer& answer) {
  const auto all =
      static_cast<std::size_t>(std::count(answer.right.begin(), answer.right.end(), true));
  if (answer.possible == 0 || all > answer.possible) {
    throw Error(ErrorCode::kInvalidArgument, "answer_invalid",
                std::to_string(all) + " right images of " + std::to_string(answer.possible) +
                    " possible ones cannot be measured");
  }
  RetrievalMetrics result;
  std::size_t right = 0;
  for (std::size_t i = 0; i < std::max(answer.right.size(), kAccuracyRanks); ++i) {
    const auto rank = static_cast<double>(i + 1);
    if (i < answer.right.size() && answer.right[i]) {
      ++right;
      result.map += static_cast<double>(right) / rank;
      if (right == 1) result.mrr = 1 / rank;
      if (i < kNsRanks) ++result.ns;
    }
    if (i < kAccuracyRanks) result.accuracy_at[i] = static_cast<double>(right) / rank;
  }
  result.map /= static_cast<double>(answer.possible);
  result.top1 = result.accuracy_at[0];
  if (answer.found) (result.top1 == 1 ? result.found_right : result.found_wrong) = 1;
  return result;
}

RetrievalMetrics Mean(std::span<const RetrievalMetrics> all) {
  if (all.empty()) return {};
  return Fieldwise([&](const auto& field) {
    double sum = 0;
    for (const RetrievalMetrics& one : all) sum += field(one);
    return sum / static_cast<double>(all.size());
  });
}

RetrievalMetrics Spread(std::span<const RetrievalMetrics> all) {
  if (all.size() < 2) return {};
  const RetrievalMetrics mean = Mean(all);
  return Fieldwise([&](const auto& field) {
    double sum = 0;
    for (const RetrievalMetrics& one : all) sum += std::pow(field(one) - field(mean), 2);
    return std::sqrt(sum / static_cast<double>(all.size() - 1));
  });
}

}  // namespace pliant
