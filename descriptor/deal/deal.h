// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The descriptors "deal" and "deal-fixed" (Potje et al., NeurIPS 2021).
#pragma once

#include <filesystem>
#include <memory>

#include "descriptor/features/descriptor.h"

namespace pliant {

enum class DealVariant {
  kWarped,  // "deal": the polar grid around each keypoint is bent by the learned thin-plate spline
  kFixed,   // "deal-fixed": the plain polar grid, for comparison
};

// 128 floats of unit length per keypoint. DescribeReference averages over three support radii, so
// that errors of a keypoint's size matter less, in twice the time. The keypoint's angle is not
// used; keypoints may lie outside the image, whose border pixels are replicated. model_id is the
// name, ":" and the first 16 hex digits of the weight file's SHA-256.
//
// Describe additionally throws kInvalidArgument for a keypoint that is not finite or has no
// positive size, and kTooLarge for more than 2^24 pixels. Concurrent calls with the same number
// of threads give bit-identical results. The other keypoints of a call, and the number of threads,
// change a descriptor by rounding only (below 1e-5 and 1e-4).
//
// Throws kNotFound or kCorrupt naming the weight file and the tensor.
std::shared_ptr<const Descriptor> MakeDealDescriptor(const std::filesystem::path& weights,
                                                     DealVariant variant);

}  // namespace pliant
