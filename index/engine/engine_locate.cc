// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: where an object is in a picture.
#include <chrono>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "index/engine/engine_impl.h"
#include "index/store/blob_codec.h"

namespace pliant {
namespace {

// Of an object's pictures so many are compared; of more, those that rank best.
constexpr int kMostCompared = 24;

}  // namespace

// The ids of those of the object's pictures that have most in common with the query by their words;
// `some` where there is no vocabulary.
std::vector<std::string> Engine::Impl::MostSimilar(const Features& query,
                                                   const std::string& collection,
                                                   const std::string& object, int threads,
                                                   std::vector<std::string> some) {
  if (!CurrentView(collection).quantizer || query.keypoints.size() < kMinKeypoints) return some;
  SearchOptions search;
  search.collection = collection;
  search.object = object;
  search.group_by = GroupBy::kImage;
  search.verify = Verification::kNone;
  search.limit = kMostCompared;
  search.threads = threads;
  const SearchResult ranked = Answer(query, search, {});
  if (ranked.hits.empty()) return some;
  some.clear();
  for (const Hit& hit : ranked.hits) some.push_back(hit.image_id);
  return some;
}

ObjectLocation Engine::Impl::Locate(Bytes encoded, const std::string& collection,
                                    const std::string& object, int threads) {
  ListOptions list;
  list.collection = collection;
  list.object = object;
  list.limit = kMostCompared + 1;
  std::vector<std::string> ids;
  for (const ImageRecord& image : List(list)) ids.push_back(image.id);
  if (ids.empty()) {
    throw Error(ErrorCode::kNotFound, "object_not_found",
                "There is no picture of an object '" + object + "'.");
  }
  ObjectLocation result;
  result.object = object;
  const Features query = InStoredPrecision(extractor().Extract(encoded, threads, &result.timings));
  result.query_width = query.width;
  result.query_height = query.height;

  const auto start = std::chrono::steady_clock::now();
  if (ids.size() > static_cast<std::size_t>(kMostCompared)) {
    ids.pop_back();
    ids = MostSimilar(query, collection, object, threads, std::move(ids));
  }
  const LocateOptions options;
  const Verifier verifier(query, options.verification);
  std::vector<Location> locations(ids.size());
  ParallelFor(ids.size(), threads, [&](std::size_t i) {
    try {
      locations[i] = pliant::Locate(verifier, query, GetFeatures(collection, ids[i]), options);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;  // removed just now
    }
  });
  const auto better = [](const Location& a, const Location& b) {
    return a.found != b.found ? a.found : a.inliers.size() > b.inliers.size();
  };
  std::size_t best = 0;
  for (std::size_t i = 1; i < ids.size(); ++i) {
    if (better(locations[i], locations[best])) best = i;
  }
  result.compared = ids.size();
  result.image_id = ids[best];
  result.location = std::move(locations[best]);
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
  result.locate_ms = took.count();
  return result;
}

}  // namespace pliant
