// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A few objects to try Pliant with, made of nothing but code: each painted flat, as one would add
// it, and photographed crumpled, as one would look for it.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "descriptor/image.h"

namespace pliant::simulation {

// What the objects are called, in order: "town map", ...
const std::vector<std::string>& DemonstrationObjects();

// Object `number` < DemonstrationObjects().size(), in colour; throws Error kInvalidArgument
// "option_out_of_range" beyond. The same on every call; thread-safe. The flat picture takes
// milliseconds, the crumpled one about a second.
Image PaintDemonstrationObject(std::size_t number);
Image CrumpleDemonstrationObject(std::size_t number);

}  // namespace pliant::simulation
