// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>

#include "index/engine/copy_database.h"
#include "index/files/text.h"

namespace pliant {
namespace {

constexpr double kSameScore = 1e-5;

std::map<std::string, double> ScoresOf(const SearchResult& result) {
  std::map<std::string, double> scores;
  for (const Hit& hit : result.hits) scores[hit.image_id] = hit.score;
  return scores;
}

// Where equal scores end a page, either of the pictures may be the last on it.
bool SameHits(const SearchResult& a, const SearchResult& b) {
  if (a.hits.size() != b.hits.size()) return false;
  const std::map<std::string, double> other = ScoresOf(b);
  for (std::size_t i = 0; i < a.hits.size(); ++i) {
    if (std::abs(a.hits[i].score - b.hits[i].score) > kSameScore) return false;
    const auto found = other.find(a.hits[i].image_id);
    const double last = a.hits.back().score;
    if (found == other.end() && std::abs(a.hits[i].score - last) > kSameScore) return false;
    if (found != other.end() && std::abs(found->second - a.hits[i].score) > kSameScore) {
      return false;
    }
  }
  return true;
}

}  // namespace

RankingsCompared CompareRankings(Engine& from, Engine& to, std::uint64_t count) {
  RankingsCompared compared;
  for (const std::string& collection : from.ListCollections()) {
    const CollectionRecord record = from.GetCollection(collection);
    if (!record.vocabulary || record.images == 0) continue;
    const std::uint64_t step =
        std::max<std::uint64_t>(1, record.images / std::max<std::uint64_t>(1, count));
    std::uint64_t number = 0;
    PictureListing list;
    list.which.collection = collection;
    list.limit = 1000;
    from.ForEachPage(list, [&](const PicturePage& page) {
      for (const ImageRecord& picture : page.records) {
        if (number++ % step != 0 || compared.compared >= count) continue;
        SearchOptions search;
        search.collection = collection;
        search.group_by = GroupBy::kImage;
        search.limit = 10;
        const Features features = from.GetFeatures(collection, picture.id);
        ++compared.compared;
        if (SameHits(from.SearchFeatures(features, search), to.SearchFeatures(features, search))) {
          continue;
        }
        compared.differences.push_back("a search with picture \"" + ToDisplayText(picture.id) +
                                       "\" of collection \"" + collection +
                                       "\" has other hits, or other scores");
      }
    });
  }
  return compared;
}

}  // namespace pliant
