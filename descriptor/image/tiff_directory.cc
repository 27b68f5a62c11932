// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/tiff_directory.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

#include "descriptor/image/byte_reader.h"

namespace pliant {
namespace {

constexpr std::uint16_t kShort = 3;
constexpr std::uint16_t kLong = 4;
constexpr std::size_t kEntryBytes = 12;
constexpr std::uint16_t kMostEntries = 1000;   // files have some thirty
constexpr std::uint32_t kMostPieces = 65'536;  // decoders prepare anew for every strip or tile

// Bytes a value of TIFF 6.0's types 1 (BYTE) to 12 (DOUBLE).
constexpr std::array<std::uint8_t, 13> kTypeBytes = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8};

// The tags that say how large a picture is, where its data lie, and how much memory they take.
struct Wanted {
  std::uint16_t tag;
  const char* name;
};
constexpr std::array kWanted = {
    Wanted{256, "ImageWidth"},   Wanted{257, "ImageLength"},     Wanted{258, "BitsPerSample"},
    Wanted{273, "StripOffsets"}, Wanted{274, "Orientation"},     Wanted{277, "SamplesPerPixel"},
    Wanted{278, "RowsPerStrip"}, Wanted{279, "StripByteCounts"}, Wanted{322, "TileWidth"},
    Wanted{323, "TileLength"},   Wanted{324, "TileOffsets"},     Wanted{325, "TileByteCounts"},
};

// One entry of the directory: a tag with `count` values of a type, at `at` in the file.
struct Entry {
  std::uint16_t tag = 0;
  std::uint16_t type = 0;
  std::uint32_t count = 0;
  std::size_t at = 0;
  bool inside = false;  // the values lie within the file
};

std::optional<Entry> ReadEntry(const ByteReader& reader, std::size_t at) {
  const auto tag = reader.U16(at);
  const auto type = reader.U16(at + 2);
  const auto count = reader.U32(at + 4);
  const auto offset = reader.U32(at + 8);
  if (!tag || !type || !count || !offset) return std::nullopt;
  const std::uint64_t bytes =
      std::uint64_t{*count} * (*type < kTypeBytes.size() ? kTypeBytes[*type] : 1);
  const std::size_t values = bytes <= 4 ? at + 8 : std::size_t{*offset};
  return Entry{*tag, *type, *count, values, values + bytes <= reader.size()};
}

bool IsWholeNumber(const Entry& entry) { return entry.type == kShort || entry.type == kLong; }

std::uint32_t Value(const ByteReader& reader, const Entry& entry, std::size_t i) {
  return entry.type == kShort ? std::uint32_t{reader.U16(entry.at + 2 * i).value_or(0)}
                              : reader.U32(entry.at + 4 * i).value_or(0);
}

// The first directory's position and number of entries.
struct Place {
  std::size_t first = 0;
  std::uint16_t entries = 0;
};

std::optional<Place> FindDirectory(const ByteReader& reader) {
  const auto start = reader.U32(4);
  if (reader.U16(2) != std::uint16_t{42} || !start) return std::nullopt;
  const auto entries = reader.U16(*start);
  if (!entries) return std::nullopt;
  return Place{std::size_t{*start} + 2, *entries};
}

ByteReader ReaderOf(Bytes bytes) { return {bytes, ByteReader(bytes, false).StartsWith(0, "MM")}; }

class DirectoryReader {
 public:
  explicit DirectoryReader(Bytes bytes) : reader_(ReaderOf(bytes)) {}

  TiffDirectory Read() {
    const auto place = FindDirectory(reader_);
    if (!place) return directory_;
    if (place->entries > kMostEntries) {
      Refuse("its directory has " + std::to_string(place->entries) + " entries");
    } else {
      ReadEntries(*place);
      TakeValues();
      if (!DataInside(273, 279) || !DataInside(324, 325)) directory_.complete = false;
    }
    return directory_;
  }

