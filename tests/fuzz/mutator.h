// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Changes inputs a little, the same way in every run: for the replay of corpora without libFuzzer.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

namespace pliant::fuzz {

using ByteVector = std::vector<std::uint8_t>;

class Mutator {
 public:
  // `corpus` must outlive it and not be empty.
  Mutator(const std::vector<ByteVector>& corpus, std::uint64_t seed)
      : corpus_(corpus), random_(seed) {}

  // One to four changes: bits, bytes, numbers, parts left out, doubled, or taken from another file.
  // At most 64 KiB.
  ByteVector Mutated(ByteVector bytes);

 private:
  std::size_t Below(std::size_t limit);  // 0..limit-1; 0 for a limit of 0
  void ChangeOnce(ByteVector& bytes);
  void SetNumber(ByteVector& bytes);
  void InsertSome(ByteVector& bytes, const ByteVector& from);

  const std::vector<ByteVector>& corpus_;
  std::mt19937_64 random_;
};

}  // namespace pliant::fuzz
