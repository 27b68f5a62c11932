// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Descriptors in few bytes. A row of floats is rotated and its components rounded to 4 bits.
//
// The rotation (random signs, then the Walsh-Hadamard transform) spreads what a row says over all
// of its components, so that one step size suits them all, whatever the descriptor (Ailon and
// Chazelle, "The fast Johnson-Lindenstrauss transform", SIAM J. Comput. 2009). index/FORMAT.md has
// the bytes. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/image/image.h"

namespace pliant {

// Bytes of one row: for floats a scale and half a byte for each of dim components, rounded up to a
// power of two; for bits as they are.
std::size_t CodedRowBytes(DescriptorKind kind, int dim);

// Appends all rows. Throws kInvalidArgument for values that are not finite or above 1e30.
void PutDescriptors(const Descriptors& descriptors, std::vector<std::uint8_t>* out);

// `bytes` holds rows x CodedRowBytes. Throws kCorrupt for a scale that no row can have.
Descriptors GetDescriptors(Bytes bytes, DescriptorKind kind, std::size_t rows, int dim);

}  // namespace pliant
