// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/judgement.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "descriptor/features/keypoints.h"

namespace pliant {

double InliersByChance(std::size_t query_keypoints, double distinctness, double agreeing) {
  const VerifyConstants& k = kVerify;
  const double octaves = std::log2(2.0 * static_cast<double>(query_keypoints) / kMaxKeypoints);
  const double usual = k.inliers_by_chance + k.more_an_octave * std::clamp(octaves, 0.0, 1.0);
  const double alike = std::max(0.0, 1 - distinctness);
  const double growth = std::exp(k.growth * alike * (1 / (agreeing * agreeing) - 1));
  return usual * std::min(k.most_growth, growth);
}

double Evidence(double effective_inliers, double by_chance, double share) {
  const double evidence = std::max(0.0, effective_inliers - by_chance) * std::sqrt(share);
  return evidence >= kVerify.least_evidence ? evidence : 0;
}

double LiftScore(double ranking_score, double evidence) {
  constexpr double kLeast = 1e-6;  // inliers can lift even the lowest score
  if (evidence <= 0) return ranking_score;
  const double lifted = std::max(kLeast, ranking_score) * std::pow(1 + evidence, kVerify.power);
  return lifted / (lifted + 1 - std::min(1 - kLeast, ranking_score));
}

double Probability(double ranking_score, double evidence) {
  const double score = LiftScore(std::min(ranking_score, kVerify.most_of_ranking), evidence);
  return kVerify.odds * score / (kVerify.odds * score + 1 - score);
}

double Likeness(const std::optional<Appearance>& appearance, double effective_inliers) {
  if (!appearance) return std::numeric_limits<double>::infinity();
  const VerifyConstants& k = kVerify;
  return k.per_seen_again * appearance->seen_again -
         k.per_colour_difference *
             appearance->colour_difference.value_or(k.usual_colour_difference) +
         k.per_log_inliers * std::log(effective_inliers);
}

double SameObject(double likeness, bool has_siblings) {
  const double siblings = has_siblings ? 1 : kVerify.lone_siblings;
  const double same = 1 / (1 + siblings * std::exp(-likeness));
  return std::min(1.0, same / kVerify.usually_same);
}

double Rounded(double probability) {
  return std::clamp(std::round(100 * probability), 1.0, 99.0) / 100;
}

}  // namespace pliant
