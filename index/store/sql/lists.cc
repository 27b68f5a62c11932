// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lists of images and objects, and what is removed by the same conditions: the catalogue and the
// writer.
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "index/files/text.h"
#include "index/store/sql/access.h"
#include "index/store/sql/originals.h"
#include "index/store/sql/rows.h"
#include "index/store/writer.h"

namespace pliant {
namespace {

// Where a page of a list ended (ListPage::next), as text. Private to index/store/.
//
// The value that the list is in order of, there, and what decides between equal ones.
struct ListPlace {
  std::string text;
  std::int64_t number = 0;
  std::string tie;
};

using Json = nlohmann::json;

std::string WritePlace(bool is_text, const ListPlace& place) {
  const Json value = is_text ? Json(place.text) : Json(place.number);
  // Text in a database may be any bytes when another program has written it.
  return Json::array({value, place.tie}).dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::optional<ListPlace> ReadPlace(bool is_text, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  const bool fits = json.is_array() && json.size() == 2 && json[1].is_string() &&
                    (is_text ? json[0].is_string() : json[0].is_number_integer());
  if (!fits) {
    throw Error(ErrorCode::kInvalidArgument, "after_invalid", "invalid position for this list");
  }
  ListPlace place;
  place.tie = json[1].get<std::string>();
  if (is_text) {
    place.text = json[0].get<std::string>();
  } else {
    place.number = json[0].get<std::int64_t>();
  }
  return place;
}

// What lists are in order of, as SQL, and whether it is text.
struct OrderColumn {
  std::string sql;
  bool is_text;
};

OrderColumn ColumnOf(Connection& db, const ImageListing& list, Query& query) {
  switch (list.order) {
    case ImageOrder::kId:
      break;
    case ImageOrder::kCreated:
      return {"p.added_ms", false};
    case ImageOrder::kUpdated:
      return {"p.updated_ms", false};
    case ImageOrder::kObject:
      return {"coalesce(o.natural_name, '')", true};
    case ImageOrder::kSource:
      return {db.NaturalKeyOf("p.source"), true};
    case ImageOrder::kMetadata:
      return {db.MetadataOrderOf(query, "p", list.order_key), true};
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
  return {"natural_name", true};
}

struct Place {
  const OrderColumn column;
  const char* tie;
  const PageOptions& page;
};

Cursor PreparePage(Connection& db, const Place& place, Query query) {
  const bool is_tie = place.column.sql == place.tie;
  if (const auto after = ReadPlace(place.column.is_text, place.page.after)) {
    const std::string beyond = place.page.descending ? " < " : " > ";
    const std::string tie = query.Bind(after->tie);
    query.sql += " AND ";
    if (is_tie) {
      query.sql += place.tie + beyond + tie;
    } else {
      const std::string value =
          place.column.is_text ? query.Bind(after->text) : query.Bind(after->number);
      query.sql +=
          "(" + place.column.sql + ", " + place.tie + ")" + beyond + "(" + value + ", " + tie + ")";
    }
  }
  const std::string direction = place.page.descending ? " DESC" : "";
  query.sql += " ORDER BY " + place.column.sql + direction;
  if (!is_tie) query.sql += std::string(", ") + place.tie + direction;
  // One more says that there is another page.
  query.sql += " LIMIT " + query.Bind(std::int64_t{place.page.limit} + 1);
  return db.Prepare(query);
}

// `read(row, &place)` gives the record of a row, and its place.
template <typename Record, typename Read>
void ReadPage(Connection& db, const Place& place, const Query& query, const Read& read,
              ListPage<Record>* page) {
  Cursor row = PreparePage(db, place, query);
  ListPlace last;
  while (row.Next()) {
    if (page->records.size() == static_cast<std::size_t>(place.page.limit)) {
      page->next = WritePlace(place.column.is_text, last);
      return;
    }
    page->records.push_back(read(row, &last));
  }
}

// `select` and the conditions on images; o is the object of p, where one is joined.
Query ImagesOf(Connection& db, const std::string& select, Key collection, const Selection& which) {
  Query query{select};
  const std::string in = query.Bind(collection);
  if (!which.object) {
    query.sql += "WHERE p.collection = " + in;
  } else {
    // +: by the index of objects, else all images are read where each has one.
    query.sql += "WHERE +p.collection = " + in;
    query.sql += which.object->empty()
                     ? " AND p.object IS NULL"
                     : " AND p.object = " + query.Bind(FindObject(db, collection, *which.object));
  }
  if (!which.text.empty()) {
    query.sql += " AND " + db.Contains(query, which.text, {"p.id", "o.name", "p.source"});
  }
  if (!which.filter.empty()) query.sql += " AND " + db.Passes(query, "p", which.filter);
  return query;
}

// `select` and the conditions on objects.
Query ObjectsOf(Connection& db, const std::string& select, Key collection, const Selection& which) {
  Query query{select};
  query.sql += "WHERE o.collection = " + query.Bind(collection);
  if (which.object) {
    query.sql += " AND o.key = " + query.Bind(FindObject(db, collection, *which.object));
  }
  if (!which.text.empty()) query.sql += " AND " + db.Contains(query, which.text, {"o.name"});
  if (!which.filter.empty()) {
    query.sql += " AND EXISTS (SELECT 1 FROM images p WHERE p.object = o.key AND " +
                 db.Passes(query, "p", which.filter) + ")";
  }
  return query;
}

// ListedObject's columns.
constexpr const char* kSelectObjects =
    "SELECT o.name AS name, "
    "(SELECT count(*) FROM images p WHERE p.object = o.key) AS images, "
    "(SELECT min(p.id) FROM images p WHERE p.object = o.key) AS first, "
    "(SELECT min(p.added_ms) FROM images p WHERE p.object = o.key) AS created, "
    "(SELECT max(p.updated_ms) FROM images p WHERE p.object = o.key) AS updated, "
    "o.natural_name AS natural_name FROM objects o ";

constexpr const char* kFromImages = " FROM images p LEFT JOIN objects o ON o.key = p.object ";

ImageRecord ReadImage(const Cursor& row, const ImageListing& list, ListPlace* place) {
  ImageRecord record = ToImage(row).record;
  place->tie = record.id;
  place->text = list.order == ImageOrder::kObject   ? NaturalKey(record.object)
                : list.order == ImageOrder::kSource ? NaturalKey(record.source)
                : list.order == ImageOrder::kMetadata
                    ? MetadataOrder(record.metadata, list.order_key)
                    : record.id;
  place->number = list.order == ImageOrder::kUpdated ? record.updated_ms : record.added_ms;
  return record;
}

ListedObject ReadObject(const Cursor& row, ObjectOrder order, ListPlace* place) {
  ListedObject object;
  object.record = {row.Text(0), static_cast<std::uint64_t>(row.Int(1))};
  if (!row.IsNull(2)) object.image_id = row.Text(2);
  object.created_ms = row.Int(3);
  object.updated_ms = row.Int(4);
  place->tie = object.record.object;
  place->text = NaturalKey(place->tie);
  place->number = order == ObjectOrder::kImages    ? row.Int(1)
                  : order == ObjectOrder::kUpdated ? object.updated_ms
                                                   : object.created_ms;
  return object;
}

void EachPage(Connection& db, Key collection, ImageListing list,
              const std::function<void(const ImagePage&)>& work) {
  while (true) {
    const ImagePage page = SelectImagePage(db, collection, list);
    work(page);
    if (!page.next) return;
    list.after = *page.next;
  }
}

// How many. Also removes objects that have no image left.
std::uint64_t DeleteImagesWhere(Connection& db, Key collection, const Selection& which) {
  std::vector<Key> keys;  // a statement must not see what it deletes
  {
    Cursor row =
        db.Prepare(ImagesOf(db, std::string("SELECT p.key") + kFromImages, collection, which));
    while (row.Next()) keys.push_back(row.Int(0));
  }
  db.Prepare("DELETE FROM images WHERE " + db.IsAmong("key", "?1")).Bind(std::span(keys)).Run();
  db.Prepare(
        "DELETE FROM objects WHERE collection = ? AND NOT EXISTS (SELECT 1 FROM images p WHERE "
        "p.object = objects.key)")
      .Bind(collection)
      .Run();
  return keys.size();
}

}  // namespace

ImagePage SelectImagePage(Connection& db, Key collection, const ImageListing& list) {
  ImagePage page;
  Query query = ImagesOf(db, kSelectImage, collection, list.which);
  const OrderColumn column = ColumnOf(db, list, query);
  ReadPage(
      db, {column, "p.id", list}, query,
      [&](const Cursor& row, ListPlace* place) { return ReadImage(row, list, place); }, &page);
  const auto select = [&](const std::string& columns) {
    return ImagesOf(db, "SELECT " + columns + kFromImages, collection, list.which);
  };
  if (list.count) page.total = db.Prepare(select("count(*)")).One().Count(0);
  if (!list.facets.empty()) {
    page.facets = db.CountFacets(select("p.key AS item, " + db.MetadataOf("p") + " AS metadata"),
                                 list.facets);
  }
  return page;
}

ImagePage Catalogue::ListImagePage(const ImageListing& list) {
  return access_.Read([&](Connection& db) {
    return SelectImagePage(db, pliant::RequireCollection(db, list.which.collection).key, list);
  });
}

void Catalogue::ForEachImagePage(ImageListing list,
                                 const std::function<void(const ImagePage&)>& work) {
  access_.Read([&](Connection& db) {
    EachPage(db, pliant::RequireCollection(db, list.which.collection).key, list, work);
  });
}

void Catalogue::ForEachImageFeatures(
    ImageListing list, const std::function<void(const ImagePage&)>& look,
    const std::function<void(const ImageRecord&, Bytes features)>& take) {
  access_.Read([&](Connection& db) {
    const Key collection = pliant::RequireCollection(db, list.which.collection).key;
    EachPage(db, collection, list, look);
    EachPage(db, collection, list, [&](const ImagePage& page) {
      for (const ImageRecord& record : page.records) {
        take(record, ReadFeaturesBlob(db, KeyOfImage(db, collection, record.id)));
      }
    });
  });
}

ObjectPage Catalogue::ListObjectPage(const ObjectListing& list) {
  return access_.Read([&](Connection& db) {
    const Key collection = pliant::RequireCollection(db, list.which.collection).key;
    ObjectPage page;
    Query query =
        ObjectsOf(db, std::string("SELECT * FROM (") + kSelectObjects, collection, list.which);
    query.sql += ") AS listed WHERE TRUE";
    ReadPage(
        db, {ColumnOf(list.order), "name", list}, query,
        [&](const Cursor& row, ListPlace* place) { return ReadObject(row, list.order, place); },
        &page);
    if (list.count) {
      page.total =
          db.Prepare(ObjectsOf(db, "SELECT count(*) FROM objects o ", collection, list.which))
              .One()
              .Count(0);
    }
    if (!list.facets.empty()) {
      query = ObjectsOf(db,
                        "SELECT p.object AS item, " + db.MetadataOf("p") +
                            " AS metadata FROM objects o JOIN images p ON p.object = o.key ",
                        collection, list.which);
      if (!list.which.filter.empty()) {
        query.sql += " AND " + db.Passes(query, "p", list.which.filter);
      }
      query.sql += " ORDER BY o.key";
      page.facets = db.CountFacets(query, list.facets);
    }
    return page;
  });
}

std::uint64_t Writer::RemoveWhere(const Selection& which) {
  std::uint64_t removed = 0;
  access_.Write(
      [&](Connection& db) {
        removed = DeleteImagesWhere(db, RequireCollection(db, which.collection).key, which);
      },
      {.reclaim = true, .alone = true});  // it may be all there is
  originals_.Tidy();
  return removed;
}

}  // namespace pliant
