// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Vocabularies and the words of each image: the catalogue and the writer.
#include <algorithm>
#include <string>

#include "descriptor/base/error.h"
#include "descriptor/base/unix_time.h"
#include "index/store/blob_codec.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"
#include "index/store/sql/rows.h"
#include "index/store/writer.h"

namespace pliant {
namespace {

constexpr int kImagesABatch = 64;
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

struct StoredFeatures {
  Key image = 0;
  std::vector<std::uint8_t> encoded;
};

// At most kImagesABatch images without words of the vocabulary, by key after `after`.
std::vector<StoredFeatures> SelectUnquantized(Connection& db, Key collection, Key vocabulary,
                                              Key after) {
  // The plus: by their keys. By an index of the collection all of it would be read and sorted, for
  // every batch.
  Cursor row = db.Prepare(
      "SELECT p.key, f.data FROM images p LEFT JOIN features f ON f.image = p.key "
      "WHERE +p.collection = ?1 AND p.key > ?3 AND NOT EXISTS "
      "(SELECT 1 FROM image_words w WHERE w.vocabulary = ?2 AND w.image = p.key) "
      "ORDER BY p.key LIMIT ?4");
  row.Bind(collection, vocabulary, after, kImagesABatch);
  std::vector<StoredFeatures> images;
  while (row.Next()) {
    if (row.IsNull(1)) throw refusals::FeaturesMissing();
    images.push_back({row.Int(0), row.CopyOfBlob(1)});
  }
  return images;
}

// One matrix product for the whole batch instead of one for each image.
std::vector<std::vector<std::uint32_t>> QuantizeBatch(const Quantizer& quantizer,
                                                      std::span<const StoredFeatures> batch,
                                                      int threads) {
  Descriptors all;
  all.kind = quantizer.vocabulary().words.kind;
  all.dim = quantizer.vocabulary().words.dim;
  std::vector<std::size_t> rows;
  for (const StoredFeatures& image : batch) {
    const Descriptors own = DecodeFeatures(image.encoded).descriptors;
    rows.push_back(own.rows);
    all.Append(own);
  }
  const std::vector<std::uint32_t> words = quantizer.Assign(all, threads);
  std::vector<std::vector<std::uint32_t>> result;
  auto first = words.begin();
  for (const std::size_t count : rows) {
    const auto last = first + static_cast<std::ptrdiff_t>(count);
    result.emplace_back(first, last);
    first = last;
  }
  return result;
}

void InsertWords(Connection& db, Key vocabulary, std::span<const StoredFeatures> batch,
                 std::span<const std::vector<std::uint32_t>> words) {
  for (std::size_t i = 0; i < batch.size(); ++i) {
    InsertImageWords(db, vocabulary, batch[i].image, words[i]);
  }
}

// What was added while the others were quantised; inside the writer's transaction.
void QuantizeRest(Connection& db, Key collection, Key vocabulary, const Quantizer& quantizer) {
  while (true) {
    const auto batch = SelectUnquantized(db, collection, vocabulary, 0);
    if (batch.empty()) return;
    InsertWords(db, vocabulary, batch, QuantizeBatch(quantizer, batch, 0));
  }
}

[[noreturn]] void ThrowCorrupt(Key vocabulary, const std::string& what) {
  throw Error(ErrorCode::kCorrupt, "vocabulary_corrupt",
              "vocabulary " + std::to_string(vocabulary) + " " + what + "; train a new one");
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

std::optional<VocabularyRecord> FindVocabulary(Connection& db, const CollectionRow& collection,
                                               Key vocabulary) {
  Cursor row =
      db.Prepare(PLIANT_SELECT_VOCABULARY "WHERE v.collection = ? AND v.key = ? AND v.ready = 1");
  if (!row.Bind(collection.key, vocabulary).Next()) return std::nullopt;
  return ToRecord(row, collection);
}

void InsertImageWords(Connection& db, Key vocabulary, Key image,
                      std::span<const std::uint32_t> words) {
  const std::vector<std::uint8_t> blob = EncodeWords(words);
  db.Prepare(
        "INSERT INTO image_words (vocabulary, image, data) "
        "SELECT ?1, key, ?3 FROM images WHERE key = ?2 "
        "ON CONFLICT (vocabulary, image) DO UPDATE SET data = excluded.data")
      .Bind(vocabulary, image, blob)
      .Run();
}

void SetActiveVocabulary(Connection& db, Key collection, Key vocabulary, bool automatic) {
  db.Prepare("UPDATE collections SET active_vocabulary = ?, automatic = ? WHERE key = ?")
      .Bind(vocabulary, automatic ? 1 : 0, collection)
      .Run();
}

std::shared_ptr<const Vocabulary> ReadVocabulary(Connection& db, Key key) {
  Cursor row = db.Prepare(PLIANT_SELECT_VOCABULARY "WHERE v.key = ?");
  if (!row.Bind(key).Next()) ThrowCorrupt(key, "is missing");
  const std::int64_t size = row.Int(2);
  const std::int64_t dim = row.Int(11);
  if (size < 1 || size > static_cast<std::int64_t>(kMaxWords) || dim < 1 ||
      dim > static_cast<std::int64_t>(kMaxDim)) {
    ThrowCorrupt(key, "claims an impossible size");
  }
  const auto vocabulary = std::make_shared<Vocabulary>();
  const bool is_float = static_cast<DescriptorKind>(row.Int(10)) == DescriptorKind::kFloat;
  vocabulary->words = (is_float ? Descriptors::Float : Descriptors::Binary)(
      static_cast<std::size_t>(size), static_cast<int>(dim));
  vocabulary->model_id = row.Text(1);
  vocabulary->origin = ToOrigin(row);
  Cursor word =
      db.Prepare("SELECT word, data FROM vocabulary_words WHERE vocabulary = ? ORDER BY word");
  word.Bind(key);
  std::int64_t next = 0;
  for (; word.Next(); ++next) {
    if (next == size || word.Int(0) != next) ThrowCorrupt(key, "has a gap");
    const Bytes target = WordBytes(vocabulary->words, static_cast<std::size_t>(next));
    const Bytes data = word.Blob(1);
    if (data.size() != target.size()) ThrowCorrupt(key, "has a word of the wrong size");
    std::copy(data.begin(), data.end(), const_cast<std::uint8_t*>(target.data()));
  }
  if (next != size) ThrowCorrupt(key, "has lost words");
  Cursor codebook = db.Prepare("SELECT codebook FROM vocabularies WHERE key = ?");
  vocabulary->codebook = DecodeCodebook(codebook.Bind(key).One().Blob(0), vocabulary->words);
  if (VocabularyChecksum(*vocabulary) != static_cast<std::uint32_t>(row.Int(9))) {
    ThrowCorrupt(key, "does not match its checksum");
  }
  return vocabulary;
}

std::vector<VocabularyRecord> SelectVocabularies(Connection& db, const CollectionRow& collection) {
  Cursor row =
      db.Prepare(PLIANT_SELECT_VOCABULARY "WHERE v.collection = ? AND v.ready = 1 ORDER BY v.key");
  row.Bind(collection.key);
  std::vector<VocabularyRecord> records;
  while (row.Next()) records.push_back(ToRecord(row, collection));
  return records;
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

std::uint64_t Catalogue::CountUnquantized(const std::string& collection, Key vocabulary) {
  return access_.Read([&](Connection& db) {
    Cursor row = db.Prepare(
        "SELECT count(*) FROM images p WHERE p.collection = ?1 AND NOT EXISTS "
        "(SELECT 1 FROM image_words w WHERE w.vocabulary = ?2 AND w.image = p.key)");
    return row.Bind(pliant::RequireCollection(db, collection).key, vocabulary).One().Count(0);
  });
}

std::map<Key, std::vector<std::uint32_t>> Catalogue::LoadWords(Key vocabulary, std::size_t words,
                                                               std::span<const Key> versions) {
  return access_.Read([&](Connection& db) {
    std::map<Key, std::vector<std::uint32_t>> found;
    Cursor row = db.Prepare("SELECT image, data FROM image_words WHERE vocabulary = ?1 AND " +
                            db.IsAmong("image", "?2"));
    row.Bind(vocabulary, versions);
    while (row.Next()) found.emplace(row.Int(0), DecodeWords(row.Blob(1), words));
    return found;
  });
}

Key Writer::AddVocabulary(Key collection, const Vocabulary& vocabulary) {
  Key key = 0;
  access_.Write([&](Connection& db) {
    // Of a training that died.
    db.Prepare("DELETE FROM vocabularies WHERE collection = ? AND ready = 0 AND created_ms < ?")
        .Bind(collection, NowMs() - kDayMs)
        .Run();
    key = InsertVocabulary(db, collection, model_.key, vocabulary);
  });
  return key;
}

void Writer::Quantize(Key collection, Key vocabulary, const Quantizer& quantizer, int threads,
                      const std::function<void(std::uint64_t images)>& progress) {
  std::uint64_t done = 0;
  for (Key after = 0;;) {
    progress(done);
    const auto batch = access_.Read(
        [&](Connection& db) { return SelectUnquantized(db, collection, vocabulary, after); });
    if (batch.empty()) return;
    const auto words = QuantizeBatch(quantizer, batch, threads);
    access_.Write([&](Connection& db) { InsertWords(db, vocabulary, batch, words); });
    after = batch.back().image;
    done += batch.size();
  }
}

VocabularyRecord Writer::FinishVocabulary(const std::string& collection, Key vocabulary,
                                          const Quantizer& quantizer, bool automatic) {
  std::optional<VocabularyRecord> record;
  access_.Write([&](Connection& db) {
    CollectionRow now = RequireCollection(db, collection);
    QuantizeRest(db, now.key, vocabulary, quantizer);
    MarkVocabularyReady(db, vocabulary);
    if (now.active_vocabulary == 0) {
      pliant::SetActiveVocabulary(db, now.key, vocabulary, automatic);
      now.active_vocabulary = vocabulary;
    }
    record = FindVocabulary(db, now, vocabulary);
  });
  return record.value();
}

void Writer::SetActiveVocabulary(const std::string& collection, Key vocabulary,
                                 const Quantizer& quantizer, bool automatic) {
  access_.Write([&](Connection& db) {
    const CollectionRow now = RequireCollection(db, collection);
    if (automatic && now.active_vocabulary != 0 && !now.automatic) return;
    QuantizeRest(db, now.key, vocabulary, quantizer);
    pliant::SetActiveVocabulary(db, now.key, vocabulary, automatic);
  });
}

void Writer::DropVocabulary(Key vocabulary) {
  access_.Write(
      [&](Connection& db) {
        db.Prepare("DELETE FROM vocabularies WHERE key = ?").Bind(vocabulary).Run();
      },
      {.reclaim = true});
}

}  // namespace pliant
