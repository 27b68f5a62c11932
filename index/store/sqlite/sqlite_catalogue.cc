// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/sqlite_catalogue.h"

#include <algorithm>
#include <utility>

#include "index/store/refusals.h"
#include "index/store/sqlite/catalogue_lists.h"
#include "index/store/sqlite/catalogue_vocabularies.h"
#include "index/store/sqlite/database.h"
#include "index/store/sqlite/descriptor_sample.h"
#include "index/store/sqlite/integrity.h"
#include "index/store/unchanged.h"

namespace pliant {
namespace {

std::uint64_t SizeOf(const std::filesystem::path& path) {
  std::error_code error;  // side files come and go
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  return error ? 0 : size;
}

std::optional<ImageRecord> RecordOf(std::optional<PictureRow> picture) {
  if (!picture) return std::nullopt;
  return std::move(picture->record);
}

// That state of the picture; else the one in its place.
std::optional<PictureRow> FindState(Connection& db, const PictureRef& ref) {
  if (ref.version != 0) {
    if (auto found = FindPictureByKey(db, ref.version)) return found;
  }
  return pliant::FindPicture(db, ref.collection, ref.id);
}

void EachPage(Connection& db, Key collection, PictureListing list,
              const std::function<void(const PicturePage&)>& work) {
  while (true) {
    const PicturePage page = SelectPicturePage(db, collection, list);
    work(page);
    if (!page.next) return;
    list.after = *page.next;
  }
}

}  // namespace

std::vector<std::string> SqliteCatalogue::ListCollections() {
  return access_.Read([](Connection& db) {
    std::vector<std::string> names;
    for (CollectionRow& row : AllCollections(db)) names.push_back(std::move(row.name));
    return names;
  });
}

std::vector<CollectionLabel> SqliteCatalogue::ListLabels() {
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

std::vector<AliasRecord> SqliteCatalogue::ListAliases() {
  return access_.Read([](Connection& db) { return SelectAliases(db); });
}

CollectionState SqliteCatalogue::RequireCollection(const std::string& name) {
  return access_.Read([&](Connection& db) { return StateOf(pliant::RequireCollection(db, name)); });
}

CollectionRecord SqliteCatalogue::DescribeCollection(const std::string& name) {
  return access_.Read(
      [&](Connection& db) { return RecordOf(db, pliant::RequireCollection(db, name)); });
}

std::optional<ObjectRecord> SqliteCatalogue::FindObject(const std::string& collection,
                                                        const std::string& object) {
  return access_.Read([&](Connection& db) -> std::optional<ObjectRecord> {
    const Key key = pliant::FindObject(db, pliant::RequireCollection(db, collection).key, object);
    if (key == 0) return std::nullopt;
    return ObjectRecord{object, CountPicturesOf(db, key)};
  });
}

std::vector<ObjectRecord> SqliteCatalogue::ListObjects(const std::string& collection,
                                                       const std::string& after, int limit) {
  return access_.Read([&](Connection& db) {
    return SelectObjects(db, pliant::RequireCollection(db, collection).key, after, limit);
  });
}

std::optional<ImageRecord> SqliteCatalogue::FindPicture(const std::string& collection,
                                                        const std::string& id) {
  return access_.Read([&](Connection& db) {
    return RecordOf(pliant::FindPicture(db, pliant::RequireCollection(db, collection).key, id));
  });
}

std::optional<ImageRecord> SqliteCatalogue::FindBySha256(const std::string& collection,
                                                         const std::string& sha256) {
  return access_.Read([&](Connection& db) {
    return RecordOf(FindPictureBySha256(db, pliant::RequireCollection(db, collection).key, sha256));
  });
}

std::vector<ImageRecord> SqliteCatalogue::ListPictures(const ListOptions& options) {
  return access_.Read([&](Connection& db) {
    return SelectPictures(db, pliant::RequireCollection(db, options.collection).key, options);
  });
}

PicturePage SqliteCatalogue::ListPicturePage(const PictureListing& list) {
  return access_.Read([&](Connection& db) {
    return SelectPicturePage(db, pliant::RequireCollection(db, list.which.collection).key, list);
  });
}

void SqliteCatalogue::ForEachPicturePage(PictureListing list,
                                         const std::function<void(const PicturePage&)>& work) {
  access_.Read([&](Connection& db) {
    EachPage(db, pliant::RequireCollection(db, list.which.collection).key, list, work);
  });
}

void SqliteCatalogue::ForEachPictureFeatures(
    PictureListing list, const std::function<void(const PicturePage&)>& look,
    const std::function<void(const ImageRecord&, Bytes features)>& take) {
  access_.Read([&](Connection& db) {
    const Key collection = pliant::RequireCollection(db, list.which.collection).key;
    EachPage(db, collection, list, look);
    EachPage(db, collection, list, [&](const PicturePage& page) {
      for (const ImageRecord& record : page.records) {
        take(record, ReadFeaturesBlob(db, KeyOfPicture(db, collection, record.id)));
      }
    });
  });
}

ObjectPage SqliteCatalogue::ListObjectPage(const ObjectListing& list) {
  return access_.Read([&](Connection& db) {
    return SelectObjectPage(db, pliant::RequireCollection(db, list.which.collection).key, list);
  });
}

std::optional<ImageRecord> FindUnchangedIn(Connection& db, Key collection,
                                           const AddRequest& request, const std::string& sha256) {
  if (!request.id) return FindMeant(PicturesBySha256(db, collection, sha256), request);
  auto found = FindPicture(db, collection, *request.id);
  if (!found || !IsUnchanged(found->record, request, sha256)) return std::nullopt;
  return std::move(found->record);
}

std::optional<ImageRecord> SqliteCatalogue::FindUnchanged(const AddRequest& request,
                                                          const std::string& sha256) {
  return access_.Read([&](Connection& db) {
    const CollectionRow in = pliant::RequireCollection(db, request.collection);
    refusals::CheckIsMeant(request, in.created_ms);
    return FindUnchangedIn(db, in.key, request, sha256);
  });
}

std::optional<StoredPicture> SqliteCatalogue::FindDescribed(const std::string& sha256) {
  return access_.Read([&](Connection& db) -> std::optional<StoredPicture> {
    const Key key = FindFeaturesOf(db, sha256, model_.key);
    if (key == 0) return std::nullopt;
    return StoredPicture{key, FindPictureByKey(db, key)->record, ReadFeaturesBlob(db, key)};
  });
}

std::vector<std::optional<StoredPicture>> SqliteCatalogue::LoadPictures(
    std::span<const PictureRef> refs, Load what) {
  std::vector<std::optional<StoredPicture>> pictures(refs.size());
  access_.Read([&](Connection& db) {
    for (std::size_t i = 0; i < refs.size(); ++i) {
      auto found = FindState(db, refs[i]);
      if (!found) continue;
      pictures[i] = StoredPicture{found->key, std::move(found->record), {}};
      if (what == Load::kRecordsAndFeatures) {
        pictures[i]->features = ReadFeaturesBlob(db, found->key);
      }
    }
  });
  return pictures;
}

std::vector<std::uint8_t> SqliteCatalogue::ReadContent(const std::string& collection,
                                                       const std::string& id) {
  return originals_.Read(collection, id);
}

Admission SqliteCatalogue::Admit(Key collection, const std::optional<std::string>& object,
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
      if (const Key key = KeyOfPicture(db, collection, id)) {
        admission.without_versions.push_back(key);
      }
    }
    std::sort(admission.without_versions.begin(), admission.without_versions.end());
    if (filter.empty() || admission.nothing) return;
    admission.versions =
        std::make_shared<const std::vector<std::int64_t>>(PicturesPassing(db, collection, filter));
  });
  return admission;
}

