// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/quantize_batch.h"

#include "index/store/feature_codec.h"

namespace pliant {

std::vector<ImageWords> QuantizeBatch(const Quantizer& quantizer,
                                      std::span<const StoredFeatures> batch, int threads) {
  Descriptors all;
  all.kind = quantizer.vocabulary().words.kind;
  all.dim = quantizer.vocabulary().words.dim;
  std::vector<std::size_t> rows;
  for (const StoredFeatures& image : batch) {
    const Descriptors own = DecodeFeatures(image.encoded).descriptors;
    rows.push_back(own.rows);
    all.Append(own);
  }
  const std::vector<std::uint32_t> words = quantizer.Assign(all, threads);
  std::vector<ImageWords> result;
  std::size_t first = 0;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    result.push_back(
        {batch[i].version, quantizer.BowOf(all, first, std::span(words).subspan(first, rows[i]))});
    first += rows[i];
  }
  return result;
}

}  // namespace pliant
