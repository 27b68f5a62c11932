// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/bulk_items.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "descriptor/base/base64.h"
#include "descriptor/base/format_bytes.h"
#include "descriptor/base/strings.h"
#include "index/files/image_files.h"
#include "index/files/text.h"
#include "index/json/record_csv.h"
#include "server/http/json.h"
#include "server/http/message.h"
#include "server/http/parameters.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr std::size_t kBlock = 512;
constexpr std::size_t kMaxNameBytes = 64 * 1024;

[[noreturn]] void ThrowDamaged(std::size_t at, const char* why) {
  throw ProblemError("bad_request", "The TAR archive " + std::string(why) + ", at byte " +
                                        std::to_string(at) + ".");
}

[[noreturn]] void ThrowTooMany(const std::string& where, const std::string& what) {
  ThrowInvalid("body", "The " + where + " has more than " + std::to_string(kMostBulkItems) + " " +
                           what + ". Send it in parts.");
}

// A field of a header: text up to its first zero.
std::string_view TextOf(std::string_view field) { return field.substr(0, field.find('\0')); }

// Octal digits, with spaces and zeros around, or GNU's base-256 (first bit set). Nothing for
// anything else.
std::optional<std::uint64_t> NumberIn(std::string_view field) {
  if (!field.empty() && (static_cast<unsigned char>(field[0]) & 0x80) != 0) {
    std::uint64_t value = static_cast<unsigned char>(field[0]) & 0x7f;
    for (const char c : field.substr(1)) {
      if (value >> 55 != 0) return std::nullopt;
      value = value << 8 | static_cast<unsigned char>(c);
    }
    return value;
  }
  const std::size_t begin = field.find_first_not_of(' ');
  if (begin == std::string_view::npos) return 0;
  const std::string_view digits =
      field.substr(begin, field.find_first_of(std::string_view(" \0", 2), begin) - begin);
  return digits.empty() ? 0 : NumberOf<std::uint64_t>(digits, 8);
}

// The sum of the header's bytes, its own field taken as spaces.
bool IsHeader(std::string_view block) {
  constexpr std::size_t kBegin = 148;
  constexpr std::size_t kEnd = 156;
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < block.size(); ++i) {
    sum += i >= kBegin && i < kEnd ? ' ' : static_cast<unsigned char>(block[i]);
  }
  return NumberIn(block.substr(kBegin, kEnd - kBegin)) == sum;
}

bool IsZero(std::string_view block) {
  return std::all_of(block.begin(), block.end(), [](char c) { return c == '\0'; });
}

// Records "length key=value\n" of a pax header (POSIX.1-2001).
struct Pax {
  std::optional<std::string> path;
  std::optional<std::uint64_t> size;
};

Pax ReadPax(std::string_view text, std::size_t at) {
  Pax pax;
  while (!text.empty()) {
    const std::size_t space = std::min(text.find(' '), text.size());
    const auto length = NumberOf<std::uint64_t>(text.substr(0, space));
    if (!length || *length > text.size() || *length < space + 3 || text[*length - 1] != '\n') {
      ThrowDamaged(at, "has a damaged pax header");
    }
    const std::string_view record = text.substr(space + 1, *length - space - 2);
    const std::size_t equals = record.find('=');
    if (equals == std::string_view::npos) ThrowDamaged(at, "has a damaged pax header");
    const std::string_view key = record.substr(0, equals);
    const std::string_view value = record.substr(equals + 1);
    if (key == "path") pax.path = std::string(value);
    if (key == "size" && !(pax.size = NumberOf<std::uint64_t>(value))) {
      ThrowDamaged(at, "has a damaged pax header");
    }
    text.remove_prefix(*length);
  }
  return pax;
}

std::string NameIn(std::string_view header) {
  const std::string_view name = TextOf(header.substr(0, 100));
  const bool is_ustar = header.substr(257, 6) == std::string_view("ustar\0", 6);
  const std::string_view prefix = is_ustar ? TextOf(header.substr(345, 155)) : std::string_view();
  return prefix.empty() ? std::string(name) : std::string(prefix) + "/" + std::string(name);
}

// The file's own name, and the path of its folder without "." and ".."; empty without.
std::pair<std::string, std::string> SplitName(const std::string& path) {
  std::string folder;
  std::size_t begin = 0;
  for (std::size_t slash = 0; (slash = path.find('/', begin)) != std::string::npos;
       begin = slash + 1) {
    const std::string part = path.substr(begin, slash - begin);
    if (!part.empty() && part != "." && part != "..") folder += (folder.empty() ? "" : "/") + part;
  }
  return {path.substr(begin), std::move(folder)};
}

enum class Kind { kOrdinary, kHidden, kSystem };

