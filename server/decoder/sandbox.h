// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Permanent limits of a process before it reads bytes from outside.
#pragma once

#include <cstdint>
#include <string>

namespace pliant::server {

// Sanitizers need memory without limit and system calls that decoding does not: such a build has no
// limit on memory and no filter of system calls.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif
#else
inline constexpr bool kSanitized = false;
#endif

struct SandboxLimits {
  std::int64_t memory_bytes = 0;  // of address space, beyond what the process has now
  std::int64_t cpu_s = 0;         // of processor time, from the start of the process
};

// Limits this process for ever: no new privileges, no tracing, no core dumps, no more open files,
// no growing files, and `limits`. Then its system calls: it can read and write `socket` and get
// memory; any other call ends it (SIGSYS). `socket` is the last of its open files, and no other
// thread runs. Returns why system calls are not limited, empty when they are. Throws Error
// kInternal when anything else fails.
std::string EnterSandbox(int socket, const SandboxLimits& limits);

}  // namespace pliant::server
