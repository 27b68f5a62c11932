// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the engine is asked and what it answers, but for searches (search.h). Plain values.
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
  std::string object;  // what the image shows; may be empty
  std::string sha256;  // of the uploaded bytes, hex
  std::string media_type;
  std::string metadata = "{}";  // a JSON object
  std::string source;           // file name as given, for people; may be empty
  int width = 0;                // original, upright
  int height = 0;
  std::uint32_t keypoints = 0;
  std::uint64_t bytes = 0;    // of the upload
  std::int64_t added_ms = 0;  // Unix time, of these bytes
  // When its bytes, its object, its metadata or its source changed last. Another name for an object
  // with all its images is no change of these.
  std::int64_t updated_ms = 0;
};

struct AddRequest {
  std::string collection = kDefaultCollection;
  // CollectionRecord::created_ms: only into the collection that was made then, not into one that
  // has its name since (kNotFound "collection_not_found"). 0 = whichever has the name.
  std::int64_t collection_created_ms = 0;
  // Absent: the image is found again by its bytes (same SHA-256 in the collection = unchanged,
  // and Error kConflict "same_bytes" when it is given another object or other metadata than it
  // has), a new one gets the first 32 hex digits of its SHA-256 as id. Present: upsert of that id.
  std::optional<std::string> id;
  std::string object;
  std::string metadata = "{}";
  std::string source;
  Bytes bytes;
  int threads = 1;        // for the description of this image
  bool as_query = false;  // describe it as Engine::Search does; for experiments
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
  std::string after_id;  // exclusive; images come in order of id
  int limit = 100;       // 1..1000
};

struct ObjectRecord {
  std::string object;
  std::uint64_t images = 0;
};

// Where one object is in an image.
struct ObjectLocation {
  std::string object;
  std::string image_id;  // the object's image that agrees best; its pixels are what the mesh maps
  Location location;
  std::size_t compared = 0;  // images of the object that were looked at
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
  int sample = 0;  // drawn at random; 0 = by engine/training_policy.h, or ten a word (from 10 000)
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

// What a database on a server of its own says.
struct DatabaseServerRecord {
  std::uint64_t connections = 0;       // that this process has open
  std::uint64_t connection_waits = 0;  // times that somebody waited for a free one
  std::int64_t commit = 0;             // of the newest change
  std::int64_t behind = 0;             // changes that the index in memory has not seen yet
  // Of the standby that is furthest behind; absent where there is none.
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
  std::uint64_t files = 0;  // that images refer to
  bool owned = false;       // false: it is another database's, as that of a copy is
};

struct MoveOriginalsResult {
  std::uint64_t moved = 0;  // images whose bytes are now in the place that was named
  std::uint64_t left = 0;   // whose file is missing or damaged: `Check` names them
};

struct CollectionRecord {
  std::string name;
  std::string display_name;          // for people; empty = its name
  std::vector<std::string> aliases;  // in order
  std::uint64_t images = 0;
  std::uint64_t objects = 0;
  std::uint64_t descriptors = 0;
  std::int64_t created_ms = 0;                 // Unix time
  std::optional<VocabularyRecord> vocabulary;  // the active one
  // Whether it was trained and put to use by a program on its own (TrainOptions and UseOptions say
  // so), so that the program may replace it; false once somebody has trained or chosen one.
  bool automatic = false;
};

// What a list of collections shows of one.
struct CollectionLabel {
  std::string name;
  std::string display_name;          // as in CollectionRecord
  std::vector<std::string> aliases;  // likewise
};

// Another name of a collection, which can be moved to another one.
struct AliasRecord {
  std::string name;
  std::string collection;
  std::int64_t updated_ms = 0;  // Unix time; when it was moved last
};

// Fewer keypoints than this are refused: nothing could be recognised by them.
inline constexpr std::uint32_t kMinKeypoints = 5;

// What can change about a stored image or object without describing it again.

// See what is there, in the transaction that changes or removes it: what they throw refuses that.
// May be called more than once.
using ImageCheck = std::function<void(const ImageRecord* now)>;  // null: there is no such image
// `image_id`: the first of the object's images in order of their ids.
using ObjectCheck = std::function<void(const ObjectRecord& now, const std::string& image_id)>;

// Absent = stays as it is.
struct ImageChange {
  std::optional<std::string> object;    // "" = none
  std::optional<std::string> metadata;  // a JSON merge patch (RFC 7396); "null" = remove all of it
  std::optional<std::string> source;
  // Sees the image as it is, in the transaction that changes it: what it throws refuses the
  // change. May be called more than once.
  std::function<void(const ImageRecord& now)> check;
};

struct CollectionChange {
  std::optional<std::string> display_name;  // "" = none
};

// By alias: the collection that it is to stand for, or nothing = it goes.
using AliasChanges = std::map<std::string, std::optional<std::string>>;

struct ObjectChange {
  std::string name;  // not empty
  // Where another object has the name: its images and these become one object. Else kConflict
  // "object_exists".
  bool merge = false;
  ObjectCheck check;
};

}  // namespace pliant
