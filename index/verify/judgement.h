// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What inliers and the ranking together say about a hit: evidence, score and probability. Pure
// functions.
#pragma once

#include <cstddef>
#include <optional>

#include "index/records/explanation.h"

namespace pliant {

// All that is tuned here. Fitted to real photos of worn shirts, packages, banknotes and labels,
// half of the searches without their object, and to drawn pages, codes and patterns that resemble
// each other (tests/accuracy/make_lookalikes.py).
struct JudgementConstants {
  // Effective inliers of a wrong image. Among the wrong images of street photographs with a warp,
  // most have five or fewer, one in 25 has more than 5.5, and none of 124 has 7.
  double inliers_by_chance = 4.5;
  // More of them for twice the keypoints: a second pass finds twice the matches, most of them
  // wrong.
  double more_an_octave = 1.5;
  double usual_keypoints = 2048;  // from here on, for one octave
  // From this VerificationResult::distinctness on, details do not resemble each other: photos have
  // 0.9 to 1.1, pages of text, codes or knit 0.3 to 0.8.
  double usual_distinctness = 0.97;
  // Inliers by chance grow with exp(growth (usual_distinctness - distinctness) (1 / agreeing^2 -
  // 1)).
  double growth = 4;
  double most_growth = 9;        // codes and boards had up to 40 inliers by chance
  double least_evidence = 0.25;  // of any warp: a hint
  // Evidence e multiplies the odds by (1 + e)^power: a third more inliers count as much as a
  // ranking score 3.2 times as high.
  double power = 4;
  double odds = 30;  // of a hit per odds of its score, in photos of worn shirts
  // Probabilities are told in whole steps of 1 / steps, and are never 0 or 1: of 100 hits that are
  // found, one is wrong. The score orders equal ones.
  double steps = 100;
  // The ranking counts up to this score. Without evidence no hit is more probable than 0.19, so
  // that the verdict is neither found nor perhaps.
  double most_of_ranking = 0.008;
  // SameObject, a logistic regression: real packages, banknotes and labels that were found, half of
  // them siblings of the right object, which was left out; and simulated crumpled prints.
  double per_seen_again = 4;
  double per_colour_difference = 6;
  double usual_colour_difference = 0.38;  // median, where it is unknown
  double per_log_inliers = 1.3;           // of the natural logarithm of the effective inliers
  double half_of_siblings = 3;            // as many siblings as right objects have this likeness
  // Odds that a photo whose details match shows an object that is missing, and has a sibling: if
  // other objects of the collection match at the same place, too, and if none does.
  double siblings = 0.05;
  double lone_siblings = 0.004;
  double usually_same = 0.95;  // what is more is as good as certain
};
inline constexpr JudgementConstants kJudgement;

// Largest effective inlier count that a wrong image has by chance, with few exceptions.
// `distinctness`: how far apart unrelated descriptors of the two images are (VerificationResult).
// `agreeing`: share of the matches at the object's place in the query that are inliers, above 0.
// Text, codes, bricks or knit consist of similar details, so many of them agree by chance; and
// then other matches in the same part contradict them.
double InliersByChance(std::size_t query_keypoints, double distinctness = 1, double agreeing = 1);

// The effective inliers beyond those by chance: `effective_inliers` - `by_chance`, but never below
// kJudgement.least_evidence; 0 for 0 (no warp). Weak evidence raises an image only among its
// neighbours (see also DropWeakEvidence).
double Evidence(double effective_inliers, double by_chance = kJudgement.inliers_by_chance);

// The final score of a hit: evidence e multiplies the odds of the ranking's score s,
//   score / (1 - score) = s / (1 - s) (1 + e)^4.
// It never lowers a score.
double LiftScore(double ranking_score, double evidence);

// The ranking score without any support: that of the best of a few hundred images without the
// query's object. For pairs of images outside a search.
inline constexpr double kNoResemblance = 0.002;

// The probability that a hit of the ranking by neighbours is correct:
//   p / (1 - p) = 30 s / (1 - s) (1 + e)^4,   s = min(ranking_score, 0.008).
// The limit of s means: without evidence nothing is found. The least evidence counts as none.
double Probability(double ranking_score, double evidence);

// How much an image whose details match looks like this object and not like a sibling: the natural
// logarithm of odds, without those of siblings. Infinite if `appearance` is unknown.
double Likeness(const std::optional<Appearance>& appearance, double effective_inliers);

// The probability that it shows this object and not a sibling. 1 above 0.95, as of most objects.
// `has_siblings`: other objects of the collection match at the same place.
double SameObject(double likeness, bool has_siblings);

// In whole steps (JudgementConstants::steps).
double Rounded(double probability);

}  // namespace pliant
