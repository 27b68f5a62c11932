// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/conditions.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "server/http/body_file.h"
#include "server/http/compression.h"
#include "server/http/problem.h"
#include "server/http/request_reader.h"

namespace pliant::server {

namespace {

constexpr std::string_view kWeak = "W/";

// The tags of all headers of that name, with their quotes and W/. A malformed list ends there.
std::vector<std::string> TagsIn(const Request& request, const std::string& name) {
  std::vector<std::string> tags;
  const auto [begin, end] = request.headers.equal_range(name);
  for (auto header = begin; header != end; ++header) {
    std::string_view text = header->second;
    while (true) {
      text.remove_prefix(std::min(text.find_first_not_of(" \t,"), text.size()));
      std::size_t close = 0;
      if (!text.starts_with('*')) {
        const std::size_t open = text.starts_with(kWeak) ? kWeak.size() : 0;
        close = text.substr(open).starts_with('"') ? text.find('"', open + 1) : text.npos;
        if (close == text.npos) break;
      }
      tags.emplace_back(text.substr(0, close + 1));
      text.remove_prefix(close + 1);
    }
  }
  return tags;
}

bool Names(const std::string& tag, const std::string& etag) {
  const std::size_t plain = etag.size() - 1;  // before the last quote
  return tag == "*" || tag == etag ||
         (tag.starts_with(etag.substr(0, plain)) && tag.substr(plain) == kGzipEtagEnd);
}

// The first byte and the number of bytes. Section 14.1.2: "bytes=0-99", "bytes=100-", "bytes=-100".
// Nothing for what is to be ignored.
std::optional<std::pair<std::uint64_t, std::uint64_t>> RangeOf(std::string_view header,
                                                               std::uint64_t bytes) {
  constexpr std::string_view kUnit = "bytes=";
  const std::size_t dash = header.find('-');
  if (!header.starts_with(kUnit) || dash == header.npos) return std::nullopt;
  const bool from_end = dash == kUnit.size();
  const bool open = dash + 1 == header.size();
  const auto first = Digits(header.substr(kUnit.size(), dash - kUnit.size()));
  const auto last = Digits(header.substr(dash + 1));
  if (from_end ? !last : !first || (!open && (!last || *last < *first))) return std::nullopt;
  const std::uint64_t begin = from_end ? bytes - std::min(*last, bytes) : *first;
  if (begin >= bytes) {
    throw ProblemError("range_not_satisfiable",
                       fmt::format("The range is outside the file of {} bytes.", bytes),
                       {.content_range = fmt::format("bytes */{}", bytes)});
  }
  const std::uint64_t end = from_end || open ? bytes : std::min(*last, bytes - 1) + 1;
  return std::pair(begin, end - begin);
}

void TakePart(const Request& request, const std::string& etag, Response& response) {
  // Section 13.1.5. A date never matches: no answer has a Last-Modified.
  const std::string if_range = request.header("If-Range");
  if (response.header("Accept-Ranges") != "bytes" || request.headers.count("Range") != 1 ||
      (!if_range.empty() && if_range != etag)) {
    return;
  }
  const std::uint64_t bytes = response.file ? response.file->size() : response.body.size();
  const auto range = RangeOf(request.header("Range"), bytes);
  if (!range) return;
  const auto [first, length] = *range;
  response.status = 206;
  response.headers.emplace_back("Content-Range",
                                fmt::format("bytes {}-{}/{}", first, first + length - 1, bytes));
  if (response.file) {
    response.file = std::make_shared<BodyFile>(std::move(response.file), first, length);
  } else {
    response.body = response.body.substr(first, length);
  }
}

}  // namespace

bool IfMatchHolds(const Request& request, const std::string& etag) {
  const std::vector<std::string> tags = TagsIn(request, "If-Match");
  return !request.headers.contains("If-Match") ||
         std::any_of(tags.begin(), tags.end(),
                     [&](const std::string& tag) { return Names(tag, etag); });
}

std::string NamedByIfNoneMatch(const Request& request, const std::string& etag) {
  for (std::string tag : TagsIn(request, "If-None-Match")) {
    if (tag.starts_with(kWeak)) tag.erase(0, kWeak.size());
    if (Names(tag, etag)) return tag == "*" ? etag : tag;
  }
  return {};
}

Response UnderConditions(const Request& request, Response whole) {
  const std::string etag = whole.header("ETag");
  const bool decided = whole.status != 200 && whole.status != 304;  // by a handler
  if (request.method != "GET" || decided || etag.empty()) return whole;
  if (!IfMatchHolds(request, etag)) {
    throw ProblemError("precondition_failed",
                       "Precondition failed: the resource does not match If-Match.");
  }
  const std::string named = NamedByIfNoneMatch(request, etag);
  if (named.empty()) {
    TakePart(request, etag, whole);
    return whole;
  }
  Response unchanged{.status = 304, .headers = std::move(whole.headers)};
  for (auto& [name, value] : unchanged.headers) {
    if (name == "ETag") value = named;
  }
  return unchanged;
}

}  // namespace pliant::server
