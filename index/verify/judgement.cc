// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/judgement.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pliant {

double InliersByChance(std::size_t query_keypoints, double distinctness, double agreeing) {
  const JudgementConstants& k = kJudgement;
  const double octaves = std::log2(static_cast<double>(query_keypoints) / k.usual_keypoints);
  const double usual = k.inliers_by_chance + k.more_an_octave * std::clamp(octaves, 0.0, 1.0);
  const double alike = std::max(0.0, k.usual_distinctness - distinctness);
  const double growth = std::exp(k.growth * alike * (1 / (agreeing * agreeing) - 1));
  return usual * std::min(k.most_growth, growth);
}

double Evidence(double effective_inliers, double by_chance) {
  return effective_inliers <= 0
             ? 0
             : std::max(kJudgement.least_evidence, effective_inliers - by_chance);
}

double LiftScore(double ranking_score, double evidence) {
  constexpr double kLeast = 1e-6;  // inliers can lift even the lowest score
  if (evidence <= 0) return ranking_score;
  const double lifted = std::max(kLeast, ranking_score) * std::pow(1 + evidence, kJudgement.power);
  return lifted / (lifted + 1 - std::min(1 - kLeast, ranking_score));
}

double Probability(double ranking_score, double evidence) {
  const double proof = evidence > kJudgement.least_evidence ? evidence : 0;
  const double score = LiftScore(std::min(ranking_score, kJudgement.most_of_ranking), proof);
  return kJudgement.odds * score / (kJudgement.odds * score + 1 - score);
}

double Likeness(const std::optional<Appearance>& appearance, double effective_inliers) {
  if (!appearance) return std::numeric_limits<double>::infinity();
  const JudgementConstants& k = kJudgement;
  return k.per_seen_again * appearance->seen_again -
         k.per_colour_difference *
             appearance->colour_difference.value_or(k.usual_colour_difference) +
         k.per_log_inliers * std::log(effective_inliers);
}

double SameObject(double likeness, bool has_siblings) {
  const JudgementConstants& k = kJudgement;
  const double siblings = has_siblings ? k.siblings : k.lone_siblings;
  const double same = 1 / (1 + siblings * std::exp(k.half_of_siblings - likeness));
  return std::min(1.0, same / k.usually_same);
}

double Rounded(double probability) {
  const double steps = kJudgement.steps;
  return std::clamp(std::round(probability * steps), 1.0, steps - 1) / steps;
}

}  // namespace pliant
