// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Demonstration objects, generated without any files: each is rendered flat, as a picture to index,
// and crumpled, as a query.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "descriptor/image/image.h"

namespace pliant::simulation {

// The names of the objects, in order: "town map", ...
const std::vector<std::string>& DemonstrationObjects();

// Of object `number` < DemonstrationObjects().size(); throw Error kInvalidArgument
// "option_out_of_range" beyond. The same on every call; thread-safe. Pictures are in colour; the
// flat one takes milliseconds, the crumpled one about a second.
std::string DemonstrationMaterial(std::size_t number);  // "paper" or "cloth"
Image PaintDemonstrationObject(std::size_t number);
Image CrumpleDemonstrationObject(std::size_t number);

}  // namespace pliant::simulation
