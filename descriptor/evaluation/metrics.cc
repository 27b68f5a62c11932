// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/metrics.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace pliant::evaluation {
namespace {

double Share(int part, int whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

double DistancePx(Vec2 p, const Keypoint& k) { return std::hypot(p.x - k.x, p.y - k.y); }

}  // namespace

std::vector<TruePair> FindTruePairs(std::span<const std::optional<Vec2>> positions,
                                    std::span<const Keypoint> second, double tolerance_px) {
  std::vector<TruePair> candidates;
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    if (!positions[i]) continue;
    for (std::uint32_t j = 0; j < second.size(); ++j) {
      const double distance = DistancePx(*positions[i], second[j]);
      if (distance <= tolerance_px) candidates.push_back({i, j, distance});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const TruePair& a, const TruePair& b) {
    return std::tie(a.distance_px, a.first, a.second) < std::tie(b.distance_px, b.first, b.second);
  });
  std::vector<bool> first_used(positions.size());
  std::vector<bool> second_used(second.size());
  std::vector<TruePair> pairs;
  for (const TruePair& candidate : candidates) {
    if (first_used[candidate.first] || second_used[candidate.second]) continue;
    first_used[candidate.first] = second_used[candidate.second] = true;
    pairs.push_back(candidate);
  }
  return pairs;
}

bool IsCorrect(const Match& match, std::span<const std::optional<Vec2>> positions,
               std::span<const Keypoint> second, double tolerance_px) {
  const std::optional<Vec2>& position = positions[match.reference];
  return position && DistancePx(*position, second[match.query]) <= tolerance_px;
}

double PairFigures::ms() const { return std::min(1.0, Share(correct, std::min(first, second))); }
double PairFigures::mma() const { return Share(correct_true, true_pairs); }
double PairFigures::mutual_precision() const { return Share(correct_mutual, mutual); }

PairFigures CountMatches(std::span<const Match> matches,
                         std::span<const std::optional<Vec2>> positions,
                         std::span<const TruePair> true_pairs, std::span<const Keypoint> second,
                         double tolerance_px) {
  PairFigures figures;
  figures.first = static_cast<int>(positions.size());
  figures.second = static_cast<int>(second.size());
  figures.true_pairs = static_cast<int>(true_pairs.size());
  std::vector<bool> has_partner(positions.size());
  for (const TruePair& pair : true_pairs) has_partner[pair.first] = true;
  for (const Match& match : matches) {
    const bool correct = IsCorrect(match, positions, second, tolerance_px);
    figures.correct += correct ? 1 : 0;
    figures.correct_true += correct && has_partner[match.reference] ? 1 : 0;
    figures.mutual += match.mutual ? 1 : 0;
    figures.correct_mutual += correct && match.mutual ? 1 : 0;
  }
  return figures;
}

}  // namespace pliant::evaluation
