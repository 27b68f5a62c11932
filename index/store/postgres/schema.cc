// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/postgres/schema.h"

namespace pliant::postgres {

// The same tables as in a file, and what a database of many writers needs. Text is in order of
// its bytes everywhere. Keys are never used twice, and given in order of commits: what writes holds
// the row of `feed` from its first statement to the end of its commit.
const char* const kSchema = R"sql(
CREATE TABLE pliant (version BIGINT NOT NULL);

-- How far each part of the database is: its writers hold the row of theirs, so that commits have one
-- order, without gaps. `timeline` is the server's: another one means that a standby took its place,
-- and `history` counts how often that was seen.
CREATE TABLE feed (
  key BIGINT PRIMARY KEY,              -- StorePart
  position BIGINT NOT NULL DEFAULT 0,  -- commits
  history BIGINT NOT NULL DEFAULT 0,
  left_at BIGINT NOT NULL DEFAULT 0,   -- position at which the history before ended
  timeline TEXT NOT NULL,
  removals BIGINT NOT NULL DEFAULT 0   -- number of the newest row that `removals` ever had
) WITH (fillfactor = 10);

CREATE TABLE models (
  key BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  name TEXT COLLATE "C" NOT NULL,
  model_id TEXT COLLATE "C" NOT NULL UNIQUE,
  kind BIGINT NOT NULL,
  dim BIGINT NOT NULL,
  max_keypoints BIGINT,
  max_side BIGINT
);
CREATE TABLE collections (
  key BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  name TEXT COLLATE "C" NOT NULL UNIQUE,
  model BIGINT NOT NULL REFERENCES models (key),
  active_vocabulary BIGINT,
  created_ms BIGINT NOT NULL,
  automatic BIGINT NOT NULL DEFAULT 0,
  images BIGINT NOT NULL DEFAULT 0,
  objects BIGINT NOT NULL DEFAULT 0,
  descriptors BIGINT NOT NULL DEFAULT 0,
  display_name TEXT COLLATE "C" NOT NULL DEFAULT ''
);
CREATE TABLE aliases (
  name TEXT COLLATE "C" PRIMARY KEY,
  collection BIGINT NOT NULL REFERENCES collections (key) ON DELETE CASCADE,
  updated_ms BIGINT NOT NULL
);
CREATE INDEX aliases_by_collection ON aliases (collection);
CREATE TABLE objects (
  key BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  collection BIGINT NOT NULL REFERENCES collections (key) ON DELETE CASCADE,
  name TEXT COLLATE "C" NOT NULL CHECK (name <> ''),
  UNIQUE (collection, name)
);
CREATE TABLE images (
  key BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  collection BIGINT NOT NULL REFERENCES collections (key) ON DELETE CASCADE,
  id TEXT COLLATE "C" NOT NULL,
  object BIGINT REFERENCES objects (key) ON DELETE CASCADE,
  sha256 BYTEA NOT NULL CHECK (length(sha256) = 32),
  media_type TEXT COLLATE "C" NOT NULL,
  width BIGINT NOT NULL,
  height BIGINT NOT NULL,
  bytes BIGINT NOT NULL,
  keypoints BIGINT NOT NULL,
  metadata TEXT COLLATE "C" NOT NULL,
  source TEXT COLLATE "C" NOT NULL,
  added_ms BIGINT NOT NULL,
  updated_ms BIGINT NOT NULL,
  fields JSONB NOT NULL,               -- the metadata, for filters (filter_sql.h)
  UNIQUE (collection, id)
);
CREATE INDEX images_by_sha256 ON images (sha256, collection);
CREATE INDEX images_by_object ON images (object, id);
CREATE INDEX images_by_added ON images (collection, added_ms, id);
CREATE INDEX images_by_updated ON images (collection, updated_ms, id);
CREATE INDEX images_by_fields ON images USING gin (fields jsonb_path_ops);
CREATE TABLE features (
  image BIGINT PRIMARY KEY REFERENCES images (key) ON DELETE CASCADE,
  model BIGINT NOT NULL REFERENCES models (key),
  data BYTEA NOT NULL
);
CREATE TABLE originals (
  image BIGINT PRIMARY KEY REFERENCES images (key) ON DELETE CASCADE,
  data BYTEA NOT NULL
);
CREATE TABLE vocabularies (
  key BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  collection BIGINT NOT NULL REFERENCES collections (key) ON DELETE CASCADE,
  model BIGINT NOT NULL REFERENCES models (key),
  words BIGINT NOT NULL,
  seed BIGINT NOT NULL,
  sampled BIGINT NOT NULL,
  available BIGINT NOT NULL,
  loss DOUBLE PRECISION NOT NULL,
  method TEXT COLLATE "C" NOT NULL,
  checksum BIGINT NOT NULL,
  ready BIGINT NOT NULL DEFAULT 0,
  created_ms BIGINT NOT NULL,
  codebook BYTEA NOT NULL
);
CREATE INDEX vocabularies_by_collection ON vocabularies (collection);
ALTER TABLE collections ADD FOREIGN KEY (active_vocabulary) REFERENCES vocabularies (key)
  ON DELETE SET NULL;
CREATE TABLE vocabulary_words (
  vocabulary BIGINT NOT NULL REFERENCES vocabularies (key) ON DELETE CASCADE,
  word BIGINT NOT NULL,
  data BYTEA NOT NULL,
  PRIMARY KEY (vocabulary, word)
);
CREATE TABLE image_words (
  key BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  vocabulary BIGINT NOT NULL REFERENCES vocabularies (key) ON DELETE CASCADE,
  image BIGINT NOT NULL REFERENCES images (key) ON DELETE CASCADE,
  data BYTEA NOT NULL,
  UNIQUE (vocabulary, image)
);
CREATE INDEX image_words_by_image ON image_words (image);
-- They do not compress, and are read whole.
ALTER TABLE features ALTER COLUMN data SET STORAGE EXTERNAL;
ALTER TABLE originals ALTER COLUMN data SET STORAGE EXTERNAL;
ALTER TABLE image_words ALTER COLUMN data SET STORAGE EXTERNAL;

CREATE TABLE removals (
  seq BIGINT PRIMARY KEY,              -- without gaps
  image BIGINT NOT NULL
);

CREATE TABLE originals_directory (
  key BIGINT PRIMARY KEY CHECK (key = 1),
  path TEXT COLLATE "C" NOT NULL,
  owner TEXT COLLATE "C" NOT NULL,
  active BIGINT NOT NULL
);
CREATE TABLE original_files (
  image BIGINT PRIMARY KEY REFERENCES images (key) ON DELETE CASCADE,
  sha256 BYTEA NOT NULL CHECK (length(sha256) = 32)
);
CREATE INDEX original_files_by_sha256 ON original_files (sha256);
CREATE TABLE dropped_originals (sha256 BYTEA PRIMARY KEY);

CREATE TABLE api_keys (
  key BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  id TEXT COLLATE "C" NOT NULL UNIQUE,
  name TEXT COLLATE "C" NOT NULL,
  scope TEXT COLLATE "C" NOT NULL CHECK (scope IN ('read', 'write', 'admin')),
  hash BYTEA NOT NULL UNIQUE CHECK (length(hash) = 32),
  created_ms BIGINT NOT NULL,
  revoked_ms BIGINT
);
CREATE TABLE jobs (
  number BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  id TEXT COLLATE "C" NOT NULL UNIQUE,
  kind TEXT COLLATE "C" NOT NULL,
  collection TEXT COLLATE "C" NOT NULL,
  parameters TEXT COLLATE "C" NOT NULL,
  state TEXT COLLATE "C" NOT NULL
    CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled')),
  done DOUBLE PRECISION NOT NULL,
  total DOUBLE PRECISION NOT NULL,
  failed BIGINT NOT NULL,
  attempts BIGINT NOT NULL,
  result TEXT COLLATE "C" NOT NULL,
  report TEXT COLLATE "C" NOT NULL,
  created_ms BIGINT NOT NULL,
  finished_ms BIGINT NOT NULL,
  owner TEXT COLLATE "C" NOT NULL DEFAULT '',
  cancel BIGINT NOT NULL DEFAULT 0
);
CREATE TABLE job_inputs (
  job TEXT COLLATE "C" PRIMARY KEY REFERENCES jobs (id) ON DELETE CASCADE,
  data BYTEA NOT NULL
);
CREATE TABLE job_items (
  job TEXT COLLATE "C" NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  number BIGINT NOT NULL,
  result TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (job, number)
);
CREATE TABLE repeatable_requests (
  caller TEXT COLLATE "C" NOT NULL,
  name TEXT COLLATE "C" NOT NULL,
  fingerprint BYTEA NOT NULL CHECK (length(fingerprint) = 32),
  owner TEXT COLLATE "C" NOT NULL,
  answer TEXT COLLATE "C",
  begun_ms BIGINT NOT NULL,
  PRIMARY KEY (caller, name)
);
CREATE INDEX repeatable_requests_by_age ON repeatable_requests (begun_ms);
-- Programs that have jobs or requests, each with the time at which it last said that it lives.
CREATE TABLE processes (
  id TEXT COLLATE "C" PRIMARY KEY,
  seen TIMESTAMPTZ NOT NULL
);

-- Text is compared whatever its case as FoldCase (index/files/fold_case.h) does it.
CREATE COLLATION pliant_fold (provider = libc, locale = 'C.UTF-8');
CREATE FUNCTION pliant_escaped(document TEXT) RETURNS TEXT LANGUAGE sql IMMUTABLE AS $$
  -- A backslash that is escaped itself is put aside, so that "\\u0000" stays what it is.
  SELECT replace(replace(replace(replace(document, '\\', E'\x07'), '\u0001', '\u0001\u0002'),
                         '\u0000', '\u0001\u0001'), E'\x07', '\\')
$$;
CREATE FUNCTION read_metadata() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  -- PostgreSQL's JSON has no U+0000. What stands for it keeps the order of text (filter_sql.h).
  new.fields = CASE WHEN new.metadata LIKE '%\\u000%'
    THEN pliant_escaped(new.metadata)::jsonb ELSE new.metadata::jsonb END;
  RETURN new;
END $$;
CREATE TRIGGER image_fields BEFORE INSERT OR UPDATE OF metadata ON images
  FOR EACH ROW EXECUTE FUNCTION read_metadata();

CREATE FUNCTION count_images() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  UPDATE collections c SET images = c.images + n.images, descriptors = c.descriptors + n.descriptors
  FROM (SELECT collection, count(*) AS images, sum(keypoints) AS descriptors FROM added
        GROUP BY collection) n WHERE c.key = n.collection;
  RETURN NULL;
END $$;
CREATE TRIGGER image_counted AFTER INSERT ON images REFERENCING NEW TABLE AS added
  FOR EACH STATEMENT EXECUTE FUNCTION count_images();

CREATE FUNCTION note_removals() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
  gone BIGINT;
  last BIGINT;
BEGIN
  SELECT count(*) INTO gone FROM removed;
  IF gone = 0 THEN RETURN NULL; END IF;
  UPDATE collections c SET images = c.images - n.images, descriptors = c.descriptors - n.descriptors
  FROM (SELECT collection, count(*) AS images, sum(keypoints) AS descriptors FROM removed
        GROUP BY collection) n WHERE c.key = n.collection;
  UPDATE feed SET removals = removals + gone WHERE key = 0 RETURNING removals INTO last;
  INSERT INTO removals (seq, image)
    SELECT last - gone + row_number() OVER (ORDER BY key), key FROM removed;
  -- A reader that missed more than these loads everything again.
  DELETE FROM removals WHERE seq <= last - 10000;
  RETURN NULL;
END $$;
CREATE TRIGGER image_removed AFTER DELETE ON images REFERENCING OLD TABLE AS removed
  FOR EACH STATEMENT EXECUTE FUNCTION note_removals();

CREATE FUNCTION count_objects() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  IF tg_op = 'INSERT' THEN
    UPDATE collections SET objects = objects + 1 WHERE key = new.collection;
  ELSE
    UPDATE collections SET objects = objects - 1 WHERE key = old.collection;
  END IF;
  RETURN NULL;
END $$;
CREATE TRIGGER object_counted AFTER INSERT OR DELETE ON objects
  FOR EACH ROW EXECUTE FUNCTION count_objects();

CREATE FUNCTION drop_originals() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  INSERT INTO dropped_originals (sha256) SELECT DISTINCT sha256 FROM removed
    ON CONFLICT DO NOTHING;
  RETURN NULL;
END $$;
CREATE TRIGGER original_dropped AFTER DELETE ON original_files REFERENCING OLD TABLE AS removed
  FOR EACH STATEMENT EXECUTE FUNCTION drop_originals();

INSERT INTO pliant (version) VALUES (1);
INSERT INTO feed (key, timeline)
  SELECT key, substr(pg_walfile_name(pg_current_wal_insert_lsn()), 1, 8)
  FROM (VALUES (0), (1)) parts (key);
)sql";

}  // namespace pliant::postgres
