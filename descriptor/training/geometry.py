# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The constants of the second spatial transformer: polar grid and thin-plate-spline basis.

The grid is normalised by the half width of the linear grid, so the basis is the same for every key
point and every radius (paper, section 3.2): one product (1024 x 66)(66 x 2N) warps N keypoints.

The rings of the paper's grid are at equal distances (LINEAR). On a LOGARITHMIC grid (Ebel et al.,
"Beyond Cartesian Representations for Local Descriptors", ICCV 2019) each ring is the same factor
larger than the one inside it, so that another size of the keypoint shifts the patch along its rows.
"""

from __future__ import annotations

import numpy as np

GRID = 32             # rows = angle over 2 pi, columns = radius
CONTROL_STRIDE = 4    # every fourth row and column is a control point: 8 x 8
TPS_PARAMETERS = 66   # 63 free weights + 3 affine rows, per axis
_BOX_SCALE = 0.3      # the normalised grid occupies 0.3 of the unit square, centred
LINEAR, LOGARITHMIC = "linear", "logarithmic"  # metadata radial_spacing of a weight file
SPACINGS = (LINEAR, LOGARITHMIC)


def unit_polar_grid(spacing: str = LINEAR) -> np.ndarray:
    """[1024, 2] offsets (x, y) in units of the radius R, angle-major. With t = (ring + 0.5) / 32 the
    radius of a ring is t, or 32^(t - 1)."""
    if spacing not in SPACINGS:
        raise ValueError(f"radial_spacing is {' or '.join(SPACINGS)}, not '{spacing}'")
    ramp = (np.arange(GRID) + 0.5) / GRID
    angle = 2 * np.pi * ramp[:, None]
    radius = ramp[None, :] if spacing == LINEAR else float(GRID) ** (ramp[None, :] - 1)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1).reshape(-1, 2)


def _half_width() -> float:
    return float(np.abs(unit_polar_grid()[:, 0]).max())


def displacement_gain() -> float:
    """Factor from the TPS's output (box units) to displacements in units of R."""
    return 2 * _half_width() / _BOX_SCALE


def _in_box(points: np.ndarray) -> np.ndarray:
    return (points / _half_width() + 1) / 2 * _BOX_SCALE + (1 - _BOX_SCALE) / 2


def tps_basis(spacing: str = LINEAR) -> np.ndarray:
    """[1024, 66]: rho(q, c_k) - rho(q, c_0) for k = 1..63, then 1, x, y (reduced form).

    rho(d) = d^2 log(d + 1e-6); the first weight is minus the sum of the others. The control points
    c_k are points of the linear grid, whatever the spacing of the q: a warp is the same field on both.
    """
    box = _in_box(unit_polar_grid(spacing))
    control = _in_box(unit_polar_grid()).reshape(GRID, GRID, 2)[::CONTROL_STRIDE, ::CONTROL_STRIDE].reshape(-1, 2)
    distance = np.linalg.norm(box[:, None] - control[None], axis=-1)
    rho = distance**2 * np.log(distance + 1e-6)
    return np.concatenate([rho[:, 1:] - rho[:, :1], np.ones((len(box), 1)), box], 1)


def tps_preconditioner() -> np.ndarray:
    """[66, 66] P such that theta = tanh(P phi) is well conditioned in phi.

    Columns are the basis' right singular vectors over their singular values (floored at 1/500 of
    the largest), so each component of phi moves the grid by a similar amount. P is invertible and
    folds into the last linear layer on export.
    """
    _, singular, vt = np.linalg.svd(tps_basis(), full_matrices=False)
    return vt.T / np.maximum(singular, singular[0] * 2e-3) * (0.1 * GRID)
