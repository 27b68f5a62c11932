// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/ranking_sets.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "descriptor/match/distance.h"
#include "index/store/blob_codec.h"
#include "index/store/sqlite/sqlite_connection.h"
#include "tests/unit/random_descriptors.h"

namespace pliant::bench {
namespace {

constexpr int kDim = 128;
constexpr std::size_t kRegions = 200;
constexpr std::size_t kCentres = 4000;

// A unit vector at about `spread` from `centre`.
void Around(const float* centre, float spread, std::mt19937_64& random, float* out) {
  std::normal_distribution<float> normal(0, spread / std::sqrt(static_cast<float>(kDim)));
  double squared = 0;
  for (int d = 0; d < kDim; ++d) {
    out[d] = centre[d] + normal(random);
    squared += static_cast<double>(out[d]) * out[d];
  }
  const auto scale = static_cast<float>(1 / std::sqrt(squared));
  for (int d = 0; d < kDim; ++d) out[d] *= scale;
}

Descriptors MakeCentres(std::mt19937_64& random) {
  Descriptors regions = Descriptors::Float(kRegions, kDim);
  const std::vector<float> origin(kDim, 0.0F);
  for (std::size_t r = 0; r < kRegions; ++r) {
    Around(origin.data(), 1, random, regions.floats.data() + r * kDim);
  }
  Descriptors centres = Descriptors::Float(kCentres, kDim);
  for (std::size_t c = 0; c < kCentres; ++c) {
    Around(regions.floats.data() + random() % kRegions * kDim, 0.9F, random,
           centres.floats.data() + c * kDim);
  }
  return centres;
}

// An image like `bow`: the same words, but of each code every fourth half byte is another.
Bow WithNoise(const Bow& bow, std::mt19937_64& random) {
  Bow noisy = bow;
  for (std::uint8_t& byte : noisy.codes) {
    const std::uint64_t bits = random();
    if (bits % 4 == 0) byte = static_cast<std::uint8_t>((byte & 0xF0U) | (bits >> 8U & 0x0FU));
    if (bits / 4 % 4 == 0) byte = static_cast<std::uint8_t>((byte & 0x0FU) | (bits >> 8U & 0xF0U));
  }
  return noisy;
}

std::vector<IndexedImage> Quantized(const std::vector<LabelledImage>& images,
                                    const Quantizer& quantizer) {
  std::vector<IndexedImage> indexed;
  for (const LabelledImage& image : images) {
    const std::vector<std::uint32_t> words = quantizer.Assign(image.descriptors);
    const testing::Coded coded(image.descriptors);
    indexed.push_back({0, 0, "", quantizer.BowOf(coded.view(), words)});
  }
  return indexed;
}

}  // namespace

RankingSet ReadSet(const std::filesystem::path& database) {
  constexpr int kBusyMs = 10'000;
  SqliteConnection db(database, SqliteConnection::Mode::kReadOnly, kBusyMs);
  Cursor row = db.Prepare(
      "SELECT c.name, o.name, f.data FROM images p JOIN collections c ON c.key = p.collection "
      "JOIN features f ON f.image = p.key LEFT JOIN objects o ON o.key = p.object "
      "WHERE c.name IN ('gallery', 'queries') ORDER BY p.id");
  RankingSet set;
  while (row.Next()) {
    auto& to = row.Text(0) == "queries" ? set.queries : set.gallery;
    to.push_back({row.IsNull(1) ? "" : row.Text(1), DecodeFeatures(row.Blob(2)).descriptors});
  }
  return set;
}

RankingSet MakeSet(std::size_t images, std::size_t queries, std::size_t descriptors) {
  std::mt19937_64 random(1);
  const Descriptors centres = MakeCentres(random);
  std::vector<double> weights;
  for (std::size_t r = 1; r <= kCentres; ++r) {
    weights.push_back(1 / std::sqrt(static_cast<double>(r)));
  }
  std::discrete_distribution<std::size_t> draw(weights.begin(), weights.end());
  RankingSet set;
  for (std::size_t p = 0; p < images; ++p) {
    LabelledImage image{std::to_string(p), Descriptors::Float(descriptors, kDim)};
    for (std::size_t i = 0; i < descriptors; ++i) {
      Around(centres.floats.data() + draw(random) * kDim, 0.8F, random,
             image.descriptors.floats.data() + i * kDim);
    }
    set.gallery.push_back(std::move(image));
  }
  for (std::size_t q = 0; q < queries; ++q) {
    LabelledImage query = set.gallery[random() % images];
    for (std::size_t i = 0; i < descriptors; ++i) {
      float* values = query.descriptors.floats.data() + i * kDim;
      Around(values, 0.5F, random, values);
    }
    set.queries.push_back(std::move(query));
  }
  return set;
}

Descriptors DrawRows(const Descriptors& descriptors, std::size_t count, std::mt19937_64& random) {
  if (descriptors.rows <= count) return descriptors;
  std::vector<std::uint32_t> rows(descriptors.rows);
  std::iota(rows.begin(), rows.end(), 0U);
  for (std::size_t i = 0; i < count; ++i) {
    std::swap(rows[i], rows[i + random() % (rows.size() - i)]);
  }
  rows.resize(count);
  std::sort(rows.begin(), rows.end());
  return SelectRows(descriptors, rows);
}

GrowingIndex::GrowingIndex(const std::vector<LabelledImage>& gallery,
                           const std::vector<LabelledImage>& distractors,
                           std::shared_ptr<const Quantizer> quantizer)
    : index_(quantizer), distractors_(Quantized(distractors, *quantizer)) {
  Add(Quantized(gallery, *quantizer));
}

std::shared_ptr<const IndexSnapshot> GrowingIndex::Grow(std::size_t images) {
  while (static_cast<std::size_t>(key_) < images && !distractors_.empty()) {
    std::vector<IndexedImage> chunk;
    while (chunk.size() < IndexSegment::kMaxImages && key_ + chunk.size() < images) {
      const std::size_t next = drawn_++;
      IndexedImage image = distractors_[next % distractors_.size()];
      if (next >= distractors_.size()) image.bow = WithNoise(image.bow, random_);
      chunk.push_back(std::move(image));
    }
    Add(std::move(chunk));
  }
  return index_.snapshot();
}

void GrowingIndex::Add(std::vector<IndexedImage> images) {
  for (IndexedImage& image : images) {
    image.key = ++key_;
    image.id = std::to_string(key_);
  }
  index_.Append(std::move(images));
}

}  // namespace pliant::bench
