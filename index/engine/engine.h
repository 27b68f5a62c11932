// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The facade of the index: one database, many threads. API keys and jobs of a server have a
// separate facade (index/store/service_store.h). Verification also works without a database
// (index/verify/verification.h).
//
// Thread safety: any thread can call any method. Searches run on an immutable snapshot. Writes go
// through one writer and are durable when the call returns: neither kill -9 nor power loss loses an
// acknowledged write.
#pragma once

#include <chrono>
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
#include "index/engine/index_parts.h"
#include "index/records/index_share.h"
#include "index/records/listing.h"
#include "index/records/records.h"
#include "index/records/search.h"

namespace pliant {

// How images are indexed unless something else is asked for: with 512 keypoints. More find photos
// of packages and shirts no better (evaluation/README.md), and cost memory and time.
inline ExtractionOptions IndexExtraction() {
  ExtractionOptions extraction;
  extraction.keypoints.max_keypoints = 512;
  return extraction;
}

inline constexpr const char* kDefaultDescriptor = "deal";

struct EngineOptions {
  std::filesystem::path database;
  // Descriptor of a NEW database. An existing database must have the same model (Error kConflict
  // "model_mismatch" names both). Empty: the database's own; kDefaultDescriptor for a new database.
  std::string descriptor;
  DescriptorOptions descriptor_options;
  ExtractionOptions extraction = IndexExtraction();
  // Keypoints of an indexed image, and longer side in pixels. They are properties of the database,
  // so that images and queries are described in the same way; a query has up to twice as many, as
  // its object may be a small part of it, and as many again enlarged. Absent: the database's own
  // values; those of `extraction` for a new database. Other values than the database's are Error
  // kConflict "extraction_mismatch".
  std::optional<int> max_keypoints;
  std::optional<int> max_side_px;
  // Also describe small images, and every query, enlarged. This replaces
  // ExtractionOptions::enlarge_below, which is ignored here. false: only at their own size, as in
  // the paper.
  bool enlarge = true;
  bool create = true;  // create a missing database; false: kNotFound
  bool read_only = false;
  bool keep_originals = true;  // also store the uploaded bytes, for GET .../content
  // Directory for the uploaded bytes, created if its parent exists; empty: the database. Absent:
  // the current location; for a new database, the database. Stored bytes stay where they are, and
  // are found there. The constructor throws kConflict "originals_foreign" for the directory of
  // another database, and kNotFound "originals_missing" for one that lacks files of this database.
  // Without a descriptor (`load_descriptor`) it only reads the directory.
  std::optional<std::filesystem::path> originals_dir;
  // Replaces `descriptor` if set. Several engines can share one.
  std::shared_ptr<const Descriptor> custom_descriptor;
  // false: the first call that describes an image makes the descriptor. Weights are not needed, and
  // not checked, before.
  bool load_descriptor = true;
  // false: the first call that needs the inverted index loads it.
  bool load_index = true;
  // The index of a database file with at least so many images is also saved in files, in a folder
  // DATABASE.index: so the next start is fast, and processes share one copy. The files are derived
  // from the database and can be removed.
  std::size_t save_index_from = 256;
  // Directory for the same files of a database on PostgreSQL; empty: none.
  std::filesystem::path index_dir;
  // The part of the index that this process holds, of a database on PostgreSQL. With parts, every
  // search asks `part_servers`.
  IndexShare share;
  std::function<std::shared_ptr<PartServers>()> part_servers;
  // Called while the index loads with the share of the images in memory, 0..1, by the loading
  // thread.
  std::function<void(double share)> loading;
  // Called for failures that no caller receives, from any thread. After such a failure the index in
  // memory is behind the database. The next search or write tries to catch up first, and throws if
  // it cannot.
  std::function<void(const std::string& failure)> warn;
  int busy_timeout_ms = 10'000;  // wait for another process's write lock, then kUnavailable
  // Images are refused (kNoSpace) if less than this would remain free on the disk of the database
  // or of the originals. Removal also needs some space before it frees any.
  std::uint64_t reserve_bytes = 64 * 1024 * 1024;
};

// EngineOptions::originals_dir from text. Empty: the current location; "database": the database;
// otherwise a path ("./database" for a directory of that name).
inline std::optional<std::filesystem::path> ParseOriginalsDir(const std::string& text) {
  if (text.empty()) return std::nullopt;
  return text == "database" ? std::filesystem::path() : std::filesystem::path(text);
}

class EngineCore;  // engine_core.h

class Engine {
 public:
  // Opens or creates the database and loads the index. Throws kNotFound, kCorrupt ("not a Pliant
  // database", "other_schema"), kConflict, kUnavailable.
  explicit Engine(EngineOptions options);
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  // --- Collections, images and objects.

