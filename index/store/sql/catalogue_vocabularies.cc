// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/catalogue_vocabularies.h"

#include <string>

#include "descriptor/base/unix_time.h"
#include "index/store/refusals.h"
#include "index/store/vocabulary_rows.h"
#include "index/store/word_codec.h"

namespace pliant {
namespace {

constexpr std::int64_t kDayMs = 24LL * 60 * 60 * 1000;

#define PLIANT_SELECT_VOCABULARY                                                          \
  "SELECT v.key, m.model_id, v.words, v.seed, v.sampled, v.available, v.loss, v.method, " \
  "v.created_ms, v.checksum, m.kind, m.dim FROM vocabularies v JOIN models m ON m.key = v.model "

VocabularyOrigin ToOrigin(const Cursor& row) {
  return {static_cast<std::uint64_t>(row.Int(3)), static_cast<std::uint64_t>(row.Int(4)),
          static_cast<std::uint64_t>(row.Int(5)), row.Double(6), row.Text(7)};
}

VocabularyRecord ToRecord(const Cursor& row, const CollectionRow& collection) {
  VocabularyRecord record;
  record.id = row.Int(0);
  record.collection = collection.name;
  record.model_id = row.Text(1);
  record.words = static_cast<std::size_t>(row.Int(2));
  record.origin = ToOrigin(row);
  record.created_ms = row.Int(8);
  record.active = record.id == collection.active_vocabulary;
  return record;
}

}  // namespace

Key InsertVocabulary(Connection& db, Key collection, Key model, const Vocabulary& vocabulary) {
  const VocabularyOrigin& origin = vocabulary.origin;
  const std::vector<std::uint8_t> codebook = EncodeCodebook(vocabulary.codebook);
  const Key key =
      db.Prepare(
            "INSERT INTO vocabularies (collection, model, words, seed, sampled, available, loss, "
            "method, checksum, created_ms, codebook) "
            "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) RETURNING key")
          .Bind(collection, model, std::uint64_t{vocabulary.size()}, origin.seed, origin.sampled,
                origin.available, origin.loss, origin.method, VocabularyChecksum(vocabulary),
                NowMs(), Bytes(codebook))
          .One()
          .Int(0);
  Cursor insert =
      db.Prepare("INSERT INTO vocabulary_words (vocabulary, word, data) VALUES (?, ?, ?)");
  for (std::size_t i = 0; i < vocabulary.size(); ++i) {
    insert.Reset().Bind(key, std::uint64_t{i}, WordBytes(vocabulary.words, i)).Run();
  }
  return key;
}

void MarkVocabularyReady(Connection& db, Key vocabulary) {
  db.Prepare("UPDATE vocabularies SET ready = 1 WHERE key = ?").Bind(vocabulary).Run();
}

void DeleteVocabulary(Connection& db, Key vocabulary) {
  db.Prepare("DELETE FROM vocabularies WHERE key = ?").Bind(vocabulary).Run();
}

void DeleteAbandonedVocabularies(Connection& db, Key collection) {
  db.Prepare("DELETE FROM vocabularies WHERE collection = ? AND ready = 0 AND created_ms < ?")
      .Bind(collection, NowMs() - kDayMs)
      .Run();
}

std::shared_ptr<const Vocabulary> ReadVocabulary(Connection& db, Key vocabulary) {
  Cursor row = db.Prepare(PLIANT_SELECT_VOCABULARY "WHERE v.key = ?");
  if (!row.Bind(vocabulary).Next()) VocabularyRows::ThrowCorrupt(vocabulary, "is missing");
  VocabularyRows rows({vocabulary, row.Int(2), static_cast<DescriptorKind>(row.Int(10)),
                       row.Int(11), row.Text(1), ToOrigin(row),
                       static_cast<std::uint32_t>(row.Int(9))});
  Cursor words =
      db.Prepare("SELECT word, data FROM vocabulary_words WHERE vocabulary = ? ORDER BY word");
  words.Bind(vocabulary);
  while (words.Next()) rows.Add(words.Int(0), words.Blob(1));
  Cursor codebook = db.Prepare("SELECT codebook FROM vocabularies WHERE key = ?");
  return rows.Finish(codebook.Bind(vocabulary).One().Blob(0));
}

std::vector<VocabularyRecord> SelectVocabularies(Connection& db, const CollectionRow& collection) {
  Cursor row =
      db.Prepare(PLIANT_SELECT_VOCABULARY "WHERE v.collection = ? AND v.ready = 1 ORDER BY v.key");
  row.Bind(collection.key);
  std::vector<VocabularyRecord> records;
  while (row.Next()) records.push_back(ToRecord(row, collection));
  return records;
}

std::optional<VocabularyRecord> FindVocabulary(Connection& db, const CollectionRow& collection,
                                               Key vocabulary) {
  Cursor row =
      db.Prepare(PLIANT_SELECT_VOCABULARY "WHERE v.collection = ? AND v.key = ? AND v.ready = 1");
  if (!row.Bind(collection.key, vocabulary).Next()) return std::nullopt;
  return ToRecord(row, collection);
}

CollectionRecord RecordOf(Connection& db, const CollectionRow& collection) {
  CollectionRecord record;
  record.name = collection.name;
  record.display_name = collection.display_name;
  for (AliasRecord& alias : SelectAliases(db, collection.key)) {
    record.aliases.push_back(std::move(alias.name));
  }
  record.images = collection.images;
  record.objects = collection.objects;
  record.descriptors = collection.descriptors;
  record.created_ms = collection.created_ms;
  record.vocabulary = FindVocabulary(db, collection, collection.active_vocabulary);
  record.automatic = collection.automatic;
  return record;
}

void InsertImageWords(Connection& db, Key vocabulary, Key image, const Bow& bow) {
  const std::vector<std::uint8_t> blob = EncodeBow(bow);
  db.Prepare(
        "INSERT INTO image_words (vocabulary, image, data) "
        "SELECT ?1, key, ?3 FROM images WHERE key = ?2 "
        "ON CONFLICT (vocabulary, image) DO UPDATE SET data = excluded.data")
      .Bind(vocabulary, image, blob)
      .Run();
}

std::vector<StoredFeatures> SelectUnquantized(Connection& db, Key collection, Key vocabulary,
                                              Key after, int limit) {
  // The plus: by their keys. By an index of the collection all of it would be read and sorted, for
  // every batch.
  Cursor row = db.Prepare(
      "SELECT p.key, f.data FROM images p LEFT JOIN features f ON f.image = p.key "
      "WHERE +p.collection = ?1 AND p.key > ?3 AND NOT EXISTS "
      "(SELECT 1 FROM image_words w WHERE w.vocabulary = ?2 AND w.image = p.key) "
      "ORDER BY p.key LIMIT ?4");
  row.Bind(collection, vocabulary, after, limit);
  std::vector<StoredFeatures> images;
  while (row.Next()) {
    if (row.IsNull(1)) throw refusals::FeaturesMissing();
    images.push_back({row.Int(0), row.CopyOfBlob(1)});
  }
  return images;
}

std::uint64_t CountImagesWithoutWords(Connection& db, Key collection, Key vocabulary) {
  Cursor row = db.Prepare(
      "SELECT count(*) FROM images p WHERE p.collection = ?1 AND NOT EXISTS "
      "(SELECT 1 FROM image_words w WHERE w.vocabulary = ?2 AND w.image = p.key)");
  return static_cast<std::uint64_t>(row.Bind(collection, vocabulary).One().Int(0));
}

}  // namespace pliant
