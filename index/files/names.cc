// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/names.h"

#include <vector>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "index/files/text.h"

namespace pliant {
namespace {

constexpr std::size_t kMaxMetadataBytes = 64 * 1024;
constexpr int kMaxMetadataDepth = 32;
constexpr std::size_t kMaxMetadataNames = 1000;  // of one object

[[noreturn]] void ThrowInvalid(const std::string& reason, const std::string& message) {
  throw Error(ErrorCode::kInvalidArgument, reason, message);
}

void CheckText(std::string_view text, std::size_t max_bytes, const std::string& field) {
  if (text.size() > max_bytes || !IsValidUtf8(text) || HasControlCharacter(text)) {
    ThrowInvalid(field + "_invalid", field + " must be UTF-8 without control characters, at most " +
                                         std::to_string(max_bytes) + " bytes.");
  }
}

void CheckLooks(std::string_view text, const std::string& field) {
  if (LooksAsItIs(text)) return;
  ThrowInvalid(
      field + "_invalid",
      field + " must not contain characters that are invisible or change the writing direction.");
}

bool IsCollectionName(std::string_view name) {
  return !name.empty() && name.size() <= 64 && name != "." && name != ".." && IsNameOf(name, "._-");
}

std::string CollectionNameRule(std::string_view name) {
  return "must be 1 to 64 letters, digits or any of . _ -, not \"" +
         ToDisplayText(name.substr(0, 80)) + "\".";
}

}  // namespace

void CheckImageId(std::string_view id) {
  if (id.empty() || id.size() > 128 || id == "." || id == ".." || !IsNameOf(id, "._~:@-")) {
    ThrowInvalid("id_invalid", "id must be 1 to 128 letters, digits or any of . _ ~ : @ -, not \"" +
                                   ToDisplayText(id.substr(0, 140)) + "\".");
  }
}

void CheckCollectionName(std::string_view name) {
  if (!IsCollectionName(name)) {
    ThrowInvalid("collection_invalid", "A collection name " + CollectionNameRule(name));
  }
}

void CheckAliasName(std::string_view name) {
  if (!IsCollectionName(name))
    ThrowInvalid("alias_invalid", "An alias " + CollectionNameRule(name));
}

void CheckDisplayName(std::string_view name) {
  if (name.empty()) return;
  CheckText(name, 200, "display_name");
  CheckLooks(name, "display_name");
}

void CheckName(std::string_view name, const std::string& field) {
  CheckText(name, 512, field);
  CheckLooks(name, field);
  if (name == "." || name == "..") {  // which no URL could reach (RFC 3986, section 5.2.4)
    ThrowInvalid(field + "_invalid", field + " must not be \".\" or \"..\".");
  }
  if (!name.empty() && name.find_first_not_of(' ') == std::string_view::npos) {
    ThrowInvalid(field + "_invalid", field + " must not be only spaces.");
  }
}

void CheckObject(std::string_view object) { CheckName(object, "object"); }

void CheckSource(std::string_view source) {
  CheckText(source, 4096, "source");
  CheckLooks(source, "source");
}

std::string CanonicalMetadata(const std::string& metadata) {
  if (metadata.size() > kMaxMetadataBytes) {
    ThrowInvalid("metadata_invalid", "metadata can have at most 64 KiB.");
  }
  using Event = nlohmann::json::parse_event_t;
  bool too_deep = false;
  bool too_many = false;
  std::vector<std::size_t> names;  // how many, of the objects that are open
  const auto watch = [&](int depth, Event event, nlohmann::json&) {
    too_deep = too_deep || depth > kMaxMetadataDepth;
    if (event == Event::object_start) names.push_back(0);
    if (event == Event::object_end) names.pop_back();
    if (event == Event::key && ++names.back() > kMaxMetadataNames) too_many = true;
    return !too_deep && !too_many;
  };
  const auto json = nlohmann::json::parse(metadata, watch, false);
  if (too_deep) ThrowInvalid("metadata_invalid", "metadata can have at most 32 levels of nesting.");
  if (too_many) {
    ThrowInvalid("metadata_invalid", "metadata can have at most 1000 keys in one object.");
  }
  if (!json.is_object()) ThrowInvalid("metadata_invalid", "metadata must be a valid JSON object.");
  std::string canonical = json.dump();  // may be longer: 1e9 is 1000000000.0
  if (canonical.size() > kMaxMetadataBytes) {
    ThrowInvalid("metadata_invalid",
                 "metadata can have at most 64 KiB, with its numbers written out.");
  }
  return canonical;
}

std::string MergeMetadata(const std::string& metadata, const std::string& patch) {
  if (patch == "null") return "{}";
  auto merged = nlohmann::json::parse(metadata);
  merged.merge_patch(nlohmann::json::parse(CanonicalMetadata(patch)));
  return CanonicalMetadata(merged.dump());
}

}  // namespace pliant
