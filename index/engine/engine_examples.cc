// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: search by several examples at once.
#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "descriptor/base/error.h"
#include "index/engine/engine_impl.h"
#include "index/engine/search_run.h"

namespace pliant {
namespace {

// Of each example: what is further down in all of them is not among the best together.
constexpr std::size_t kHitsAnExample = 1000;

void CheckExamples(const std::vector<std::string>& ids, const SearchOptions& options) {
  const auto refuse = [](const char* reason, const std::string& message) {
    throw Error(ErrorCode::kInvalidArgument, reason, message);
  };
  if (ids.empty() || ids.size() > kMaxExamples) {
    refuse("examples_invalid", "examples must be 1 to " + std::to_string(kMaxExamples) +
                                   " pictures, not " + std::to_string(ids.size()));
  }
  if (std::set<std::string>(ids.begin(), ids.end()).size() != ids.size()) {
    refuse("examples_invalid", "examples has a picture twice");
  }
  if (options.region) {
    refuse("region_invalid", "region is of one picture, and there are several");
  }
}

// Hits of all examples, by what they are of.
class Merger {
 public:
  Merger(GroupBy group_by, double min_score) : group_by_(group_by), min_score_(min_score) {}

  void Add(const std::string& example, std::vector<Hit> hits) {
    for (Hit& hit : hits) {
      const bool by_object = group_by_ == GroupBy::kObject && !hit.object.empty();
      const auto [at, is_new] =
          merged_.try_emplace({by_object, by_object ? hit.object : hit.image_id});
      Entry& entry = at->second;
      entry.missing *= 1 - hit.score;
      const auto probability = std::max(entry.hit.probability, hit.probability);  // absent: least
      if (is_new || hit.score > entry.best) {
        entry.best = hit.score;
        entry.hit = std::move(hit);
        entry.hit.example = example;
      }
      entry.hit.probability = probability;
    }
  }

  // Best first.
  std::vector<Hit> Take() {
    std::vector<Hit> hits;
    for (auto& [key, entry] : merged_) {
      entry.hit.score = 1 - entry.missing;
      if (entry.hit.score >= min_score_) hits.push_back(std::move(entry.hit));
    }
    std::sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& b) {
      return a.score != b.score ? a.score > b.score : a.image_id < b.image_id;
    });
    for (std::size_t i = 0; i < hits.size(); ++i) hits[i].rank = i + 1;
    return hits;
  }

 private:
  struct Entry {
    Hit hit;
    double best = 0;
    double missing = 1;  // the product of 1 - score
  };
  const GroupBy group_by_;
  const double min_score_;
  std::map<std::pair<bool, std::string>, Entry> merged_;
};

void AddUp(const SearchTimings& one, SearchTimings* sum) {
  sum->quantize_ms += one.quantize_ms;
  sum->rank_ms += one.rank_ms;
  sum->verify_ms += one.verify_ms;
  sum->database_ms += one.database_ms;
}

std::vector<Hit> PageOf(std::vector<Hit> hits, const SearchOptions& options) {
  const auto begin = std::min(options.offset, hits.size());
  const auto end = options.limit == 0 ? hits.size() : std::min(hits.size(), begin + options.limit);
  return {std::make_move_iterator(hits.begin() + static_cast<std::ptrdiff_t>(begin)),
          std::make_move_iterator(hits.begin() + static_cast<std::ptrdiff_t>(end))};
}

}  // namespace

SearchResult Engine::Impl::SearchExamples(const std::vector<std::string>& image_ids,
                                          const SearchOptions& options) {
  Validate(options);
  CheckExamples(image_ids, options);
  SearchOptions single = options;
  single.limit = kHitsAnExample;
  single.offset = 0;
  single.min_score = 0;
  single.without.insert(single.without.end(), image_ids.begin(), image_ids.end());
  const CollectionView view = View(options.collection);
  std::vector<Features> examples;  // all, before any search
  for (const std::string& id : image_ids) {
    examples.push_back(GetFeatures({view.collection, id}, options.collection));
  }
  SearchResult result;
  Merger merger(options.group_by, options.min_score);
  for (std::size_t i = 0; i < image_ids.size(); ++i) {
    const std::string& id = image_ids[i];
    SearchResult one = Answer(view, std::move(examples[i]), single, {});
    result.examples.push_back({id, one.keypoints, one.query_width, one.query_height});
    AddUp(one.timings, &result.timings);
    result.rank = one.rank;
    result.vocabulary = one.vocabulary;
    result.words = one.words;
    result.keypoints += one.keypoints;
    if (one.found) result.found = 0;
    if (one.undecided) result.undecided = true;
    merger.Add(id, std::move(one.hits));
  }
  std::vector<Hit> hits = merger.Take();
  result.total = hits.size();
  if (result.found) {
    result.found =
        static_cast<std::size_t>(std::count_if(hits.begin(), hits.end(), [](const Hit& hit) {
          return hit.probability && *hit.probability >= kFoundProbability;
        }));
    if (*result.found > 0) result.undecided = false;
  }
  result.hits = PageOf(std::move(hits), options);
  return result;
}

}  // namespace pliant