  // Collections: separate images, objects and vocabularies. `default` always exists and cannot be
  // removed. Create: false = it existed already. Remove: with all its content; false = it did not
  // exist.
  bool CreateCollection(const std::string& name);
  std::vector<std::string> ListCollections();
  bool RemoveCollection(const std::string& name);
  // kNotFound as GetCollection; kInvalidArgument "display_name_invalid", "found_from_invalid".
  CollectionRecord ChangeCollection(const std::string& name, const CollectionChange& change);
  CollectionRecord GetCollection(const std::string& name);  // kNotFound "collection_not_found"
  std::string GetSelfTest(const std::string& name);         // CollectionChange::self_test

  // Aliases: other names of collections, valid wherever a collection is named. Only
  // RemoveCollection refuses them (kConflict "collection_is_alias"). CollectionName: the
  // collection's own name; kNotFound as GetCollection. Aliases can move between two calls: call it
  // first if several calls must use the same collection. ChangeAliases: all changes in one step, or
  // none. kNotFound "alias_not_found" for an alias to remove, "collection_not_found"; kConflict
  // "collection_exists" for an alias with the name of a collection; kInvalidArgument
  // "alias_invalid". Removing a collection removes its aliases.
  std::string CollectionName(const std::string& name_or_alias);
  std::vector<AliasRecord> ListAliases();
  void ChangeAliases(const AliasChanges& changes);

  // Images. Add throws what DecodeImage throws, kUnprocessable "too_few_features", kInvalidArgument
  // for an invalid id, object or metadata. Bytes that are already stored under another id are not
  // described again. `check` receives the image that has the id: before the new one is described,
  // and again when it is stored. An exception from `check` refuses the addition.
  AddResult Add(const AddRequest& request, const ImageCheck& check = {});
  // An image that another program described, with the database's model (kConflict
  // "model_mismatch"). The request's bytes can be empty: then the features identify the image, and
  // there is no content. kInvalidArgument "features_invalid" above kMaxKeypoints.
  AddResult AddFeatures(const AddRequest& request, const Features& features);
  // Add in two steps. This call uses the processor; the returned function waits for the store,
  // possibly for long. The request's bytes and the engine must outlive it.
  std::function<AddResult()> BeginAdd(const AddRequest& request, const ImageCheck& check = {});
  std::optional<ImageRecord> FindBySha256(const std::string& collection, const std::string& sha256);
  ImageRecord Get(const std::string& collection, const std::string& id);  // kNotFound
  Features GetFeatures(const std::string& collection, const std::string& id);
  // kNotFound "content_not_kept"; kCorrupt "original_missing", "original_corrupt".
  std::vector<std::uint8_t> GetContent(const std::string& collection, const std::string& id);
  // false = it did not exist. Throws what `check` throws.
  bool Remove(const std::string& collection, const std::string& id, const ImageCheck& check = {});
  // A page of the selected images, in any order, with counts (records/listing.h). kInvalidArgument
  // names the invalid option.
  ImagePage ListPage(const ImageListing& list);
  // All pages, one after another, of one state of the database. Writers continue, but their changes
  // are not visible here. The database's log grows until this returns.
  void ForEachPage(const ImageListing& list, const std::function<void(const ImagePage&)>& work);
  // The same with the features of each image: first `look` receives all pages, then `take` receives
  // each image, in the same order.
  void ForEachFeatures(const ImageListing& list, const std::function<void(const ImagePage&)>& look,
                       const std::function<void(const ImageRecord&, const Features&)>& take);
  DescriptorInfo Model();  // the descriptor of the images
  ObjectPage ListPage(const ObjectListing& list);
  // Removes all selected images in one step, or none. Returns their number. A selection of the
  // whole collection is kInvalidArgument "selection_empty".
  std::uint64_t RemoveWhere(const Selection& which);
  // Changes object, metadata or collection without describing the image again. Returns the new
  // record. kNotFound "image_not_found", "collection_not_found"; kConflict "image_exists" in the
  // other collection; kInvalidArgument for invalid values; what `check` throws.
  ImageRecord Change(const std::string& collection, const std::string& id,
                     const ImageChange& change);

  std::optional<ObjectRecord> GetObject(const std::string& collection, const std::string& object);
  std::uint64_t RemoveObject(const std::string& collection, const std::string& object,
                             const ObjectCheck& check = {});
  // Renames the object in all its images, or moves them to another collection, in one step.
  // kNotFound "object_not_found", "collection_not_found"; kConflict "object_exists",
  // "image_exists"; kInvalidArgument; what `check` throws.
  ObjectRecord ChangeObject(const std::string& collection, const std::string& object,
                            const ObjectChange& change);

