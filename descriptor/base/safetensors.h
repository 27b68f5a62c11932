// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The safetensors format (https://github.com/huggingface/safetensors), for weights, scenes, texture
// packs and features: u64 little-endian header length | JSON header | tensor data, little-endian
// and contiguous. Readers check every size, offset and type before anything is allocated for it:
// tensors lie inside the file, do not overlap, leave no gap, and are as long as their shape says.
// They throw kNotFound "file_unreadable" for a missing file, and kCorrupt "tensor_file_corrupt"
// naming the file and the tensor for anything malformed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <system_error>
#include <vector>

namespace pliant {

using TensorShape = std::vector<std::int64_t>;  // row-major; empty = a scalar

struct TensorInfo {
  std::string dtype;  // "F32", "F16", ...
  TensorShape shape;
  std::size_t begin = 0;  // bytes from the start of the data section
  std::size_t end = 0;

  std::size_t count() const;  // product of the shape
};

struct Tensor {
  std::string name;
  std::string dtype;
  TensorShape shape;
  std::vector<std::uint8_t> bytes;
};

struct SafetensorsHeader {
  std::size_t data_begin = 0;  // bytes from the start of the file
  std::map<std::string, TensorInfo> tensors;
  std::map<std::string, std::string> metadata;
};

// "[64, 3, 7, 7]"
std::string ShapeText(const TensorShape& shape);

// The header of a file alone: a set may have thousands of files of many megabytes.
SafetensorsHeader ReadSafetensorsHeader(const std::filesystem::path& path);

// All tensors in the order of their names, read one by one, so that only one copy is in memory.
std::vector<Tensor> ReadSafetensors(const std::filesystem::path& path);

// Replaces the file in one step (see ReplaceFile), the tensors' data in the order given: the widest
// types first keep all of them aligned. Invalid UTF-8 in a name or in the metadata is replaced by
// U+FFFD. Returns the system's error, as ReplaceFile does.
[[nodiscard]] std::error_code WriteSafetensors(const std::filesystem::path& path,
                                               const std::vector<Tensor>& tensors,
                                               const std::map<std::string, std::string>& metadata);

// A whole file in memory. Immutable, so safe to share between threads.
class SafetensorsFile {
 public:
  // Files above 1 GiB are refused.
  static SafetensorsFile Open(const std::filesystem::path& path);

  // The same from bytes; messages use `name` as the file's name.
  static SafetensorsFile Parse(std::vector<std::uint8_t> bytes, std::string name);

  const std::string& name() const { return name_; }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }
  const std::map<std::string, TensorInfo>& tensors() const { return header_.tensors; }
  const std::map<std::string, std::string>& metadata() const { return header_.metadata; }

  // The bytes of a tensor of this file.
  std::span<const std::uint8_t> Data(const TensorInfo& tensor) const;

  // The values of an F32 or F16 tensor, row-major. Throws kCorrupt when the tensor is missing, of
  // another type, or holds NaN or infinity.
  std::vector<float> Floats(const std::string& tensor) const;

 private:
  std::string name_;
  std::vector<std::uint8_t> bytes_;
  SafetensorsHeader header_;
};

}  // namespace pliant
