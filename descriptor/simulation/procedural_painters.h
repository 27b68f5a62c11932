// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One painter per kind of procedural picture; the canvas is filled with the palette's paper colour.
// Internal.
#pragma once

#include "descriptor/simulation/procedural_parts.h"

namespace pliant::simulation {

// Patterns, in procedural_patterns.cc.
void PaintLettering(Canvas& canvas, Random& random, const Palette& palette);
void PaintLogo(Canvas& canvas, Random& random, const Palette& palette);
void PaintChecks(Canvas& canvas, Random& random, const Palette& palette);
void PaintFloral(Canvas& canvas, Random& random, const Palette& palette);
void PaintWoven(Canvas& canvas, Random& random, const Palette& palette);

// Printed matter, in procedural_prints.cc.
void PaintNewspaper(Canvas& canvas, Random& random, const Palette& palette);
void PaintPackaging(Canvas& canvas, Random& random, const Palette& palette);
void PaintMap(Canvas& canvas, Random& random, const Palette& palette);

}  // namespace pliant::simulation
