// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The facade of the index: one database, many threads. An Engine has four faces: its images, its
// searches, its vocabularies, and its maintenance. API keys and jobs of a server have a facade of
// their own (index/store/service_store.h), and verification can be used without a database
// (index/verify/verification.h).
//
// Thread safety: every method may be called from any thread. Searches run on an immutable
// snapshot; writes go through one writer and are durable when the call returns, so that kill -9 or
// power loss loses nothing that was acknowledged.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "descriptor/features/descriptor.h"
#include "index/records/listing.h"
#include "index/records/records.h"
#include "index/records/search.h"

namespace pliant {

struct EngineOptions {
  std::filesystem::path database;
  // Descriptor of a NEW database; an existing one must have been made with the same model
  // (Error kConflict "model_mismatch" names both). Empty: whatever the database was made with, and
  // "deal" for a new one.
  std::string descriptor = "deal";
  DescriptorOptions descriptor_options;
  ExtractionOptions extraction;
  // Keypoints an image and its longer side in pixels are properties of a database, so that what
  // is stored and what is asked are described alike. Absent: as the database was made, and what
  // `extraction` says for a new one. Another value than the database's is Error kConflict
  // "extraction_mismatch".
  std::optional<int> max_keypoints;
  std::optional<int> max_side_px;
  // Also describe small images, and every query, enlarged (ExtractionOptions::enlarge_below,
  // which is not looked at here). false: at their own size alone, as the paper does.
  bool enlarge = true;
  bool create = true;  // make the file if it does not exist; else kNotFound
  bool read_only = false;
  bool keep_originals = true;  // store the uploaded bytes too, for GET .../content
  // Directory for them, made if the one above it exists; empty: the database. Absent: as the
  // database remembers, and the database for a new one. What is stored already stays where it is
  // and is found there. The constructor throws kConflict "originals_foreign" for the directory of
  // another database and kNotFound "originals_missing" for one that lacks the files of this one;
  // without a descriptor (`load_descriptor`) it only looks into the directory.
  std::optional<std::filesystem::path> originals_dir;
  // Used instead of `descriptor` when set; engines can share one this way.
  std::shared_ptr<const Descriptor> custom_descriptor;
  // false: the descriptor is made by the first call that describes an image, so that weights are
  // neither needed nor checked before.
  bool load_descriptor = true;
  // false: the inverted index is loaded by the first call that needs it.
  bool load_index = true;
  // Hears which share of the images is in memory while the index loads, 0..1, from the thread
  // that loads.
  std::function<void(double share)> loading;
  // Hears of failures that no caller is told, from any thread: after them the index in memory is
  // behind the database. Searches and writes try to catch up first, and throw what is wrong.
  std::function<void(const std::string& failure)> warn;
  int busy_timeout_ms = 10'000;  // wait for another process's write lock, then kUnavailable
  // Images are refused (kNoSpace) when less than this would stay free on the disk of the database
  // or of the originals: removing takes space, too, before it gives some back.
  std::uint64_t reserve_bytes = 64 * 1024 * 1024;
};

// What people write for EngineOptions::originals_dir: nothing = as before, "database", or a path
// ("./database" for a directory of that name).
inline std::optional<std::filesystem::path> ParseOriginalsDir(const std::string& text) {
  if (text.empty()) return std::nullopt;
  return text == "database" ? std::filesystem::path() : std::filesystem::path(text);
}

class EngineCore;  // what the faces share (engine_core.h)

// Collections, images and objects.
class EngineImages {
 public:
  // Collections: separate images, objects and vocabularies. `default` is there from the start and
  // cannot be removed. Create: false = it was there. Remove: with all it holds; false = it was not.
  bool CreateCollection(const std::string& name);
  std::vector<std::string> ListCollections();
  std::vector<CollectionLabel> ListLabels();  // the same, with their other names
  bool RemoveCollection(const std::string& name);
  // kNotFound as GetCollection; kInvalidArgument "display_name_invalid".
  CollectionRecord ChangeCollection(const std::string& name, const CollectionChange& change);
  // An active one; kNotFound as GetCollection.
  bool HasVocabulary(const std::string& collection);
  CollectionRecord GetCollection(const std::string& name);  // kNotFound "collection_not_found"

