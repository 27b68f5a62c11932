// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/schema.h"

namespace pliant {

// A key is never used twice, so that an index in memory can tell what is new (greater keys) and
// what is gone (the table `removals`) since it last asked.
const char* const kTables = R"sql(
CREATE TABLE models (
  key INTEGER PRIMARY KEY,
  name TEXT NOT NULL,                  -- "deal", "sift", ...
  model_id TEXT NOT NULL UNIQUE,
  kind INTEGER NOT NULL,               -- DescriptorKind
  dim INTEGER NOT NULL,
  max_keypoints INTEGER,               -- how every program describes images; NULL: not decided yet
  max_side INTEGER
);
CREATE TABLE collections (
  key INTEGER PRIMARY KEY AUTOINCREMENT,
  name TEXT NOT NULL UNIQUE,
  model INTEGER NOT NULL REFERENCES models (key),
  active_vocabulary INTEGER REFERENCES vocabularies (key) ON DELETE SET NULL,
  created_ms INTEGER NOT NULL,
  automatic INTEGER NOT NULL DEFAULT 0,     -- 1: a program chose the active vocabulary
  images INTEGER NOT NULL DEFAULT 0,        -- kept by triggers, so that nobody has to count
  objects INTEGER NOT NULL DEFAULT 0,
  descriptors INTEGER NOT NULL DEFAULT 0,
  display_name TEXT NOT NULL DEFAULT '',    -- '': its name
  found_from REAL NOT NULL DEFAULT 0.9,     -- a hit of this probability is found
  self_test TEXT NOT NULL DEFAULT ''        -- the last report, JSON; '': none
);
CREATE TABLE aliases (
  name TEXT PRIMARY KEY,               -- of no collection
  collection INTEGER NOT NULL REFERENCES collections (key) ON DELETE CASCADE,
  updated_ms INTEGER NOT NULL
) WITHOUT ROWID;
CREATE INDEX aliases_by_collection ON aliases (collection);
CREATE TABLE objects (
  key INTEGER PRIMARY KEY AUTOINCREMENT,
  collection INTEGER NOT NULL REFERENCES collections (key) ON DELETE CASCADE,
  name TEXT NOT NULL CHECK (name <> ''),
  natural_name TEXT NOT NULL,               -- NaturalKey (index/files/text.h), for lists
  UNIQUE (collection, name)
);
CREATE INDEX objects_in_order ON objects (collection, natural_name, name);
CREATE TABLE images (
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
  updated_ms INTEGER NOT NULL,
  UNIQUE (collection, id)
);
CREATE INDEX images_by_sha256 ON images (sha256, collection);
CREATE INDEX images_by_object ON images (object, id);
CREATE INDEX images_by_added ON images (collection, added_ms, id);
CREATE INDEX images_by_updated ON images (collection, updated_ms, id);
CREATE TABLE features (
  image INTEGER PRIMARY KEY REFERENCES images (key) ON DELETE CASCADE,
  model INTEGER NOT NULL REFERENCES models (key),
  data BLOB NOT NULL
);
CREATE TABLE originals (
  image INTEGER PRIMARY KEY REFERENCES images (key) ON DELETE CASCADE,
  data BLOB NOT NULL
);
-- Originals may be files of a directory (original_store.h). The transaction that drops the last
-- reference to one writes it down here; the file is removed after the commit.
CREATE TABLE originals_directory (
  key INTEGER PRIMARY KEY CHECK (key = 1),
  path TEXT NOT NULL,
  owner TEXT NOT NULL,                 -- 32 hex digits, also in the directory
  active INTEGER NOT NULL              -- 1: new originals go there; 0: into the database
);
CREATE TABLE original_files (
  image INTEGER PRIMARY KEY REFERENCES images (key) ON DELETE CASCADE,
  sha256 BLOB NOT NULL CHECK (length(sha256) = 32)
);
CREATE INDEX original_files_by_sha256 ON original_files (sha256);
CREATE TABLE dropped_originals (
  sha256 BLOB PRIMARY KEY
) WITHOUT ROWID;
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
  ready INTEGER NOT NULL DEFAULT 0,    -- 1 when every image was quantised with it
  created_ms INTEGER NOT NULL,
  codebook BLOB NOT NULL               -- index/FORMAT.md
);
CREATE INDEX vocabularies_by_collection ON vocabularies (collection);
CREATE TABLE vocabulary_words (
  vocabulary INTEGER NOT NULL REFERENCES vocabularies (key) ON DELETE CASCADE,
  word INTEGER NOT NULL,
  data BLOB NOT NULL,
  PRIMARY KEY (vocabulary, word)
) WITHOUT ROWID;
CREATE TABLE image_words (
  key INTEGER PRIMARY KEY,
  vocabulary INTEGER NOT NULL REFERENCES vocabularies (key) ON DELETE CASCADE,
  image INTEGER NOT NULL REFERENCES images (key) ON DELETE CASCADE,
  data BLOB NOT NULL,
  UNIQUE (vocabulary, image)
);
CREATE INDEX image_words_by_image ON image_words (image);
CREATE TABLE saved_indexes (           -- in files (ChangeFeed::SignSaved)
  signature TEXT PRIMARY KEY,
  vocabulary INTEGER NOT NULL REFERENCES vocabularies (key) ON DELETE CASCADE
) WITHOUT ROWID;
CREATE INDEX saved_indexes_by_vocabulary ON saved_indexes (vocabulary);

-- What a server keeps beside the images (service_store.h).
CREATE TABLE api_keys (
  key INTEGER PRIMARY KEY AUTOINCREMENT,
  id TEXT NOT NULL UNIQUE,
  name TEXT NOT NULL,
  scope TEXT NOT NULL CHECK (scope IN ('read', 'write', 'admin', 'peer')),
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
  finished_ms INTEGER NOT NULL,        -- 0: not yet
  owner TEXT NOT NULL DEFAULT '',      -- the server that does it; '': nobody
  cancel INTEGER NOT NULL DEFAULT 0    -- 1: somebody asked for its end
);
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

}  // namespace pliant
