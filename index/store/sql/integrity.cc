// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/integrity.h"

#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/sha256.h"
#include "index/files/names.h"
#include "index/store/blob_codec.h"
#include "index/store/sql/rows.h"

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

// Runs `work`; what it throws is a problem of `whose`.
template <typename Work>
void Note(Problems& problems, const std::string& whose, const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    problems.push_back(whose + error.what());
  }
}

void CheckFeatures(Connection& db, Problems& problems) {
  const char* select =
      "SELECT p.id, p.width, p.height, p.keypoints, f.data, m.kind, m.dim, f.model = c.model, "
      "p.key FROM images p JOIN collections c ON c.key = p.collection "
      "LEFT JOIN features f ON f.image = p.key LEFT JOIN models m ON m.key = f.model "
      "WHERE p.key > ? ORDER BY p.key LIMIT ?";
  EachRow(db, select, 8, [&](const Cursor& row) {
    const std::string image = "image \"" + row.Text(0) + "\": ";
    if (row.IsNull(4)) {
      problems.push_back(image + "its features are missing");
      return;
    }
    if (row.Int(7) == 0) problems.push_back(image + "its features are of another model");
    Note(problems, image, [&] {
      const Features features = DecodeFeatures(row.Blob(4));
      if (features.width != row.Int(1) || features.height != row.Int(2) ||
          static_cast<std::int64_t>(features.keypoints.size()) != row.Int(3)) {
        problems.push_back(image + "its features differ from its record");
      }
      if (static_cast<std::int64_t>(features.descriptors.kind) != row.Int(5) ||
          features.descriptors.dim != row.Int(6)) {
        problems.push_back(image + "its descriptors are not of their model's form");
      }
    });
  });
}

void CheckVocabularies(Connection& db, Problems& problems) {
  for (const CollectionRow& collection : AllCollections(db)) {
    const std::vector<VocabularyRecord> records = SelectVocabularies(db, collection);
    bool active_seen = collection.active_vocabulary == 0;
    for (const VocabularyRecord& record : records) {
      active_seen = active_seen || record.active;
      Note(problems, "", [&] { ReadVocabulary(db, record.id); });
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
      "SELECT p.id FROM images p JOIN collections c ON c.key = p.collection "
      "WHERE c.active_vocabulary IS NOT NULL AND NOT EXISTS (SELECT 1 FROM image_words w "
      "WHERE w.vocabulary = c.active_vocabulary AND w.image = p.key)");
  while (missing.Next()) {
    problems.push_back("image \"" + missing.Text(0) +
                       "\": it has no words of the active vocabulary");
  }
  const char* select =
      "SELECT p.id, v.words, p.keypoints, w.data, v.collection = p.collection, w.key "
      "FROM image_words w "
      "JOIN images p ON p.key = w.image JOIN vocabularies v ON v.key = w.vocabulary "
      "WHERE w.key > ? ORDER BY w.key LIMIT ?";
  EachRow(db, select, 5, [&](const Cursor& row) {
    const std::string image = "image \"" + row.Text(0) + "\": ";
    if (row.Int(4) == 0)
      problems.push_back(image + "its words are of another collection's vocabulary");
    Note(problems, image, [&] {
      const auto words = DecodeWords(row.Blob(3), static_cast<std::size_t>(row.Int(1)));
      if (words.size() != row.Count(2))
        problems.push_back(image + "it has more or fewer words than keypoints");
    });
  });
}

void CheckOriginals(Connection& db, Problems& problems) {
  const char* select =
      "SELECT p.id, p.sha256, o.data, o.image FROM originals o JOIN images p ON p.key = "
      "o.image WHERE o.image > ? ORDER BY o.image LIMIT ?";
  EachRow(db, select, 3, [&](const Cursor& row) {
    if (Sha256Hex(row.Blob(2)) != ToHex(row.Blob(1))) {
      problems.push_back("image \"" + row.Text(0) + "\": its original does not have its hash");
    }
  });
}

void CheckObjects(Connection& db, Problems& problems) {
  Cursor row = db.Prepare(
      "SELECT name FROM objects o WHERE NOT EXISTS (SELECT 1 FROM images p WHERE p.object = "
      "o.key)");
  while (row.Next()) problems.push_back("object \"" + row.Text(0) + "\" has no image");
  if (db.Scalar("SELECT count(*) FROM images p JOIN objects o ON o.key = p.object "
                "WHERE o.collection <> p.collection") != 0) {
    problems.emplace_back("an image shows an object of another collection");
  }
}

// Names and metadata that no program of ours would have stored.
void CheckNames(Connection& db, Problems& problems) {
  const auto check = [&](const std::string& whose, const auto& rule, const std::string& text) {
    Note(problems, whose + ": ", [&] { rule(text); });
  };
  const char* select =
      "SELECT id, metadata, source, key FROM images WHERE key > ? ORDER BY key LIMIT ?";
  EachRow(db, select, 3, [&](const Cursor& image) {
    const std::string whose = "image \"" + image.Text(0) + "\"";
    check(whose, CheckImageId, image.Text(0));
    check(whose, CheckSource, image.Text(2));
    check(whose, CanonicalMetadata, image.Text(1));
  });
  const auto check_names = [&](const std::string& table, const std::string& kind,
                               const auto& rule) {
    Cursor row = db.Prepare("SELECT name FROM " + table);
    while (row.Next()) check(kind + " \"" + row.Text(0) + "\"", rule, row.Text(0));
  };
  check_names("objects", "object", CheckObject);
  check_names("collections", "collection", CheckCollectionName);
  check_names("aliases", "alias", CheckAliasName);
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
      "images <> (SELECT count(*) FROM images p WHERE p.collection = c.key) OR "
      "objects <> (SELECT count(*) FROM objects o WHERE o.collection = c.key) OR descriptors <> "
      "(SELECT coalesce(sum(keypoints), 0) FROM images p WHERE p.collection = c.key)");
  while (row.Next()) {
    problems.push_back("collection \"" + row.Text(0) + "\": its counts are not what it holds");
  }
  // An index in memory follows the removals.
  if (db.Scalar("SELECT count(*) FROM removals r JOIN images p ON p.key = r.image") != 0) {
    problems.emplace_back("an image is recorded as removed but is there");
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
      "JOIN images p ON p.key = f.image ORDER BY f.sha256");
  std::string last;  // images that share a file are one line
  while (row.Next()) {
    const std::string image = "image \"" + row.Text(0) + "\": ";
    const std::string sha256 = ToHex(row.Blob(1));
    if (row.Int(2) == 0) problems.push_back(image + "its original is of another image");
    if (sha256 == std::exchange(last, sha256)) continue;
    if (files == nullptr) {
      problems.push_back(image + "the directory with its original is not known");
      continue;
    }
    Note(problems, image, [&] {
      if (files->Read(sha256, row.Count(3))) return;
      problems.push_back(image + "its original is not in " + files->directory().string());
    });
  }
  return problems;
}

}  // namespace pliant
