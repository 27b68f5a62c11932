// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The C library's calls on files, defined once more by the program that is linked with this: what
// concerns the folder of a simulated disk goes through it, SQLite's calls as well as ours, and all
// else straight to the C library. So the order between a database and the files beside it is seen.
#include <cstdarg>
#include <cstdio>

#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include "tests/chaos/faults/simulated_disk.h"

using pliant::chaos::SimulatedDisk;

namespace {

template <typename Function>
Function* Real(Function* /*same type*/, const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}
#define PLIANT_REAL(name)                        \
  (*[] {                                         \
    static auto* const f = Real(&::name, #name); \
    return f;                                    \
  }())

SimulatedDisk* DiskOf(const char* path) {
  SimulatedDisk* disk = SimulatedDisk::Watching();
  return disk != nullptr && path != nullptr && disk->Holds(path) ? disk : nullptr;
}

SimulatedDisk* DiskOf(int fd) {
  SimulatedDisk* disk = SimulatedDisk::Watching();
  return disk != nullptr && disk->Holds(fd) ? disk : nullptr;
}

mode_t ModeOf(int flags, std::va_list arguments) {
  return (flags & O_CREAT) != 0 ? static_cast<mode_t>(va_arg(arguments, int)) : 0;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  std::va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = ModeOf(flags, arguments);
  va_end(arguments);
  const auto real = [&] { return PLIANT_REAL(open)(path, flags, mode); };
  SimulatedDisk* disk = DiskOf(path);
  return disk == nullptr ? real() : static_cast<int>(disk->Open(path, flags, real));
}

int open64(const char* path, int flags, ...) {
  std::va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = ModeOf(flags, arguments);
  va_end(arguments);
  return open(path, flags, mode);
}

// Streams that read; nothing durable is written through one.
FILE* fopen64(const char* path, const char* mode) {
  FILE* file = nullptr;
  const auto real = [&]() -> std::int64_t {
    file = PLIANT_REAL(fopen64)(path, mode);
    return file == nullptr ? -1 : ::fileno(file);
  };
  SimulatedDisk* disk = DiskOf(path);
  if (disk == nullptr) {
    real();
  } else {
    disk->Open(path, mode[0] == 'r' ? O_RDONLY : O_WRONLY | O_CREAT | O_TRUNC, real);
  }
  return file;
}

int fclose(FILE* file) {
  SimulatedDisk* disk = SimulatedDisk::Watching();
  if (disk != nullptr) disk->Close(::fileno(file));
  return PLIANT_REAL(fclose)(file);
}

int close(int fd) {
  SimulatedDisk* disk = SimulatedDisk::Watching();
  if (disk != nullptr) disk->Close(fd);
  return PLIANT_REAL(close)(fd);
}

ssize_t read(int fd, void* data, size_t size) {
  const auto real = [&] { return PLIANT_REAL(read)(fd, data, size); };
  SimulatedDisk* disk = DiskOf(fd);
  return disk == nullptr ? real() : disk->Read(fd, real);
}

ssize_t pread64(int fd, void* data, size_t size, off64_t at) {
  const auto real = [&] { return PLIANT_REAL(pread64)(fd, data, size, at); };
  SimulatedDisk* disk = DiskOf(fd);
  return disk == nullptr ? real() : disk->Read(fd, real);
}

ssize_t pread(int fd, void* data, size_t size, off_t at) { return pread64(fd, data, size, at); }

ssize_t write(int fd, const void* data, size_t size) {
  const auto real = [&](std::size_t part) { return PLIANT_REAL(write)(fd, data, part); };
  SimulatedDisk* disk = DiskOf(fd);
  if (disk == nullptr) return real(size);
  return disk->Write(fd, data, size, ::lseek(fd, 0, SEEK_CUR), real);
}

ssize_t pwrite64(int fd, const void* data, size_t size, off64_t at) {
  const auto real = [&](std::size_t part) { return PLIANT_REAL(pwrite64)(fd, data, part, at); };
  SimulatedDisk* disk = DiskOf(fd);
  return disk == nullptr ? real(size) : disk->Write(fd, data, size, at, real);
}

ssize_t pwrite(int fd, const void* data, size_t size, off_t at) {
  return pwrite64(fd, data, size, at);
}

// The real flush is left out: the test waits for no disk.
int fsync(int fd) {
  SimulatedDisk* disk = DiskOf(fd);
  if (disk == nullptr) return PLIANT_REAL(fsync)(fd);
  return static_cast<int>(disk->Flush(fd, [] { return 0; }));
}

int fdatasync(int fd) {
  SimulatedDisk* disk = DiskOf(fd);
  if (disk == nullptr) return PLIANT_REAL(fdatasync)(fd);
  return static_cast<int>(disk->Flush(fd, [] { return 0; }));
}

int ftruncate64(int fd, off64_t size) noexcept {
  const auto real = [&] { return PLIANT_REAL(ftruncate64)(fd, size); };
  SimulatedDisk* disk = DiskOf(fd);
  return disk == nullptr ? real() : static_cast<int>(disk->Truncate(fd, size, real));
}

int ftruncate(int fd, off_t size) noexcept { return ftruncate64(fd, size); }

int rename(const char* from, const char* to) noexcept {
  const auto real = [&] { return PLIANT_REAL(rename)(from, to); };
  SimulatedDisk* disk = DiskOf(to);
  return disk == nullptr ? real() : static_cast<int>(disk->Rename(from, to, real));
}

int renameat2(int from_fd, const char* from, int to_fd, const char* to, unsigned flags) noexcept {
  const auto real = [&] { return PLIANT_REAL(renameat2)(from_fd, from, to_fd, to, flags); };
  SimulatedDisk* disk = DiskOf(to);
  return disk == nullptr ? real() : static_cast<int>(disk->Rename(from, to, real));
}

int link(const char* from, const char* to) noexcept {
  const auto real = [&] { return PLIANT_REAL(link)(from, to); };
  SimulatedDisk* disk = DiskOf(to);
  return disk == nullptr ? real() : static_cast<int>(disk->Link(from, to, real));
}

int unlink(const char* path) noexcept {
  const auto real = [&] { return PLIANT_REAL(unlink)(path); };
  SimulatedDisk* disk = DiskOf(path);
  return disk == nullptr ? real() : static_cast<int>(disk->Remove(path, real));
}

int rmdir(const char* path) noexcept {
  const auto real = [&] { return PLIANT_REAL(rmdir)(path); };
  SimulatedDisk* disk = DiskOf(path);
  return disk == nullptr ? real() : static_cast<int>(disk->Remove(path, real));
}

int remove(const char* path) noexcept {
  const auto real = [&] { return PLIANT_REAL(remove)(path); };
  SimulatedDisk* disk = DiskOf(path);
  return disk == nullptr ? real() : static_cast<int>(disk->Remove(path, real));
}

int mkdir(const char* path, mode_t mode) noexcept {
  const auto real = [&] { return PLIANT_REAL(mkdir)(path, mode); };
  SimulatedDisk* disk = DiskOf(path);
  return disk == nullptr ? real() : static_cast<int>(disk->MakeFolder(path, real));
}

}  // extern "C"
