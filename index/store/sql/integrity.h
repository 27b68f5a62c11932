// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Looks for everything that must hold in the rows of a database and does not. Private to
// index/store/.
#pragma once

#include <string>
#include <vector>

#include "index/store/sql/connection.h"
#include "index/store/sql/original_store.h"

namespace pliant {

// What the schema cannot say: every image has features that decode, match their checksum, their
// record and their model; vocabularies are whole and of the collection's model; every image has
// words of the active vocabulary, inside it, as many as it has keypoints; originals have the hash
// of their image; no object without images; names and metadata are what the engine accepts; and
// CheckCounts. Adds a sentence a problem.
void CheckRows(Connection& db, std::vector<std::string>* problems);

// What shows without decoding anything: counts that triggers keep, removals, the model.
void CheckCounts(Connection& db, std::vector<std::string>& problems);

// Whether the originals that are files of `files` (nullptr: there is no such directory) are there
// and have their hash. A file that is removed meanwhile, with its image, is a problem only in
// the transaction that was begun before.
std::vector<std::string> CheckOriginalFiles(Connection& db, const OriginalStore* files);

}  // namespace pliant
