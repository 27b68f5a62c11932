// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/schema.h"

#include <array>
#include <string>

#include <SQLiteCpp/Transaction.h>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

// Keys are AUTOINCREMENT: a key is never used twice, so that an index in memory can tell what is
// new (greater keys) and what is gone (removals) since it last looked.
constexpr const char* kVersion1 = R"sql(
CREATE TABLE models (
  key INTEGER PRIMARY KEY,
  name TEXT NOT NULL,                  -- "deal", "sift", ...
  model_id TEXT NOT NULL UNIQUE,
  kind INTEGER NOT NULL,               -- DescriptorKind
  dim INTEGER NOT NULL
);
CREATE TABLE collections (
  key INTEGER PRIMARY KEY AUTOINCREMENT,
  name TEXT NOT NULL UNIQUE,
  model INTEGER NOT NULL REFERENCES models (key),
  active_vocabulary INTEGER REFERENCES vocabularies (key) ON DELETE SET NULL,
  created_ms INTEGER NOT NULL
);
CREATE TABLE objects (
  key INTEGER PRIMARY KEY AUTOINCREMENT,
  collection INTEGER NOT NULL REFERENCES collections (key) ON DELETE CASCADE,
  name TEXT NOT NULL CHECK (name <> ''),
  UNIQUE (collection, name)
);
CREATE TABLE pictures (
  key INTEGER PRIMARY KEY AUTOINCREMENT,
  collection INTEGER NOT NULL REFERENCES collections (key) ON DELETE CASCADE,
  id TEXT NOT NULL,
  object INTEGER REFERENCES objects (key) ON DELETE CASCADE,
  sha256 BLOB NOT NULL CHECK (length(sha256) = 32),
  media_type TEXT NOT NULL,
  width INTEGER NOT NULL,
  height INTEGER NOT NULL,
  bytes INTEGER NOT NULL,
  keypoints INTEGER NOT NULL,
  metadata TEXT NOT NULL,
  source TEXT NOT NULL,
  added_ms INTEGER NOT NULL,
  UNIQUE (collection, id)
);
CREATE INDEX pictures_by_sha256 ON pictures (sha256, collection);
CREATE INDEX pictures_by_object ON pictures (object, id);
CREATE TABLE features (
  picture INTEGER PRIMARY KEY REFERENCES pictures (key) ON DELETE CASCADE,
  model INTEGER NOT NULL REFERENCES models (key),
  data BLOB NOT NULL
);
CREATE TABLE originals (
  picture INTEGER PRIMARY KEY REFERENCES pictures (key) ON DELETE CASCADE,
  data BLOB NOT NULL
);
CREATE TABLE vocabularies (
  key INTEGER PRIMARY KEY AUTOINCREMENT,
  collection INTEGER NOT NULL REFERENCES collections (key) ON DELETE CASCADE,
  model INTEGER NOT NULL REFERENCES models (key),
  words INTEGER NOT NULL,
  seed INTEGER NOT NULL,
  sampled INTEGER NOT NULL,
  available INTEGER NOT NULL,
  loss REAL NOT NULL,
  method TEXT NOT NULL,
  checksum INTEGER NOT NULL,           -- CRC-32 over the words' bytes in order
  ready INTEGER NOT NULL DEFAULT 0,    -- 1 when every picture was quantised with it
  created_ms INTEGER NOT NULL
);
CREATE INDEX vocabularies_by_collection ON vocabularies (collection);
CREATE TABLE vocabulary_words (
  vocabulary INTEGER NOT NULL REFERENCES vocabularies (key) ON DELETE CASCADE,
  word INTEGER NOT NULL,
  data BLOB NOT NULL,
  PRIMARY KEY (vocabulary, word)
) WITHOUT ROWID;
CREATE TABLE picture_words (
  key INTEGER PRIMARY KEY,
  vocabulary INTEGER NOT NULL REFERENCES vocabularies (key) ON DELETE CASCADE,
  picture INTEGER NOT NULL REFERENCES pictures (key) ON DELETE CASCADE,
  data BLOB NOT NULL,
  UNIQUE (vocabulary, picture)
);
CREATE INDEX picture_words_by_picture ON picture_words (picture);
CREATE TABLE removals (
  seq INTEGER PRIMARY KEY AUTOINCREMENT,
  picture INTEGER NOT NULL
);
CREATE TRIGGER picture_removed AFTER DELETE ON pictures BEGIN
  INSERT INTO removals (picture) VALUES (old.key);
  -- A reader that missed more than these loads everything anew.
  DELETE FROM removals WHERE seq <= (SELECT max(seq) FROM removals) - 10000;
END;
)sql";

// Words may have thresholds, and the words of pictures signatures (vocab/signature.h). Vocabularies
// that are there have none and rank as before; those trained from now on have them.
constexpr const char* kVersion2 = R"sql(
ALTER TABLE vocabulary_words ADD COLUMN thresholds BLOB;  -- 64 float32; NULL = none
)sql";