  // Aliases: other names of collections, good wherever a collection is named (RemoveCollection
  // refuses them: kConflict "collection_is_alias"). Whoever makes several calls that belong
  // together asks for CollectionName() first, since aliases can be moved between two calls: the
  // name of the collection itself; kNotFound as GetCollection.
  // Change: all at once, or none. kNotFound "alias_not_found" for one to remove,
  // "collection_not_found"; kConflict "collection_exists" for an alias that has the name of a
  // collection; kInvalidArgument "alias_invalid". They go with their collection.
  std::string CollectionName(const std::string& name_or_alias);
  std::vector<AliasRecord> ListAliases();
  void ChangeAliases(const AliasChanges& changes);

  // Images. Add throws what DecodeImage throws, kUnprocessable "too_few_features",
  // kInvalidArgument for an id, object or metadata that is not acceptable. Bytes that are stored
  // under another id already are not described again. Where there is a `check`, it sees the image
  // that has the id, before anything is described, and again when it is stored; what it throws
  // refuses the addition.
  AddResult Add(const AddRequest& request, const ImageCheck& check = {});
  // The same in two steps: this one takes processor time, and what it returns waits for the store,
  // which may take long. The request's bytes, and the engine, must outlive it.
  std::function<AddResult()> BeginAdd(const AddRequest& request, const ImageCheck& check = {});
  std::optional<ImageRecord> FindBySha256(const std::string& collection, const std::string& sha256);
  ImageRecord Get(const std::string& collection, const std::string& id);  // kNotFound
  Features GetFeatures(const std::string& collection, const std::string& id);
  // kNotFound "content_not_kept"; kCorrupt "original_missing", "original_corrupt".
  std::vector<std::uint8_t> GetContent(const std::string& collection, const std::string& id);
  std::vector<ImageRecord> List(const ListOptions& options);
  // False = was not there. What `check` throws.
  bool Remove(const std::string& collection, const std::string& id, const ImageCheck& check = {});
  // A page of those selected, in any order, with what is counted beside (records/listing.h).
  // kInvalidArgument names what is wrong.
  ImagePage ListPage(const ImageListing& list);
  // All pages, one after the other, of one state of the database: what is changed meanwhile is not
  // seen. Writers go on, and the database's log grows until it ends.
  void ForEachPage(const ImageListing& list, const std::function<void(const ImagePage&)>& work);
  // Likewise, with the features of each image: `look` sees all pages first, then `take` each
  // image, in the same order.
  void ForEachFeatures(const ImageListing& list, const std::function<void(const ImagePage&)>& look,
                       const std::function<void(const ImageRecord&, const Features&)>& take);
  DescriptorInfo Model();  // what the images are described with
  ObjectPage ListPage(const ObjectListing& list);
  // Removes all images selected, at once or not at all; how many. Nothing selected apart from the
  // collection is kInvalidArgument "selection_empty": that would be all of it.
  std::uint64_t RemoveWhere(const Selection& which);
  // Another object, other metadata, without describing anything anew; the record as it is then.
  // kNotFound "image_not_found"; kInvalidArgument for what is not acceptable; what `check` throws.
  ImageRecord Change(const std::string& collection, const std::string& id,
                     const ImageChange& change);

  std::vector<ObjectRecord> ListObjects(const std::string& collection, const std::string& after,
                                        int limit);
  std::optional<ObjectRecord> GetObject(const std::string& collection, const std::string& object);
  std::uint64_t RemoveObject(const std::string& collection, const std::string& object,
                             const ObjectCheck& check = {});
  // Another name, for all its images at once. kNotFound "object_not_found"; kConflict
  // "object_exists"; kInvalidArgument; what `check` throws.
  ObjectRecord ChangeObject(const std::string& collection, const std::string& object,
                            const ObjectChange& change);

 protected:
  explicit EngineImages(EngineCore* core) : core_(*core) {}

