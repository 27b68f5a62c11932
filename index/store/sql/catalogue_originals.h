// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The catalogue's originals: in the database, or which of them are files of a directory
// (original_store.h). One function a statement or two. Private to index/. Functions that write must
// run inside a transaction (WriteQueue).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "index/store/sql/rows.h"

namespace pliant {

struct OriginalsDirectoryRow {
  std::string path;   // absolute
  std::string owner;  // id that the directory names
  bool active = false;
};

std::optional<OriginalsDirectoryRow> FindOriginalsDirectory(Connection& db);
void StoreOriginalsDirectory(Connection& db, const OriginalsDirectoryRow& row);

void InsertOriginal(Connection& db, Key picture, Bytes bytes);
std::optional<std::vector<std::uint8_t>> ReadOriginal(Connection& db, Key picture);

void InsertOriginalFile(Connection& db, Key picture, const std::string& sha256);
bool HasOriginalFile(Connection& db, Key picture);
bool IsOriginalFile(Connection& db, const std::string& sha256);  // of any picture
std::uint64_t CountOriginalFiles(Connection& db);                // different ones
std::string AnyOriginalFile(Connection& db);                     // hash of one; "" = there is none

// Pictures after `after`, in order of their keys, whose bytes are in the database (`files` false)
// or in a file. An original has bytes in one place only.
std::vector<Key> SelectOriginals(Connection& db, bool files, Key after, int limit);
std::uint64_t CountOriginals(Connection& db, bool files);
// False = it is not there (any more).
bool DeleteOriginal(Connection& db, Key picture, bool file);

// Files whose last picture is gone, and which may still be there.
std::vector<std::string> DroppedOriginals(Connection& db);
void ForgetDroppedOriginal(Connection& db, const std::string& sha256);

}  // namespace pliant
