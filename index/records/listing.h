// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lists of images and objects, page by page: selection, order and counts. Plain values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "index/records/filter.h"
#include "index/records/records.h"

namespace pliant {

inline constexpr std::size_t kMaxTextBytes = 512;  // of Selection::text
inline constexpr std::size_t kMaxFacets = 16;
inline constexpr std::size_t kFacetValues = 100;  // listed values of one key

// Selects images of a collection. For objects: those with at least one selected image.
struct Selection {
  std::string collection = kDefaultCollection;
  std::optional<std::string> object;  // its images; "": images without an object
  Filter filter;                      // metadata must pass
  // Words separated by spaces. Each must occur in the id, the object or the source (for objects: in
  // the name), in any case (FoldCase of index/files/text.h). Empty: all.
  std::string text;

  bool all() const { return !object && filter.empty() && text.empty(); }
};

// Names of objects and files are in natural order: "(2)" before "(10)" (NaturalKey of
// index/files/text.h).
enum class ImageOrder { kId, kCreated, kUpdated, kObject, kSource, kMetadata };
enum class ObjectOrder { kName, kCreated, kUpdated, kImages };

// Counts the values of one metadata key over the whole list. A list counts once for each of its
// values. Values that are lists or objects are omitted.
struct Facet {
  struct Value {
    FilterValue value;
    std::uint64_t count = 0;
  };
  std::string key;
  std::vector<Value> values;  // the most frequent, at most kFacetValues
  std::uint64_t without = 0;  // number without the key
  bool complete = true;       // false: some values are not listed
};

// The options of a page of any list.
struct PageOptions {
  bool descending = false;
  std::string after;   // ListPage::next of the last page, of the same selection and order
  int limit = 100;     // 1..1000
  bool count = false;  // fill ListPage::total
  std::vector<std::string> facets;  // keys of the metadata; at most kMaxFacets
};

struct ImageListing : PageOptions {
  Selection which;
  ImageOrder order = ImageOrder::kId;  // ties by id
  std::string order_key;               // of the metadata, for kMetadata (MetadataOrder)
};

struct ObjectListing : PageOptions {
  Selection which;
  ObjectOrder order = ObjectOrder::kName;  // ties by name
};

// A page shows one state of the collection. A record whose position changes between two pages can
// be on both or on neither. Every other record is on exactly one page.
template <typename Record>
struct ListPage {
  std::vector<Record> records;
  std::optional<std::string> next;     // absent: this is the last page
  std::optional<std::uint64_t> total;  // over all pages
  std::vector<Facet> facets;           // over all pages, in the order asked for
};

using ImagePage = ListPage<ImageRecord>;

// An object in a list.
struct ListedObject {
  ObjectRecord record;
  std::string image_id;         // its first image by id
  std::int64_t created_ms = 0;  // when its oldest image was added
  std::int64_t updated_ms = 0;  // when one of its images was last added or changed
};

using ObjectPage = ListPage<ListedObject>;

// Throw kInvalidArgument: "limit_invalid", "filter_invalid", "text_invalid" (too long, not UTF-8),
// "facets_invalid" (too many, or a key twice).
void CheckSelection(const Selection& which);
void CheckListing(const Selection& which, const PageOptions& page);

}  // namespace pliant
