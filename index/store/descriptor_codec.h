// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Descriptors in few bytes. A row of floats is rotated, its components are rounded to 0.55 of their
// root mean square, and frequent values get shorter codes: 3 bits a component.
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

// Appends all rows. Throws kInvalidArgument for values that are not finite or above 1e30.
void PutDescriptors(const Descriptors& descriptors, std::vector<std::uint8_t>* out);

// Those that begin at `*offset`, which moves behind them. Throws kCorrupt "blob_corrupt" where they
// are cut short, or a length is none that a row can have.
Descriptors GetDescriptors(Bytes bytes, std::size_t* offset, DescriptorKind kind, std::size_t rows,
                           int dim);

}  // namespace pliant
