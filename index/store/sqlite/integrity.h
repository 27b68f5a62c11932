// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Looks for everything that must hold in a database and does not. Private to index/.
#pragma once

#include <string>
#include <vector>

#include "index/store/sqlite/connection.h"
#include "index/store/sqlite/original_store.h"

namespace pliant {

// The schema, SQLite's own checks, foreign keys, and what the schema cannot say: every picture has
// features that decode, match their checksum, their record and their model; vocabularies are whole
// and of the collection's model; every picture has words of the active vocabulary, inside it, as
// many as it has key points; originals have the hash of their picture; no object without pictures;
// names and metadata are what the engine accepts; keys are never used again. One sentence a
// problem; empty = sound.
std::vector<std::string> CheckDatabase(Connection& db);

// What shows without decoding anything: the schema, SQLite's quick check, and in databases of this
// schema counts and keys. The first problem is enough.
std::vector<std::string> QuickCheck(Connection& db);

// Whether the originals that are files of `files` (nullptr: there is no such directory) are there
// and have their hash. A file that is removed meanwhile, with its picture, is a problem only in
// the transaction that was begun before.
std::vector<std::string> CheckOriginalFiles(Connection& db, const OriginalStore* files);

}  // namespace pliant
