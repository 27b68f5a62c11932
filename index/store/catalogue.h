// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is kept, read. Every method sees one consistent state. Thread-safe. Throws what a database
// throws: kUnavailable, kCorrupt, kInternal; kNotFound "collection_not_found" for a collection that
// there is not. Collections are known by their names and by their aliases.
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

// What the images are described with.
struct StoredModel {
  DescriptorInfo info;
  ExtractionLimits limits;
};

struct CollectionState {
  Key key = 0;
  std::string name;
  Key vocabulary = 0;  // the active one; 0 = none
  std::int64_t created_ms = 0;
};

struct StoredImage {
  std::int64_t version = 0;
  ImageRecord record;
  std::vector<std::uint8_t> features;  // encoded; empty when not asked for
};

struct DescriptorSample {
  Descriptors descriptors;      // as many rows as asked for, or all there are
  std::uint64_t available = 0;  // descriptors there are
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

  // What a search reads.
  CollectionState RequireCollection(const std::string& name);
  // All at once, in the order of `refs`. Where that version is gone, the one in its place; nothing
  // where there is none.
  std::vector<std::optional<StoredImage>> LoadImages(std::span<const ImageRef> refs, Load what);
  // Fills in what `object`, `filter` and `without` come to; ids of no image leave nothing out.
  Admission Admit(Key collection, const std::optional<std::string>& object, const Filter& filter,
                  const std::vector<std::string>& without);

  // Collections and objects.
  std::vector<std::string> ListCollections();
  std::vector<CollectionLabel> ListLabels();  // as ListCollections, with other names
  std::vector<AliasRecord> ListAliases();     // in order of their names
  CollectionRecord DescribeCollection(const std::string& name);
  std::optional<ObjectRecord> FindObject(const std::string& collection, const std::string& object);
  std::vector<ObjectRecord> ListObjects(const std::string& collection, const std::string& after,
                                        int limit);

  // Images.
  std::optional<ImageRecord> FindImage(const std::string& collection, const std::string& id);
  std::optional<ImageRecord> FindBySha256(const std::string& collection, const std::string& sha256);
  std::vector<ImageRecord> ListImages(const ListOptions& options);
  // Reads the metadata, or the names, of the whole collection when there is a filter, a text, a
  // count of what these leave, or a facet; holds a page in memory. kInvalidArgument
  // "after_invalid".
  ImagePage ListImagePage(const ImageListing& list);
  // All pages, one after the other, of one state of the store, however long `work` takes.
  void ForEachImagePage(ImageListing list, const std::function<void(const ImagePage&)>& work);
  // The same images twice, of one state of the store, in the same order: page by page, then one
  // by one with their encoded features, of which a page is in memory.
  void ForEachImageFeatures(ImageListing list, const std::function<void(const ImagePage&)>& look,
                            const std::function<void(const ImageRecord&, Bytes features)>& take);
  ObjectPage ListObjectPage(const ObjectListing& list);
  // The image that `request` would only store once more . Throws kConflict "same_bytes"
  // for another object or other metadata.
  std::optional<ImageRecord> FindUnchanged(const AddRequest& request, const std::string& sha256);
  // An image of any collection with these bytes, with its features.
  std::optional<StoredImage> FindDescribed(const std::string& sha256);
  // The uploaded bytes. kNotFound "image_not_found", "content_not_kept"; kCorrupt
  // "original_missing", "original_corrupt".
  std::vector<std::uint8_t> ReadContent(const std::string& collection, const std::string& id);

  // Vocabularies: those that are ready, oldest first.
  std::vector<VocabularyRecord> ListVocabularies(const std::string& collection);
  std::optional<VocabularyRecord> FindVocabulary(const std::string& collection, Key vocabulary);
  std::shared_ptr<const Vocabulary> ReadVocabulary(Key vocabulary);
  std::uint64_t CountImages(Key collection);
  std::uint64_t CountUnquantized(const std::string& collection, Key vocabulary);
  // The words of the images that have some, by version. `words`: the size of the vocabulary.
  std::map<Key, Bow> LoadWords(Key vocabulary, std::size_t words, std::span<const Key> versions);
  // Each descriptor of the collection is as likely as any other, none is drawn twice. The same
  // seed and images give the same sample, in whatever order the images were added.
  DescriptorSample SampleDescriptors(Key collection, std::size_t count, std::uint64_t seed);

  // The whole store. Count: images, objects, descriptors, bytes, and the default collection's
  // vocabulary. Check: what is wrong, a sentence each. Backup: see Engine::Backup.
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
