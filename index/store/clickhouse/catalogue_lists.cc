// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// ClickhouseCatalogue: lists, a page at a time.
#include <algorithm>
#include <tuple>

#include "index/files/fold_case.h"
#include "index/store/clickhouse/clickhouse_catalogue.h"
#include "index/store/clickhouse/query.h"
#include "index/store/facet_count.h"
#include "index/store/list_place.h"
#include "index/store/refusals.h"

namespace pliant::clickhouse {
namespace {

bool IsText(PictureOrder order) {
  return order != PictureOrder::kCreated && order != PictureOrder::kUpdated;
}

bool IsText(ObjectOrder order) { return order == ObjectOrder::kName; }

ListPlace PlaceOf(const PictureOutline& outline, PictureOrder order) {
  ListPlace place;
  place.tie = outline.id;
  place.text = order == PictureOrder::kObject   ? outline.object
               : order == PictureOrder::kSource ? outline.source
                                                : outline.id;
  place.number = order == PictureOrder::kUpdated ? outline.updated_ms : outline.added_ms;
  return place;
}

ListPlace PlaceOf(const ListedObject& object, ObjectOrder order) {
  ListPlace place;
  place.tie = place.text = object.record.object;
  place.number = order == ObjectOrder::kImages    ? static_cast<std::int64_t>(object.record.images)
                 : order == ObjectOrder::kUpdated ? object.updated_ms
                                                  : object.created_ms;
  return place;
}

bool Before(const ListPlace& a, const ListPlace& b, bool is_text) {
  return is_text ? std::tie(a.text, a.tie) < std::tie(b.text, b.tie)
                 : std::tie(a.number, a.tie) < std::tie(b.number, b.tie);
}

// The items of the page, of all that are listed, in the order of the list; `next` is set.
template <typename Item, typename Order>
std::vector<Item> TakePage(std::vector<Item> items, const PageOptions& page, Order order,
                           std::optional<std::string>* next) {
  const bool is_text = IsText(order);
  const auto place = [order](const Item& item) { return PlaceOf(item, order); };
  const auto before = [&](const ListPlace& a, const ListPlace& b) {
    return page.descending ? Before(b, a, is_text) : Before(a, b, is_text);
  };
  if (const auto after = ReadPlace(is_text, page.after)) {
    std::erase_if(items, [&](const Item& item) { return !before(*after, place(item)); });
  }
  const auto limit = static_cast<std::size_t>(page.limit);
  const auto by_place = [&](const Item& a, const Item& b) { return before(place(a), place(b)); };
  const std::size_t sorted = std::min(items.size(), limit);
  std::partial_sort(items.begin(), items.begin() + static_cast<std::ptrdiff_t>(sorted), items.end(),
                    by_place);
  if (items.size() > limit) {
    items.resize(limit);
    *next = WritePlace(is_text, place(items.back()));
  }
  return items;
}

// By object, the pictures of each in order of their ids; without those that have none.
std::map<std::string, std::vector<const PictureOutline*>> ByObject(
    const std::vector<PictureOutline>& outlines) {
  std::map<std::string, std::vector<const PictureOutline*>> objects;
  for (const PictureOutline& outline : outlines) {
    if (!outline.object.empty()) objects[outline.object].push_back(&outline);
  }
  for (auto& [name, pictures] : objects) {
    std::sort(pictures.begin(), pictures.end(),
              [](const auto* a, const auto* b) { return a->id < b->id; });
  }
  return objects;
}

ListedObject Listed(const std::string& name, const std::vector<const PictureOutline*>& pictures) {
  ListedObject object;
  object.record = {name, pictures.size()};
  object.image_id = pictures.front()->id;
  object.created_ms = pictures.front()->added_ms;
  for (const PictureOutline* picture : pictures) {
    object.created_ms = std::min(object.created_ms, picture->added_ms);
    object.updated_ms = std::max(object.updated_ms, picture->updated_ms);
  }
  return object;
}

}  // namespace

std::vector<ImageRecord> ClickhouseCatalogue::RecordsOf(const Snapshot& now,
                                                        const CollectionEntry& collection,
                                                        const std::vector<std::string>& ids) {
  std::map<std::string, ImageRecord> found;
  for (const PictureState& state : states_.ByIds(collection.key, ids, now.log)) {
    found.emplace(state.record.id, RecordOf(state, collection.name));
  }
  std::vector<ImageRecord> records;
  for (const std::string& id : ids) {
    if (const auto record = found.find(id); record != found.end()) {
      records.push_back(std::move(record->second));
    }
  }
  return records;
}

std::vector<PictureOutline> ClickhouseCatalogue::Select(const Snapshot& now,
                                                        const Selection& which) {
  std::vector<PictureOutline> outlines =
      states_.Outlines({.collection = now.registry->Require(which.collection).key,
                        .log = now.log,
                        .object = which.object,
                        .metadata = true});
  const std::vector<std::u32string> words = FoldedWords(which.text);
  std::erase_if(outlines, [&](const PictureOutline& outline) {
    return (!words.empty() && !OccurIn(words, {outline.id, outline.object, outline.source})) ||
           (!which.filter.empty() && !Passes(which.filter, outline.metadata));
  });
  return outlines;
}

PicturePage ClickhouseCatalogue::PageById(const Snapshot& now, const PictureListing& list) {
  const CollectionEntry& collection = now.registry->Require(list.which.collection);
  OutlineQuery query{.collection = collection.key, .log = now.log, .object = list.which.object};
  if (const auto after = ReadPlace(true, list.after)) {
    query.more = std::string(" AND id ") + (list.descending ? "< " : "> ") + Literal(after->tie);
  }
  query.end = std::string(" ORDER BY id") + (list.descending ? " DESC" : "") + " LIMIT " +
              std::to_string(list.limit + 1);
  PicturePage page;
  std::vector<std::string> ids;
  PageOptions rest = list;
  rest.after.clear();
  for (PictureOutline& outline :
       TakePage(states_.Outlines(query), rest, PictureOrder::kId, &page.next)) {
    ids.push_back(std::move(outline.id));
  }
  page.records = RecordsOf(now, collection, ids);
  return page;
}

PicturePage ClickhouseCatalogue::PageAt(const Snapshot& now, const PictureListing& list) {
  const Selection& which = list.which;
  if (which.filter.empty() && which.text.empty() && list.order == PictureOrder::kId &&
      !list.count && list.facets.empty()) {
    return PageById(now, list);
  }
  PicturePage page;
  std::vector<PictureOutline> outlines = Select(now, which);
  if (list.count) page.total = outlines.size();
  if (!list.facets.empty()) {
    FacetCount count(list.facets);
    for (const PictureOutline& outline : outlines) {
      count.BeginItem();
      count.Add(outline.metadata);
    }
    page.facets = count.Result();
  }
  std::vector<std::string> ids;
  for (PictureOutline& outline : TakePage(std::move(outlines), list, list.order, &page.next)) {
    ids.push_back(std::move(outline.id));
  }
  page.records = RecordsOf(now, now.registry->Require(which.collection), ids);
  return page;
}

PicturePage ClickhouseCatalogue::ListPicturePage(const PictureListing& list) {
  return PageAt(snapshots_.Now(), list);
}

void ClickhouseCatalogue::ForEachPicturePage(PictureListing list,
                                             const std::function<void(const PicturePage&)>& work) {
  EachPageAt(snapshots_.Now(), std::move(list), work);
}

void ClickhouseCatalogue::EachPageAt(const Snapshot& now, PictureListing list,
                                     const std::function<void(const PicturePage&)>& work) {
  now.registry->Require(list.which.collection);
  while (true) {
    const PicturePage page = PageAt(now, list);
    snapshots_.RequireKept(now);
    work(page);
    if (!page.next) return;
    list.after = *page.next;
  }
}

void ClickhouseCatalogue::ForEachPictureFeatures(
    PictureListing list, const std::function<void(const PicturePage&)>& look,
    const std::function<void(const ImageRecord&, Bytes features)>& take) {
  const Snapshot now = snapshots_.Now();
  EachPageAt(now, list, look);
  const std::uint32_t collection = now.registry->Require(list.which.collection).key;
  EachPageAt(now, list, [&](const PicturePage& page) {
    std::vector<std::string> ids;
    for (const ImageRecord& record : page.records) ids.push_back(record.id);
    std::map<std::string, std::uint32_t> numbers;
    NumbersByShard wanted;
    for (const PictureState& state : states_.ByIds(collection, ids, now.log)) {
      numbers.emplace(state.record.id, state.picture);
      wanted[state.shard].push_back(state.picture);
    }
    const auto features = states_.Features(wanted);
    for (const ImageRecord& record : page.records) {
      const auto number = numbers.find(record.id);
      const auto blob = number == numbers.end() ? features.end() : features.find(number->second);
      if (blob == features.end()) throw refusals::FeaturesMissing();
      take(record, blob->second);
    }
  });
}

std::vector<ImageRecord> ClickhouseCatalogue::ListPictures(const ListOptions& options) {
  PictureListing list;
  list.which.collection = options.collection;
  list.which.object = options.object;
  list.limit = options.limit;
  if (!options.after_id.empty()) {
    list.after = WritePlace(true, {options.after_id, 0, options.after_id});
  }
  return PageById(snapshots_.Now(), list).records;
}

ObjectPage ClickhouseCatalogue::ListObjectPage(const ObjectListing& list) {
  const Snapshot now = snapshots_.Now();
  // The texts are looked for in the names of objects, not in their pictures.
  Selection which = list.which;
  which.text.clear();
  which.filter = {};
  const std::vector<PictureOutline> outlines = Select(now, which);
  const std::vector<std::u32string> words = FoldedWords(list.which.text);
  FacetCount count(list.facets);
  std::vector<ListedObject> objects;
  for (const auto& [name, pictures] : ByObject(outlines)) {
    if (!words.empty() && !OccurIn(words, {name})) continue;
    std::vector<const PictureOutline*> passing = pictures;
    std::erase_if(passing, [&](const PictureOutline* picture) {
      return !list.which.filter.empty() && !Passes(list.which.filter, picture->metadata);
    });
    if (passing.empty()) continue;
    objects.push_back(Listed(name, pictures));
    count.BeginItem();
    for (const PictureOutline* picture : passing) count.Add(picture->metadata);
  }
  ObjectPage page;
  if (list.count) page.total = objects.size();
  if (!list.facets.empty()) page.facets = count.Result();
  page.records = TakePage(std::move(objects), list, list.order, &page.next);
  return page;
}

std::optional<ObjectRecord> ClickhouseCatalogue::FindObject(const std::string& collection,
                                                            const std::string& object) {
  const Snapshot now = snapshots_.Now();
  const std::uint32_t in = now.registry->Require(collection).key;
  if (object.empty()) return std::nullopt;
  const auto outlines = states_.Outlines({.collection = in, .log = now.log, .object = object});
  if (outlines.empty()) return std::nullopt;
  return ObjectRecord{object, outlines.size()};
}

std::vector<ObjectRecord> ClickhouseCatalogue::ListObjects(const std::string& collection,
                                                           const std::string& after, int limit) {
  ObjectListing list;
  list.which.collection = collection;
  list.limit = limit;
  if (!after.empty()) list.after = WritePlace(true, {after, 0, after});
  std::vector<ObjectRecord> records;
  for (ListedObject& object : ListObjectPage(list).records) {
    records.push_back(std::move(object.record));
  }
  return records;
}

}  // namespace pliant::clickhouse
