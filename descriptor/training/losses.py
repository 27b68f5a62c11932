# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Losses on descriptors of corresponding keypoints, and on the warp.

All take unit descriptors a, b [N, D] (row i of a belongs to row i of b) and a mask [N, N] of pairs
(i, j) that must not count as negatives.
"""

from __future__ import annotations

import torch
from torch.nn import functional as F

from .fast_linear import linear

NEAR_PX = 5.0
_NEAR_DUPLICATE = 0.008  # distance below which a negative is taken for a twin of the anchor
_WARP_SMOOTH = 0.1       # radii: where smooth-L1 turns from square to linear


def false_negatives(xy_a: torch.Tensor, xy_b: torch.Tensor, surface: torch.Tensor,
                    texture: torch.Tensor) -> torch.Tensor:
    """[N, N] true where i and j may show the same thing: neighbours on one surface, or any two
    points of different surfaces with the same texture. The diagonal is false."""
    same_surface = surface[:, None] == surface[None]
    near = (torch.cdist(xy_a, xy_a) < NEAR_PX) | (torch.cdist(xy_b, xy_b) < NEAR_PX)
    twin = (texture[:, None] == texture[None]) & ~same_surface
    mask = (same_surface & near) | twin
    return mask & ~torch.eye(len(mask), dtype=torch.bool, device=mask.device)


def info_nce(a: torch.Tensor, b: torch.Tensor, ignore: torch.Tensor, temperature: float) -> torch.Tensor:
    """Cross entropy over the batch in both directions (van den Oord et al. 2018)."""
    logits = (linear(a, b) / temperature).masked_fill(ignore, -1e4)
    target = torch.arange(len(a), device=a.device)
    return 0.5 * (F.cross_entropy(logits, target) + F.cross_entropy(logits.t(), target))


def distillation(a: torch.Tensor, b: torch.Tensor, teacher_a: torch.Tensor, teacher_b: torch.Tensor,
                 temperature: float) -> torch.Tensor:
    """What separates descriptors from a teacher's: 1 - cosine of each, and the Kullback-Leibler
    divergence of what each is similar to in the batch (Hinton et al. 2015)."""
    apart = 1 - 0.5 * ((a * teacher_a).sum(1) + (b * teacher_b).sum(1)).mean()
    own, wanted = linear(a, b) / temperature, linear(teacher_a, teacher_b) / temperature
    divergence = [F.kl_div(F.log_softmax(x, 1), F.log_softmax(y, 1), reduction="batchmean", log_target=True)
                  for x, y in ((own, wanted), (own.t(), wanted.t()))]
    return apart + 0.5 * (divergence[0] + divergence[1])


def distances(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    return torch.sqrt((2 - 2 * linear(a, b)).clamp_min(1e-6))


def hardest_negatives(distance: torch.Tensor, ignore: torch.Tensor) -> torch.Tensor:
    """[N] nearest negative of each correspondence, searched in both directions."""
    diagonal = torch.eye(len(distance), dtype=torch.bool, device=distance.device)
    excluded = ignore | diagonal | (distance.detach() < _NEAR_DUPLICATE)
    open_distance = distance.masked_fill(excluded, 10.0)
    return torch.minimum(open_distance.min(1)[0], open_distance.min(0)[0])


def triplet(a: torch.Tensor, b: torch.Tensor, ignore: torch.Tensor, margin: float = 0.5) -> torch.Tensor:
    """Hardest-in-batch triplet margin (paper, equation 6; Mishchuk et al. 2017). Collapses from a
    random start: for the last stage only."""
    distance = distances(a, b)
    return F.relu(margin + distance.diagonal() - hardest_negatives(distance, ignore)).mean()


@torch.no_grad()
def separation(a: torch.Tensor, b: torch.Tensor, ignore: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """Mean positive distance, mean hardest negative distance, share of positives that are nearer."""
    distance = distances(a, b)
    positive, negative = distance.diagonal(), hardest_negatives(distance, ignore)
    return positive.mean(), negative.mean(), (positive < negative).float().mean()


def warp_loss(predicted: torch.Tensor, truth: torch.Tensor, known: torch.Tensor) -> torch.Tensor:
    """Mean smooth-L1 over the grid points whose displacement is known. All [K, G, 2] / [K, G]."""
    error = F.smooth_l1_loss(predicted, truth, beta=_WARP_SMOOTH, reduction="none").sum(-1)
    weight = known.to(error)
    return (error * weight).sum() / weight.sum().clamp_min(1)


@torch.no_grad()
def warp_r2_terms(predicted: torch.Tensor, truth: torch.Tensor, known: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Squared error and squared truth over the known points; R^2 = 1 - error / truth."""
    weight = known.to(predicted)[..., None]
    return (((predicted - truth) ** 2) * weight).sum(), ((truth**2) * weight).sum()
