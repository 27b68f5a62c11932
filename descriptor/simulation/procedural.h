// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Pictures generated from a seed, so that the simulator needs no files: lettering, logos,
// checks, flowers, weaves, newspaper pages, packaging and maps.
#pragma once

#include <cstdint>
#include <string>

#include "descriptor/image/image.h"
#include "descriptor/simulation/texture_source.h"

namespace pliant::simulation {

enum class ProceduralKind {
  kLettering,
  kLogo,
  kChecks,
  kFloral,
  kWoven,
  kNewspaper,
  kPackaging,
  kMap
};
inline constexpr int kProceduralKinds = 8;
std::string ToString(ProceduralKind kind);

// A colour picture whose longer side is `side_px`.
Image PaintProcedural(ProceduralKind kind, std::uint64_t seed, int side_px = 640);

// `count` pictures, the kinds in turn, named "procedural/KIND-NNNN". Throws Error kInvalidArgument
// "option_out_of_range" when count < 1.
TextureSource ProceduralTextures(int count, std::uint64_t seed, int side_px = 640);

}  // namespace pliant::simulation
