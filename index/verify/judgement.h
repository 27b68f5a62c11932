// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What inliers and the ranking together say about a hit: evidence, score and probability. Pure
// functions.
#pragma once

#include <cstddef>
#include <optional>

#include "index/records/explanation.h"
#include "index/verify/constants.h"

namespace pliant {

// Largest effective inlier count that a wrong image has by chance, with few exceptions.
// `distinctness`: how far apart unrelated descriptors of the two images are (VerificationResult).
// `agreeing`: share of the matches at the object's place in the query that are inliers, above 0.
// Text, codes, bricks or knit consist of similar details, so many of them agree by chance; and
// then other matches in the same part contradict them.
double InliersByChance(std::size_t query_keypoints, double distinctness = 1, double agreeing = 1);

// The effective inliers beyond those by chance, times the square root of the share of the matches
// that count for the object. 0 if that is below kVerify.least_evidence.
double Evidence(double effective_inliers, double by_chance = kVerify.inliers_by_chance,
                double share = 1);

// The final score of a hit: evidence e multiplies the odds of the ranking's score s,
//   score / (1 - score) = s / (1 - s) (1 + e)^4.
// It never lowers a score.
double LiftScore(double ranking_score, double evidence);

// The probability that a hit of the ranking by neighbours is correct:
//   p / (1 - p) = 30 s / (1 - s) (1 + e)^4,   s = min(ranking_score, 0.002).
// The limit of s means: without evidence nothing is found.
double Probability(double ranking_score, double evidence);

// How much an image whose details match looks like this object and not like a sibling: the natural
// logarithm of the odds if the object has siblings. Infinite if `appearance` is unknown.
double Likeness(const std::optional<Appearance>& appearance, double effective_inliers);

// The probability that it shows this object and not a sibling. 1 above 0.95, as of most objects.
// `has_siblings`: other objects of the collection match at the same place.
double SameObject(double likeness, bool has_siblings);

// In whole percent, from 0.01 to 0.99: of 100 hits that are found, one is wrong. The score orders
// equal ones.
double Rounded(double probability);

}  // namespace pliant
