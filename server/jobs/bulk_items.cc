// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/bulk_items.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "descriptor/base/base64.h"
#include "descriptor/base/format_bytes.h"
#include "index/files/text.h"
#include "server/http/json.h"
#include "server/http/message.h"
#include "server/http/parameters.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

// The file's own name, and the way to its folder without "." and ".."; empty without.
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

std::string Above(const std::string& folder) {
  return folder.substr(0, folder.rfind('/') + 1);  // npos + 1 = 0
}

// What is above all folders that are in folders, with a slash at its end: what was packed.
std::string CommonWay(const std::vector<TarFile>& files) {
  std::optional<std::string> common;
  for (const TarFile& file : files) {
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

std::string Stem(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  return dot == std::string::npos || dot == 0 ? name : name.substr(0, dot);
}

std::optional<std::string> TextIn(Json& item, const char* name) {
  const auto found = item.find(name);
  if (found == item.end() || found->is_null()) return std::nullopt;
  if (!found->is_string()) ThrowInvalid(name, std::string(name) + " must be text.");
  return std::move(found->get_ref<std::string&>());
}

}  // namespace

BulkItems::BulkItems(std::string_view body, const std::string& type, BulkDefaults defaults)
    : defaults_(std::move(defaults)) {
  if (type == kTarType) {
    files_ = ReadTar(body, kMostBulkItems);
    // What systems write beside the files themselves.
    std::erase_if(files_,
                  [](const TarFile& file) { return SplitName(file.name).first.starts_with('.'); });
    const bool has_folders = std::any_of(files_.begin(), files_.end(), [](const TarFile& file) {
      return !SplitName(file.name).second.empty();
    });
    common_way_ = CommonWay(files_);
    object_is_folder_ =
        defaults_.object_from == "folder" || (defaults_.object_from == "auto" && has_folders);
  } else {
    std::size_t number = 0;
    for (std::size_t begin = 0; begin < body.size();) {
      const std::size_t end = std::min(body.find('\n', begin), body.size());
      const std::string_view line = body.substr(begin, end - begin);
      ++number;
      if (line.find_first_not_of(" \t\r") != std::string_view::npos) {
        lines_.emplace_back(number, line);
      }
      begin = end + 1;
      if (lines_.size() > kMostBulkItems) {
        ThrowInvalid("body", "The body has more than " + std::to_string(kMostBulkItems) +
                                 " lines: send it in parts.");
      }
    }
  }
  if (size() == 0) {
    throw ProblemError("missing_parameter", "The body has no images.").Parameter("body");
  }
}

std::string BulkItems::NameOf(std::size_t i) const {
  if (i < lines_.size()) return "line " + std::to_string(lines_[i].first);
  return ToDisplayText(files_.at(i).name);
}

BulkItem BulkItems::Item(std::size_t i) const {
  const std::size_t bytes =
      i < lines_.size() ? lines_[i].second.size() : files_.at(i).content.size();
  if (bytes > defaults_.max_item_bytes) {
    throw ProblemError("body_too_large",
                       "Each may have " + FormatBytes(defaults_.max_item_bytes) + ".");
  }
  return i < lines_.size() ? OfLine(lines_[i].second) : OfFile(files_.at(i));
}

BulkItem BulkItems::OfLine(std::string_view line) const {
  Json json = ParseJsonObject(std::string(line), "line");
  for (const auto& [name, value] : json.items()) {
    if (name != "image" && name != "image_url" && name != "id" && name != "object" &&
        name != "metadata" && name != "source") {
      throw ProblemError("unknown_parameter",
                         "There is no '" + ToDisplayText(name.substr(0, 64)) +
                             "', only image, image_url, id, object, metadata and "
                             "source.")
          .Parameter(ToDisplayText(name.substr(0, 64)));
    }
  }
  const auto image = TextIn(json, "image");
  BulkItem item;
  item.url = TextIn(json, "image_url");
  if (image && item.url) ThrowInvalid("image_url", "image_url and image exclude each other.");
  if (!image && !item.url) {
    throw ProblemError("missing_parameter", "image or image_url is required.").Parameter("image");
  }
  if (image) {
    auto decoded = std::make_shared<std::vector<std::uint8_t>>();
    if (!Base64Decode(*image, decoded.get())) ThrowInvalid("image", "image is no base64.");
    item.request.bytes = *decoded;
    item.decoded = std::move(decoded);
  }
  item.request.id = TextIn(json, "id");
  item.request.object = TextIn(json, "object").value_or(defaults_.object);
  item.request.source = TextIn(json, "source").value_or("");
  item.request.metadata = defaults_.metadata;
  if (const auto metadata = json.find("metadata"); metadata != json.end()) {
    if (!metadata->is_object()) ThrowInvalid("metadata", "metadata must be a JSON object.");
    item.request.metadata = ToText(*metadata);
  }
  return item;
}

std::string BulkItems::ObjectOf(const std::string& folder, const std::string& name) const {
  if (!object_is_folder_ || (folder.empty() && defaults_.object_from == "auto")) return Stem(name);
  return folder.substr(folder.starts_with(common_way_) ? common_way_.size() : Above(folder).size());
}

BulkItem BulkItems::OfFile(const TarFile& file) const {
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
