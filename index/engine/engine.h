// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The facade of the index: one database file, many threads. The command line and the HTTP server
// use nothing else.
//
// Thread safety: every method may be called from any thread. Searches run on an immutable
// snapshot; writes go through one writer and are durable when the call returns (SQLite WAL,
// synchronous = FULL), so that kill -9 or power loss loses nothing that was acknowledged.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "descriptor/features/descriptor.h"
#include "index/records/search.h"
#include "index/verify/location.h"
#include "vocab/vocabulary.h"

namespace pliant {

struct EngineOptions {
  std::filesystem::path database;
  // Descriptor of a NEW database; an existing one must have been made with the same model
  // (Error kConflict "model_mismatch" names both). Empty: whatever the database was made with, and
  // "deal" for a new one.
  std::string descriptor = "deal";
  DescriptorOptions descriptor_options;
  ExtractionOptions extraction;
  // Key points a picture and its longer side in pixels are properties of a database, so that what
  // is stored and what is asked are described alike. Absent: as the database was made, and what
  // `extraction` says for a new one. Another value than the database's is Error kConflict
  // "extraction_mismatch".
  std::optional<int> max_keypoints;
  std::optional<int> max_side_px;
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
  // false: the descriptor is made by the first call that describes a picture, so that weights are
  // neither needed nor checked before.
  bool load_descriptor = true;
  // false: the inverted index is loaded by the first call that needs it.
  bool load_index = true;
  // Hears which share of the pictures is in memory while the index loads, 0..1, from the thread
  // that loads.
  std::function<void(double share)> loading;
  int busy_timeout_ms = 10'000;  // wait for another process's write lock, then kUnavailable
};

// What people write for EngineOptions::originals_dir: nothing = as before, "database", or a path
// ("./database" for a directory of that name).
inline std::optional<std::filesystem::path> ParseOriginalsDir(const std::string& text) {
  if (text.empty()) return std::nullopt;
  return text == "database" ? std::filesystem::path() : std::filesystem::path(text);
}

struct ImageRecord {
  std::string collection;
  std::string id;      // unique in the collection
  std::string object;  // what the picture shows; may be empty
  std::string sha256;  // of the uploaded bytes, hex
  std::string media_type;
  std::string metadata = "{}";  // a JSON object
  std::string source;           // file name as given, for people; may be empty
  int width = 0;                // original, upright
  int height = 0;
  std::uint32_t keypoints = 0;
  std::uint64_t bytes = 0;    // of the upload
  std::int64_t added_ms = 0;  // Unix time
};

struct AddRequest {
  std::string collection = kDefaultCollection;
  // Absent: the picture is found again by its bytes (same SHA-256 in the collection = unchanged,
  // and Error kConflict "same_bytes" when it is given another object or other metadata than it
  // has), a new one gets the first 32 hex digits of its SHA-256 as id. Present: upsert of that id.
  std::optional<std::string> id;
  std::string object;
  std::string metadata = "{}";
  std::string source;
  Bytes bytes;
  int threads = 1;  // for the description of this picture
};

enum class AddOutcome {
  kCreated,
  kReplaced,
  kUnchanged,  // same bytes, object and metadata were there already: no work was done
};

struct AddTimings {
  ExtractionTimings extraction;  // 0 when stored features were used again
  double quantize_ms = 0;
  double database_ms = 0;  // until the write was durable
};

struct AddResult {
  AddOutcome outcome = AddOutcome::kCreated;
  ImageRecord image;
  AddTimings timings;
};

struct ListOptions {
  std::string collection = kDefaultCollection;
  std::optional<std::string> object;
  std::string after_id;  // exclusive; pictures come in order of id
  int limit = 100;       // 1..1000
};

struct ObjectRecord {
  std::string object;
  std::uint64_t images = 0;
};

// Where one object is in a picture.
struct ObjectLocation {
  std::string object;
  std::string image_id;  // the object's picture that agrees best; its pixels are what the mesh maps
  Location location;
  std::size_t compared = 0;  // pictures of the object that were looked at
  int query_width = 0;       // of the original upright picture that was sent
  int query_height = 0;
  ExtractionTimings timings;
  double locate_ms = 0;
};

struct VocabularyRecord {
  std::int64_t id = 0;
  std::string collection;
  std::string model_id;
  std::size_t words = 0;
  VocabularyOrigin origin;
  std::int64_t created_ms = 0;
  bool active = false;
};

struct TrainOptions {
  std::string collection = kDefaultCollection;
  int words = 0;   // 0 = a tenth of the sample
  int sample = 0;  // descriptors drawn at random; 0 = 40 000, or ten a given word (10 000 at least)
  std::uint64_t seed = 1;
  int threads = 0;
  std::function<void(double done, double loss)> progress;
  std::stop_token stop;
  bool automatic = false;  // nobody asked for it: see CollectionRecord
};

struct UseOptions {
  int threads = 0;  // 0 = all cores
  std::function<void(double done)> progress;
  std::stop_token stop;
  // Nobody chose it: then it does not replace one that somebody has chosen meanwhile.
  bool automatic = false;
};

struct EngineStats {
  std::uint64_t images = 0;
  std::uint64_t objects = 0;
  std::uint64_t descriptors = 0;
  std::uint64_t database_bytes = 0;
  std::uint64_t index_bytes = 0;  // of the inverted index in memory
  std::string descriptor;
  std::string model_id;
  std::optional<VocabularyRecord> vocabulary;  // the active one of the default collection
};

// A directory of uploaded files (EngineOptions::originals_dir).
struct OriginalsRecord {
  std::filesystem::path directory;
  std::uint64_t files = 0;  // that pictures refer to
  bool owned = false;       // false: it is another database's, as that of a copy is
};

struct MoveOriginalsResult {
  std::uint64_t moved = 0;  // pictures whose bytes are now in the place that was named
  std::uint64_t left = 0;   // whose file is missing or damaged: `Check` names them
};

struct CollectionRecord {
  std::string name;
  std::uint64_t images = 0;
  std::uint64_t objects = 0;
  std::uint64_t descriptors = 0;
  std::int64_t created_ms = 0;                 // Unix time
  std::optional<VocabularyRecord> vocabulary;  // the active one
  // Whether it was trained and put to use by a program on its own (TrainOptions and UseOptions say
  // so), so that the program may replace it; false once somebody has trained or chosen one.
  bool automatic = false;
};

// Fewer key points than this are refused: nothing could be recognised by them.
inline constexpr std::uint32_t kMinKeypoints = 5;

class Engine {
 public:
  // Opens or makes the database, migrates its schema and loads the index. Throws kNotFound,
  // kCorrupt ("not a Pliant database", "made by a newer Pliant"), kConflict, kUnavailable.
  explicit Engine(EngineOptions options);
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  // Collections: separate pictures, objects and vocabularies. `default` is there from the start and
  // cannot be removed. Create: false = it was there. Remove: with all it holds; false = it was not.
  bool CreateCollection(const std::string& name);
  std::vector<std::string> ListCollections();
  bool RemoveCollection(const std::string& name);
  CollectionRecord GetCollection(const std::string& name);  // kNotFound "collection_not_found"

