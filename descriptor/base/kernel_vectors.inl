// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Vectors of PLIANT_LANES floats. Kernel files (kernel_sets.inl) include it in their namespace.

constexpr int kWidth = PLIANT_LANES;
using Vec = float __attribute__((vector_size(kWidth * sizeof(float))));
// The same in memory that holds plain floats, at any address.
using UnalignedVec =
    float __attribute__((vector_size(kWidth * sizeof(float)), aligned(4), may_alias));

PLIANT_INLINE Vec Load(const float* from) { return *reinterpret_cast<const UnalignedVec*>(from); }

PLIANT_INLINE void Store(const Vec& from, float* to) {
  *reinterpret_cast<UnalignedVec*>(to) = from;
}
