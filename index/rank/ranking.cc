// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/ranking.h"

#include <algorithm>
#include <span>
#include <unordered_map>
#include <unordered_set>

#include "index/rank/scoring.h"

namespace pliant {
namespace {

// The order of results: a total one, so that they do not depend on segments and threads.
bool IsBetter(const Candidate& a, const Candidate& b) {
  if (a.score != b.score) return a.score > b.score;
  return a.segment->id(a.image) < b.segment->id(b.image);
}

std::vector<Candidate> BestOfEachObject(std::span<const Candidate> candidates,
                                        const std::unordered_set<std::int64_t>& but_not) {
  std::vector<Candidate> best;
  std::unordered_map<std::int64_t, std::size_t> position;  // of an object in `best`
  for (const Candidate& candidate : candidates) {
    const std::int64_t object = candidate.segment->object(candidate.image);
    if (object != 0) {
      if (but_not.contains(object)) continue;
      const auto [found, is_new] = position.try_emplace(object, best.size());
      if (!is_new) {
        Candidate& held = best[found->second];
        if (IsBetter(candidate, held)) held = candidate;
        continue;
      }
    }
    best.push_back(candidate);
  }
  return best;
}

// The best `count` in order at the front; nothing is said about the others.
void SortBest(std::span<Candidate> candidates, std::size_t count) {
  if (count == 0) return;
  if (count < candidates.size()) {
    std::nth_element(candidates.begin(),
                     candidates.begin() + static_cast<std::ptrdiff_t>(count - 1), candidates.end(),
                     IsBetter);
    candidates = candidates.first(count);
  }
  std::sort(candidates.begin(), candidates.end(), IsBetter);
}

std::vector<RankedImage> Named(std::span<const Candidate> candidates) {
  std::vector<RankedImage> named;
  named.reserve(candidates.size());
  for (const Candidate& c : candidates) {
    named.push_back({{0, std::string(c.segment->id(c.image)), c.segment->key(c.image)},
                     c.segment->object(c.image),
                     c.score});
  }
  return named;
}

Ranking Chosen(std::vector<Candidate> all, const RankOptions& options) {
  Ranking ranking;
  const std::size_t apart = std::min(options.candidates, all.size());
  SortBest(all, apart);
  auto others = all.begin() + static_cast<std::ptrdiff_t>(apart);
  if (!options.also.empty()) {
    const auto first = others;
    others = std::partition(first, all.end(), [&](const Candidate& c) {
      return std::binary_search(options.also.begin(), options.also.end(), c.segment->key(c.image));
    });
    std::sort(first, others, IsBetter);
  }
  ranking.candidates = Named({all.begin(), others});
  std::vector<Candidate> rest(others, all.end());
  std::erase_if(rest, [&](const Candidate& c) { return c.score < options.min_score; });
  if (options.group_by == GroupBy::kObject) {
    std::unordered_set<std::int64_t> shown;
    for (const RankedImage& candidate : ranking.candidates) shown.insert(candidate.object);
    rest = BestOfEachObject(rest, shown);
  }
  ranking.total = rest.size();
  const std::size_t keep = options.keep == 0 ? rest.size() : std::min(options.keep, rest.size());
  SortBest(rest, keep);
  ranking.best = Named(std::span(rest).first(keep));
  return ranking;
}

}  // namespace

std::vector<Candidate> Joined(const std::vector<std::vector<Candidate>>& parts) {
  std::vector<Candidate> all;
  std::size_t total = 0;
  for (const auto& part : parts) total += part.size();
  all.reserve(total);
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

Ranking RankByHistogram(const IndexSnapshot& snapshot, const Bow& query,
                        const RankOptions& options) {
  return Chosen(ScoreByHistogram(snapshot, query, options), options);
}

Ranking RankByNeighbours(const IndexSnapshot& snapshot, const Quantizer& quantizer,
                         const Voters& query, const RankOptions& options) {
  return Chosen(ScoreByNeighbours(snapshot, quantizer, query, options), options);
}

}  // namespace pliant
