// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Data-parallel loops with an explicit number of threads, from one pool of the process.
#pragma once

#include <cstddef>
#include <functional>

namespace pliant {

// 0 (or less) = all cores, otherwise `threads`.
int ResolveThreads(int threads);

// Calls body(i) for i = 0..n-1, handed out in order to at most `threads` threads (0 = all cores;
// the caller's own is one of them) and returns when all are done. If bodies throw, the exception of
// the lowest i is thrown here, and bodies not yet started are skipped. Bodies should be worth 10
// microseconds or more. Thread-safe; bodies may call it, and so may the child of a fork. The pool
// grows to the number of threads that all loops together request, and keeps them.
void ParallelFor(std::size_t n, int threads, const std::function<void(std::size_t)>& body);

// As ParallelFor, for bodies that need memory of their own: body(i, worker) with worker below
// ParallelWorkers(n, threads), and never two at once with the same worker.
void ParallelForWorkers(std::size_t n, int threads,
                        const std::function<void(std::size_t i, std::size_t worker)>& body);
std::size_t ParallelWorkers(std::size_t n, int threads);

}  // namespace pliant
