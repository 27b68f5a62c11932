// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Codes: where within its word a descriptor lies, in a few bytes, so that a query's distance to it
// can be estimated without the descriptor itself.
//
// Float descriptors: product quantisation of the residual to the word (Jegou, Douze and Schmid,
// "Product quantization for nearest neighbor search", PAMI 2011) after a learned rotation (Ge, He,
// Ke and Sun, "Optimized product quantization", PAMI 2014, the parametric one). Each part of the
// rotated residual has 16 centroids, so that two parts share a byte and 32 distances are looked up
// by one byte shuffle (Andre, Kermarrec and Le Scouarnec, "Cache locality is not enough", VLDB
// 2015; code_scan.h). Binary descriptors are short: their code is the descriptor.
//
// With x' = w + R^T c the descriptor that the code c of word w stands for, and q a query,
//   |q - x'|^2 = |q - w|^2 + b - 2 (R q).c,   b = |c|^2 + 2 (R w).c,
// so the sums over parts depend on the query only, whatever word is looked into, and the bias b on
// the code only: it is kept beside the code.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "descriptor/features/features.h"
#include "vocab/vocabulary.h"

namespace pliant {

struct CodebookOptions {
  int bytes = 32;       // per code: two parts each; at most half the descriptor's components
  int iterations = 12;  // of k-means
  std::uint64_t seed = 1;
};

// Learned on the residuals of `samples` to their words: assignment[i] is the word of sample i.
// Deterministic. For binary descriptors there is nothing to learn but the size. Throws
// kInvalidArgument "codebook_options_invalid", "no_samples".
Codebook TrainCodebook(const Descriptors& samples, std::span<const std::uint32_t> assignment,
                       const Descriptors& words, const CodebookOptions& options = {});

// Throws kInvalidArgument "codebook_malformed" for sizes that do not fit together or values that
// are not finite.
void CheckCodebook(const Codebook& codebook, const Descriptors& words);

// What a query descriptor looks up: the distance that each centroid of each part adds, in whole
// steps, part by part.
struct LookupTable {
  std::vector<std::uint8_t> entries;  // parts x 16
  float step = 0;
  float offset = 0;  // the sum of the parts' least distances
};

// Descriptors to codes. Immutable and thread-safe.
class ResidualCoder {
 public:
  // Throws kInvalidArgument "codebook_malformed", also for a vocabulary without codebook.
  explicit ResidualCoder(std::shared_ptr<const Vocabulary> vocabulary);

  bool binary() const { return binary_; }
  std::size_t code_bytes() const { return code_bytes_; }

  // `code` gets code_bytes() bytes.
  void Encode(const Descriptors& descriptors, std::size_t row, std::uint32_t word,
              std::uint8_t* code) const;
  // b of the code, in steps of bias_step(); 0 when binary.
  std::int16_t Bias(std::uint32_t word, const std::uint8_t* code) const;
  float bias_step() const { return bias_step_; }

  // Floats only.
  LookupTable TableOf(std::span<const float> query) const;

 private:
  std::vector<float> Rotated(std::span<const float> vector) const;

  std::shared_ptr<const Vocabulary> vocabulary_;
  bool binary_;
  std::size_t code_bytes_;
  std::vector<float> columns_;        // of the rotation: dim x padded_dim
  std::vector<float> rotated_words_;  // words x padded_dim
  float bias_step_ = 0;
};

}  // namespace pliant
