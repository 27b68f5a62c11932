// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Selects some of an image's features. Private to index/.
#pragma once

#include <functional>

#include "descriptor/features/features.h"

namespace pliant {

// The keypoints that `keep` accepts, with their descriptors, in their order.
Features Subset(const Features& features, const std::function<bool(const Keypoint&)>& keep);

}  // namespace pliant
