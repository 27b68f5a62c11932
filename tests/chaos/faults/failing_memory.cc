// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/chaos/faults/failing_memory.h"

#include <cstddef>
#include <cstdlib>
#include <new>
#include <stdexcept>

#include <dirent.h>
#include <dlfcn.h>
#include <sqlite3.h>

namespace pliant::chaos {
namespace {

struct Counter {
  bool armed = false;
  bool struck = false;
  std::uint64_t at = 0;
  std::uint64_t allocations = 0;
  int spared = 0;  // the next ones do not fail
};
thread_local constinit Counter counter;

bool Fails() {
  if (!counter.armed) return false;
  ++counter.allocations;
  if (counter.spared > 0) {
    --counter.spared;
    return false;
  }
  if (counter.struck || counter.at == 0 || counter.allocations < counter.at) return false;
  counter.struck = true;
  return true;
}

sqlite3_mem_methods& MethodsOfSqlite() {
  static sqlite3_mem_methods methods;
  return methods;
}

}  // namespace

FailingMemory::FailingMemory(std::uint64_t at) { counter = {true, false, at, 0, 0}; }
FailingMemory::~FailingMemory() { counter.armed = false; }
bool FailingMemory::struck() { return counter.struck; }
std::uint64_t FailingMemory::allocations() { return counter.allocations; }

void TakeOverMemoryOfSqlite() {
  sqlite3_mem_methods& methods = MethodsOfSqlite();
  if (sqlite3_config(SQLITE_CONFIG_GETMALLOC, &methods) != SQLITE_OK) {
    throw std::runtime_error("SQLite is in use already");
  }
  sqlite3_mem_methods failing = methods;
  failing.xMalloc = [](int size) { return Fails() ? nullptr : MethodsOfSqlite().xMalloc(size); };
  failing.xRealloc = [](void* old, int size) {
    return Fails() ? nullptr : MethodsOfSqlite().xRealloc(old, size);
  };
  if (sqlite3_config(SQLITE_CONFIG_MALLOC, &failing) != SQLITE_OK) {
    throw std::runtime_error("SQLite keeps its memory to itself");
  }
}

namespace {

void* Allocate(std::size_t size, std::size_t alignment) {
  if (Fails()) return nullptr;
  if (size == 0) size = 1;
  if (alignment <= alignof(std::max_align_t)) return std::malloc(size);
  return std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}

void* AllocateOrThrow(std::size_t size, std::size_t alignment) {
  void* memory = Allocate(size, alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace
}  // namespace pliant::chaos

using pliant::chaos::Allocate;
using pliant::chaos::AllocateOrThrow;
using pliant::chaos::counter;

// std::filesystem's iterators put the name together where an exception ends the program.
extern "C" dirent* readdir(DIR* directory) {
  constexpr int kAllocationsOfAName = 16;
  static auto* const real = reinterpret_cast<dirent* (*)(DIR*)>(::dlsym(RTLD_NEXT, "readdir"));
  counter.spared = kAllocationsOfAName;
  return real(directory);
}

void* operator new(std::size_t size) { return AllocateOrThrow(size, 1); }
void* operator new[](std::size_t size) { return AllocateOrThrow(size, 1); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return AllocateOrThrow(size, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return AllocateOrThrow(size, static_cast<std::size_t>(alignment));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return Allocate(size, 1); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return Allocate(size, 1); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
