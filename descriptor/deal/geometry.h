// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The constants of the second spatial transformer (paper, section 3.2): polar grid and
// thin-plate-spline basis. Because the grid is normalised by the half width of the paper's grid,
// the linear one, both are the same for every key point, picture and radius.
//
// The paper's grid has its rings at equal distances. On a logarithmic one (Ebel et al., "Beyond
// Cartesian Representations for Local Descriptors", ICCV 2019) another key-point size is a shift
// along the rows of the patch, which convolutions and their strides bear, and the outer rings,
// where the surroundings of small objects lie, have fewer points.
#pragma once

#include <vector>

#include "descriptor/deal/weights.h"

namespace pliant::deal {

// kPatchPixels x 2 (x, y) offsets in units of the support radius R, angle-major. With
// t = (j + 0.5) / 32, point (i, j) lies at angle 2 pi (i + 0.5) / 32 and radius t (kLinear) or
// 32^(t - 1) (kLogarithmic).
std::vector<float> UnitPolarGrid(RadialSpacing spacing);

// kPatchPixels x kTpsParameters, row-major. Row of grid point q, in box coordinates (the grid
// scaled to occupy 0.3 of the unit square, centred):
//   rho(|q - c_1|) - rho(|q - c_0|), ..., rho(|q - c_63|) - rho(|q - c_0|), 1, q_x, q_y
// with rho(d) = d^2 log(d + 1e-6) and c_k the points of every fourth row and column of the linear
// grid, whatever the spacing, so that a warp is the same field on both. This is the reduced form of
// the spline: the first weight is minus the sum of the others.
std::vector<float> TpsBasis(RadialSpacing spacing);

// Factor from box coordinates to units of R: displacement = gain * basis * theta.
double DisplacementGain();

}  // namespace pliant::deal
