// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <malloc.h>

namespace pliant {

// Lets malloc keep what one image needed for the next one. By default it returns blocks of more
// than 128 kB to the system, which gives them back page by page: a tenth of the time of indexing.
// For programs, at their start.
inline void ReuseMemory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the largest that glibc takes
  mallopt(M_TRIM_THRESHOLD, 128 << 20);
}

}  // namespace pliant
