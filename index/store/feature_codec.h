// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The compact, checked byte form of features, as kept in the database. The format is described byte
// by byte in index/FORMAT.md.
#pragma once

#include <cstdint>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/image/image.h"

namespace pliant {

// How descriptors lie in a feature blob. The encoder chooses.
enum class DescriptorEncoding : std::uint8_t {
  kBits = 0,        // binary descriptors, as they are
  kUint8 = 1,       // floats that are all whole numbers 0..255 (OpenCV's SIFT): lossless
  kScaledInt8 = 2,  // float32 scale s = max|v| / 127 a row, then round(v / s) as int8
};

// Throws kInvalidArgument for descriptors that are not finite or do not fit the keypoints.
std::vector<std::uint8_t> EncodeFeatures(const Features& features);

// Throws kCorrupt when anything about the blob is wrong: magic, version, sizes, checksum. The
// model id is kept beside the blob, not in it: it comes back empty.
Features DecodeFeatures(Bytes blob);

// `features` as they will be once stored and read again. Queries and new images are quantised in
// this precision, so that an image gets the same words when it is asked for as when it was stored.
// Throws what EncodeFeatures throws.
Features InStoredPrecision(Features features);

}  // namespace pliant
