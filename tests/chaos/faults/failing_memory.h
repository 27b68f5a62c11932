// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Allocations that fail: operator new and SQLite's, of the thread that asked for it.
#pragma once

#include <cstdint>

namespace pliant::chaos {

class FailingMemory {
 public:
  // From now on the `at`-th allocation of this thread fails, once; 0: none.
  explicit FailingMemory(std::uint64_t at);
  ~FailingMemory();
  FailingMemory(const FailingMemory&) = delete;
  FailingMemory& operator=(const FailingMemory&) = delete;

  static bool struck();
  static std::uint64_t allocations();
};

// Must be called before SQLite is used.
void TakeOverMemoryOfSqlite();

}  // namespace pliant::chaos
