// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranks the pictures of a snapshot by a query's bag of words. Private to index/.
//
// kTfIdf: cosine of the vectors tf * idf, tf = count / total, idf = ln((N + 1) / max(df, 1)):
//   score = sum_w tf_q tf_d idf_w^2 / (|q| |d|). 1 = same words in the same proportions, 0 = none
//   in common. Only pictures that share a word are hits. (Sivic and Zisserman, "Video Google", ICCV
//   2003; N + 1 keeps a word that every picture has above zero.)
// With signatures (vocab/signature.h) kTfIdf is, instead, ASMK's (Tolias, Avrithis and Jegou, ICCV
//   2013): score = sum_w idf_w s(h_w) / sqrt(sum_{w in q} idf_w sum_{w in d} idf_w) over the words
//   that q and d share; h_w = bits in which their signatures differ, s(h) = (1 - 2 h / 64)^5, 0
//   where that is below 0. Each word counts once however often it occurs, which is what tames
//   bursts. 1 = same words and signatures, 0 = nothing alike.
// kHistogram: the paper's. h = count / total; score = 1 - |h_q - h_d| / sqrt(2). Every picture is
//   a hit; sqrt(2) is the distance of two pictures that are each all one word.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <unordered_set>
#include <vector>

#include "index/engine/engine.h"
#include "index/rank/inverted_index.h"

namespace pliant {

struct RankOptions {
  RankMethod method = RankMethod::kTfIdf;
  GroupBy group_by = GroupBy::kImage;
  std::size_t keep = 0;  // best entries returned; 0 = all
  double min_score = 0;  // lower scores are no hits
  // Only pictures that it accepts, by key and object; empty = all. Called from several threads.
  std::function<bool(std::int64_t key, std::int64_t object)> accept;
  int threads = 1;  // at most; 0 = all cores
  // This many pictures, the best of all, are set apart for verification: by image, whatever their
  // score and object, since verification may lift any of them.
  std::size_t candidates = 0;
  // Further pictures, by key, that are set apart too if they are hits at all.
  const std::unordered_set<std::int64_t>* also = nullptr;
  bool signatures = true;  // kTfIdf compares them where the snapshot and the query have them
};

struct RankedPicture {
  std::int64_t key = 0;
  std::int64_t object = 0;
  std::string id;
  double score = 0;  // 0..1
};

// Each list has the highest score first; of equal scores the lower id.
struct Ranking {
  std::vector<RankedPicture> candidates;
  // The hits that are no candidates, all after them. Grouped by object: the best picture of each
  // object stands for it (its score is the object's), a picture without object for itself, and
  // objects that a candidate shows are left out.
  std::vector<RankedPicture> best;
  std::size_t total = 0;  // of these hits, before `keep` cut them off
};

// Only what is returned is sorted: O(postings + pictures), and n log n for the n that are returned.
Ranking Rank(const IndexSnapshot& snapshot, const Bow& query, const RankOptions& options);

}  // namespace pliant
