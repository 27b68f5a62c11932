// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Affine maps between small neighbourhoods: the local approximation of a smooth warp
// (Tran et al., "In defence of RANSAC for outlier rejection in deformable registration", ECCV
// 2012).
#pragma once

#include <optional>
#include <span>

#include "descriptor/warp/tps.h"

namespace pliant {

// q = query + [a b; c d] (p - reference).
struct LocalAffine {
  Vec2 reference;
  Vec2 query;
  double a = 1, b = 0, c = 0, d = 1;

  Vec2 operator()(Vec2 p) const {
    const double x = p.x - reference.x;
    const double y = p.y - reference.y;
    return {query.x + a * x + b * y, query.y + c * x + d * y};
  }
  double determinant() const { return a * d - b * c; }
};

// Least-squares fit to 3 or more corresponding points. nullopt when the reference points are nearly
// collinear (width below 1/12 of their length, or below half a pixel).
std::optional<LocalAffine> FitLocalAffine(std::span<const Vec2> reference,
                                          std::span<const Vec2> query);

// Whether [a b; c d] can be a view of a bent surface: no reflection, and a ratio of its singular
// values of at most `max_anisotropy`.
bool IsPlausible(double a, double b, double c, double d, double max_anisotropy);

}  // namespace pliant
