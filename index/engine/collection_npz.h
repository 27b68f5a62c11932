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

// Writes the features of the images in `list`, all of one state. Returns the number of images.
// `begin` receives the size of the file before the first byte is written. Memory does not grow with
// the collection. Throws as Engine::ForEachPage does, and what `begin` and `write` throw.
std::int64_t WriteFeaturesNpz(Engine& engine, ImageListing list,
                              const std::function<void(std::uint64_t bytes)>& begin,
                              const NpzArchive::Write& write);

}  // namespace pliant
