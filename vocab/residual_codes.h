// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Codes: the position of a descriptor within its word, in a few bytes. They are enough to estimate
// a query's distance to the descriptor.
//
// Float descriptors: product quantisation of the residual to the word (Jegou, Douze and Schmid,
// "Product quantization for nearest neighbor search", PAMI 2011) after a learned rotation (Ge, He,
// Ke and Sun, "Optimized product quantization", PAMI 2014, the parametric one). Each part of the
// rotated residual has 16 centroids, so that two parts share a byte and 32 distances are looked up
// by one byte shuffle (Andre, Kermarrec and Le Scouarnec, "Cache locality is not enough", VLDB
// 2015; code_scan.h). Binary descriptors are short: their code is the descriptor.
//
// Let x' = w + R^T c be the descriptor that code c of word w encodes, and q a query:
//   |q - x'|^2 = |q - w|^2 + b - 2 (R q).c,   b = |c|^2 + 2 (R w).c,
// The sums over parts depend on the query only, for every word. The bias b depends on the code only
// and is stored with it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "descriptor/features/coded_descriptors.h"
#include "descriptor/features/features.h"
#include "vocab/row_coding.h"
#include "vocab/vocabulary.h"

namespace pliant {

// Learned on the residuals of `samples` to their words: assignment[i] is the word of sample i. A
// code gets `bytes` bytes of two parts each (1 to 128), but at most one for two components.
// Deterministic, for any number of threads (0 = all cores). For binary descriptors only the size is
// set. Throws kInvalidArgument "code_bytes_invalid", "no_samples".
Codebook TrainCodebook(const Descriptors& samples, std::span<const std::uint32_t> assignment,
                       const Descriptors& words, int bytes, std::uint64_t seed = 1,
                       int threads = 0);

// Throws kInvalidArgument "codebook_malformed" for contradictory sizes or values that are not
// finite.
void CheckCodebook(const Codebook& codebook, const Descriptors& words);

// The lookup table of a query descriptor: the distance that each centroid of each part adds, in
// whole steps, part by part.
struct LookupTable {
  std::vector<std::uint8_t> entries;  // parts x 16
  float step = 0;
  float offset = 0;  // the sum of the parts' least distances
};

struct Codes {
  std::vector<std::uint8_t> bytes;   // code_bytes() each
  std::vector<std::int16_t> biases;  // b of each, in steps of bias_step(); empty when binary
};

// Descriptors to codes. Immutable and thread-safe.
class ResidualCoder {
 public:
  // Throws kInvalidArgument "codebook_malformed", also for a vocabulary without codebook.
  explicit ResidualCoder(std::shared_ptr<const Vocabulary> vocabulary);

  bool binary() const { return binary_; }
  std::size_t code_bytes() const { return code_bytes_; }

  // The codes of these rows in these words. Throws kCorrupt "blob_corrupt" (ReadCodedRow).
  Codes Encode(const CodedDescriptors& descriptors, std::span<const std::uint32_t> rows,
               std::span<const std::uint32_t> words) const;
  float bias_step() const { return bias_step_; }

  // Floats only.
  LookupTable TableOf(std::span<const float> query) const;

 private:
  void SetRotation();
  void SetCentroids();
  std::size_t Output(std::size_t component) const;  // of a rotated vector (RowTables)
  const std::int16_t* Word(std::size_t word) const {
    return words_.data() + word * tables_.outputs;
  }

  std::shared_ptr<const Vocabulary> vocabulary_;
  bool binary_;
  std::size_t code_bytes_;
  RowTables tables_;
  std::vector<float> rotation_;      // as tables_ has it, in floats
  std::vector<std::int16_t> words_;  // rotated, output by output
  float rotation_step_ = 0;
  float unit_ = 0;  // of words_
  float bias_step_ = 0;
  float bias_factor_ = 0;
};

}  // namespace pliant
