# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""SIFT's keypoint detector (Lowe 2004, sections 3 and 4) in NumPy, without orientations.

For machines without OpenCV: the conventions (doubled first octave, 3 layers, sigma 1.6, contrast
0.04, edge ratio 10, size as a diameter) are OpenCV's, so that weights trained on these keypoints
fit those that OpenCV's detector finds.
"""

from __future__ import annotations

import numpy as np

_LAYERS = 3
_SIGMA = 1.6
CONTRAST = 0.04  # SIFT's own threshold
_EDGE = 10.0
_CAMERA_BLUR = 0.5
_BORDER = 5
_MAX_STEPS = 5


def _blur(image: np.ndarray, sigma: float) -> np.ndarray:
    """Separable Gaussian, mirrored at the border."""
    radius = int(round(sigma * 4))
    taps = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    taps = (taps / taps.sum()).astype(np.float32)
    for axis in (0, 1):
        width = [(0, 0), (0, 0)]
        width[axis] = (radius, radius)
        padded = np.pad(image, width, mode="reflect" if image.shape[axis] > radius else "symmetric")
        length = image.shape[axis]
        out = np.zeros_like(image)
        for i, tap in enumerate(taps):
            out += tap * (padded[i:i + length] if axis == 0 else padded[:, i:i + length])
        image = out
    return image


def _doubled(image: np.ndarray) -> np.ndarray:
    """Twice the size, bilinear; output pixel i lies at (i + 0.5) / 2 - 0.5 of the input."""
    for axis in (0, 1):
        length = image.shape[axis]
        position = np.clip((np.arange(2 * length) + 0.5) / 2 - 0.5, 0, length - 1)
        low = np.minimum(position.astype(int), max(length - 2, 0))
        high = np.minimum(low + 1, length - 1)
        part = (position - low).astype(np.float32)
        part = part[:, None] if axis == 0 else part[None]
        image = np.take(image, low, axis) * (1 - part) + np.take(image, high, axis) * part
    return image


def _octave(base: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Differences of Gaussians [5, H, W] of one octave, and the next octave's first image."""
    step = 2 ** (1 / _LAYERS)
    gaussians = [base]
    for layer in range(1, _LAYERS + 3):
        previous = _SIGMA * step ** (layer - 1)
        gaussians.append(_blur(gaussians[-1], previous * np.sqrt(step * step - 1)))
    stack = np.stack(gaussians)
    return stack[1:] - stack[:-1], gaussians[_LAYERS][::2, ::2]


def _extrema(dog: np.ndarray, contrast: float) -> np.ndarray:
    """[K, 3] layer, row, column of pixels that are extreme among their 26 neighbours."""
    threshold = np.floor(0.5 * contrast / _LAYERS * 255) / 255
    inner = dog[1:-1, _BORDER:-_BORDER, _BORDER:-_BORDER]
    if not inner.size:
        return np.zeros((0, 3), np.int64)
    high, low = dog.copy(), dog.copy()
    for axis in (0, 1, 2):  # separable 3 x 3 x 3 maximum and minimum
        for target, choose in ((high, np.maximum), (low, np.minimum)):
            ahead, back = [slice(None)] * 3, [slice(None)] * 3
            ahead[axis], back[axis] = slice(1, None), slice(None, -1)
            source = target.copy()
            choose(target[tuple(back)], source[tuple(ahead)], out=target[tuple(back)])
            choose(target[tuple(ahead)], source[tuple(back)], out=target[tuple(ahead)])
    cut = (slice(1, -1), slice(_BORDER, -_BORDER), slice(_BORDER, -_BORDER))
    found = ((inner > threshold) & (inner >= high[cut])) | ((inner < -threshold) & (inner <= low[cut]))
    return np.argwhere(found) + [1, _BORDER, _BORDER]