 private:
  EngineCore& core_;
};

// What is in an image.
class EngineSearch {
 public:
  // Search throws what DecodeImage throws, kConflict "no_vocabulary", kUnprocessable
  // "too_few_features", kInvalidArgument for options (named), kNotFound for a stored id.
  SearchResult Search(Bytes encoded, const SearchOptions& options);
  SearchResult SearchStored(const std::string& image_id, const SearchOptions& options);
  // By several stored images at once, 1 to kMaxExamples (kInvalidArgument "examples_invalid",
  // kNotFound for one that there is not): images like any of them, those like several first. Each
  // example is searched with; a hit's score is 1 - the product of (1 - score) over them, its
  // probability the highest, and the rest what the example gave that it agrees with best. The
  // examples themselves are no hits. `options.region` is kInvalidArgument "region_invalid". Beyond
  // the 1000 best hits of each example nothing is counted.
  SearchResult SearchExamples(const std::vector<std::string>& image_ids,
                              const SearchOptions& options);
  // With features that were extracted elsewhere with the database's model (else kConflict
  // "model_mismatch"): what Search gives for the image they are of. `second` gives the features
  // of a second pass at high resolution, where Search would make one; none: there are no more.
  using SecondPass = std::function<std::optional<Features>(ExtractionTimings*)>;
  SearchResult SearchFeatures(const Features& features, const SearchOptions& options,
                              const SecondPass& second = {});
  // Such features, of the image that `known` are of (FeatureExtractor::ExtractSecondPass).
  std::optional<Features> DescribeFiner(Bytes encoded, const Features& known, int threads);

  // Whether two images show the same object, and where that of the first is in the second; no
  // image is stored. Where not, the second is looked at more closely, as Search does. `threads`:
  // 0 = all cores. Throws what DecodeImage throws, kUnprocessable
  // "too_few_features" that names the image.
  Comparison Compare(Bytes first, Bytes second, int threads);

  // Where the object is in the image, as the tracker asks of every frame. All of an object's
  // images are compared when they are few, those with the most similar words when there are many.
  // Not found is no error. `threads`: 0 = all cores. Throws what DecodeImage throws, kNotFound
  // "collection_not_found", "object_not_found".
  ObjectLocation Locate(Bytes encoded, const std::string& collection, const std::string& object,
                        int threads);

 protected:
  explicit EngineSearch(EngineCore* core) : core_(*core) {}

 private:
  EngineCore& core_;
};

// Vocabularies.
class EngineVocabularies {
 public:
  // Training makes a new version beside the old and re-quantises the images from
  // their stored descriptors; UseVocabulary switches atomically.
  VocabularyRecord TrainVocabulary(const TrainOptions& options);
  std::vector<VocabularyRecord> ListVocabularies(const std::string& collection);
  void UseVocabulary(const std::string& collection, std::int64_t id,
                     const UseOptions& options = {});
  // Images that UseVocabulary would have to quantise first.
  std::uint64_t CountUnquantized(const std::string& collection, std::int64_t id);

 protected:
  explicit EngineVocabularies(EngineCore* core) : core_(*core) {}

 private:
  EngineCore& core_;
  std::mutex training_mutex_;  // one training at a time
};

// The database as a whole.
class EngineMaintenance {
 public:
  EngineStats Stats();
  // Every invariant of the database; empty = sound. Each problem is a sentence.
  std::vector<std::string> Check();
  // Removes files of the originals' directory that no image refers to: what a process left that
  // died while it added. How many. Nothing where the directory is another database's.
  std::uint64_t SweepOriginals();
  // Makes `directory` (empty: the database) the place of originals, as EngineOptions::originals_dir
  // does, and moves those there that are stored already, a few in a transaction: also while the
  // database is in use, and what was cut off goes on when called again. `progress` hears the share.
  MoveOriginalsResult MoveOriginals(const std::filesystem::path& directory,
                                    const std::function<void(double done)>& progress = {});
  std::optional<OriginalsRecord> DescribeOriginals();  // nullopt = all are in the database
  // Online backup to a file that must not exist; written to a temporary name, then renamed. Without
  // the originals' directory: copy that afterwards. `stop`: then kCancelled "cancelled".
  void Backup(const std::filesystem::path& target, const std::stop_token& stop = {});

 protected:
  explicit EngineMaintenance(EngineCore* core) : core_(*core) {}

 private:
  EngineCore& core_;
};

class Engine : public EngineImages,
               public EngineSearch,
               public EngineVocabularies,
               public EngineMaintenance {
 public:
  // Opens or makes the database and loads the index. Throws kNotFound, kCorrupt ("not a Pliant
  // database", "other_schema"), kConflict, kUnavailable.
  explicit Engine(EngineOptions options);
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

 private:
  explicit Engine(std::unique_ptr<EngineCore> core);

  std::unique_ptr<EngineCore> core_;
};

}  // namespace pliant
