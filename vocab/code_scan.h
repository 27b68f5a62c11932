// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The inner loop of ranking by nearest neighbours: estimated distances from one query descriptor to
// a list of codes (vocab/residual_codes.h), 32 at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "vocab/residual_codes.h"

namespace pliant {

inline constexpr std::size_t kCodeBlock = 32;

// Codes of one word, laid out for the scan: blocks of 32 codes, the last one shorter; within a
// block of n codes byte j of all of them comes first, n bytes, then byte j + 1. The memory must be
// readable for kCodeBlock bytes beyond the last code (kCodePadding).
struct CodeList {
  const std::uint8_t* codes = nullptr;
  const std::int16_t* biases = nullptr;  // nullptr for binary descriptors
  std::size_t size = 0;
  std::size_t bytes = 0;  // per code
};
inline constexpr std::size_t kCodePadding = kCodeBlock;

// Appends `count` codes, row-major, to `list` in that layout.
void AppendCodes(const std::uint8_t* codes, std::size_t count, std::size_t bytes,
                 std::vector<std::uint8_t>* list);
// The i-th code of a list, row-major.
void CopyCode(const CodeList& list, std::size_t i, std::uint8_t* code);

struct NearCode {
  std::uint32_t index = 0;     // in the list
  float squared_distance = 0;  // Hamming distance for binary descriptors
};

// The query to a list.
struct CodeQuery {
  const LookupTable* table = nullptr;  // floats
  float base = 0;                      // |q - w|^2 for the list's word w
  float bias_step = 0;
  std::span<const std::uint8_t> bits;  // binary descriptors: the query
  float limit = 0;                     // only distances below it
};

// Prefetches the beginning of a list, so that a scan soon afterwards does not wait.
void Prefetch(const CodeList& list);

// Writes those codes of the list that are nearer than query.limit to `near`, which has room for
// list.size, in order; returns how many. The same on every processor.
std::size_t ScanCodes(const CodeList& list, const CodeQuery& query, NearCode* near);

}  // namespace pliant
