// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Words for many stored images at once.
#pragma once

#include <span>
#include <vector>

#include "index/store/catalogue.h"
#include "index/store/writer.h"
#include "vocab/quantizer.h"

namespace pliant {

inline constexpr int kImagesABatch = 64;

// One matrix product for the whole batch instead of one for each image.
std::vector<ImageWords> QuantizeBatch(const Quantizer& quantizer,
                                      std::span<const StoredFeatures> batch, int threads);

}  // namespace pliant