 private:
  void Refuse(const std::string& why) {
    if (directory_.defect.empty()) directory_.defect = why;
  }

  void ReadEntries(const Place& place) {
    directory_.complete = reader_.U32(place.first + place.entries * kEntryBytes).has_value();
    for (std::size_t i = 0; i < place.entries; ++i) {
      const auto entry = ReadEntry(reader_, place.first + i * kEntryBytes);
      directory_.complete = directory_.complete && entry && entry->inside;
      if (!entry) continue;
      const auto* wanted = std::find_if(kWanted.begin(), kWanted.end(),
                                        [&](const Wanted& w) { return w.tag == entry->tag; });
      if (wanted == kWanted.end()) continue;
      Entry& known = entries_[static_cast<std::size_t>(wanted - kWanted.begin())];
      if (known.tag != 0) {  // decoders differ in which of the two they believe
        Refuse(std::string("it names ") + wanted->name + " twice");
      } else if (entry->count > 0 && !IsWholeNumber(*entry)) {
        Refuse(std::string("its ") + wanted->name + " is no 16 or 32 bit number");
      } else {
        known = *entry;
      }
    }
  }

  const Entry* Find(std::uint16_t tag) const {
    for (const Entry& entry : entries_) {
      if (entry.tag == tag && entry.inside && entry.count > 0) return &entry;
    }
    return nullptr;
  }

  void Take(std::uint16_t tag, std::int64_t* value) const {
    if (const Entry* entry = Find(tag)) *value = Value(reader_, *entry, 0);
  }

  void TakeValues() {
    Take(256, &directory_.width);
    Take(257, &directory_.height);
    Take(277, &directory_.samples);
    Take(278, &directory_.rows_per_strip);
    Take(322, &directory_.tile_width);
    Take(323, &directory_.tile_height);
    if (const Entry* bits = Find(258)) {
      directory_.bits = 0;
      for (std::size_t i = 0; i < bits->count; ++i) {
        directory_.bits = std::max<std::int64_t>(directory_.bits, Value(reader_, *bits, i));
      }
    }
    std::int64_t orientation = 1;
    Take(274, &orientation);
    if (orientation >= 1 && orientation <= 8)
      directory_.orientation = static_cast<int>(orientation);
  }

  // Whether all strips or tiles lie within the file.
  bool DataInside(std::uint16_t offsets_tag, std::uint16_t sizes_tag) {
    const Entry* offsets = Find(offsets_tag);
    if (offsets == nullptr) return true;
    const Entry* sizes = Find(sizes_tag);
    if (offsets->count > kMostPieces) {
      Refuse("it has " + std::to_string(offsets->count) + " strips or tiles");
      return true;
    }
    std::uint64_t total = 0;
    for (std::size_t i = 0; i < offsets->count; ++i) {
      const std::uint64_t size =
          sizes != nullptr && i < sizes->count ? Value(reader_, *sizes, i) : 0;
      if (Value(reader_, *offsets, i) + size > reader_.size()) return false;
      total += size;
    }
    if (total > reader_.size()) Refuse("its strips or tiles lie over one another");
    return true;
  }

  ByteReader reader_;
  TiffDirectory directory_;
  std::array<Entry, kWanted.size()> entries_{};
};

}  // namespace

TiffDirectory ReadTiffDirectory(Bytes bytes) { return DirectoryReader(bytes).Read(); }

int ReadOrientation(Bytes exif) {
  const ByteReader reader = ReaderOf(exif);
  const auto place = FindDirectory(reader);
  if (!place || place->entries > kMostEntries) return 1;
  for (std::size_t i = 0; i < place->entries; ++i) {
    const auto entry = ReadEntry(reader, place->first + i * kEntryBytes);
    if (!entry || entry->tag != 274) continue;
    const bool readable = IsWholeNumber(*entry) && entry->inside && entry->count > 0;
    const std::uint32_t value = readable ? Value(reader, *entry, 0) : 1;
    return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  }
  return 1;
}

}  // namespace pliant
