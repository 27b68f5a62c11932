// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/integrity.h"

#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/sha256.h"
#include "index/files/names.h"
#include "index/store/feature_codec.h"
#include "index/store/sql/catalogue_vocabularies.h"
#include "index/store/word_codec.h"

namespace pliant {
namespace {

using Problems = std::vector<std::string>;

constexpr std::size_t kRowsAtOnce = 200;  // a database may send all rows before the first is read

// Calls `work` for each row of a statement whose parameters are the key that rows come after, and
// how many; column `key` has the key.
template <typename Work>
void EachRow(Connection& db, const char* select, int key, const Work& work) {
  std::int64_t after = 0;
  for (std::size_t rows = kRowsAtOnce; rows == kRowsAtOnce;) {
    rows = 0;
    Cursor row = db.Prepare(select);
    row.Bind(after, kRowsAtOnce);
    for (; row.Next(); ++rows) {
      after = row.Int(key);
      work(row);
    }
  }
}

void CheckFeatures(Connection& db, Problems& problems) {
  const char* select =
      "SELECT p.id, p.width, p.height, p.keypoints, f.data, m.kind, m.dim, f.model = c.model, "
      "p.key FROM pictures p JOIN collections c ON c.key = p.collection "
      "LEFT JOIN features f ON f.picture = p.key LEFT JOIN models m ON m.key = f.model "
      "WHERE p.key > ? ORDER BY p.key LIMIT ?";
  EachRow(db, select, 8, [&](const Cursor& row) {
    const std::string picture = "picture \"" + row.Text(0) + "\": ";
    if (row.IsNull(4)) {
      problems.push_back(picture + "its features are missing");
      return;
    }
    if (row.Int(7) == 0) problems.push_back(picture + "its features are of another model");
    try {
      const Features features = DecodeFeatures(row.Blob(4));
      if (features.width != row.Int(1) || features.height != row.Int(2) ||
          static_cast<std::int64_t>(features.keypoints.size()) != row.Int(3)) {
        problems.push_back(picture + "its features differ from its record");
      }
      if (static_cast<std::int64_t>(features.descriptors.kind) != row.Int(5) ||
          features.descriptors.dim != row.Int(6)) {
        problems.push_back(picture + "its descriptors are not of their model's form");
      }
    } catch (const Error& error) {
      problems.push_back(picture + error.what());
    }
  });
}

void CheckVocabularies(Connection& db, Problems& problems) {
  for (const CollectionRow& collection : AllCollections(db)) {
    const std::vector<VocabularyRecord> records = SelectVocabularies(db, collection);
    bool active_seen = collection.active_vocabulary == 0;
    for (const VocabularyRecord& record : records) {
      active_seen = active_seen || record.active;
      try {
        ReadVocabulary(db, record.id);
      } catch (const Error& error) {
        problems.emplace_back(error.what());
      }
    }
    if (!active_seen) {
      problems.push_back("collection \"" + collection.name +
                         "\": its active vocabulary is not usable");
    }
  }
  if (db.Scalar("SELECT count(*) FROM vocabularies v JOIN collections c ON c.key = v.collection "
                "WHERE v.model <> c.model") != 0) {
    problems.emplace_back("a vocabulary is of another model than its collection");
  }
}

void CheckWords(Connection& db, Problems& problems) {
  Cursor missing = db.Prepare(
      "SELECT p.id FROM pictures p JOIN collections c ON c.key = p.collection "
      "WHERE c.active_vocabulary IS NOT NULL AND NOT EXISTS (SELECT 1 FROM picture_words w "
      "WHERE w.vocabulary = c.active_vocabulary AND w.picture = p.key)");
  while (missing.Next()) {
    problems.push_back("picture \"" + missing.Text(0) +
                       "\": it has no words of the active vocabulary");
  }
  const char* select =
      "SELECT p.id, v.words, p.keypoints, w.data, v.collection = p.collection, w.key "
      "FROM picture_words w "
      "JOIN pictures p ON p.key = w.picture JOIN vocabularies v ON v.key = w.vocabulary "
      "WHERE w.key > ? ORDER BY w.key LIMIT ?";
  EachRow(db, select, 5, [&](const Cursor& row) {
    const std::string picture = "picture \"" + row.Text(0) + "\": ";
    if (row.Int(4) == 0)
      problems.push_back(picture + "its words are of another collection's vocabulary");
    try {
      const Bow bow = DecodeBow(row.Blob(3), static_cast<std::size_t>(row.Int(1)));
      if (bow.total != row.Int(2))
        problems.push_back(picture + "it has more or fewer words than key points");
    } catch (const Error& error) {
      problems.push_back(picture + error.what());
    }
  });
}

void CheckOriginals(Connection& db, Problems& problems) {
  const char* select =
      "SELECT p.id, p.sha256, o.data, o.picture FROM originals o JOIN pictures p ON p.key = "
      "o.picture WHERE o.picture > ? ORDER BY o.picture LIMIT ?";
  EachRow(db, select, 3, [&](const Cursor& row) {
    if (Sha256Hex(row.Blob(2)) != ToHex(row.Blob(1))) {
      problems.push_back("picture \"" + row.Text(0) + "\": its original does not have its hash");
    }
  });
}

void CheckObjects(Connection& db, Problems& problems) {
  Cursor row = db.Prepare(
      "SELECT name FROM objects o WHERE NOT EXISTS (SELECT 1 FROM pictures p WHERE p.object = "
      "o.key)");
  while (row.Next()) problems.push_back("object \"" + row.Text(0) + "\" has no picture");
  if (db.Scalar("SELECT count(*) FROM pictures p JOIN objects o ON o.key = p.object "
                "WHERE o.collection <> p.collection") != 0) {
    problems.emplace_back("a picture shows an object of another collection");
  }
}

// Names and metadata that no program of ours would have stored.
void CheckNames(Connection& db, Problems& problems) {
  const auto check = [&](const std::string& whose, const auto& rule, const std::string& text) {
    try {
      rule(text);
    } catch (const Error& error) {
      problems.push_back(whose + ": " + error.what());
    }
  };
  const char* select =
      "SELECT id, metadata, source, key FROM pictures WHERE key > ? ORDER BY key LIMIT ?";
  EachRow(db, select, 3, [&](const Cursor& picture) {
    const std::string whose = "picture \"" + picture.Text(0) + "\"";
    check(whose, CheckImageId, picture.Text(0));
    check(whose, CheckSource, picture.Text(2));
    check(whose, CanonicalMetadata, picture.Text(1));
  });
  Cursor object = db.Prepare("SELECT name FROM objects");
  while (object.Next()) {
    check("object \"" + object.Text(0) + "\"", CheckObject, object.Text(0));
  }
  Cursor collection = db.Prepare("SELECT name FROM collections");
  while (collection.Next()) {
    check("collection \"" + collection.Text(0) + "\"", CheckCollectionName, collection.Text(0));
  }
  Cursor alias = db.Prepare("SELECT name FROM aliases");
  while (alias.Next()) check("alias \"" + alias.Text(0) + "\"", CheckAliasName, alias.Text(0));
  if (db.Scalar("SELECT count(*) FROM aliases a JOIN collections c ON c.name = a.name") != 0) {
    problems.emplace_back("an alias has the name of a collection");
  }
  if (!FindCollection(db, kDefaultCollection)) {
    problems.emplace_back("the collection \"default\" is missing");
  }
}

}  // namespace

// The triggers keep what Stats reads.
void CheckCounts(Connection& db, std::vector<std::string>& problems) {
  Cursor row = db.Prepare(
      "SELECT name FROM collections c WHERE "
      "images <> (SELECT count(*) FROM pictures p WHERE p.collection = c.key) OR "
      "objects <> (SELECT count(*) FROM objects o WHERE o.collection = c.key) OR descriptors <> "
      "(SELECT coalesce(sum(keypoints), 0) FROM pictures p WHERE p.collection = c.key)");
  while (row.Next()) {
    problems.push_back("collection \"" + row.Text(0) + "\": its counts are not what it holds");
  }
  // An index in memory follows the removals.
  if (db.Scalar("SELECT count(*) FROM removals r JOIN pictures p ON p.key = r.picture") != 0) {
    problems.emplace_back("a picture is recorded as removed but is there");
  }
  if (db.Scalar("SELECT count(*) FROM models") != 1) {
    problems.emplace_back("the database is not of exactly one model");
  }
}

void CheckRows(Connection& db, Problems* problems) {
  for (const auto check : {CheckFeatures, CheckVocabularies, CheckWords, CheckOriginals,
                           CheckObjects, CheckCounts, CheckNames}) {
    try {
      check(db, *problems);
    } catch (const Error&) {
      throw;  // it cannot be looked at, which is no problem of its rows
    } catch (const std::exception& error) {
      problems->push_back(std::string("the database: ") + error.what());
    }
  }
}

std::vector<std::string> CheckOriginalFiles(Connection& db, const OriginalStore* files) {
  Problems problems;
  Cursor row = db.Prepare(
      "SELECT p.id, f.sha256, f.sha256 = p.sha256, p.bytes FROM original_files f "
      "JOIN pictures p ON p.key = f.picture ORDER BY f.sha256");
  std::string last;  // pictures that share a file are one line
  while (row.Next()) {
    const std::string picture = "picture \"" + row.Text(0) + "\": ";
    const std::string sha256 = ToHex(row.Blob(1));
    if (row.Int(2) == 0) problems.push_back(picture + "its original is of another picture");
    if (sha256 == std::exchange(last, sha256)) continue;
    if (files == nullptr) {
      problems.push_back(picture + "the directory with its original is not known");
      continue;
    }
    try {
      if (!files->Read(sha256, static_cast<std::uint64_t>(row.Int(3)))) {
        problems.push_back(picture + "its original is not in " + files->directory().string());
      }
    } catch (const Error& error) {
      problems.push_back(picture + error.what());
    }
  }
  return problems;
}

}  // namespace pliant
