// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Reader of the safetensors format (https://github.com/huggingface/safetensors):
// u64 little-endian header length | JSON header | tensor data, little-endian and contiguous.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace pliant::deal {

struct TensorInfo {
  std::string dtype;                // "F32", "F16", ...
  std::vector<std::int64_t> shape;  // row-major; empty = a scalar
  std::size_t begin = 0;            // bytes from the start of the data section
  std::size_t end = 0;

  std::size_t count() const;  // product of the shape
};

// "[64, 3, 7, 7]"
std::string ShapeText(const std::vector<std::int64_t>& shape);

// A whole file in memory, every size, offset and type checked before anything is allocated for it:
// tensors lie inside the file, do not overlap, leave no gap, and are as long as their shape says.
// Immutable, so safe to share between threads.
class SafetensorsFile {
 public:
  // Throws kNotFound "model_not_found" when there is no such file, kCorrupt "model_corrupt" naming
  // the file and the tensor for anything malformed.
  static SafetensorsFile Open(const std::filesystem::path& path);

  // The same from bytes; `name` stands for the file in messages.
  static SafetensorsFile Parse(std::vector<std::uint8_t> bytes, std::string name);

  const std::string& name() const { return name_; }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }
  const std::map<std::string, TensorInfo>& tensors() const { return tensors_; }
  const std::map<std::string, std::string>& metadata() const { return metadata_; }

  // The values of an F32 tensor, row-major. Throws kCorrupt when the tensor is missing, of another
  // type, or holds NaN or infinity.
  std::vector<float> Floats(const std::string& tensor) const;

 private:
  std::string name_;
  std::vector<std::uint8_t> bytes_;
  std::size_t data_start_ = 0;
  std::map<std::string, TensorInfo> tensors_;
  std::map<std::string, std::string> metadata_;
};

}  // namespace pliant::deal
