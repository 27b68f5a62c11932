// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/vocabulary.h"

#include <algorithm>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/match/distance.h"
#include "vocab/hierarchical_k_medoids.h"
#include "vocab/residual_codes.h"

namespace pliant {
namespace {

// Of descriptors with 64 or 128 components: longer codes find real photos no better
// (index/evaluation/README.md).
constexpr int kCodeBytes = 16;

// The codebook, which tells descriptors of one word apart.
void LearnCodes(const Descriptors& samples, std::span<const std::uint32_t> assignment,
                const KMedoidsOptions& options, Vocabulary* vocabulary) {
  vocabulary->codebook = TrainCodebook(samples, assignment, vocabulary->words, kCodeBytes,
                                       options.seed, options.threads);
}

void TrainInLevels(const Descriptors& samples, const KMedoidsOptions& options,
                   Vocabulary* vocabulary) {
  const HierarchicalKMedoidsResult result = HierarchicalKMedoids(samples, options);
  vocabulary->words = SelectRows(samples, result.medoids);
  LearnCodes(SelectRows(samples, result.judged), result.assignment, options, vocabulary);
  vocabulary->origin.loss = result.mean_loss;
  vocabulary->origin.method = "fasterpam tree";
}

void TrainExactly(const Descriptors& samples, const KMedoidsOptions& options,
                  Vocabulary* vocabulary) {
  const KMedoidsResult result = KMedoids(samples, options);
  // A converged result has no equal medoids while there are enough different samples: one of them
  // would be of more use elsewhere. One cut short by max_passes may.
  vocabulary->words = SelectRows(samples, DistinctRows(samples, result.medoids));
  std::unordered_map<std::string_view, std::uint32_t> word_of;
  for (std::uint32_t w = 0; w < vocabulary->size(); ++w) {
    word_of.emplace(RowBytes(vocabulary->words, w), w);
  }
  std::vector<std::uint32_t> words;
  for (const std::uint32_t medoid : result.assignment) {
    words.push_back(word_of.at(RowBytes(samples, result.medoids[medoid])));
  }
  LearnCodes(samples, words, options, vocabulary);
  vocabulary->origin.loss = result.loss / static_cast<double>(samples.rows);
  vocabulary->origin.method = "fasterpam";
}

}  // namespace

Vocabulary TrainVocabulary(const Descriptors& samples, const std::string& model_id,
                           std::uint64_t available, const KMedoidsOptions& options) {
  CheckDescriptors(samples, "vocabulary samples");
  if (samples.rows == 0) {
    throw Error(ErrorCode::kInvalidArgument, "no_samples",
                "A vocabulary cannot be trained without descriptors; index images first.");
  }
  KMedoidsOptions clustering = options;
  if (options.k > 1) {
    const std::size_t distinct = DistinctRows(samples, AllRows(samples.rows)).size();
    clustering.k = static_cast<int>(std::min(static_cast<std::size_t>(options.k), distinct));
  }
  Vocabulary vocabulary;
  vocabulary.model_id = model_id;
  vocabulary.origin.seed = options.seed;
  vocabulary.origin.sampled = samples.rows;
  vocabulary.origin.available = std::max<std::uint64_t>(available, samples.rows);
  if (samples.rows > kMaxExactSamples) {
    TrainInLevels(samples, clustering, &vocabulary);
  } else {
    TrainExactly(samples, clustering, &vocabulary);
  }
  return vocabulary;
}

}  // namespace pliant
