// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The textures used in a scene. Internal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "descriptor/simulation/random.h"
#include "descriptor/simulation/texture_source.h"

namespace pliant::simulation {

// The object's picture first, then some others for backgrounds, backs and solids.
using Cast = std::vector<std::shared_ptr<const Texture>>;

// Which texture scene `index` shows: all of them in turn, but neighbours in the source (often of
// one kind) far apart, so that the first scenes of a set are as mixed as the whole.
std::size_t TextureOfScene(std::size_t count, std::uint64_t seed, std::uint64_t index);

// `own`: number of the object's texture.
Cast DrawCast(const TextureSource& textures, std::size_t own, Random& random);

// The same for a scene of the preset objects: others come from the half of the textures that scenes
// take last. As long as a set has no more objects than the other half, no picture shows another
// object of the set in its background, where two answers would be correct.
Cast DrawObjectCast(const TextureSource& textures, std::size_t own, std::uint64_t seed,
                    Random& random);

// One of the others; null where there is none.
const Texture* AnyOther(const Cast& cast, Random& random);

}  // namespace pliant::simulation