// What a server keeps beside the pictures (service_store.h), and how pictures are described, so
// that every program that opens the database describes alike. NULL: not decided yet.
constexpr const char* kVersion3 = R"sql(
ALTER TABLE models ADD COLUMN max_keypoints INTEGER;
ALTER TABLE models ADD COLUMN max_side INTEGER;
CREATE TABLE api_keys (
  key INTEGER PRIMARY KEY AUTOINCREMENT,
  id TEXT NOT NULL UNIQUE,
  name TEXT NOT NULL,
  scope TEXT NOT NULL CHECK (scope IN ('read', 'write', 'admin')),
  hash BLOB NOT NULL UNIQUE CHECK (length(hash) = 32),  -- SHA-256 of the whole key
  created_ms INTEGER NOT NULL,
  revoked_ms INTEGER                                    -- NULL: it works
);
CREATE TABLE jobs (
  number INTEGER PRIMARY KEY AUTOINCREMENT,
  id TEXT NOT NULL UNIQUE,
  kind TEXT NOT NULL,
  collection TEXT NOT NULL,
  parameters TEXT NOT NULL,            -- a JSON object
  state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled')),
  done REAL NOT NULL,
  total REAL NOT NULL,
  failed INTEGER NOT NULL,
  attempts INTEGER NOT NULL,           -- times it was begun
  result TEXT NOT NULL,
  report TEXT NOT NULL,                -- a JSON object: the problem, what was skipped
  created_ms INTEGER NOT NULL,
  finished_ms INTEGER NOT NULL         -- 0: not yet
);
)sql";

// Originals may be files of a directory (original_store.h). What no picture refers to any more is
// written down by the transaction that drops the last reference and removed after its commit.
constexpr const char* kVersion4 = R"sql(
CREATE TABLE originals_directory (
  key INTEGER PRIMARY KEY CHECK (key = 1),
  path TEXT NOT NULL,
  owner TEXT NOT NULL,                 -- 32 hex digits, also in the directory
  active INTEGER NOT NULL              -- 1: new originals go there; 0: into the database
);
CREATE TABLE original_files (
  picture INTEGER PRIMARY KEY REFERENCES pictures (key) ON DELETE CASCADE,
  sha256 BLOB NOT NULL CHECK (length(sha256) = 32)
);
CREATE INDEX original_files_by_sha256 ON original_files (sha256);
CREATE TABLE dropped_originals (
  sha256 BLOB PRIMARY KEY
) WITHOUT ROWID;
CREATE TRIGGER original_dropped AFTER DELETE ON original_files BEGIN
  INSERT OR IGNORE INTO dropped_originals (sha256) VALUES (old.sha256);
END;
)sql";

// Who chose the active vocabulary, and how much a collection holds, so that nobody has to count.
// Until now automatic training was known by its seed (0x504c49414e54), and an older vocabulary that
// is active again was chosen by hand.
constexpr const char* kVersion5 = R"sql(
ALTER TABLE collections ADD COLUMN automatic INTEGER NOT NULL DEFAULT 0;
ALTER TABLE collections ADD COLUMN images INTEGER NOT NULL DEFAULT 0;
ALTER TABLE collections ADD COLUMN objects INTEGER NOT NULL DEFAULT 0;
ALTER TABLE collections ADD COLUMN descriptors INTEGER NOT NULL DEFAULT 0;
UPDATE collections SET
  automatic = EXISTS (SELECT 1 FROM vocabularies v WHERE v.key = active_vocabulary
    AND v.seed = 88288576753236 AND v.key = (SELECT max(w.key) FROM vocabularies w
    WHERE w.collection = v.collection AND w.ready = 1)),
  images = (SELECT count(*) FROM pictures p WHERE p.collection = collections.key),
  objects = (SELECT count(*) FROM objects o WHERE o.collection = collections.key),
  descriptors = (SELECT coalesce(sum(p.keypoints), 0) FROM pictures p
                 WHERE p.collection = collections.key);
CREATE TRIGGER picture_counted AFTER INSERT ON pictures BEGIN
  UPDATE collections SET images = images + 1, descriptors = descriptors + new.keypoints
  WHERE key = new.collection;
END;
CREATE TRIGGER picture_uncounted AFTER DELETE ON pictures BEGIN
  UPDATE collections SET images = images - 1, descriptors = descriptors - old.keypoints
  WHERE key = old.collection;
END;
CREATE TRIGGER object_counted AFTER INSERT ON objects BEGIN
  UPDATE collections SET objects = objects + 1 WHERE key = new.collection;
END;
CREATE TRIGGER object_uncounted AFTER DELETE ON objects BEGIN
  UPDATE collections SET objects = objects - 1 WHERE key = old.collection;