def _derivatives(dog: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values [K], gradients [K, 3] and Hessians [K, 3, 3] in (x, y, layer)."""
    layer, row, column = at.T
    value = lambda dl, dr, dc: dog[layer + dl, row + dr, column + dc].astype(np.float64)  # noqa: E731
    steps = ((0, 0, 1), (0, 1, 0), (1, 0, 0))  # x, y, layer
    centre = value(0, 0, 0)
    gradient = np.stack([(value(*s) - value(*(-d for d in s))) / 2 for s in steps], 1)
    hessian = np.empty((len(at), 3, 3))
    for i, a in enumerate(steps):
        hessian[:, i, i] = value(*a) + value(*(-d for d in a)) - 2 * centre
        for j in range(i):
            b = steps[j]
            plus, minus = np.add(a, b), np.subtract(a, b)
            cross = (value(*plus) + value(*-plus) - value(*minus) - value(*-minus)) / 4
            hessian[:, i, j] = hessian[:, j, i] = cross
    return centre, gradient, hessian


def _solve(hessian: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    singular = np.abs(np.linalg.det(hessian)) < 1e-18
    hessian = np.where(singular[:, None, None], np.eye(3), hessian)
    return np.where(singular[:, None], 9.0, -np.linalg.solve(hessian, gradient[..., None])[..., 0])


def _refine(dog: np.ndarray, at: np.ndarray, threshold: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sub-pixel positions: returns pixels [K, 3], offsets (x, y, layer) [K, 3] and contrast [K] of
    those that converge and pass the contrast and edge tests."""
    limit = np.array([dog.shape[0] - 2, dog.shape[1] - 1 - _BORDER, dog.shape[2] - 1 - _BORDER])
    start = np.array([1, _BORDER, _BORDER])
    done: list[tuple[np.ndarray, ...]] = []
    for _ in range(_MAX_STEPS):
        if not len(at):
            break
        centre, gradient, hessian = _derivatives(dog, at)
        offset = _solve(hessian, gradient)
        converged = (np.abs(offset) < 0.5).all(1)
        contrast = centre + 0.5 * (gradient * offset).sum(1)
        trace = hessian[:, 0, 0] + hessian[:, 1, 1]
        determinant = hessian[:, 0, 0] * hessian[:, 1, 1] - hessian[:, 0, 1] ** 2
        good = (converged & (np.abs(contrast) * _LAYERS >= threshold) & (determinant > 0)
                & (trace**2 * _EDGE < (_EDGE + 1) ** 2 * determinant))
        done.append((at[good], offset[good], np.abs(contrast[good])))
        moved = at[~converged] + np.rint(np.clip(offset[~converged], -1e6, 1e6)).astype(np.int64)[:, ::-1]
        at = moved[((moved >= start) & (moved <= limit)).all(1)]
    if not done:
        return np.zeros((0, 3), np.int64), np.zeros((0, 3)), np.zeros(0)
    return tuple(np.concatenate(part) for part in zip(*done))


def detect(image: np.ndarray, contrast_threshold: float = CONTRAST) -> np.ndarray:
    """[N, 4] x, y, size, response of a grey uint8 image [H, W]; pixel centres at integers."""
    base = _doubled(image.astype(np.float32) / 255)
    base = _blur(base, float(np.sqrt(_SIGMA**2 - (2 * _CAMERA_BLUR) ** 2)))
    octaves = int(round(np.log2(min(base.shape)) - 2))
    found = []
    for octave in range(octaves):
        if min(base.shape) <= 2 * _BORDER:
            break
        dog, base = _octave(base)
        at, offset, contrast = _refine(dog, _extrema(dog, contrast_threshold), contrast_threshold)
        scale = 2.0**octave / 2  # the first octave is the doubled image
        xy = (at[:, :0:-1] + offset[:, :2]) * scale
        size = _SIGMA * 2 ** ((at[:, 0] + offset[:, 2]) / _LAYERS) * 2 * scale
        found.append(np.column_stack([xy, size, contrast]))
    table = np.concatenate(found) if found else np.zeros((0, 4))
    return np.unique(table.astype(np.float32), axis=0)
