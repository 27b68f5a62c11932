// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// ClickhouseWriter: collections and vocabularies.
#include "descriptor/base/error.h"
#include "index/store/clickhouse/clickhouse_writer.h"
#include "index/store/quantize_batch.h"
#include "index/store/refusals.h"
#include "index/store/vocabulary_rows.h"
#include "index/store/word_codec.h"

namespace pliant::clickhouse {
namespace {

constexpr std::int64_t kDayMs = 24LL * 60 * 60 * 1000;

// A vocabulary that is gone, or was never finished: only its entry goes; its words, and what
// pictures have of it, are found by nobody.
void Forget(Change& change, const VocabularyEntry& vocabulary) {
  change.Set(ToRow(vocabulary, /*deleted=*/true));
}

[[noreturn]] void ThrowCollectionGone() {
  throw Error(ErrorCode::kNotFound, "collection_not_found",
              "the collection was removed while its vocabulary was made");
}

void Activate(Change& change, CollectionEntry collection, Key vocabulary, bool automatic) {
  collection.vocabulary = vocabulary;
  collection.automatic = automatic;
  change.Set(ToRow(collection));
}

}  // namespace

bool ClickhouseWriter::CreateCollection(const std::string& name) {
  bool created = false;
  commits_.Run([&](Change& change) {
    created = change.registry().Find(name) == nullptr;
    if (!created) return;
    CollectionEntry entry;
    entry.key = static_cast<std::uint32_t>(change.NewKey());
    entry.name = name;
    entry.created_ms = NowMs();
    change.Set(ToRow(entry));
  });
  return created;
}

bool ClickhouseWriter::RemoveCollection(const std::string& name) {
  bool removed = false;
  commits_.Run([&](Change& change) {
    const CollectionEntry* found = change.registry().Find(name);
    removed = found != nullptr;
    if (!removed) return;
    const CollectionEntry entry = *found;
    if (entry.name != name) {
      throw refusals::CollectionIsAlias(name, entry.name);
    }
    const Registry before = change.registry();
    for (const auto& [alias, target] : before.aliases) {
      if (target.collection == entry.key) change.Set(ToRow(target, /*deleted=*/true));
    }
    for (const auto& [key, vocabulary] : before.vocabularies) {
      if (vocabulary.collection == entry.key) Forget(change, vocabulary);
    }
    change.Set(ToRow(entry, /*deleted=*/true));
  });
  return removed;
}

CollectionRecord ClickhouseWriter::ChangeCollection(const std::string& name,
                                                    const CollectionChange& change) {
  std::string real_name;
  commits_.Run([&](Change& commit) {
    CollectionEntry entry = commit.registry().Require(name);
    real_name = entry.name;
    if (change.display_name) entry.display_name = *change.display_name;
    commit.Set(ToRow(entry));
  });
  return catalogue_.DescribeCollection(real_name);
}

void ClickhouseWriter::ChangeAliases(const AliasChanges& changes) {
  commits_.Run([&](Change& commit) {
    for (const auto& [name, collection] : changes) {
      const Registry& now = commit.registry();
      const auto known = now.aliases.find(name);
      if (!collection) {
        if (known == now.aliases.end()) {
          throw refusals::NoAlias(name);
        }
        commit.Set(ToRow(AliasEntry(known->second), /*deleted=*/true));
        continue;
      }
      if (now.collections.count(name) > 0) {
        throw refusals::AliasIsCollection(name);
      }
      const auto target = now.collections.find(*collection);
      if (target == now.collections.end()) {  // an alias of an alias would move with it
        const CollectionEntry* other = now.Find(*collection);
        throw refusals::NoAliasTarget(*collection, other != nullptr ? other->name : "");
      }
      if (known != now.aliases.end() && known->second.collection == target->second.key) continue;
      commit.Set(ToRow(AliasEntry{name, target->second.key, NowMs()}));
    }
  });
}

Key ClickhouseWriter::AddVocabulary(Key collection, const Vocabulary& vocabulary) {
  Key key = 0;
  commits_.Run([&](Change& change) {
    const Registry before = change.registry();
    const bool gone = before.Find(static_cast<std::uint32_t>(collection)) == nullptr;
    if (gone) ThrowCollectionGone();
    for (const auto& [old, entry] : before.vocabularies) {
      if (entry.collection == collection && !entry.ready && entry.created_ms < NowMs() - kDayMs) {
        Forget(change, entry);
      }
    }
    VocabularyEntry entry;
    entry.key = key = change.NewKey();
    entry.collection = static_cast<std::uint32_t>(collection);
    entry.words = vocabulary.size();
    entry.origin = vocabulary.origin;
    entry.checksum = VocabularyChecksum(vocabulary);
    entry.created_ms = NowMs();
    change.AddVocabularyWords(key, vocabulary);
    change.Set(ToRow(entry));
  });
  return key;
}

void ClickhouseWriter::AddWords(Key vocabulary, std::span<const PictureWords> pictures) {
  std::vector<std::uint64_t> versions;
  for (const PictureWords& picture : pictures) {
    versions.push_back(static_cast<std::uint64_t>(picture.version));
  }
  if (versions.empty()) return;
  struct Place {
    std::uint32_t collection;
    std::uint32_t picture;
    std::string id;
  };
  std::map<std::uint64_t, Place> places;  // by version
  for (const NativeBlock& block :
       link_.ReadEach("SELECT version, collection, picture, id FROM pictures WHERE version IN (" +
                          LiteralList(versions) + ")",
                      {{"version", "UInt64"},
                       {"collection", "UInt32"},
                       {"picture", "UInt32"},
                       {"id", "String"}})) {
    for (std::size_t i = 0; i < block.rows; ++i) {
      const Row row(block, i);
      places[row.Number(0)] = {static_cast<std::uint32_t>(row.Number(1)),
                               static_cast<std::uint32_t>(row.Number(2)), row.Text(3)};
    }
  }
  commits_.Run([&](Change& change) {
    for (const PictureWords& picture : pictures) {
      const auto place = places.find(static_cast<std::uint64_t>(picture.version));
      if (place == places.end()) continue;
      change.AddWords(place->second.collection, place->second.id, vocabulary, place->second.picture,
                      EncodeBow(picture.bow));
    }
  });
}

// What was added while the others were quantised; under the lock, and alone.
void ClickhouseWriter::QuantizeRest(Change& change, std::uint32_t collection, Key vocabulary,
                                    const Quantizer& quantizer) {
  PictureStates states(&link_);
  const std::vector<PictureOutline> rest =
      Unquantized(states, collection, change.snapshot().log, vocabulary, 0, 0);
  for (std::size_t from = 0; from < rest.size(); from += kPicturesABatch) {
    const std::size_t to = std::min<std::size_t>(rest.size(), from + kPicturesABatch);
    const std::vector<PictureOutline> some(rest.begin() + static_cast<std::ptrdiff_t>(from),
                                           rest.begin() + static_cast<std::ptrdiff_t>(to));
    const auto words = QuantizeBatch(quantizer, FeaturesOf(states, some), 0);
    for (std::size_t i = 0; i < some.size(); ++i) {
      change.AddWords(collection, some[i].id, vocabulary, some[i].picture, EncodeBow(words[i].bow));
    }
  }
}

VocabularyRecord ClickhouseWriter::FinishVocabulary(const std::string& collection, Key vocabulary,
                                                    const Quantizer& quantizer, bool automatic) {
  std::optional<VocabularyRecord> record;
  commits_.Run(
      [&](Change& change) {
        const CollectionEntry in = change.registry().Require(collection);
        const auto found = change.registry().vocabularies.find(vocabulary);
        // Another collection may have the name by now.
        if (found == change.registry().vocabularies.end() || found->second.collection != in.key) {
          ThrowCollectionGone();
        }
        QuantizeRest(change, in.key, vocabulary, quantizer);
        VocabularyEntry entry = found->second;
        entry.ready = true;
        change.Set(ToRow(entry));
        if (in.vocabulary == 0) Activate(change, in, vocabulary, automatic);
        record = change.registry().Describe(entry);
      },
      {}, /*alone=*/true);
  return record.value();
}

void ClickhouseWriter::SetActiveVocabulary(const std::string& collection, Key vocabulary,
                                           const Quantizer& quantizer, bool automatic) {
  commits_.Run(
      [&](Change& change) {
        const CollectionEntry in = change.registry().Require(collection);
        if (automatic && in.vocabulary != 0 && !in.automatic) return;
        if (change.registry().FindVocabulary(in.key, vocabulary) == nullptr) ThrowCollectionGone();
        QuantizeRest(change, in.key, vocabulary, quantizer);
        Activate(change, in, vocabulary, automatic);
      },
      {}, /*alone=*/true);
}

void ClickhouseWriter::DropVocabulary(Key vocabulary) {
  commits_.Run([&](Change& change) {
    const auto found = change.registry().vocabularies.find(vocabulary);
    if (found != change.registry().vocabularies.end())
      Forget(change, VocabularyEntry(found->second));
  });
}

}  // namespace pliant::clickhouse
