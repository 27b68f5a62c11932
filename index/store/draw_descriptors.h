// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A random sample of the stored descriptors, wherever they are kept. Private to index/store/.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "descriptor/features/descriptor.h"
#include "index/store/catalogue.h"

namespace pliant {

struct StoredCount {
  Key key = 0;
  std::uint64_t descriptors = 0;
};

// The encoded features of some of the images, in their order.
using LoadEncoded = std::function<std::vector<std::vector<std::uint8_t>>(std::span<const Key>)>;

// See Catalogue::SampleDescriptors. `images`: those of the collection in order of their ids.
DescriptorSample DrawDescriptors(const DescriptorInfo& model, std::span<const StoredCount> images,
                                 std::size_t count, std::uint64_t seed, const LoadEncoded& load);

}  // namespace pliant
