// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Finds broken invariants in the rows of a database. Private to index/store/.
#pragma once

#include <string>
#include <vector>

#include "index/store/sql/connection.h"
#include "index/store/sql/original_store.h"

namespace pliant {

// The invariants outside the schema: every image has features that decode, match their checksum,
// their record and their model; vocabularies are whole and of the collection's model; every image
// has words of the active vocabulary, inside it, as many as it has keypoints; originals have the
// hash of their image; no object without images; the engine accepts names and metadata; and
// CheckCounts. Adds one sentence per problem.
void CheckRows(Connection& db, std::vector<std::string>* problems);

// Checks without decoding: counts kept by triggers, removals, the model.
void CheckCounts(Connection& db, std::vector<std::string>& problems);

// Whether the originals in `files` (nullptr: no such directory) exist and have their hash. A file
// removed during the check, with its image, is a problem only in a transaction begun before.
std::vector<std::string> CheckOriginalFiles(Connection& db, const OriginalStore* files);

}  // namespace pliant
