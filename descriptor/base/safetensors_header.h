// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The header of a safetensors file, checked. Internal to safetensors.cc.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "descriptor/base/safetensors.h"

namespace pliant {

inline constexpr std::size_t kSafetensorsLengthBytes = 8;  // of the header's length

// Throws kCorrupt "tensor_file_corrupt": "FILE: FAULT".
[[noreturn]] void FailSafetensors(const std::string& file, const std::string& fault);

// The header's length from the file's first bytes (`start`, at most 8); never more than the file
// has, nor more than any header needs.
std::size_t SafetensorsHeaderBytes(const std::string& file, std::string_view start,
                                   std::uintmax_t file_bytes);

// `text` is the JSON, behind which `data_bytes` of data follow.
SafetensorsHeader ParseSafetensorsHeader(const std::string& file, std::string_view text,
                                         std::size_t data_bytes);

}  // namespace pliant
