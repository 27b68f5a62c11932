// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: where an object is in a picture.
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/stopwatch.h"
#include "index/engine/engine_impl.h"
#include "index/files/text.h"
#include "index/store/feature_codec.h"
#include "index/verify/locate.h"

namespace pliant {
namespace {

// Of an object's pictures so many are compared; of more, those that rank best.
constexpr int kMostCompared = 24;

}  // namespace

// All of the object's pictures, or one more than are compared.
std::vector<PictureRef> Engine::Impl::PicturesOf(const std::string& collection,
                                                 const std::string& object) {
  ListOptions list;
  list.collection = collection;
  list.object = object;
  list.limit = kMostCompared + 1;
  const Key key = catalogue().RequireCollection(collection).key;
  std::vector<PictureRef> refs;
  for (const ImageRecord& image : catalogue().ListPictures(list)) refs.push_back({key, image.id});
  return refs;
}

// Those of the object's pictures that rank best for the query; `some` where there is no vocabulary.
std::vector<PictureRef> Engine::Impl::MostSimilar(const Features& query,
                                                  const std::string& collection,
                                                  const std::string& object, int threads,
                                                  std::vector<PictureRef> some) {
  const CollectionView view = View(collection);
  if (!view.has_vocabulary() || query.keypoints.size() < kMinKeypoints) return some;
  RankOptions options;
  options.keep = kMostCompared;
  options.threads = threads;
  options.admission = catalogue().Admit(view.collection, object, {}, {});
  const Ranking ranking = ranker_->Rank(view, {query, Bow()}, options);
  if (ranking.best.empty()) return some;
  some.clear();
  for (const RankedPicture& picture : ranking.best) some.push_back(picture.ref);
  return some;
}

ObjectLocation Engine::Impl::Locate(Bytes encoded, const std::string& collection,
                                    const std::string& object, int threads) {
  std::vector<PictureRef> refs = PicturesOf(collection, object);
  if (refs.empty()) {
    throw Error(ErrorCode::kNotFound, "object_not_found",
                "There is no picture of an object '" + Shown(object) + "'.");
  }
  ObjectLocation result;
  result.object = object;
  const Features query = InStoredPrecision(extractor().Extract(encoded, threads, &result.timings));
  result.query_width = query.width;
  result.query_height = query.height;

  const Stopwatch watch;
  if (refs.size() > static_cast<std::size_t>(kMostCompared)) {
    refs.pop_back();
    refs = MostSimilar(query, collection, object, threads, std::move(refs));
  }
  std::vector<std::optional<StoredPicture>> pictures =
      catalogue().LoadPictures(refs, Load::kRecordsAndFeatures);
  std::erase_if(pictures, [](const auto& picture) { return !picture; });  // removed just now
  const LocateOptions options;
  const Verifier verifier(query, options.verification);
  std::vector<Location> locations(pictures.size());
  ParallelFor(pictures.size(), threads, [&](std::size_t i) {
    Features features = DecodeFeatures(pictures[i]->features);
    features.model_id = query.model_id;
    locations[i] = pliant::Locate(verifier, query, features, options);
  });
  const auto better = [](const Location& a, const Location& b) {
    return a.found != b.found ? a.found : a.inliers.size() > b.inliers.size();
  };
  result.compared = pictures.size();
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (i > 0 && !better(locations[i], result.location)) continue;
    result.image_id = pictures[i]->record.id;
    result.location = std::move(locations[i]);
  }
  result.locate_ms = watch.ms();
  return result;
}

}  // namespace pliant