std::vector<VocabularyRecord> SqliteCatalogue::ListVocabularies(const std::string& collection) {
  return access_.Read([&](Connection& db) {
    return SelectVocabularies(db, pliant::RequireCollection(db, collection));
  });
}

std::optional<VocabularyRecord> SqliteCatalogue::FindVocabulary(const std::string& collection,
                                                                Key vocabulary) {
  return access_.Read([&](Connection& db) {
    return pliant::FindVocabulary(db, pliant::RequireCollection(db, collection), vocabulary);
  });
}

std::shared_ptr<const Vocabulary> SqliteCatalogue::ReadVocabulary(Key vocabulary) {
  return access_.Read([&](Connection& db) { return pliant::ReadVocabulary(db, vocabulary); });
}

std::uint64_t SqliteCatalogue::CountPictures(Key collection) {
  return access_.Read([&](Connection& db) { return CountPicturesIn(db, collection); });
}

std::uint64_t SqliteCatalogue::CountUnquantized(const std::string& collection, Key vocabulary) {
  return access_.Read([&](Connection& db) {
    return CountPicturesWithoutWords(db, pliant::RequireCollection(db, collection).key, vocabulary);
  });
}

std::vector<StoredFeatures> LoadUnquantizedIn(Connection& db, Key collection, Key vocabulary,
                                              std::int64_t after, int limit) {
  std::vector<StoredFeatures> pictures;
  for (const Key key : PicturesWithoutWords(db, collection, vocabulary, after, limit)) {
    pictures.push_back({key, ReadFeaturesBlob(db, key)});
  }
  return pictures;
}

std::vector<StoredFeatures> SqliteCatalogue::LoadUnquantized(Key collection, Key vocabulary,
                                                             std::int64_t after, int limit) {
  return access_.Read(
      [&](Connection& db) { return LoadUnquantizedIn(db, collection, vocabulary, after, limit); });
}

DescriptorSample SqliteCatalogue::SampleDescriptors(Key collection, std::size_t count,
                                                    std::uint64_t seed) {
  return access_.Read([&](Connection& db) {
    return pliant::SampleDescriptors(db, collection, model_.model.info, count, seed);
  });
}

EngineStats SqliteCatalogue::Count() {
  return access_.Read([&](Connection& db) {
    EngineStats stats;
    for (const CollectionRow& collection : AllCollections(db)) {
      stats.images += collection.images;
      stats.objects += collection.objects;
      stats.descriptors += collection.descriptors;
    }
    stats.database_bytes = SizeOf(access_.path()) + SizeOf(access_.path().string() + "-wal");
    stats.descriptor = model_.model.info.name;
    stats.model_id = model_.model.info.model_id;
    if (const auto collection = FindCollection(db, kDefaultCollection)) {
      stats.vocabulary = pliant::FindVocabulary(db, *collection, collection->active_vocabulary);
    }
    return stats;
  });
}

std::vector<std::string> SqliteCatalogue::Check() {
  if (access_.writes()) originals_.RemoveDropped();
  std::vector<std::string> problems =
      access_.Read([](Connection& db) { return CheckDatabase(db); });
  for (std::string& problem : originals_.Check()) problems.push_back(std::move(problem));
  return problems;
}

void SqliteCatalogue::Backup(const std::filesystem::path& target, const std::stop_token& stop) {
  WithDatabaseErrors(access_.path(), [&] {
    // A connection of its own: a backup may take long and must not see its source written by the
    // same connection.
    Connection source(access_.path(), Connection::Mode::kReadOnly, 10'000);
    BackupDatabase(source, target, stop);
  });
}

}  // namespace pliant