END;
)sql";

// Vocabularies may have a codebook, and the words of pictures codes (vocab/residual_codes.h). Those
// that are there have none: they rank by tf-idf until a new vocabulary is trained.
constexpr const char* kVersion6 = R"sql(
ALTER TABLE vocabularies ADD COLUMN codebook BLOB;  -- FORMAT in index/README.md; NULL = none
)sql";

// Several servers may work on one database: each job is one server's (service_store.h).
constexpr const char* kVersion7 = R"sql(
ALTER TABLE jobs ADD COLUMN owner TEXT NOT NULL DEFAULT '';    -- '': nobody's
ALTER TABLE jobs ADD COLUMN cancel INTEGER NOT NULL DEFAULT 0;  -- 1: somebody asked for its end
)sql";

// Lists in order of time: until now nobody wrote down when a picture's record changed. Jobs that
// work on what was sent, and say what became of each item.
constexpr const char* kVersion8 = R"sql(
ALTER TABLE pictures ADD COLUMN updated_ms INTEGER NOT NULL DEFAULT 0;
UPDATE pictures SET updated_ms = added_ms;
CREATE INDEX pictures_by_added ON pictures (collection, added_ms, id);
CREATE INDEX pictures_by_updated ON pictures (collection, updated_ms, id);
CREATE TABLE job_inputs (
  key INTEGER PRIMARY KEY,
  job TEXT NOT NULL UNIQUE,            -- jobs.id
  data BLOB NOT NULL
);
CREATE TABLE job_items (
  job TEXT NOT NULL,                   -- jobs.id
  number INTEGER NOT NULL,             -- from 0
  result TEXT NOT NULL,                -- a JSON object
  PRIMARY KEY (job, number)
) WITHOUT ROWID;
CREATE TRIGGER job_forgotten AFTER DELETE ON jobs BEGIN
  DELETE FROM job_inputs WHERE job = old.id;
  DELETE FROM job_items WHERE job = old.id;
END;
)sql";

// Names for people, and names that can be moved from one collection to another. Requests that may
// be sent twice (service_store.h).
constexpr const char* kVersion9 = R"sql(
ALTER TABLE collections ADD COLUMN display_name TEXT NOT NULL DEFAULT '';  -- '': its name
CREATE TABLE aliases (
  name TEXT PRIMARY KEY,               -- of no collection
  collection INTEGER NOT NULL REFERENCES collections (key) ON DELETE CASCADE,
  updated_ms INTEGER NOT NULL
) WITHOUT ROWID;
CREATE INDEX aliases_by_collection ON aliases (collection);
CREATE TABLE repeatable_requests (
  caller TEXT NOT NULL,                -- id of the API key; '': none
  name TEXT NOT NULL,                  -- the Idempotency-Key
  fingerprint BLOB NOT NULL CHECK (length(fingerprint) = 32),
  owner TEXT NOT NULL,                 -- the server that does it
  answer TEXT,                         -- a JSON object; NULL: not answered yet
  begun_ms INTEGER NOT NULL,
  PRIMARY KEY (caller, name)
) WITHOUT ROWID;
CREATE INDEX repeatable_requests_by_age ON repeatable_requests (begun_ms);
)sql";

// No table changes, but features may hold colours (feature_codec.h): what does not know them is not
// to meet them.
constexpr const char* kVersion10 = "SELECT 1";

constexpr std::array kMigrations = {
    Migration{kVersion1}, Migration{kVersion2}, Migration{kVersion3}, Migration{kVersion4},
    Migration{kVersion5}, Migration{kVersion6}, Migration{kVersion7}, Migration{kVersion8},
    Migration{kVersion9}, Migration{kVersion10}};

}  // namespace

std::span<const Migration> Migrations() { return kMigrations; }

int SchemaVersion() { return static_cast<int>(kMigrations.size()); }

void Migrate(SQLite::Database& database, std::span<const Migration> migrations) {
  const int newest = static_cast<int>(migrations.size());
  while (true) {
    const int seen = database.execAndGet("PRAGMA user_version").getInt();
    if (seen == newest) return;
    if (seen < 0 || seen > newest) {
      throw Error(ErrorCode::kCorrupt, "newer_schema",
                  database.getFilename() + " was made by a newer Pliant (schema version " +
                      std::to_string(seen) + ", this program knows " + std::to_string(newest) +
                      "); use that one");
    }
    SQLite::Transaction transaction(database, SQLite::TransactionBehavior::IMMEDIATE);
    // Another process may have migrated while this one waited for the write lock.
    if (database.execAndGet("PRAGMA user_version").getInt() != seen) continue;
    database.exec(migrations[static_cast<std::size_t>(seen)].sql);
    database.exec("PRAGMA user_version = " + std::to_string(seen + 1));
    transaction.commit();
  }
}

}  // namespace pliant
