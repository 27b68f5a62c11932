// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/conditions.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "server/http/body_file.h"

namespace pliant::server {

namespace {

constexpr std::array<std::string_view, 2> kCodingSuffixes = {"-gzip\"", "-br\""};

struct EntityTag {
  bool weak = false;
  std::string text;  // with its quotes; "*" = any
};

// Those of all headers of that name. A list that is not well-formed ends where it is not.
std::vector<EntityTag> TagsIn(const Request& request, const std::string& name) {
  std::vector<EntityTag> tags;
  const auto [begin, end] = request.headers.equal_range(name);
  for (auto header = begin; header != end; ++header) {
    std::string_view text = header->second;
    while (true) {
      const std::size_t at = text.find_first_not_of(" \t,");
      if (at == std::string_view::npos) break;
      text.remove_prefix(at);
      if (text.front() == '*') {
        tags.push_back({.text = "*"});
        text.remove_prefix(1);
        continue;
      }
      EntityTag tag{.weak = text.starts_with("W/"), .text = {}};
      if (tag.weak) text.remove_prefix(2);
      const std::size_t close = text.starts_with('"') ? text.find('"', 1) : std::string_view::npos;
      if (close == std::string_view::npos) break;
      tag.text = text.substr(0, close + 1);
      text.remove_prefix(close + 1);
      tags.push_back(std::move(tag));
    }
  }
  return tags;
}

// The tag of the same thing uncompressed.
std::string Plain(const std::string& tag) {
  for (const std::string_view suffix : kCodingSuffixes) {
    if (tag.ends_with(suffix)) return tag.substr(0, tag.size() - suffix.size()) + '"';
  }
  return tag;
}

bool Means(const std::string& tag, const std::string& etag) {
  return tag == "*" || tag == etag || Plain(tag) == etag;
}

std::string HeaderOf(const Response& response, const std::string& name) {
  const auto it = std::find_if(response.headers.begin(), response.headers.end(),
                               [&](const auto& header) { return header.first == name; });
  return it == response.headers.end() ? std::string() : it->second;
}

struct ByteRange {
  std::size_t first = 0;
  std::size_t last = 0;  // inclusive
};

std::optional<std::uint64_t> Digits(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || text.front() == '-' || end != text.data() + text.size()) return std::nullopt;
  if (error == std::errc::result_out_of_range) return UINT64_MAX;  // beyond any end
  if (error != std::errc()) return std::nullopt;
  return value;
}

// Section 14.1.2: "bytes=0-99", "bytes=100-", "bytes=-100". Nothing for what is to be ignored.
std::optional<ByteRange> SingleRange(const std::string& header, std::size_t bytes) {
  constexpr std::string_view kUnit = "bytes=";
  if (!header.starts_with(kUnit)) return std::nullopt;
  const std::string_view spec = std::string_view(header).substr(kUnit.size());
  const std::size_t dash = spec.find('-');
  if (dash == std::string_view::npos) return std::nullopt;
  const auto second = Digits(spec.substr(dash + 1));
  if (dash == 0) {  // so many at the end
    if (!second) return std::nullopt;
    if (*second == 0 || bytes == 0) throw RangeOutside(bytes);
    return ByteRange{bytes - static_cast<std::size_t>(std::min<std::uint64_t>(*second, bytes)),
                     bytes - 1};
  }
  const auto first = Digits(spec.substr(0, dash));
  const bool open = dash + 1 == spec.size();
  if (!first || (!open && (!second || *second < *first))) return std::nullopt;
  if (*first >= bytes) throw RangeOutside(bytes);
  const std::uint64_t last = open ? bytes - 1 : std::min<std::uint64_t>(*second, bytes - 1);
  return ByteRange{static_cast<std::size_t>(*first), static_cast<std::size_t>(last)};
}

// Section 13.1.5. A date never matches: no answer has a Last-Modified.
bool IfRangeHolds(const Request& request, const std::string& etag) {
  const std::string wanted = request.header("If-Range");
  return wanted.empty() || wanted == etag;
}

void TakePart(const Request& request, const std::string& etag, Response& response) {
  if (HeaderOf(response, "Accept-Ranges") != "bytes" || request.headers.count("Range") != 1 ||
      !IfRangeHolds(request, etag)) {
    return;
  }
  const std::size_t bytes = response.file ? response.file->size() : response.body.size();
  const auto range = SingleRange(request.header("Range"), bytes);
  if (!range) return;
  response.status = 206;
  response.headers.emplace_back("Content-Range", "bytes " + std::to_string(range->first) + "-" +
                                                     std::to_string(range->last) + "/" +
                                                     std::to_string(bytes));
  const std::size_t length = range->last - range->first + 1;
  if (response.file) {
    response.file = std::make_shared<BodyFile>(std::move(response.file), range->first, length);
  } else {
    response.body = response.body.substr(range->first, length);
  }
}

}  // namespace

RangeOutside::RangeOutside(std::size_t bytes)
    : ProblemError("range_not_satisfiable", "The range is outside of what there is.") {
  ContentRange("bytes */" + std::to_string(bytes));
}

bool IfMatchHolds(const Request& request, const std::string& etag) {
  if (!request.headers.contains("If-Match")) return true;
  const std::vector<EntityTag> tags = TagsIn(request, "If-Match");
  return std::any_of(tags.begin(), tags.end(),
                     [&](const EntityTag& tag) { return !tag.weak && Means(tag.text, etag); });
}

std::string NamedByIfNoneMatch(const Request& request, const std::string& etag) {
  for (const EntityTag& tag : TagsIn(request, "If-None-Match")) {
    if (Means(tag.text, etag)) return tag.text == "*" ? etag : tag.text;
  }
  return {};
}

Response UnderConditions(const Request& request, Response whole) {
  const std::string etag = HeaderOf(whole, "ETag");
  const bool decided = whole.status != 200 && whole.status != 304;  // by a handler
  if (request.method != "GET" || decided || etag.empty()) return whole;
  if (!IfMatchHolds(request, etag)) {
    throw ProblemError("precondition_failed", "What is stored is not what If-Match names.");
  }
  const std::string named = NamedByIfNoneMatch(request, etag);
  if (!named.empty()) {
    whole.status = 304;
    whole.body.clear();
    whole.file.reset();
    whole.content_type.clear();
    for (auto& [name, value] : whole.headers) {
      if (name == "ETag") value = named;
    }
    return whole;
  }
  TakePart(request, etag, whole);
  return whole;
}

}  // namespace pliant::server