// By the first of the file's folders that is not an ordinary one, or by the file's own name.
Kind KindOf(const std::string& folder, const std::string& own_name) {
  for (const std::string& part : Split(folder, '/')) {
    if (part.starts_with('.')) return Kind::kHidden;
    if (IsSystemFolder(part)) return Kind::kSystem;
  }
  return own_name.starts_with('.') ? Kind::kHidden : Kind::kOrdinary;
}

std::string Above(const std::string& folder) {
  return folder.substr(0, folder.rfind('/') + 1);  // npos + 1 = 0
}

std::string Stem(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  return dot == std::string::npos || dot == 0 ? name : name.substr(0, dot);
}

// The JSON body of an upload.
const Route& LineForm() {
  static const Route form{
      .name = "line",
      .method = "POST",
      .pattern = "/",
      .body = BodyKind::kImageOrJson,
      .parameters = {{"id", ""}, {"object", ""}, Parameter("metadata", "").Json(), {"source", ""}},
      .handler = {}};
  return form;
}

}  // namespace

BulkItems::BulkItems(std::string_view body, const std::string& type, BulkDefaults defaults)
    : defaults_(std::move(defaults)),
      is_tar_(type == kTarType),
      items_(is_tar_            ? ReadTar(body)
             : type == kCsvType ? ReadTable(body)
                                : ReadLines(body)) {
  if (size() == 0) {
    throw ProblemError("missing_parameter", "The body has no images.", {.parameter = "body"});
  }
  const bool has_folders = std::any_of(items_.begin(), items_.end(), [](const Raw& file) {
    return !SplitName(file.name).second.empty();
  });
  common_way_ = CommonWay();
  object_is_folder_ =
      defaults_.object_from == "folder" || (defaults_.object_from == "auto" && has_folders);
}

std::vector<BulkItems::Raw> BulkItems::ReadLines(std::string_view body) {
  std::vector<Raw> lines;
  std::size_t number = 0;
  for (std::size_t begin = 0; begin < body.size();) {
    const std::size_t end = std::min(body.find('\n', begin), body.size());
    const std::string_view line = body.substr(begin, end - begin);
    ++number;
    if (line.find_first_not_of(" \t\r") != std::string_view::npos) {
      lines.push_back({"line " + std::to_string(number), line});
    }
    begin = end + 1;
    if (lines.size() > kMostBulkItems) {
      ThrowTooMany("body", "lines");
    }
  }
  return lines;
}

std::vector<BulkItems::Raw> BulkItems::ReadTable(std::string_view body) {
  const auto read = CsvRows(body);
  if (!read) ThrowInvalid("body", "The table has a quote that is not closed.");
  const std::vector<std::string_view>& rows = *read;
  if (rows.empty()) return {};
  if (rows.size() > kMostBulkItems + 1) {
    ThrowTooMany("table", "rows");
  }
  separator_ = SeparatorOf(rows[0]);
  for (const std::string& name : CsvFields(rows[0], separator_)) {
    columns_.push_back(Lower(Trimmed(name)));
    const bool is_known = columns_.back() == "id" || columns_.back() == "object" ||
                          columns_.back() == "file" || columns_.back() == "labels";
    if (is_known && std::ranges::count(columns_, columns_.back()) == 1) continue;
    ThrowInvalid("body", "Unknown or repeated column \"" + Shown(name) +
                             "\". A table has the columns id, object, file and labels.");
  }
  if (std::ranges::find(columns_, "id") == columns_.end()) {
    ThrowInvalid("body", "The table has no column id. Its first row must name the columns.");
  }
  std::vector<Raw> items;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    items.push_back({"row " + std::to_string(i + 1), rows[i]});
  }
  return items;
}

std::vector<BulkItems::Raw> BulkItems::ReadTar(std::string_view archive) {
  std::vector<Raw> files;
  Pax next;  // headers of the next file
  std::size_t at = 0;
  while (true) {
    if (at == archive.size() && at > 0) return files;  // some writers leave the end out
    if (archive.size() - at < kBlock) ThrowDamaged(at, "ends too early");
    const std::string_view header = archive.substr(at, kBlock);
    if (IsZero(header)) return files;
    if (at == 0 && archive.starts_with("\x1f\x8b")) {
      throw ProblemError("bad_request", "The TAR archive is compressed. Send it uncompressed.");
    }
    if (!IsHeader(header)) ThrowDamaged(at, at == 0 ? "has no valid header" : "is damaged");
    const char type = header[156];
    const auto stated = NumberIn(header.substr(124, 12));
    const bool is_about_next = type == 'x' || type == 'L';
    const auto size = is_about_next || !next.size ? stated : next.size;
    const bool has_content = type < '1' || type > '6';  // else a link, device or folder
    if (!size || (has_content && *size > archive.size() - at - kBlock)) {
      ThrowDamaged(at, "ends too early");
    }
    const std::string_view content =
        archive.substr(at + kBlock, has_content ? static_cast<std::size_t>(*size) : 0);
    if (is_about_next && content.size() > kMaxNameBytes) ThrowDamaged(at, "has too long a header");
    if (type == 'x') {
      next = ReadPax(content, at);
    } else if (type == 'L') {
      next.path = std::string(TextOf(content));
    } else if (type != 'g' && type != 'K') {
      const std::string name = next.path.value_or(NameIn(header));
      const auto [own_name, folder] = SplitName(name);
      const bool is_file = (type == '0' || type == '\0' || type == '7') && !own_name.empty();
      const Kind kind = KindOf(folder, own_name);
      if (is_file && kind == Kind::kOrdinary) files.push_back({name, content});
      if (is_file && kind == Kind::kSystem) ++system_files_;
      if (files.size() > kMostBulkItems) {
        ThrowTooMany("archive", "files");
      }
      next = {};
    }
    const std::size_t blocks = (content.size() + kBlock - 1) / kBlock;
    // The last file need not be filled up.
    at = std::min(archive.size(), at + kBlock + blocks * kBlock);
  }
}

