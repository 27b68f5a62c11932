// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A random sample of the stored descriptors. Private to index/.
#pragma once

#include <cstdint>

#include "index/store/sqlite/catalogue.h"

namespace pliant {

struct DescriptorSample {
  Descriptors descriptors;      // at most `count` rows
  std::uint64_t available = 0;  // descriptors there are
};

// Each descriptor of the collection is as likely as any other, none is drawn twice. The same seed
// and pictures give the same sample, in whatever order the pictures were added.
DescriptorSample SampleDescriptors(Connection& db, const CollectionRow& collection,
                                   const DescriptorInfo& model, std::size_t count,
                                   std::uint64_t seed);

}  // namespace pliant