  // --- Searches, and comparisons of images.

  // Search throws what DecodeImage throws, kConflict "no_vocabulary", kUnprocessable
  // "too_few_features", kInvalidArgument that names the option, kNotFound for a stored id.
  SearchResult Search(Bytes encoded, const SearchOptions& options);
  SearchResult SearchStored(const std::string& image_id, const SearchOptions& options);
  // Searches by several stored images, 1 to kMaxExamples (kInvalidArgument "examples_invalid",
  // kNotFound for an unknown id). Finds images similar to any of them; images similar to several
  // come first. Each example is a query. A hit's score is 1 - the product of (1 - score) over the
  // examples, its probability the highest. All its other fields are from its best example. The
  // examples themselves are no hits. `options.region` is kInvalidArgument "region_invalid". Only
  // the 1000 best hits of each example count.
  SearchResult SearchExamples(const std::vector<std::string>& image_ids,
                              const SearchOptions& options);
  // The result of Search for an image from its features, which were extracted elsewhere with the
  // database's model (otherwise kConflict "model_mismatch"). `second` returns the features of the
  // second pass at high resolution if Search would make one; none: no second pass.
  using SecondPass = std::function<std::optional<Features>(ExtractionTimings*)>;
  SearchResult SearchFeatures(const Features& features, const SearchOptions& options,
                              const SecondPass& second = {});
  // The features for `second`, of the image of `known` (FeatureExtractor::ExtractSecondPass).
  std::optional<Features> DescribeFiner(Bytes encoded, const Features& known, int threads);

  // Whether two images show the same object, and where the object of the first is in the second.
  // Stores nothing. If they do not, the second image gets a second pass, as in Search. `threads`: 0
  // = all cores. Throws what DecodeImage throws, kUnprocessable "too_few_features" that names the
  // image.
  Comparison Compare(Bytes first, Bytes second, int threads);

  // Answers another process's search for the part of the index that this one holds (messages:
  // index_parts.h), or gives up at `until` (kUnavailable "busy"). Throws kNotFound "part_elsewhere"
  // if it is not here, kConflict "part_changed", kInvalidArgument "peer_message_invalid".
  std::string RankPart(const IndexShare& share, const std::string& message, int threads,
                       std::chrono::steady_clock::time_point until);
  // The state of the database that the index of this process has reached.
  std::int64_t followed();
  // Which database that is, the same in all processes; empty unless the index is in parts.
  const std::string& database() const;

  // Where the object is in the image, as in the tracker. If the object has few images, all are
  // compared, otherwise those with the most similar visual words. Not found is no error. `threads`:
  // 0 = all cores. Throws what DecodeImage throws, kNotFound "collection_not_found",
  // "object_not_found".
  ObjectLocation Locate(Bytes encoded, const std::string& collection, const std::string& object,
                        int threads);

  // --- Vocabularies.

  // Training makes an additional vocabulary and quantises the images from their stored descriptors.
  // UseVocabulary switches atomically.
  VocabularyRecord TrainVocabulary(const TrainOptions& options);
  std::vector<VocabularyRecord> ListVocabularies(const std::string& collection);
  void UseVocabulary(const std::string& collection, std::int64_t id,
                     const UseOptions& options = {});
  // Number of images that UseVocabulary must quantise first.
  std::uint64_t CountUnquantized(const std::string& collection, std::int64_t id);

  // --- The database as a whole.

  EngineStats Stats();
  // Checks every invariant of the database. Returns one sentence per problem; empty = sound.
  std::vector<std::string> Check();
  // Removes files from the originals' directory that no image refers to, such as those of a process
  // that died during an addition. Returns their number. Removes nothing from another database's
  // directory.
  std::uint64_t SweepOriginals();
  // Makes `directory` (empty: the database) the location of originals, as
  // EngineOptions::originals_dir does, and moves the stored originals there, a few per transaction.
  // This works while the database is in use. After an interruption, call it again to continue.
  // `progress` receives the share, 0..1.
  MoveOriginalsResult MoveOriginals(const std::filesystem::path& directory,
                                    const std::function<void(double done)>& progress = {});
  std::optional<OriginalsRecord> DescribeOriginals();  // nullopt = all are in the database
  // Online backup to a file that must not exist. It is written under a temporary name, then
  // renamed. It does not contain the originals' directory: copy that afterwards. On `stop`:
  // kCancelled "cancelled".
  void Backup(const std::filesystem::path& target, const std::stop_token& stop = {});

 private:
  std::function<AddResult()> BeginAdd(const AddRequest& request, const ImageCheck& check,
                                      const Features* given);

  const std::unique_ptr<EngineCore> core_;
  std::mutex training_mutex_;  // one training at a time
};

}  // namespace pliant
