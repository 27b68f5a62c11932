// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A random sample of the stored descriptors. Private to index/.
#pragma once

#include <cstdint>

#include "index/store/sqlite/catalogue.h"

namespace pliant {

// See Catalogue::SampleDescriptors.
DescriptorSample SampleDescriptors(Connection& db, Key collection, const DescriptorInfo& model,
                                   std::size_t count, std::uint64_t seed);

}  // namespace pliant
