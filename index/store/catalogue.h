// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Reads the stored records. Every method sees one consistent state. Thread-safe. Throws what a
// database throws: kUnavailable, kCorrupt, kInternal; kNotFound "collection_not_found" for a
// missing collection. Names of collections can be aliases.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "index/records/image_ref.h"
#include "index/records/listing.h"
#include "index/records/records.h"
#include "index/records/search.h"
#include "vocab/quantizer.h"
#include "vocab/vocabulary.h"

namespace pliant {

// How images are described.
struct ExtractionLimits {
  int max_keypoints = 0;  // 0 = not decided
  int max_side_px = 0;    // 0 = not decided
};

// The descriptor of the images.
struct StoredModel {
  DescriptorInfo info;
  ExtractionLimits limits;
};

struct CollectionState {
  Key key = 0;
  std::string name;
  Key vocabulary = 0;  // the active one; 0 = none
  std::int64_t created_ms = 0;
  double found_from = kFoundProbability;  // CollectionRecord
};

struct StoredImage {
  std::int64_t version = 0;
  ImageRecord record;
  std::vector<std::uint8_t> features;  // encoded; empty if not requested
};

struct DescriptorSample {
  Descriptors descriptors;      // the requested number of rows, or all
  std::uint64_t available = 0;  // all descriptors
};

enum class Load { kRecords, kRecordsAndFeatures };

class Access;
class OriginalsKeeper;
struct ModelRow;

class Catalogue {
 public:
  // All must outlive it.
  Catalogue(Access* access, OriginalsKeeper* originals, const ModelRow* model)
      : access_(*access), originals_(*originals), model_(*model) {}

  // For searches.
  CollectionState RequireCollection(const std::string& name);
  // In one batch, in the order of `refs`. If that version was replaced, the present one; nullopt if
  // the image was removed.
  std::vector<std::optional<StoredImage>> LoadImages(std::span<const ImageRef> refs, Load what);
  // Sets the keys for `object`, `filter` and `without`. Ignores unknown ids.
  Admission Admit(Key collection, const std::optional<std::string>& object, const Filter& filter,
                  const std::vector<std::string>& without);

  // Collections and objects.
  std::vector<std::string> ListCollections();
  std::vector<CollectionLabel> ListLabels();  // as ListCollections, with display names and aliases
  std::vector<AliasRecord> ListAliases();     // in order of their names
  CollectionRecord DescribeCollection(const std::string& name);
  std::string SelfTestOf(const std::string& collection);  // CollectionChange::self_test
  std::optional<ObjectRecord> FindObject(const std::string& collection, const std::string& object);

  // Images.
  std::optional<ImageRecord> FindImage(const std::string& collection, const std::string& id);
  std::optional<ImageRecord> FindBySha256(const std::string& collection, const std::string& sha256);
  // With a filter, a text, a count of either, or a facet, this reads the metadata or names of the
  // whole collection. It holds one page in memory. kInvalidArgument "after_invalid".
  ImagePage ListImagePage(const ImageListing& list);
  // All pages, one after another, of one state of the store, however long `work` takes.
  void ForEachImagePage(ImageListing list, const std::function<void(const ImagePage&)>& work);
  // The same images twice, of one state of the store, in the same order: page by page, then one by
  // one with their encoded features. One page of features is in memory.
  void ForEachImageFeatures(ImageListing list, const std::function<void(const ImagePage&)>& look,
                            const std::function<void(const ImageRecord&, Bytes features)>& take);
  ObjectPage ListObjectPage(const ObjectListing& list);
  // The stored image that `request` would only repeat. Throws kConflict "same_bytes" for another
  // object or other metadata.
  std::optional<ImageRecord> FindUnchanged(const AddRequest& request, const std::string& sha256);
  // An image of any collection with these bytes, with its features.
  std::optional<StoredImage> FindDescribed(const std::string& sha256);
  // The uploaded bytes. kNotFound "image_not_found", "content_not_kept"; kCorrupt
  // "original_missing", "original_corrupt".
  std::vector<std::uint8_t> ReadContent(const std::string& collection, const std::string& id);

  // Vocabularies: only ready ones, oldest first.
  std::vector<VocabularyRecord> ListVocabularies(const std::string& collection);
  std::optional<VocabularyRecord> FindVocabulary(const std::string& collection, Key vocabulary);
  std::shared_ptr<const Vocabulary> ReadVocabulary(Key vocabulary);
  std::uint64_t CountImages(Key collection);
  std::uint64_t CountUnquantized(const std::string& collection, Key vocabulary);
  // The words of the images that have words, by version. `words`: the size of the vocabulary.
  std::map<Key, std::vector<std::uint32_t>> LoadWords(Key vocabulary, std::size_t words,
                                                      std::span<const Key> versions);
  // Each descriptor of the collection has the same probability, and none is drawn twice. The same
  // seed and images give the same sample, in any order of addition.
  DescriptorSample SampleDescriptors(Key collection, std::size_t count, std::uint64_t seed);

  // The whole store. Count: images, objects, descriptors, bytes, and the default collection's
  // vocabulary. Check: one sentence per problem. Backup: see Engine::Backup.
  EngineStats Count();
  std::vector<std::string> Check();
  void Backup(const std::filesystem::path& target, const std::stop_token& stop);
  std::optional<OriginalsRecord> DescribeOriginals();

 private:
  Access& access_;
  OriginalsKeeper& originals_;
  const ModelRow& model_;
};

}  // namespace pliant
