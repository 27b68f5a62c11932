// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranks the pictures of a snapshot by a query's bag of words. Private to index/.
//
// kTfIdf: cosine of the vectors tf * idf, tf = count / total, idf = ln((N + 1) / max(df, 1)):
//   score = sum_w tf_q tf_d idf_w^2 / (|q| |d|). 1 = same words in the same proportions, 0 = none
//   in common. Only pictures that share a word are hits. (Sivic and Zisserman, "Video Google", ICCV
//   2003; N + 1 keeps a word that every picture has above zero.)
// kHistogram: the paper's. h = count / total; score = 1 - |h_q - h_d| / sqrt(2). Every picture is
//   a hit; sqrt(2) is the distance of two pictures that are each all one word.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "index/engine.h"
#include "index/inverted_index.h"

namespace pliant {

struct RankOptions {
  RankMethod method = RankMethod::kTfIdf;
  GroupBy group_by = GroupBy::kImage;
  std::size_t keep = 0;  // best entries returned; 0 = all
  double min_score = 0;  // lower scores are no hits
  // Only pictures that it accepts, by key and object; empty = all. Called from several threads.
  std::function<bool(std::int64_t key, std::int64_t object)> accept;
  int threads = 1;  // at most; 0 = all cores
};

struct RankedPicture {
  std::int64_t key = 0;
  std::int64_t object = 0;
  std::string id;
  double score = 0;  // 0..1
};

struct Ranking {
  // Score descending, then id ascending. Grouped by object: the best picture of each object stands
  // for it (its score is the object's); a picture without object stands for itself.
  std::vector<RankedPicture> best;
  std::size_t total = 0;  // hits before `keep` cut them off
};

Ranking Rank(const IndexSnapshot& snapshot, const Bow& query, const RankOptions& options);

}  // namespace pliant
