// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/json.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <set>
#include <vector>

#include <fmt/format.h>

#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr const char* kBase64 = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr const char* kBase64Url =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

std::string Encode64(const std::uint8_t* data, std::size_t bytes, const char* alphabet, bool pad) {
  std::string text;
  text.reserve((bytes + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes; i += 3) {
    const std::size_t have = std::min<std::size_t>(3, bytes - i);
    std::uint32_t group = data[i] << 16;
    if (have > 1) group |= data[i + 1] << 8;
    if (have > 2) group |= data[i + 2];
    for (std::size_t j = 0; j < 4; ++j) {
      if (j <= have) {
        text += alphabet[(group >> (18 - 6 * j)) & 63];
      } else if (pad) {
        text += '=';
      }
    }
  }
  return text;
}

Json Parse(const std::string& text, const std::string& name, Json::value_t top,
           const char* top_name) {
  const auto fail = [&](const std::string& why) {
    return ProblemError("invalid_json", name + " " + why).Parameter(name);
  };
  bool too_deep = false;
  bool too_many = false;
  std::vector<std::set<std::string>> names;  // of the objects that are open
  std::string twice;
  const auto watch = [&](int depth, Json::parse_event_t event, const Json& parsed) {
    const bool opens = event == Json::parse_event_t::object_start ||
                       event == Json::parse_event_t::array_start;  // the top has depth 0
    if (opens && depth >= kMaxJsonDepth) too_deep = true;
    if (event == Json::parse_event_t::object_start) names.emplace_back();
    if (event == Json::parse_event_t::object_end) names.pop_back();
    if (event == Json::parse_event_t::key) {
      const std::string& key = parsed.get_ref<const std::string&>();
      if (!names.back().insert(key).second && twice.empty()) twice = "'" + key.substr(0, 64) + "'";
      if (names.back().size() > kMaxJsonNames) too_many = true;
    }
    return !too_deep && !too_many;  // what is refused here is not kept
  };
  Json json = Json::parse(text, watch, /*allow_exceptions=*/false);
  if (too_deep) throw fail(fmt::format("is nested more than {} deep.", kMaxJsonDepth));
  if (too_many) throw fail(fmt::format("has more than {} names in one object.", kMaxJsonNames));
  if (json.is_discarded()) throw fail("is not valid JSON.");
  if (!twice.empty()) throw fail("has " + twice + " more than once.");
  if (json.type() != top) throw fail(fmt::format("must be a JSON {}.", top_name));
  return json;
}

}  // namespace

Json ParseJsonObject(const std::string& text, const std::string& name) {
  return Parse(text, name, Json::value_t::object, "object");
}

Json ParseJsonArray(const std::string& text, const std::string& name) {
  return Parse(text, name, Json::value_t::array, "array");
}

std::string Base64(const void* data, std::size_t bytes) {
  return Encode64(static_cast<const std::uint8_t*>(data), bytes, kBase64, true);
}

bool Base64Decode(std::string_view text, std::vector<std::uint8_t>* bytes) {
  static const std::array<std::int8_t, 256> values = [] {
    std::array<std::int8_t, 256> made{};
    made.fill(-1);
    for (int i = 0; i < 64; ++i)
      made[static_cast<unsigned char>(kBase64[i])] = static_cast<std::int8_t>(i);
    return made;
  }();
  constexpr std::string_view kData = "data:";
  constexpr std::string_view kMark = ";base64,";
  constexpr std::size_t kMaxTypeBytes = 256;
  if (text.starts_with(kData)) {
    const std::size_t mark = text.substr(0, kMaxTypeBytes).find(kMark);
    if (mark == std::string_view::npos) return false;
    text.remove_prefix(mark + kMark.size());
  }
  if (text.size() % 4 == 0) {
    for (int i = 0; i < 2 && text.ends_with('='); ++i) text.remove_suffix(1);
  }
  bytes->clear();
  bytes->reserve(text.size() / 4 * 3 + 2);
  std::uint32_t group = 0;
  int bits = 0;
  for (const char c : text) {
    const int value = values[static_cast<unsigned char>(c)];
    if (value < 0) return false;
    group = (group << 6 | static_cast<std::uint32_t>(value)) & 0xffff;
    bits += 6;
    if (bits >= 8) {
      bits -= 8;
      bytes->push_back(static_cast<std::uint8_t>(group >> bits & 0xff));
    }
  }
  return text.size() % 4 != 1 && (group & ((1U << bits) - 1)) == 0;
}

std::string Base64UrlEncode(const std::string& bytes) {
  return Encode64(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), kBase64Url,
                  false);
}

bool Base64UrlDecode(const std::string& text, std::string* bytes) {
  const std::string alphabet = kBase64Url;
  bytes->clear();
  std::uint32_t group = 0;
  int bits = 0;
  for (const char c : text) {
    const std::size_t value = alphabet.find(c);
    if (value == std::string::npos) return false;
    group = group << 6 | static_cast<std::uint32_t>(value);
    bits += 6;
    if (bits >= 8) {
      bits -= 8;
      *bytes += static_cast<char>(group >> bits & 0xff);
    }
  }
  // One form for each value: no left-over character, no stray bits.
  return text.size() % 4 != 1 && (group & ((1U << bits) - 1)) == 0;
}

}  // namespace pliant::server
