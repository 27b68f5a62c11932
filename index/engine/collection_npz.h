// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The features of a collection as one NumPy archive (files/features_npz.h): `names` are the
// images' ids, and `objects` what they show.
#pragma once

#include <cstdint>
#include <functional>

#include "index/engine/engine.h"
#include "index/files/features_npz.h"

namespace pliant {

// Of the images that `list` names, all of one state; how many. `begin` hears how many bytes the
// file will have, before the first is written. Memory does not grow with the collection. Throws as
// Engine::ForEachPage does, and what `begin` and `write` throw.
std::int64_t WriteFeaturesNpz(Engine& engine, ImageListing list,
                              const std::function<void(std::uint64_t bytes)>& begin,
                              const NpzArchive::Write& write);

}  // namespace pliant
