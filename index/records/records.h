// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests to the engine and its results, except searches (search.h). Plain values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "descriptor/features/descriptor.h"
#include "index/records/location.h"
#include "index/records/search.h"
#include "vocab/vocabulary.h"

namespace pliant {

struct ImageRecord {
  std::string collection;
  std::string id;      // unique in the collection
  std::string object;  // shown by the image; can be empty
  std::string sha256;  // of the uploaded bytes, hex
  std::string media_type;
  std::string metadata = "{}";  // a JSON object
  std::string source;           // file name as given, for people; can be empty
  int width = 0;                // original, upright
  int height = 0;
  std::uint32_t keypoints = 0;
  std::uint64_t bytes = 0;    // of the upload
  std::int64_t added_ms = 0;  // Unix time; of these bytes
  // When its bytes, object, metadata or source last changed. Renaming an object with all its images
  // does not change this.
  std::int64_t updated_ms = 0;
};

struct AddRequest {
  std::string collection = kDefaultCollection;
  // CollectionRecord::created_ms of the collection, to exclude a later one of the same name
  // (kNotFound "collection_not_found"). 0 = any collection of that name.
  std::int64_t collection_created_ms = 0;
  // Present: upsert of that id. Absent: the bytes identify the image. The same SHA-256 in the
  // collection = unchanged; with another object or other metadata, Error kConflict "same_bytes".
  // The id of a new image is the first 32 hex digits of its SHA-256.
  std::optional<std::string> id;
  std::string object;
  std::string metadata = "{}";
  std::string source;
  Bytes bytes;
  int threads = 1;        // to describe this image
  bool as_query = false;  // describe it like a query; for experiments
};

enum class AddOutcome {
  kCreated,
  kReplaced,
  kUnchanged,  // same bytes, object and metadata are stored already
};

struct AddTimings {
  ExtractionTimings extraction;  // 0 if stored features were reused
  double quantize_ms = 0;
  double database_ms = 0;  // until the write is durable
};

struct AddResult {
  AddOutcome outcome = AddOutcome::kCreated;
  ImageRecord image;
  AddTimings timings;
};

struct ObjectRecord {
  std::string object;
  std::uint64_t images = 0;
};

// Where one object is in an image.
struct ObjectLocation {
  std::string object;
  std::string image_id;  // the object's image with most inliers; the mesh maps its pixels
  Location location;
  std::size_t compared = 0;  // images of the object that were compared
  int query_width = 0;       // of the original upright image that was sent
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
  int sample = 0;  // random; 0 = by engine/training_policy.h, or ten per word (at least 10 000)
  std::uint64_t seed = 1;
  int threads = 0;
  std::function<void(double done, double loss)> progress;
  std::stop_token stop;
  bool automatic = false;  // not on request: see CollectionRecord
};

struct UseOptions {
  int threads = 0;  // 0 = all cores
  std::function<void(double done)> progress;
  std::stop_token stop;
  // Not on request: then it does not replace a vocabulary that a person has chosen meanwhile.
  bool automatic = false;
};

// The state of a database server.
struct DatabaseServerRecord {
  std::uint64_t connections = 0;       // open connections of this process
  std::uint64_t connection_waits = 0;  // number of waits for a free connection
  std::int64_t commit = 0;             // number of the newest change
  std::int64_t behind = 0;             // changes that the index in memory does not have yet
  // Of the standby that is furthest behind; absent without a standby.
  std::optional<double> replication_lag_s;
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
  std::optional<DatabaseServerRecord> server;  // absent: the database is a file
};

// A directory of uploaded files (EngineOptions::originals_dir).
struct OriginalsRecord {
  std::filesystem::path directory;
  std::uint64_t files = 0;  // files that images refer to
  bool owned = false;       // false: it is another database's, as for a copy
};

struct MoveOriginalsResult {
  std::uint64_t moved = 0;  // images whose bytes are now in the new location
  std::uint64_t left = 0;   // images whose file is missing or damaged; `Check` names them
};

struct CollectionRecord {
  std::string name;
  std::string display_name;          // for people; empty = `name`
  std::vector<std::string> aliases;  // in order
  std::uint64_t images = 0;
  std::uint64_t objects = 0;
  std::uint64_t descriptors = 0;
  std::int64_t created_ms = 0;                 // Unix time
  std::optional<VocabularyRecord> vocabulary;  // the active one
  // Whether a program trained and activated it without a request (TrainOptions and UseOptions), so
  // that the program can replace it. false once a person has trained or chosen one.
  bool automatic = false;
  // From this probability on a hit counts as found: kFoundProbability, or what a self-test advised.
  double found_from = kFoundProbability;
};

// A collection in a list.
struct CollectionLabel {
  std::string name;
  std::string display_name;          // as in CollectionRecord
  std::vector<std::string> aliases;  // likewise
};

// Another name of a collection. It can be moved to another collection.
struct AliasRecord {
  std::string name;
  std::string collection;
  std::int64_t updated_ms = 0;  // Unix time; when it was last moved
};

// Images with fewer keypoints are refused: they cannot be recognised.
inline constexpr std::uint32_t kMinKeypoints = 5;

// Changes of a stored image or object without describing it again.

// These receive the present state in the transaction that changes or removes it. An exception
// refuses the change. They can be called more than once.
using ImageCheck = std::function<void(const ImageRecord* now)>;  // null: no such image
// `image_id`: the first of the object's images in order of their ids.
using ObjectCheck = std::function<void(const ObjectRecord& now, const std::string& image_id)>;

// Absent = stays as it is.
struct ImageChange {
  std::optional<std::string> object;    // "" = none
  std::optional<std::string> metadata;  // a JSON merge patch (RFC 7396); "null" = remove all of it
  std::optional<std::string> source;
  std::optional<std::string> collection;  // moves the image there, with its features
  // Receives the present image in the transaction that changes it. An exception refuses the change.
  // Can be called more than once.
  std::function<void(const ImageRecord& now)> check;
};

struct CollectionChange {
  std::optional<std::string> display_name = {};  // "" = none
  std::optional<double> found_from = {};         // kLeastFoundFrom to kMostFoundFrom
  std::optional<std::string> self_test = {};     // JSON of the last report; "" = none
};

// By alias: its new collection; absent = remove the alias.
using AliasChanges = std::map<std::string, std::optional<std::string>>;

struct ObjectChange {
  std::string name;                            // not empty
  std::optional<std::string> collection = {};  // moves all its images there, in one step
  // If another object has the name: true = merge the two objects; false = kConflict
  // "object_exists".
  bool merge = false;
  ObjectCheck check;
};

}  // namespace pliant
