// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/postgres/schema.h"

#include <utility>

#include "index/store/sql/schema.h"

namespace pliant::postgres {
namespace {

// Text is in order of its bytes everywhere. Some references are added below, once the tables that
// they name are there. The longer names first.
constexpr std::pair<std::string_view, std::string_view> kNames[] = {
    {"INTEGER REFERENCES vocabularies (key) ON DELETE SET NULL", "BIGINT"},
    {"INTEGER PRIMARY KEY AUTOINCREMENT", "BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY"},
    {" key INTEGER PRIMARY KEY,", " key BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,"},
    {"INTEGER", "BIGINT"},
    {"TEXT", "TEXT COLLATE \"C\""},
    {"BLOB", "BYTEA"},
    {"REAL", "DOUBLE PRECISION"},
    {" WITHOUT ROWID", ""}};

// What a database of many writers needs beside. Keys are given in order of commits: what writes
// holds the row of `feed` from its first statement to the end of its commit.
constexpr const char* kOwn = R"sql(
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

ALTER TABLE collections ADD FOREIGN KEY (active_vocabulary) REFERENCES vocabularies (key)
  ON DELETE SET NULL;
ALTER TABLE job_inputs ADD FOREIGN KEY (job) REFERENCES jobs (id) ON DELETE CASCADE;
ALTER TABLE job_items ADD FOREIGN KEY (job) REFERENCES jobs (id) ON DELETE CASCADE;
ALTER TABLE images ADD COLUMN fields JSONB NOT NULL;  -- the metadata, for filters (filter_sql.h)
CREATE INDEX images_by_fields ON images USING gin (fields jsonb_path_ops);
-- They do not compress, and are read whole.
ALTER TABLE features ALTER COLUMN data SET STORAGE EXTERNAL;
ALTER TABLE originals ALTER COLUMN data SET STORAGE EXTERNAL;
ALTER TABLE image_words ALTER COLUMN data SET STORAGE EXTERNAL;

CREATE TABLE removals (
  seq BIGINT PRIMARY KEY,              -- without gaps
  image BIGINT NOT NULL
);

-- Programs that have jobs or requests, each with the time at which it last said that it lives.
CREATE TABLE processes (
  id TEXT COLLATE "C" PRIMARY KEY,
  seen TIMESTAMPTZ NOT NULL
);

-- Text is compared whatever its case as FoldCase (index/files/text.h) does it.
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

}  // namespace

std::string SchemaSql() {
  std::string sql = kTables;
  for (const auto& [name, here] : kNames) {
    for (std::size_t at = sql.find(name); at != sql.npos; at = sql.find(name, at + here.size())) {
      sql.replace(at, name.size(), here);
    }
  }
  return sql + kOwn;
}

}  // namespace pliant::postgres
