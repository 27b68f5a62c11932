// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Compiles hot loops for several instruction sets. PLIANT_KERNEL_FILE holds each loop once, on
// vectors of PLIANT_LANES floats, and defines `kTable` in the namespace PLIANT_KERNELS. It is
// included once for each instruction set, in a namespace of its own, instead of function clones:
// those resolve before main, where the sanitizers cannot run yet.
#include <vector>

#define PLIANT_INLINE inline __attribute__((always_inline))
#define PLIANT_TEXT_OF(name) #name
#define PLIANT_TEXT(name) PLIANT_TEXT_OF(name)

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define PLIANT_X86_KERNELS 1
#endif

#define PLIANT_LANES 4
#define PLIANT_KERNELS baseline
#include PLIANT_KERNEL_FILE
#undef PLIANT_LANES
#undef PLIANT_KERNELS

#ifdef PLIANT_X86_KERNELS
#pragma GCC push_options
#pragma GCC target("avx2,fma,popcnt")
#define PLIANT_LANES 8
#define PLIANT_KERNELS avx2
#include PLIANT_KERNEL_FILE
#undef PLIANT_LANES
#undef PLIANT_KERNELS
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,popcnt")
#define PLIANT_LANES 16
#define PLIANT_KERNELS avx512
#include PLIANT_KERNEL_FILE
#undef PLIANT_LANES
#undef PLIANT_KERNELS
#pragma GCC pop_options
#endif

namespace PLIANT_KERNEL_NAMESPACE {

const std::vector<const Kernels*>& UsableKernels() {
  static const std::vector<const Kernels*> usable = [] {
    std::vector<const Kernels*> kernels;
#ifdef PLIANT_X86_KERNELS
    const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                      __builtin_cpu_supports("popcnt");
    if (avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw")) {
      kernels.push_back(&avx512::kTable);
    }
    if (avx2) kernels.push_back(&avx2::kTable);
#endif
    kernels.push_back(&baseline::kTable);
    return kernels;
  }();
  return usable;
}

}  // namespace PLIANT_KERNEL_NAMESPACE
