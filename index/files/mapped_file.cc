// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/mapped_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include "index/files/durable_file.h"

namespace pliant {

std::shared_ptr<const std::string_view> MapFile(const std::filesystem::path& path) {
  const FileHandle file(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
  struct stat info = {};
  if (!file.is_open() || ::fstat(file.get(), &info) != 0) ThrowErrno("cannot read", path);
  const auto size = static_cast<std::size_t>(info.st_size);
  if (size == 0) return std::make_shared<const std::string_view>();
  void* const data = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, file.get(), 0);
  if (data == MAP_FAILED) ThrowErrno("cannot map", path);
  return {new std::string_view(static_cast<const char*>(data), size),
          [](const std::string_view* bytes) {
            ::munmap(const_cast<char*>(bytes->data()), bytes->size());
            delete bytes;
          }};
}

}  // namespace pliant
