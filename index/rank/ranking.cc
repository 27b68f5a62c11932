// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/ranking.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>

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

Key ObjectOf(const Candidate& candidate) { return candidate.image().object; }
Key ObjectOf(const RankedImage& image) { return image.object; }

std::string_view IdOf(const Candidate& candidate) { return candidate.id(); }
std::string_view IdOf(const RankedImage& image) { return image.ref.id; }

// The order of results: a total one, so that they do not depend on segments, parts and threads.
constexpr auto kIsBetter = [](const auto& a, const auto& b) {
  return a.score != b.score ? a.score > b.score : IdOf(a) < IdOf(b);
};

// Each object once, by its best image, and the images without an object.
template <typename Image>
std::vector<Image> BestOfEachObject(std::vector<Image> images) {
  std::vector<Image> best;
  std::unordered_map<Key, std::size_t> position;  // of an object in `best`
  for (Image& image : images) {
    const Key object = ObjectOf(image);
    const std::size_t next = best.size();
    const std::size_t at = object == 0 ? next : position.try_emplace(object, next).first->second;
    if (at == next) {
      best.push_back(std::move(image));
    } else if (kIsBetter(image, best[at])) {
      best[at] = std::move(image);
    }
  }
  return best;
}

// Removes the best `count`, in order, or all if there are fewer. The others stay in any order.
template <typename Image>
std::vector<Image> TakeBest(std::vector<Image>* images, std::size_t count) {
  const auto end = images->begin() + static_cast<std::ptrdiff_t>(std::min(count, images->size()));
  if (count > 0 && end != images->end()) {
    std::nth_element(images->begin(), end - 1, images->end(), kIsBetter);
  }
  std::sort(images->begin(), end, kIsBetter);
  std::vector<Image> best(std::make_move_iterator(images->begin()), std::make_move_iterator(end));
  images->erase(images->begin(), end);
  return best;
}

std::vector<RankedImage> Named(std::span<const Candidate> candidates) {
  std::vector<RankedImage> named;
  named.reserve(candidates.size());
  for (const Candidate& c : candidates) {
    named.push_back({{0, std::string(c.id()), c.image().key}, c.image().object, c.score});
  }
  return named;
}

}  // namespace

Ranking Merge(std::vector<PartRanking> parts, std::size_t candidates, const RankOptions& options) {
  Ranking ranking;
  ranking.depth = candidates;
  std::vector<RankedImage> images;
  std::vector<Key> objects;
  for (PartRanking& part : parts) {
    std::ranges::move(part.candidates, std::back_inserter(images));
    const auto middle = objects.insert(objects.end(), part.objects.begin(), part.objects.end());
    std::inplace_merge(objects.begin(), middle, objects.end());
    ranking.total += part.alone;
  }
  objects.erase(std::unique(objects.begin(), objects.end()), objects.end());
  ranking.candidates = TakeBest(&images, candidates);
  const bool by_object = options.group_by == GroupBy::kObject;
  std::unordered_set<Key> shown;  // objects
  for (const RankedImage& image : ranking.candidates) {
    if (by_object && image.object != 0) shown.insert(image.object);
  }
  const auto is_no_hit = [&](const RankedImage& image) {
    return image.score < options.min_score || shown.contains(image.object);
  };
  std::erase_if(images, is_no_hit);
  ranking.total += static_cast<std::size_t>(
      std::ranges::count_if(objects, [&](Key object) { return !shown.contains(object); }));
  std::unordered_set<Key> others;  // objects of which parts had candidates only
  for (const RankedImage& image : images) {
    const bool is_alone = !by_object || image.object == 0;
    if (is_alone || (!std::ranges::binary_search(objects, image.object) &&
                     others.insert(image.object).second)) {
      ++ranking.total;
    }
  }
  for (PartRanking& part : parts) std::ranges::move(part.best, std::back_inserter(images));
  std::erase_if(images, is_no_hit);
  if (by_object) images = BestOfEachObject(std::move(images));
  ranking.best = TakeBest(&images, options.keep == 0 ? images.size() : options.keep);
  return ranking;
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

RankQuery NeighboursOf(Descriptors descriptors, std::vector<float> weights,
                       const Quantizer& quantizer, int threads) {
  RankQuery query;
  const NeighbourOptions options;
  const bool has_many = quantizer.vocabulary().size() >= options.many_words;
  const int cells = has_many ? options.cells / 2 : options.cells;
  if (descriptors.rows > 0) query.words = quantizer.NearestWords(descriptors, cells, threads);
  query.descriptors = std::move(descriptors);
  query.weights = std::move(weights);
  return query;
}

PartRanker::PartRanker(const IndexSnapshot& snapshot, const Quantizer& quantizer,
                       const RankQuery& query, int threads)
    : snapshot_(snapshot), query_(query) {
  if (query.method == RankMethod::kHistogram) return;
  neighbours_.emplace(*quantizer.coder(), Voters{query.descriptors, query.weights}, query.words,
                      NeighbourOptions{.threads = threads});
  votes_ = CollectVotes(*neighbours_, snapshot, threads);
  voted_.resize(query.descriptors.rows);
  for (const std::vector<Vote>& votes : votes_) {
    for (const Vote& vote : votes) ++voted_[vote.row];
  }
}

PartRanking PartRanker::Rank(std::span<const std::uint32_t> voted, std::size_t candidates,
                             const RankOptions& options) {
  std::vector<std::vector<Candidate>> found(snapshot_.parts.size());
  ParallelFor(found.size(), options.threads, [&](std::size_t i) {
    if (!neighbours_) {
      return ScorePart(snapshot_.parts[i], query_.bow, options.admission, &found[i]);
    }
    neighbours_->Weigh(voted, &votes_[i]);
    const IndexSegment& segment = *snapshot_.parts[i].segment;
    std::vector<float> sums(segment.size(), 0.0F);
    SumVotes(&votes_[i], &sums);
    for (std::uint32_t p = 0; p < sums.size(); ++p) {
      if (sums[p] <= 0 || !options.admission.Admits(segment[p].key, segment[p].object)) continue;
      found[i].push_back({&segment, p, neighbours_->Score(sums[p], segment[p].keypoints)});
    }
  });
  std::vector<Candidate> images;
  for (const auto& part : found) images.insert(images.end(), part.begin(), part.end());
  PartRanking ranking;
  ranking.candidates = Named(TakeBest(&images, candidates));
  std::erase_if(images, [&](const Candidate& c) { return c.score < options.min_score; });
  if (options.group_by == GroupBy::kObject) {
    images = BestOfEachObject(std::move(images));
    for (const Candidate& image : images) {
      if (ObjectOf(image) != 0) ranking.objects.push_back(ObjectOf(image));
    }
  }
  ranking.alone = images.size() - ranking.objects.size();
  // Objects of candidates from other parts fall out later.
  const std::size_t keep = options.keep == 0 ? images.size() : options.keep + candidates;
  ranking.best = Named(TakeBest(&images, keep));
  return ranking;
}

Ranking Rank(const IndexSnapshot& snapshot, const Quantizer& quantizer, const RankQuery& query,
             const RankOptions& options) {
  PartRanker ranker(snapshot, quantizer, query, options.threads);
  const std::size_t candidates = options.candidates ? options.candidates(snapshot.images) : 0;
  std::vector<PartRanking> parts;
  parts.push_back(ranker.Rank(ranker.voted(), candidates, options));
  return Merge(std::move(parts), candidates, options);
}

}  // namespace pliant
