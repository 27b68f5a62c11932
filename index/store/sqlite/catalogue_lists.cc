// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/catalogue_lists.h"

#include <optional>
#include <string_view>
#include <utility>

#include "index/store/facet_count.h"
#include "index/store/list_place.h"
#include "index/store/sqlite/row_tests.h"

namespace pliant {
namespace {

// A column that lists are in order of, as SQL, and whether it is text.
struct OrderColumn {
  const char* sql;
  bool is_text;
};

OrderColumn ColumnOf(PictureOrder order) {
  switch (order) {
    case PictureOrder::kId:
      break;
    case PictureOrder::kCreated:
      return {"p.added_ms", false};
    case PictureOrder::kUpdated:
      return {"p.updated_ms", false};
    case PictureOrder::kObject:
      return {"coalesce(o.name, '')", true};
    case PictureOrder::kSource:
      return {"p.source", true};
  }
  return {"p.id", true};
}

OrderColumn ColumnOf(ObjectOrder order) {
  switch (order) {
    case ObjectOrder::kName:
      break;
    case ObjectOrder::kCreated:
      return {"created", false};
    case ObjectOrder::kUpdated:
      return {"updated", false};
    case ObjectOrder::kImages:
      return {"images", false};
  }
  return {"name", true};
}

// What all statements here have: ?1 the collection, ?2 the object; those of pages also ?3 and ?4,
// the place, and ?5, the limit. A parameter can be bound where one with a higher number stands.
constexpr const char* kHasObject = " AND ?2 IS ?2";

struct Query {
  Connection& db;
  Key collection = 0;
  Key object = 0;  // 0 where there is none of that name: the key of no object
  const OrderColumn column;
  const char* tie;
  const PageOptions& page;
};

Cursor Prepare(const Query& query, const std::string& sql) {
  Cursor row = query.db.Prepare(sql);
  row.Bind(query.collection, query.object);
  return row;
}

Cursor PreparePage(const Query& query, std::string sql) {
  const bool is_tie = std::string_view(query.column.sql) == query.tie;
  const std::string place =
      is_tie ? std::string(query.tie) + " {} ?4"
             : std::string("(") + query.column.sql + ", " + query.tie + ") {} (?3, ?4)";
  const auto after = ReadPlace(query.column.is_text, query.page.after);
  if (after) {
    sql += " AND " +
           std::string(place).replace(place.find("{}"), 2, query.page.descending ? "<" : ">");
  }
  const std::string direction = query.page.descending ? " DESC" : "";
  sql += std::string(" ORDER BY ") + query.column.sql + direction;
  if (!is_tie) sql += std::string(", ") + query.tie + direction;
  Cursor row = query.db.Prepare(sql + " LIMIT ?5");
  const ListPlace begin = after.value_or(ListPlace{});
  const int rows = query.page.limit + 1;  // one more says that there is another page
  if (query.column.is_text) {
    row.Bind(query.collection, query.object, begin.text, begin.tie, rows);
  } else {
    row.Bind(query.collection, query.object, begin.number, begin.tie, rows);
  }
  return row;
}

// `read(row, &place)` gives the record of a row, and its place.
template <typename Record, typename Read>
void ReadPage(const Query& query, const std::string& sql, const Read& read,
              ListPage<Record>* page) {
  Cursor row = PreparePage(query, sql);
  ListPlace last;
  while (row.Next()) {
    if (page->records.size() == static_cast<std::size_t>(query.page.limit)) {
      page->next = WritePlace(query.column.is_text, last);
      return;
    }
    page->records.push_back(read(row, &last));
  }
}

// The conditions on pictures; o is the object of p, where one is joined.
std::string PicturesWhere(const Selection& which) {
  std::string where;
  if (!which.object) {
    where = "WHERE p.collection = ?1";
  } else if (which.object->empty()) {
    // +: by the index of objects, else all pictures are read where each has one.
    where = "WHERE +p.collection = ?1 AND p.object IS NULL";
  } else {
    where = "WHERE +p.collection = ?1 AND p.object = ?2";
  }
  if (!which.text.empty()) where += " AND pliant_contains(p.id, o.name, p.source)";
  if (!which.filter.empty()) where += " AND pliant_passes(p.metadata)";
  return where + kHasObject;
}

// The conditions on objects.
std::string ObjectsWhere(const Selection& which) {
  std::string where = "WHERE o.collection = ?1";
  if (which.object) where += " AND o.key = ?2";
  if (!which.text.empty()) where += " AND pliant_contains(o.name)";
  if (!which.filter.empty()) {
    where +=
        " AND EXISTS (SELECT 1 FROM pictures p WHERE p.object = o.key AND "
        "pliant_passes(p.metadata))";
  }
  return where + kHasObject;
}

// ListedObject's columns.
constexpr const char* kSelectObjects =
    "SELECT o.name AS name, "
    "(SELECT count(*) FROM pictures p WHERE p.object = o.key) AS images, "
    "(SELECT min(p.id) FROM pictures p WHERE p.object = o.key) AS first, "
    "(SELECT min(p.added_ms) FROM pictures p WHERE p.object = o.key) AS created, "
    "(SELECT max(p.updated_ms) FROM pictures p WHERE p.object = o.key) AS updated "
    "FROM objects o ";

constexpr const char* kFromPictures = "FROM pictures p LEFT JOIN objects o ON o.key = p.object ";

Key ObjectOf(Connection& db, Key collection, const Selection& which) {
  return which.object ? FindObject(db, collection, *which.object) : 0;
}

ImageRecord ReadPicture(const Cursor& row, PictureOrder order, ListPlace* place) {
  ImageRecord record = ToPicture(row).record;
  place->tie = record.id;
  place->text = order == PictureOrder::kObject   ? record.object
                : order == PictureOrder::kSource ? record.source
                                                 : record.id;
  place->number = order == PictureOrder::kUpdated ? record.updated_ms : record.added_ms;
  return record;
}

ListedObject ReadObject(const Cursor& row, ObjectOrder order, ListPlace* place) {
  ListedObject object;
  object.record = {row.Text(0), static_cast<std::uint64_t>(row.Int(1))};
  if (!row.IsNull(2)) object.image_id = row.Text(2);
  object.created_ms = row.Int(3);
  object.updated_ms = row.Int(4);
  place->tie = place->text = object.record.object;
  place->number = order == ObjectOrder::kImages    ? row.Int(1)
                  : order == ObjectOrder::kUpdated ? object.updated_ms
                                                   : object.created_ms;
  return object;
}

// Rows of an item, 0 = one of its own, and metadata; those of an item one after the other.
std::vector<Facet> CountFacets(Cursor row, const std::vector<std::string>& keys) {
  FacetCount count(keys);
  Key item = 0;
  while (row.Next()) {
    if (row.Int(0) == 0 || row.Int(0) != item) count.BeginItem();
    item = row.Int(0);
    count.Add(row.Text(1));
  }
  return count.Result();
}

}  // namespace

PicturePage SelectPicturePage(Connection& db, Key collection, const PictureListing& list) {
  const RowTestScope scope(db, list.which);
  const Query query{db,     collection, ObjectOf(db, collection, list.which), ColumnOf(list.order),
                    "p.id", list};
  const std::string where = PicturesWhere(list.which);
  PicturePage page;
  ReadPage(
      query, SelectPictureSql() + where,
      [&](const Cursor& row, ListPlace* place) { return ReadPicture(row, list.order, place); },
      &page);
  if (list.count) {
    page.total = static_cast<std::uint64_t>(
        Prepare(query, std::string("SELECT count(*) ") + kFromPictures + where).One().Int(0));
  }
  if (!list.facets.empty()) {
    page.facets = CountFacets(
        Prepare(query, std::string("SELECT 0, p.metadata ") + kFromPictures + where), list.facets);
  }
  return page;
}

ObjectPage SelectObjectPage(Connection& db, Key collection, const ObjectListing& list) {
  const RowTestScope scope(db, list.which);
  const Query query{db,     collection, ObjectOf(db, collection, list.which), ColumnOf(list.order),
                    "name", list};
  const std::string where = ObjectsWhere(list.which);
  ObjectPage page;
  ReadPage(
      query, "SELECT * FROM (" + (kSelectObjects + where) + ") WHERE ?2 IS ?2",
      [&](const Cursor& row, ListPlace* place) { return ReadObject(row, list.order, place); },
      &page);
  if (list.count) {
    page.total = static_cast<std::uint64_t>(
        Prepare(query, "SELECT count(*) FROM objects o " + where).One().Int(0));
  }
  if (!list.facets.empty()) {
    std::string pictures =
        "SELECT p.object, p.metadata FROM objects o JOIN pictures p ON p.object = o.key " + where;
    if (!list.which.filter.empty()) pictures += " AND pliant_passes(p.metadata)";
    page.facets = CountFacets(Prepare(query, pictures + " ORDER BY o.key"), list.facets);
  }
  return page;
}

std::uint64_t DeletePicturesWhere(Connection& db, Key collection, const Selection& which) {
  std::vector<Key> keys;  // a statement must not see what it deletes
  {
    const RowTestScope scope(db, which);
    Cursor row = db.Prepare(std::string("SELECT p.key ") + kFromPictures + PicturesWhere(which));
    row.Bind(collection, ObjectOf(db, collection, which));
    while (row.Next()) keys.push_back(row.Int(0));
  }
  for (const Key key : keys) db.Prepare("DELETE FROM pictures WHERE key = ?").Bind(key).Run();
  db.Prepare(
        "DELETE FROM objects WHERE collection = ? AND NOT EXISTS (SELECT 1 FROM pictures p WHERE "
        "p.object = objects.key)")
      .Bind(collection)
      .Run();
  return keys.size();
}

}  // namespace pliant