  // Pictures. Add throws what DecodeImage throws, kUnprocessable "too_few_features",
  // kInvalidArgument for an id, object or metadata that is not acceptable. Bytes that are stored
  // under another id already are not described again.
  AddResult Add(const AddRequest& request);
  std::optional<ImageRecord> FindBySha256(const std::string& collection, const std::string& sha256);
  ImageRecord Get(const std::string& collection, const std::string& id);  // kNotFound
  Features GetFeatures(const std::string& collection, const std::string& id);
  // kNotFound "content_not_kept"; kCorrupt "original_missing", "original_corrupt".
  std::vector<std::uint8_t> GetContent(const std::string& collection, const std::string& id);
  std::vector<ImageRecord> List(const ListOptions& options);
  bool Remove(const std::string& collection, const std::string& id);  // false = was not there

  std::vector<ObjectRecord> ListObjects(const std::string& collection, const std::string& after,
                                        int limit);
  std::optional<ObjectRecord> GetObject(const std::string& collection, const std::string& object);
  std::uint64_t RemoveObject(const std::string& collection, const std::string& object);

  // Search throws what DecodeImage throws, kConflict "no_vocabulary", kUnprocessable
  // "too_few_features", kInvalidArgument for options (named), kNotFound for a stored id.
  SearchResult Search(Bytes encoded, const SearchOptions& options);
  SearchResult SearchStored(const std::string& image_id, const SearchOptions& options);
  // With features that were extracted elsewhere with the database's model (else kConflict
  // "model_mismatch"): what Search gives for the picture they are of.
  SearchResult SearchFeatures(const Features& features, const SearchOptions& options);

  // Where the object is in the picture, as the tracker asks of every frame. All of an object's
  // pictures are compared when they are few, those with the most similar words when there are many.
  // Not found is no error. `threads`: 0 = all cores. Throws what DecodeImage throws, kNotFound
  // "collection_not_found", "object_not_found".
  ObjectLocation Locate(Bytes encoded, const std::string& collection, const std::string& object,
                        int threads);

  // Vocabularies. Training makes a new version beside the old and re-quantises the pictures from
  // their stored descriptors; UseVocabulary switches atomically.
  VocabularyRecord TrainVocabulary(const TrainOptions& options);
  std::vector<VocabularyRecord> ListVocabularies(const std::string& collection);
  void UseVocabulary(const std::string& collection, std::int64_t id,
                     const UseOptions& options = {});
  // Pictures that UseVocabulary would have to quantise first.
  std::uint64_t CountUnquantized(const std::string& collection, std::int64_t id);

  EngineStats Stats();
  // Every invariant of the database; empty = sound. Each problem is a sentence.
  std::vector<std::string> Check();
  // Removes files of the originals' directory that no picture refers to: what a process left that
  // died while it added. How many. Nothing where the directory is another database's.
  std::uint64_t SweepOriginals();
  // Makes `directory` (empty: the database) the place of originals, as EngineOptions::originals_dir
  // does, and moves those there that are stored already, a few in a transaction: also while the
  // database is in use, and what was cut off goes on when called again. `progress` hears the share.
  MoveOriginalsResult MoveOriginals(const std::filesystem::path& directory,
                                    const std::function<void(double done)>& progress = {});
  std::optional<OriginalsRecord> DescribeOriginals();  // nullopt = all are in the database
  // Online backup to a file that must not exist; written to a temporary name, then renamed. Without
  // the originals' directory: copy that afterwards.
  void Backup(const std::filesystem::path& target);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant
