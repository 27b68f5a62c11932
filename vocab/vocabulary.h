// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A visual vocabulary: k medoids of descriptors and their origin.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "descriptor/features/features.h"
#include "vocab/k_medoids.h"

namespace pliant {

inline constexpr std::size_t kMaxWords = 262'144;
inline constexpr std::size_t kMaxVocabularySamples = 4'000'000;

struct VocabularyOrigin {
  std::uint64_t seed = 0;
  std::uint64_t sampled = 0;    // size of the sample
  std::uint64_t available = 0;  // descriptors from which it was drawn
  double loss = 0;              // mean distance of a sample to its medoid
  std::string method;           // "fasterpam", "fasterpam tree"
};

// How residuals to the words are coded; see vocab/residual_codes.h.
struct Codebook {
  int code_bytes = 0;  // per descriptor; 0 = no codes
  // Floats only: a code has two parts a byte, of 16 centroids each.
  int part_dim = 0;              // components of a part; parts() * part_dim >= dim of the words
  std::vector<float> rotation;   // (parts() * part_dim) x dim, row-major, orthonormal columns
  std::vector<float> centroids;  // parts() x 16 x part_dim

  bool empty() const { return code_bytes == 0; }
  std::size_t parts() const { return 2 * static_cast<std::size_t>(code_bytes); }
  std::size_t padded_dim() const { return parts() * static_cast<std::size_t>(part_dim); }
};

struct Vocabulary {
  Descriptors words;     // k x dim
  std::string model_id;  // of the descriptors; only features of this model may be quantised
  VocabularyOrigin origin;
  Codebook codebook;  // empty = without codes; TrainVocabulary always makes one

  std::size_t size() const { return words.rows; }
};

// Trains by k-medoids on `samples`, a random sample drawn by the caller. Equal samples keep their
// weight in the loss but never give two equal words. With fewer than options.k distinct samples,
// the vocabulary has one word per distinct sample (check size()). Throws kInvalidArgument
// "no_samples", and what KMedoids throws.
Vocabulary TrainVocabulary(const Descriptors& samples, const std::string& model_id,
                           std::uint64_t available, const KMedoidsOptions& options);

}  // namespace pliant