std::string BulkItems::CommonWay() const {
  std::optional<std::string> common;
  for (const Raw& file : items_) {
    const std::string above = Above(SplitName(file.name).second);
    if (above.empty()) continue;
    if (!common) common = above;
    const auto [end, other] =
        std::mismatch(common->begin(), common->end(), above.begin(), above.end());
    common->erase(end, common->end());
    *common = Above(*common);
  }
  return common.value_or("");
}

std::string BulkItems::NameOf(std::size_t i) const { return ToDisplayText(items_.at(i).name); }

BulkItem BulkItems::Item(std::size_t i) const {
  const Raw& item = items_.at(i);
  if (item.content.size() > defaults_.max_item_bytes) {
    throw ProblemError("body_too_large",
                       "An item can have at most " + FormatBytes(defaults_.max_item_bytes) + ".");
  }
  if (!columns_.empty()) return OfRow(item.content);
  return is_tar_ ? OfFile(item) : OfLine(item.content);
}

BulkItem BulkItems::OfLine(std::string_view line) const {
  Request upload;
  upload.content_type = "application/json";
  upload.body = line;
  const Parameters parameters(LineForm(), upload, "line");
  const ImageText* image = parameters.Image();
  if (image == nullptr) {
    throw ProblemError("missing_parameter", "image or image_url is required.",
                       {.parameter = "image"});
  }
  BulkItem item;
  item.url = image->url;
  if (image->base64) {
    auto decoded = std::make_shared<std::vector<std::uint8_t>>();
    if (!Base64Decode(*image->base64, decoded.get())) {
      ThrowInvalid("image", "image must be valid base64.");
    }
    item.request.bytes = *decoded;
    item.decoded = std::move(decoded);
  }
  item.request.id = parameters.Text("id");
  item.request.object = parameters.Text("object").value_or(defaults_.object);
  item.request.source = parameters.Text("source").value_or("");
  item.request.metadata = parameters.Text("metadata").value_or(defaults_.metadata);
  return item;
}

BulkItem BulkItems::OfRow(std::string_view row) const {
  const std::vector<std::string> fields = CsvFields(row, separator_);
  if (fields.size() != columns_.size()) {
    ThrowInvalid("row", "The row has " + std::to_string(fields.size()) + " fields instead of " +
                            std::to_string(columns_.size()) + ".");
  }
  BulkItem item;
  item.change.emplace();
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (columns_[i] == "id") item.request.id = fields[i];
    if (columns_[i] == "object") item.change->object = fields[i];
    if (columns_[i] == "file") item.change->source = fields[i];
    if (columns_[i] != "labels" || Trimmed(fields[i]).empty()) continue;
    if (!ParseJson(fields[i], "labels").is_object()) {
      ThrowInvalid("labels", "labels must be a JSON object, such as {\"shop\": \"east\"}.");
    }
    item.change->metadata = fields[i];
  }
  return item;
}

std::string BulkItems::ObjectOf(const std::string& folder, const std::string& name) const {
  if (!object_is_folder_ || (folder.empty() && defaults_.object_from == "auto")) return Stem(name);
  return folder.substr(folder.starts_with(common_way_) ? common_way_.size() : Above(folder).size());
}

BulkItem BulkItems::OfFile(const Raw& file) const {
  const auto [name, folder] = SplitName(file.name);
  BulkItem item;
  item.request.bytes = {reinterpret_cast<const std::uint8_t*>(file.content.data()),
                        file.content.size()};
  item.request.source = ToDisplayText(name);
  item.request.metadata = defaults_.metadata;
  if (!defaults_.object.empty()) {
    item.request.object = defaults_.object;
  } else if (defaults_.object_from != "none") {
    item.request.object = ToDisplayText(ObjectOf(folder, name));
  }
  return item;
}

}  // namespace pliant::server
