// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Many images in one body: lines of JSON (NDJSON) with base64 or addresses, or a TAR archive (POSIX
// ustar with pax headers, and GNU's long names). Or new names and labels of stored images: CSV.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "index/records/records.h"

namespace pliant::server {

inline constexpr std::size_t kMostBulkItems = 10'000;

// Defaults for the images of a body.
struct BulkDefaults {
  std::string object;                     // also instead of the objects that a TAR's names give
  std::string metadata = "{}";            // a JSON object
  std::string object_from;                // of a TAR: "auto", "folder", "stem" or "none"
  std::size_t max_item_bytes = SIZE_MAX;  // longer lines and files are refused, each by itself
};

// An image of a body. The request's bytes are those of the body, or `decoded`; none when it has to
// be fetched from `url` first.
struct BulkItem {
  AddRequest request;
  std::shared_ptr<const std::vector<std::uint8_t>> decoded = {};
  std::optional<std::string> url = {};
  std::optional<ImageChange> change = {};  // of the stored image with the request's id
};

// The items of a body, which must outlive it. An item is parsed only by Item(). Immutable and
// thread-safe.
class BulkItems {
 public:
  // Throws ProblemError: "bad_request" for a damaged archive, "missing_parameter" for a body
  // without items, "invalid_parameter" for too many. `type`: kTarType, kCsvType, or one that
  // IsNdjsonType knows.
  BulkItems(std::string_view body, const std::string& type, BulkDefaults defaults);

  std::size_t size() const { return items_.size(); }
  // Of a TAR: left out, as FindImages() leaves files out.
  std::uint64_t system_files() const { return system_files_; }
  // For people; known also for items that are wrong. "line 3", or the file's name.
  std::string NameOf(std::size_t i) const;
  // Throws ProblemError that says what is wrong with it: "invalid_json", "missing_parameter",
  // "invalid_parameter", "unknown_parameter", "body_too_large".
  BulkItem Item(std::size_t i) const;

 private:
  struct Raw {
    std::string name;          // of a file as stored, with its folders; may be any bytes
    std::string_view content;  // inside the body
  };

  std::vector<Raw> ReadTar(std::string_view archive);
  static std::vector<Raw> ReadLines(std::string_view body);
  std::vector<Raw> ReadTable(std::string_view body);
  std::string CommonWay() const;
  BulkItem OfLine(std::string_view line) const;
  BulkItem OfRow(std::string_view row) const;
  BulkItem OfFile(const Raw& file) const;
  std::string ObjectOf(const std::string& folder, const std::string& name) const;

  const BulkDefaults defaults_;
  const bool is_tar_;
  std::uint64_t system_files_ = 0;
  std::vector<std::string> columns_;  // of CSV; empty = something else
  char separator_ = ',';
  std::vector<Raw> items_;
  bool object_is_folder_ = false;
  std::string common_way_;  // above all folders that are in folders; with a slash at its end
};

}  // namespace pliant::server
