// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/integrity.h"

#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "index/files/names.h"
#include "index/store/feature_codec.h"
#include "index/store/sqlite/catalogue_vocabularies.h"
#include "index/store/sqlite/schema.h"
#include "index/store/sqlite/schema_check.h"
#include "index/store/word_codec.h"

namespace pliant {
namespace {

using Problems = std::vector<std::string>;

void CheckFile(Connection& db, Problems& problems) {
  Cursor row = db.Prepare("PRAGMA integrity_check(100)");
  while (row.Next()) {
    if (row.Text(0) != "ok") problems.push_back("SQLite: " + row.Text(0));
  }
  Cursor keys = db.Prepare("PRAGMA foreign_key_check");
  while (keys.Next()) {
    problems.push_back("a row of table " + keys.Text(0) + " refers to a missing row of " +
                       keys.Text(2));
  }
  if (db.Scalar("PRAGMA application_id") != static_cast<std::int64_t>(kApplicationId)) {
    problems.emplace_back("the application id is not Pliant's");
  }
  if (db.Scalar("PRAGMA user_version") != SchemaVersion()) {
    problems.emplace_back("the schema version is not this program's");
  }
}

void CheckFeatures(Connection& db, Problems& problems) {
  Cursor row = db.Prepare(
      "SELECT p.id, p.width, p.height, p.keypoints, f.data, m.kind, m.dim, f.model = c.model "
      "FROM pictures p JOIN collections c ON c.key = p.collection "
      "LEFT JOIN features f ON f.picture = p.key LEFT JOIN models m ON m.key = f.model");
  while (row.Next()) {
    const std::string picture = "picture \"" + row.Text(0) + "\": ";
    if (row.IsNull(4)) {
      problems.push_back(picture + "its features are missing");
      continue;
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
  }
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
  Cursor row = db.Prepare(
      "SELECT p.id, v.words, p.keypoints, w.data, v.collection = p.collection, EXISTS (SELECT 1 "
      "FROM "
      "vocabulary_words t WHERE t.vocabulary = v.key AND t.thresholds IS NOT NULL), "
      "v.codebook IS NOT NULL "
      "FROM picture_words w "
      "JOIN pictures p ON p.key = w.picture JOIN vocabularies v ON v.key = w.vocabulary");
  while (row.Next()) {
    const std::string picture = "picture \"" + row.Text(0) + "\": ";
    if (row.Int(4) == 0)
      problems.push_back(picture + "its words are of another collection's vocabulary");
    try {
      const Bow bow = DecodeBow(row.Blob(3), static_cast<std::size_t>(row.Int(1)));
      if (bow.total != row.Int(2))
        problems.push_back(picture + "it has more or fewer words than key points");
      if (bow.signatures.empty() == (row.Int(5) != 0)) {
        problems.push_back(picture +
                           "its words have signatures and the vocabulary has none, or the "
                           "other way round");
      }
      if (bow.codes.empty() == (row.Int(6) != 0)) {
        problems.push_back(
            picture + "its words have codes and the vocabulary has none, or the other way round");
      }
    } catch (const Error& error) {
      problems.push_back(picture + error.what());
    }
  }
}

void CheckOriginals(Connection& db, Problems& problems) {
  Cursor row = db.Prepare(
      "SELECT p.id, lower(hex(p.sha256)), o.data FROM originals o JOIN pictures p ON p.key = "
      "o.picture");
  while (row.Next()) {
    if (Sha256Hex(row.Blob(2)) != row.Text(1)) {
      problems.push_back("picture \"" + row.Text(0) + "\": its original does not have its hash");
    }
  }
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

// The triggers keep what Stats reads.
void CheckCounts(Connection& db, Problems& problems) {
  Cursor row = db.Prepare(
      "SELECT name FROM collections c WHERE "
      "images <> (SELECT count(*) FROM pictures p WHERE p.collection = c.key) OR "
      "objects <> (SELECT count(*) FROM objects o WHERE o.collection = c.key) OR descriptors <> "
      "(SELECT coalesce(sum(keypoints), 0) FROM pictures p WHERE p.collection = c.key)");
  while (row.Next()) {
    problems.push_back("collection \"" + row.Text(0) + "\": its counts are not what it holds");
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
  Cursor picture = db.Prepare("SELECT id, metadata, source FROM pictures");
  while (picture.Next()) {
    const std::string whose = "picture \"" + picture.Text(0) + "\"";
    check(whose, CheckImageId, picture.Text(0));
    check(whose, CheckStoredSource, picture.Text(2));
    const std::string metadata = picture.Text(1);
    check(
        whose, [](const std::string& text) { CanonicalMetadata(text, kAnyNumberOfNames); },
        metadata);
  }
  Cursor object = db.Prepare("SELECT name FROM objects");
  while (object.Next()) {
    check("object \"" + object.Text(0) + "\"", CheckStoredObject, object.Text(0));
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

// An index in memory follows the database by these: a key that is used twice, or a removal of a
// picture that is there, would leave it wrong.
void CheckKeys(Connection& db, Problems& problems) {
  for (const char* table : {"collections", "objects", "pictures", "vocabularies"}) {
    const std::string name = table;
    const std::int64_t last = db.Scalar(
        "SELECT coalesce((SELECT seq FROM sqlite_sequence WHERE name = '" + name + "'), 0)");
    if (db.Scalar("SELECT coalesce(max(key), 0) FROM " + name) > last) {
      problems.push_back("table " + name + ": keys that were used may be used again");
    }
  }
  if (db.Scalar("SELECT count(*) FROM removals r JOIN pictures p ON p.key = r.picture") != 0) {
    problems.emplace_back("a picture is recorded as removed but is there");
  }
  if (db.Scalar("SELECT count(*) FROM models") != 1) {
    problems.emplace_back("the database is not of exactly one model");
  }
}

}  // namespace

std::vector<std::string> CheckDatabase(Connection& db) {
  // Nothing else is asked of tables that are not Pliant's: the answer might never end.
  Problems problems = CheckSchema(db, Others::kLeft);
  if (!problems.empty()) return problems;
  for (const auto check : {CheckFile, CheckFeatures, CheckVocabularies, CheckWords, CheckOriginals,
                           CheckObjects, CheckCounts, CheckNames, CheckKeys}) {
    try {
      check(db, problems);
    } catch (const SQLite::Exception& error) {
      problems.push_back(std::string("SQLite: ") + error.what());
    }
  }
  return problems;
}

std::vector<std::string> QuickCheck(Connection& db) {
  Problems problems = CheckSchema(db, Others::kLeft);
  if (!problems.empty()) return problems;
  const std::string answer = db.Prepare("PRAGMA quick_check(1)").One().Text(0);
  if (answer != "ok") {
    problems.push_back("SQLite: " + answer);
  } else if (db.Scalar("PRAGMA user_version") == SchemaVersion()) {
    CheckCounts(db, problems);
    CheckKeys(db, problems);
  }
  return problems;
}

std::vector<std::string> CheckOriginalFiles(Connection& db, const OriginalStore* files) {
  Problems problems;
  Cursor row = db.Prepare(
      "SELECT p.id, lower(hex(f.sha256)), f.sha256 = p.sha256, p.bytes FROM original_files f "
      "JOIN pictures p ON p.key = f.picture ORDER BY f.sha256");
  std::string last;  // pictures that share a file are one line
  while (row.Next()) {
    const std::string picture = "picture \"" + row.Text(0) + "\": ";
    const std::string sha256 = row.Text(1);
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
