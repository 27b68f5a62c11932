// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/ranking.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>

#include "descriptor/base/parallel.h"

namespace pliant {
namespace {

struct Candidate {
  const IndexSegment* segment = nullptr;
  std::uint32_t position = 0;
  double score = 0;

  const IndexSegment::Image& image() const { return (*segment)[position]; }
  std::string_view id() const { return segment->id(position); }
};

// Fewer descriptors than this are not worth a second thread.
constexpr std::size_t kDescriptorsForThreads = 1u << 20;

// 1 - |h_q - h_d| / sqrt(2), with |h_q - h_d|^2 = h_q.h_q + h_d.h_d - 2 h_q.h_d.
double Score(const Bow& query, double query_squares, const IndexSegment::Image& image, double dot) {
  const double query_total = query.total;
  const double total = image.keypoints;
  if (query_total == 0 || total == 0) return 0;
  const double squared_distance = query_squares / (query_total * query_total) +
                                  image.sum_of_squares / (total * total) -
                                  2 * dot / (query_total * total);
  return std::max(0.0, 1 - std::sqrt(std::max(0.0, squared_distance)) / std::numbers::sqrt2);
}

void ScorePart(const IndexSnapshot::Part& part, const Bow& query, const Admission& admission,
               std::vector<Candidate>* candidates) {
  const IndexSegment& segment = *part.segment;
  std::vector<double> dots(segment.size(), 0.0);  // integers: exact in any order
  double squares = 0;
  for (const auto& [word, count] : query.words) {
    const double weight = count;
    squares += weight * weight;
    segment.codes().ForEachCount(word, [&](std::size_t image, std::size_t own) {
      dots[image] += weight * static_cast<double>(own);
    });
  }
  for (std::uint32_t p = 0; p < segment.size(); ++p) {
    if (part.IsDead(p) || !admission.Admits(segment[p].key, segment[p].object)) continue;
    candidates->push_back({&segment, p, Score(query, squares, segment[p], dots[p])});
  }
}

// With this many words, half of the lists find the same images in little more than half of the time
// (index/RANKING.md).
constexpr std::size_t kManyWords = 32'768;
constexpr int kCellsOfManyWords = 8;

// The order of results: a total one, so that they do not depend on segments and threads.
bool IsBetter(const Candidate& a, const Candidate& b) {
  if (a.score != b.score) return a.score > b.score;
  return a.id() < b.id();
}

std::vector<Candidate> BestOfEachObject(std::span<const Candidate> candidates,
                                        const std::unordered_set<std::int64_t>& but_not) {
  std::vector<Candidate> best;
  std::unordered_map<std::int64_t, std::size_t> position;  // of an object in `best`
  for (const Candidate& candidate : candidates) {
    const std::int64_t object = candidate.image().object;
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

// The best `count` in order at the front, the others in any order.
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
    named.push_back({{0, std::string(c.id()), c.image().key}, c.image().object, c.score});
  }
  return named;
}

// Of the candidates of all parts.
Ranking Chosen(const std::vector<std::vector<Candidate>>& parts, const RankOptions& options) {
  Ranking ranking;
  std::vector<Candidate> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  const std::size_t apart = std::min(options.candidates, all.size());
  SortBest(all, apart);
  const auto others = all.begin() + static_cast<std::ptrdiff_t>(apart);
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

Ranking RankByHistogram(const IndexSnapshot& snapshot, const Bow& query,
                        const RankOptions& options) {
  std::vector<std::vector<Candidate>> found(snapshot.parts.size());
  const int threads = query.total * snapshot.images < kDescriptorsForThreads ? 1 : options.threads;
  ParallelFor(found.size(), threads, [&](std::size_t i) {
    ScorePart(snapshot.parts[i], query, options.admission, &found[i]);
  });
  return Chosen(found, options);
}

std::vector<std::vector<Vote>> CollectVotes(const NeighbourQuery& query,
                                            const IndexSnapshot& snapshot, int threads) {
  // Parts differ in size: slices of them keep all threads busy to the end.
  const auto slices = static_cast<std::size_t>(ResolveThreads(threads));
  std::vector<std::vector<Vote>> found(snapshot.parts.size() * slices);
  ParallelFor(found.size(), threads, [&](std::size_t i) {
    const IndexSnapshot::Part& part = snapshot.parts[i / slices];
    query.Collect(part.segment->codes(), part.dead.get(), i % slices, slices, &found[i]);
  });
  std::vector<std::vector<Vote>> votes(snapshot.parts.size());
  ParallelFor(votes.size(), threads, [&](std::size_t i) {
    for (std::size_t s = 0; s < slices; ++s) {
      const std::vector<Vote>& slice = found[i * slices + s];
      votes[i].insert(votes[i].end(), slice.begin(), slice.end());
    }
    KeepBest(&votes[i]);
  });
  return votes;
}

Ranking RankByNeighbours(const IndexSnapshot& snapshot, const Quantizer& quantizer,
                         const Voters& voters, const RankOptions& options) {
  NeighbourOptions neighbours;
  neighbours.threads = options.threads;
  if (quantizer.vocabulary().size() >= kManyWords) neighbours.cells = kCellsOfManyWords;
  const NeighbourQuery query(quantizer, voters, neighbours);
  std::vector<std::vector<Vote>> votes = CollectVotes(query, snapshot, options.threads);
  query.Weigh(votes);
  std::vector<std::vector<Candidate>> found(votes.size());
  ParallelFor(votes.size(), options.threads, [&](std::size_t i) {
    const IndexSegment& segment = *snapshot.parts[i].segment;
    std::vector<float> sums(segment.size(), 0.0F);
    SumVotes(&votes[i], &sums);
    for (std::uint32_t p = 0; p < sums.size(); ++p) {
      if (sums[p] <= 0 || !options.admission.Admits(segment[p].key, segment[p].object)) continue;
      found[i].push_back({&segment, p, query.Score(sums[p], segment[p].keypoints)});
    }
  });
  return Chosen(found, options);
}

}  // namespace pliant
