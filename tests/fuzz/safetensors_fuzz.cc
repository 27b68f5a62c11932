// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The safetensors reader, from memory and from a file.
#include <algorithm>

#include <sys/mman.h>
#include <unistd.h>

#include "descriptor/base/safetensors.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::fuzz::Accepts;
using pliant::fuzz::Require;

// A file that exists in memory only.
class MemoryFile {
 public:
  explicit MemoryFile(pliant::fuzz::Input bytes) : fd_(memfd_create("input", 0)) {
    Require(
        fd_ >= 0 && write(fd_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()),
        "a file in memory can be written");
  }
  ~MemoryFile() { close(fd_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  std::filesystem::path path() const { return "/proc/self/fd/" + std::to_string(fd_); }

 private:
  int fd_;
};

void CheckTensors(const pliant::SafetensorsFile& file) {
  std::size_t bytes = 0;
  for (const auto& tensor : file.tensors()) {  // clang 14: lambdas capture no structured bindings
    const pliant::TensorInfo& info = tensor.second;
    const auto data = file.Data(info);
    Require(data.data() >= file.bytes().data() &&
                data.data() + data.size() <= file.bytes().data() + file.bytes().size(),
            "a tensor lies inside of the file");
    bytes += data.size();
    std::vector<float> values;
    if (Accepts([&] { values = file.Floats(tensor.first); })) {
      Require(values.size() == info.count(), "a tensor has as many values as its shape says");
    }
  }
  Require(bytes < file.bytes().size(), "tensors do not overlap");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const pliant::fuzz::Input bytes(data, size);
  const bool accepted = Accepts(
      [&] { CheckTensors(pliant::SafetensorsFile::Parse(pliant::fuzz::CopyOf(bytes), "input")); });
  const MemoryFile file(bytes);
  std::vector<pliant::Tensor> tensors;
  const bool read = Accepts([&] { tensors = pliant::ReadSafetensors(file.path()); });
  Require(read == accepted, "a file is read from memory and from the disk alike");
  const bool has_header = Accepts([&] { pliant::ReadSafetensorsHeader(file.path()); });
  Require(has_header == accepted, "a file whose header is accepted is accepted");
  return 0;
}
