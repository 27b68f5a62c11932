// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The constants of the second spatial transformer (paper, section 3.2): polar grid and
// thin-plate-spline basis. Because the grid is normalised by its own half width, both are the same
// for every key point, picture and radius.
#pragma once

#include <vector>

namespace pliant::deal {

// kPatchPixels x 2 (x, y) offsets in units of the support radius R, angle-major: point (i, j) lies
// at angle 2 pi (i + 0.5) / 32 and radius (j + 0.5) / 32.
std::vector<float> UnitPolarGrid();

// kPatchPixels x kTpsParameters, row-major. Row of grid point q, in box coordinates (the grid
// scaled to occupy 0.3 of the unit square, centred):
//   rho(|q - c_1|) - rho(|q - c_0|), ..., rho(|q - c_63|) - rho(|q - c_0|), 1, q_x, q_y
// with rho(d) = d^2 log(d + 1e-6) and c_k the points of every fourth row and column. This is the
// reduced form of the spline: the first weight is minus the sum of the others.
std::vector<float> TpsBasis();

// Factor from box coordinates to units of R: displacement = gain * basis * theta.
double DisplacementGain();

}  // namespace pliant::deal
