// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/catalogue.h"

#include <algorithm>
#include <map>
#include <utility>

#include "index/store/draw_descriptors.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"
#include "index/store/sql/catalogue_lists.h"
#include "index/store/sql/catalogue_vocabularies.h"
#include "index/store/sql/integrity.h"
#include "index/store/sql/originals.h"
#include "index/store/unchanged.h"
#include "index/store/word_codec.h"

namespace pliant {
namespace {

std::optional<ImageRecord> RecordOf(std::optional<ImageRow> image) {
  if (!image) return std::nullopt;
  return std::move(image->record);
}

void EachPage(Connection& db, Key collection, ImageListing list,
              const std::function<void(const ImagePage&)>& work) {
  while (true) {
    const ImagePage page = SelectImagePage(db, collection, list);
    work(page);
    if (!page.next) return;
    list.after = *page.next;
  }
}

}  // namespace

std::vector<std::string> Catalogue::ListCollections() {
  return access_.Read([](Connection& db) {
    std::vector<std::string> names;
    for (CollectionRow& row : AllCollections(db)) names.push_back(std::move(row.name));
    return names;
  });
}

std::vector<CollectionLabel> Catalogue::ListLabels() {
  return access_.Read([](Connection& db) {
    std::vector<CollectionLabel> labels;
    for (CollectionRow& row : AllCollections(db)) {
      labels.push_back({std::move(row.name), std::move(row.display_name), {}});
    }
    for (AliasRecord& alias : SelectAliases(db)) {
      const auto label = std::lower_bound(
          labels.begin(), labels.end(), alias.collection,
          [](const CollectionLabel& one, const std::string& name) { return one.name < name; });
      label->aliases.push_back(std::move(alias.name));
    }
    return labels;
  });
}

std::vector<AliasRecord> Catalogue::ListAliases() {
  return access_.Read([](Connection& db) { return SelectAliases(db); });
}

CollectionState Catalogue::RequireCollection(const std::string& name) {
  return access_.Read([&](Connection& db) { return StateOf(pliant::RequireCollection(db, name)); });
}

CollectionRecord Catalogue::DescribeCollection(const std::string& name) {
  return access_.Read(
      [&](Connection& db) { return RecordOf(db, pliant::RequireCollection(db, name)); });
}

std::optional<ObjectRecord> Catalogue::FindObject(const std::string& collection,
                                                  const std::string& object) {
  return access_.Read([&](Connection& db) -> std::optional<ObjectRecord> {
    const Key key = pliant::FindObject(db, pliant::RequireCollection(db, collection).key, object);
    if (key == 0) return std::nullopt;
    return ObjectRecord{object, CountImagesOf(db, key)};
  });
}

std::vector<ObjectRecord> Catalogue::ListObjects(const std::string& collection,
                                                 const std::string& after, int limit) {
  return access_.Read([&](Connection& db) {
    return SelectObjects(db, pliant::RequireCollection(db, collection).key, after, limit);
  });
}

std::optional<ImageRecord> Catalogue::FindImage(const std::string& collection,
                                                const std::string& id) {
  return access_.Read([&](Connection& db) {
    return RecordOf(pliant::FindImage(db, pliant::RequireCollection(db, collection).key, id));
  });
}

std::optional<ImageRecord> Catalogue::FindBySha256(const std::string& collection,
                                                   const std::string& sha256) {
  return access_.Read([&](Connection& db) {
    return RecordOf(FindImageBySha256(db, pliant::RequireCollection(db, collection).key, sha256));
  });
}

std::vector<ImageRecord> Catalogue::ListImages(const ListOptions& options) {
  return access_.Read([&](Connection& db) {
    return SelectImages(db, pliant::RequireCollection(db, options.collection).key, options);
  });
}

ImagePage Catalogue::ListImagePage(const ImageListing& list) {
  return access_.Read([&](Connection& db) {
    return SelectImagePage(db, pliant::RequireCollection(db, list.which.collection).key, list);
  });
}

void Catalogue::ForEachImagePage(ImageListing list,
                                 const std::function<void(const ImagePage&)>& work) {
  access_.Read([&](Connection& db) {
    EachPage(db, pliant::RequireCollection(db, list.which.collection).key, list, work);
  });
}

void Catalogue::ForEachImageFeatures(
    ImageListing list, const std::function<void(const ImagePage&)>& look,
    const std::function<void(const ImageRecord&, Bytes features)>& take) {
  access_.Read([&](Connection& db) {
    const Key collection = pliant::RequireCollection(db, list.which.collection).key;
    EachPage(db, collection, list, look);
    EachPage(db, collection, list, [&](const ImagePage& page) {
      for (const ImageRecord& record : page.records) {
        take(record, ReadFeaturesBlob(db, KeyOfImage(db, collection, record.id)));
      }
    });
  });
}

ObjectPage Catalogue::ListObjectPage(const ObjectListing& list) {
  return access_.Read([&](Connection& db) {
    return SelectObjectPage(db, pliant::RequireCollection(db, list.which.collection).key, list);
  });
}

std::optional<ImageRecord> FindUnchangedIn(Connection& db, Key collection,
                                           const AddRequest& request, const std::string& sha256) {
  if (!request.id) return FindMeant(ImagesBySha256(db, collection, sha256), request);
  auto found = FindImage(db, collection, *request.id);
  if (!found || !IsUnchanged(found->record, request, sha256)) return std::nullopt;
  return std::move(found->record);
}

std::optional<ImageRecord> Catalogue::FindUnchanged(const AddRequest& request,
                                                    const std::string& sha256) {
  return access_.Read([&](Connection& db) {
    const CollectionRow in = pliant::RequireCollection(db, request.collection);
    refusals::CheckIsMeant(request, in.created_ms);
    return FindUnchangedIn(db, in.key, request, sha256);
  });
}

std::optional<StoredImage> Catalogue::FindDescribed(const std::string& sha256) {
  return access_.Read([&](Connection& db) -> std::optional<StoredImage> {
    const Key key = FindFeaturesOf(db, sha256, model_.key);
    if (key == 0) return std::nullopt;
    return StoredImage{key, FindImageByKey(db, key)->record, ReadFeaturesBlob(db, key)};
  });
}

std::vector<std::optional<StoredImage>> Catalogue::LoadImages(std::span<const ImageRef> refs,
                                                              Load what) {
  return access_.Read([&](Connection& db) {
    std::vector<std::optional<StoredImage>> images(refs.size());
    std::multimap<Key, std::size_t> wanted;  // places in `images`
    const auto fill = [&](Key key, StoredImage image) {
      const auto [begin, end] = wanted.equal_range(key);
      for (auto at = std::next(begin); at != end; ++at) images[at->second] = image;
      images[begin->second] = std::move(image);
    };
    for (std::size_t i = 0; i < refs.size(); ++i) wanted.emplace(refs[i].version, i);
    SelectStored(db, wanted, what, fill);
    wanted.clear();
    for (std::size_t i = 0; i < refs.size(); ++i) {
      if (images[i]) continue;
      const Key other = KeyOfImage(db, refs[i].collection, refs[i].id);  // in its place
      if (other != 0) wanted.emplace(other, i);
    }
    if (!wanted.empty()) SelectStored(db, wanted, what, fill);
    return images;
  });
}

std::vector<std::uint8_t> Catalogue::ReadContent(const std::string& collection,
                                                 const std::string& id) {
  return originals_.Read(collection, id);
}

Admission Catalogue::Admit(Key collection, const std::optional<std::string>& object,
                           const Filter& filter, const std::vector<std::string>& without) {
  Admission admission;
  admission.object = object;
  admission.filter = filter;
  admission.without = without;
  if (!object && filter.empty() && without.empty()) return admission;
  access_.Read([&](Connection& db) {
    if (object) {
      admission.object_key = pliant::FindObject(db, collection, *object);
      admission.nothing = *admission.object_key == 0 && !object->empty();
    }
    for (const std::string& id : without) {
      if (const Key key = KeyOfImage(db, collection, id)) {
        admission.without_versions.push_back(key);
      }
    }
    std::sort(admission.without_versions.begin(), admission.without_versions.end());
    if (filter.empty() || admission.nothing) return;
    admission.versions =
        std::make_shared<const std::vector<std::int64_t>>(ImagesPassing(db, collection, filter));
  });
  return admission;
}

std::vector<VocabularyRecord> Catalogue::ListVocabularies(const std::string& collection) {
  return access_.Read([&](Connection& db) {
    return SelectVocabularies(db, pliant::RequireCollection(db, collection));
  });
}

std::optional<VocabularyRecord> Catalogue::FindVocabulary(const std::string& collection,
                                                          Key vocabulary) {
  return access_.Read([&](Connection& db) {
    return pliant::FindVocabulary(db, pliant::RequireCollection(db, collection), vocabulary);
  });
}

std::shared_ptr<const Vocabulary> Catalogue::ReadVocabulary(Key vocabulary) {
  return access_.Read([&](Connection& db) { return pliant::ReadVocabulary(db, vocabulary); });
}

std::uint64_t Catalogue::CountImages(Key collection) {
  return access_.Read([&](Connection& db) { return CountImagesIn(db, collection); });
}

std::uint64_t Catalogue::CountUnquantized(const std::string& collection, Key vocabulary) {
  return access_.Read([&](Connection& db) {
    return CountImagesWithoutWords(db, pliant::RequireCollection(db, collection).key, vocabulary);
  });
}

std::vector<StoredFeatures> Catalogue::LoadUnquantized(Key collection, Key vocabulary,
                                                       std::int64_t after, int limit) {
  return access_.Read(
      [&](Connection& db) { return SelectUnquantized(db, collection, vocabulary, after, limit); });
}

std::map<Key, Bow> Catalogue::LoadWords(Key vocabulary, std::size_t words,
                                        std::span<const Key> versions) {
  return access_.Read([&](Connection& db) {
    std::map<Key, Bow> found;
    Cursor row = db.Prepare("SELECT image, data FROM image_words WHERE vocabulary = ?1 AND " +
                            db.IsAmong("image", "?2"));
    row.Bind(vocabulary, versions);
    while (row.Next()) found.emplace(row.Int(0), DecodeBow(row.Blob(1), words));
    return found;
  });
}

DescriptorSample Catalogue::SampleDescriptors(Key collection, std::size_t count,
                                              std::uint64_t seed) {
  return access_.Read([&](Connection& db) {
    std::vector<StoredCount> images;
    Cursor row = db.Prepare("SELECT key, keypoints FROM images WHERE collection = ? ORDER BY id");
    row.Bind(collection);
    while (row.Next()) images.push_back({row.Int(0), row.Count(1)});
    return DrawDescriptors(model_.model.info, images, count, seed,
                           [&](std::span<const Key> keys) { return ReadFeaturesBlobs(db, keys); });
  });
}

EngineStats Catalogue::Count() {
  return access_.Read([&](Connection& db) {
    EngineStats stats;
    for (const CollectionRow& collection : AllCollections(db)) {
      stats.images += collection.images;
      stats.objects += collection.objects;
      stats.descriptors += collection.descriptors;
    }
    stats.database_bytes = access_.SizeBytes();
    stats.server = access_.ServerFigures();
    stats.descriptor = model_.model.info.name;
    stats.model_id = model_.model.info.model_id;
    if (const auto collection = FindCollection(db, kDefaultCollection)) {
      stats.vocabulary = pliant::FindVocabulary(db, *collection, collection->active_vocabulary);
    }
    return stats;
  });
}

std::vector<std::string> Catalogue::Check() {
  if (access_.writes()) originals_.RemoveDropped();
  std::vector<std::string> problems = access_.Read([&](Connection& db) {
    std::vector<std::string> found;
    if (access_.CheckStructure(db, &found)) CheckRows(db, &found);
    return found;
  });
  for (std::string& problem : originals_.Check()) problems.push_back(std::move(problem));
  return problems;
}

void Catalogue::Backup(const std::filesystem::path& target, const std::stop_token& stop) {
  access_.Backup(target, stop);
}

std::optional<OriginalsRecord> Catalogue::DescribeOriginals() { return originals_.Describe(); }

}  // namespace pliant
