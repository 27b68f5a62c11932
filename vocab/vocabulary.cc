// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/vocabulary.h"

#include <algorithm>
#include <cstring>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "descriptor/distance.h"
#include "descriptor/error.h"

namespace pliant {
namespace {

// The bytes of a row. Two rows are the same word when their bytes are.
std::string_view RowBytes(const Descriptors& d, std::size_t row) {
  if (d.kind == DescriptorKind::kFloat) {
    return {reinterpret_cast<const char*>(d.float_row(row).data()), d.dim * sizeof(float)};
  }
  return {reinterpret_cast<const char*>(d.binary_row(row).data()), static_cast<std::size_t>(d.dim)};
}

// How many of the rows differ, counted up to `enough`.
std::size_t CountDistinct(const Descriptors& d, std::size_t enough) {
  std::unordered_set<std::string_view> seen;
  for (std::size_t i = 0; i < d.rows && seen.size() < enough; ++i) seen.insert(RowBytes(d, i));
  return seen.size();
}

// The rows without those equal to an earlier one.
std::vector<std::uint32_t> DropEqual(const Descriptors& d, const std::vector<std::uint32_t>& rows) {
  std::unordered_set<std::string_view> seen;
  std::vector<std::uint32_t> kept;
  for (const std::uint32_t row : rows) {
    if (seen.insert(RowBytes(d, row)).second) kept.push_back(row);
  }
  return kept;
}

}  // namespace

Vocabulary TrainVocabulary(const Descriptors& samples, const std::string& model_id,
                           std::uint64_t available, const KMedoidsOptions& options) {
  CheckDescriptors(samples, "vocabulary samples");
  if (samples.rows == 0) {
    throw Error(ErrorCode::kInvalidArgument, "no_samples",
                "A vocabulary cannot be trained without descriptors; index pictures first.");
  }
  KMedoidsOptions clustering = options;
  if (options.k > 1) {
    clustering.k = static_cast<int>(CountDistinct(samples, static_cast<std::size_t>(options.k)));
  }
  const KMedoidsResult result = KMedoids(samples, clustering);
  Vocabulary vocabulary;
  // A converged result has no equal medoids while there are enough different samples: one of them
  // would be of more use elsewhere. One cut short by max_passes may.
  vocabulary.words = SelectRows(samples, DropEqual(samples, result.medoids));
  vocabulary.model_id = model_id;
  vocabulary.origin.seed = options.seed;
  vocabulary.origin.sampled = samples.rows;
  vocabulary.origin.available = std::max<std::uint64_t>(available, samples.rows);
  vocabulary.origin.loss = result.loss / static_cast<double>(samples.rows);
  vocabulary.origin.method = "fasterpam";
  return vocabulary;
}

}  // namespace pliant
