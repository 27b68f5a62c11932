// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The catalogue's vocabularies and the words of each image. Private to index/.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "index/store/sql/rows.h"
#include "vocab/quantizer.h"
#include "vocab/vocabulary.h"

namespace pliant {

// Stores the words as rows; not ready yet. Returns the key.
Key InsertVocabulary(Connection& db, Key collection, Key model, const Vocabulary& vocabulary);
void MarkVocabularyReady(Connection& db, Key vocabulary);
void DeleteVocabulary(Connection& db, Key vocabulary);
// Removes what a training run that died left behind: not ready and older than a day.
void DeleteAbandonedVocabularies(Connection& db, Key collection);

// Throws kCorrupt when rows are missing or do not match their checksum.
std::shared_ptr<const Vocabulary> ReadVocabulary(Connection& db, Key vocabulary);
// Ready ones only, oldest first.
std::vector<VocabularyRecord> SelectVocabularies(Connection& db, const CollectionRow& collection);
std::optional<VocabularyRecord> FindVocabulary(Connection& db, const CollectionRow& collection,
                                               Key vocabulary);

CollectionRecord RecordOf(Connection& db, const CollectionRow& collection);

// Does nothing when the image is gone.
void InsertImageWords(Connection& db, Key vocabulary, Key image, const Bow& bow);
// At most `limit` images without words of this vocabulary, by key after `after`; or kCorrupt.
std::vector<StoredFeatures> SelectUnquantized(Connection& db, Key collection, Key vocabulary,
                                              Key after, int limit);
std::uint64_t CountImagesWithoutWords(Connection& db, Key collection, Key vocabulary);

}  // namespace pliant
