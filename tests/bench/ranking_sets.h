// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images for measuring rankings at any number: real ones, from the databases that `pliant eval
// retrieval --cache` leaves, or synthetic ones.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "descriptor/features/features.h"
#include "index/rank/inverted_index.h"
#include "vocab/quantizer.h"

namespace pliant::bench {

struct LabelledImage {
  std::string object;
  Descriptors descriptors;
};

struct RankingSet {
  std::vector<LabelledImage> queries;
  std::vector<LabelledImage> gallery;
};

// Reads the collections "gallery" and "queries" of a database. Throws what a database throws.
RankingSet ReadSet(const std::filesystem::path& database);

// Unit vectors of 128 floats around 4000 centres, the r-th of which is drawn in proportion to
// 1 / sqrt(r); centres themselves are drawn around 200. Queries are images of the gallery with
// noise. Deterministic.
RankingSet MakeSet(std::size_t images, std::size_t queries, std::size_t descriptors);

// `count` of the image's descriptors drawn at random; all if there are no more.
Descriptors DrawRows(const Descriptors& descriptors, std::size_t count, std::mt19937_64& random);

// An index that grows by distractors: as many as are there, then the same with noise. Keys are 1 +
// the position in the gallery, then higher.
class GrowingIndex {
 public:
  GrowingIndex(const std::vector<LabelledImage>& gallery,
               const std::vector<LabelledImage>& distractors,
               std::shared_ptr<const Quantizer> quantizer);

  // To at least `images` in all.
  std::shared_ptr<const IndexSnapshot> Grow(std::size_t images);

 private:
  void Add(std::vector<IndexedImage> images);

  InvertedIndex index_;
  std::vector<IndexedImage> distractors_;
  std::mt19937_64 random_{5};
  std::int64_t key_ = 0;
  std::size_t drawn_ = 0;
};

}  // namespace pliant::bench
