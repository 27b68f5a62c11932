// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A retrieval set indexed with one descriptor in an engine's database, to measure the product
// itself.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "index/engine/engine.h"
#include "index/evaluation/retrieval_metrics.h"
#include "index/evaluation/retrieval_set.h"

namespace pliant {

struct RetrievalGalleryOptions {
  std::shared_ptr<const Descriptor> descriptor;
  // Present: the features come from elsewhere; `descriptor` has only their form.
  std::function<Features(const std::filesystem::path& image)> features;
  ExtractionOptions extraction = IndexExtraction();
  bool enlarge = true;             // EngineOptions::enlarge
  std::filesystem::path database;  // created if it does not exist
  // Keep the features of all images in the database, so that the next run with it describes only
  // new ones. Images and vocabularies of the last run are dropped either way.
  bool keep_features = false;
  int jobs = 0;                                                       // threads; 0 = one per core
  std::function<void(std::size_t done, std::size_t total)> progress;  // images; from any thread
  std::stop_token stop;
};

// Mean milliseconds per query.
struct RetrievalTimes {
  double decode = 0, detect = 0, describe = 0;
  double quantize = 0, rank = 0, verify = 0;

  double total() const { return decode + detect + describe + quantize + rank + verify; }
};

// The result of a query with object grouping: what `pliant query` prints first.
struct ObjectAnswer {
  double top1 = 0;  // the first object is right
  double mrr = 0;   // 1 / rank of the right object; 0 when it is not found
};

// A hit of a query, as Hit.
struct NamedHit {
  std::string object;
  std::filesystem::path file;
  double score = 0;
  std::optional<double> probability;
  int inliers = 0;
  bool is_right = false;
};

// A query and its first hits, by name. A query that was refused has none.
struct NamedAnswer {
  std::filesystem::path file;
  std::string object;     // shown by the query
  bool left_out = false;  // asked without the images of this object
  std::vector<NamedHit> hits = {};
};

// Of queries whose object is absent.
struct AbsentAnswers {
  std::size_t asked = 0;   // without refused queries
  std::size_t alarms = 0;  // queries with a hit that counts as found
};

// Not thread-safe.
class RetrievalGallery {
 public:
  // Describes and stores all images. Images that are unreadable or have too few features are listed
  // in the set's `skipped` and still count: a refused query, or one whose correct answers are
  // refused, is a miss. Throws what Engine throws when all images are concerned, kCancelled on a
  // stop, and kUnprocessable "nothing_to_search" when every image to search was refused.
  RetrievalGallery(RetrievalSet set, RetrievalGalleryOptions options);

  const RetrievalSet& set() const { return set_; }

  // Trains a vocabulary as `pliant index` does (TrainOptions's own choice when words or sample is
  // 0) and searches with it from now on. Returns its size.
  std::size_t UseNewVocabulary(int words, int sample, std::uint64_t seed);

  // Every query's answer by image, under `search` (collection, grouping and paging are set here).
  // Where each object has one image, this is the answer by object that `pliant query` gives. Adds
  // the mean times of quantisation, ranking and verification to `times` if given, and every query
  // with its first ten hits to `named` if given.
  std::vector<RetrievalAnswer> Ask(SearchOptions search, RetrievalTimes* times = nullptr,
                                   std::vector<NamedAnswer>* named = nullptr);

  // The same by object. The ranks are meaningful only if the queries are not in the gallery.
  ObjectAnswer AskForObjects(SearchOptions search);

  // Asks the absent images of the set.
  AbsentAnswers AskAbsent(SearchOptions search);

  // Asks every query again without the images of its object, at most kMaxExcluded: is something
  // similar found? Nothing without probabilities. `named`: each query's first hit is added.
  AbsentAnswers AskLeftOut(SearchOptions search, std::vector<NamedAnswer>* named = nullptr);

  // Queries that were refused.
  std::size_t refused_queries() const;

  bool several_images_of_an_object() const { return several_images_of_an_object_; }

  // Decoding, detection and description of the first queries (20 at most), one at a time. Nothing
  // for features from elsewhere.
  void TimeExtraction(RetrievalTimes* times);

  double StoredBytesPerImage();  // keypoints and descriptors, mean of 100 images
  double IndexBytesPerImage();   // of the inverted index in memory

 private:
  void Fill();
  void Add(const RetrievalImage& image, const std::string& id, Bytes bytes);
  void ThrowIfStopped() const;
  // The second pass of a query at high resolution (Engine::DescribeFiner). It is kept as a file
  // beside the database, since every vocabulary and protocol needs it.
  std::optional<Features> SecondPass(std::size_t image, const Features& known);
  std::vector<std::string> SearchedIds() const;  // without refused images
  SearchResult Search(std::size_t image, SearchOptions search);
  NamedAnswer Named(std::size_t query, const std::vector<Hit>& hits) const;

  RetrievalSet set_;
  RetrievalGalleryOptions options_;
  Engine engine_;
  bool several_images_of_an_object_ = false;  // searched ones
  std::vector<std::size_t> queries_;          // positions in set_.images
  std::vector<std::size_t> possible_;         // right answers, by position
  std::vector<std::string> ids_;              // by position; empty = the image was refused
};

}  // namespace pliant
