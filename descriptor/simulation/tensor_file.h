// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Safetensors files, as far as scenes and texture packs need them: 8 bytes length of the header
// (little-endian), a JSON header, then the tensors' bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace pliant::simulation {

struct Tensor {
  std::string name;
  std::string type;  // "U8", "U16", "F32"
  std::vector<std::size_t> shape;
  std::vector<std::uint8_t> bytes;
};

// Written to a temporary file beside it, then renamed. `metadata` values are strings, as the format
// demands. Throws Error kNoSpace "file_unwritable".
void WriteTensorFile(const std::filesystem::path& path, const std::vector<Tensor>& tensors,
                     const std::map<std::string, std::string>& metadata);

// Tensors in the order of their names; the metadata is not read. All sizes are checked before
// memory is taken. Throws Error kNotFound "file_unreadable", kCorrupt "tensor_file_corrupt".
std::vector<Tensor> ReadTensorFile(const std::filesystem::path& path);

// A JSON string literal with its quotes.
std::string JsonQuote(std::string_view text);

}  // namespace pliant::simulation
