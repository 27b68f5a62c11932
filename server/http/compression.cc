// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/compression.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <regex>

#include <zlib.h>

#include "descriptor/base/strings.h"

namespace pliant::server {

namespace {

// Long answers are compressed at about 100 MB/s, short ones better.
constexpr int kGzipLevel = 6;
constexpr int kGzipLevelOfLong = 1;
constexpr int kGzipWindowBits = 15 + 16;  // 16: a gzip header and trailer
constexpr int kGzipMemory = 8;

// Empty on failure.
std::string Gzipped(const std::string& body) {
  z_stream stream{};
  const int level = body.size() >= Compressor::kLongBytes ? kGzipLevelOfLong : kGzipLevel;
  if (deflateInit2(&stream, level, Z_DEFLATED, kGzipWindowBits, kGzipMemory, Z_DEFAULT_STRATEGY) !=
      Z_OK) {
    return {};
  }
  std::string packed(deflateBound(&stream, static_cast<uLong>(body.size())), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(body.data()));
  stream.avail_in = static_cast<uInt>(body.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const bool whole = deflate(&stream, Z_FINISH) == Z_STREAM_END;
  packed.resize(whole ? stream.total_out : 0);
  deflateEnd(&stream);
  return packed;
}

// "0", "0.5", "1.000" in thousandths; -1 = no q-value.
int ThousandthsOf(const std::string& text) {
  static const std::regex form(R"(0(\.[0-9]{0,3})?|1(\.0{0,3})?)");
  return std::regex_match(text, form) ? static_cast<int>(std::lround(std::stod(text) * 1000)) : -1;
}

}  // namespace

std::map<std::string, int> WeightsOf(std::string_view list) {
  std::map<std::string, int> weights;
  for (const std::string& entry : Split(list, ',')) {
    const std::size_t semicolon = std::min(entry.find(';'), entry.size());
    const std::string name = Lower(Trimmed(std::string_view(entry).substr(0, semicolon)));
    int weight = 1000;
    if (semicolon < entry.size()) {
      const std::string q = Lower(Trimmed(std::string_view(entry).substr(semicolon + 1)));
      weight = q.starts_with("q=") ? ThousandthsOf(q.substr(2)) : -1;
    }
    if (weight >= 0 && !name.empty()) weights.emplace(name, weight);
  }
  return weights;
}

bool PrefersGzip(std::string_view accept_encoding) {
  std::map<std::string, int> weights = WeightsOf(accept_encoding);
  for (const char* name :
       {"x-gzip", "*"}) {  // its earlier name (RFC 9110, section 8.4.1.3), or any
    if (const auto other = weights.find(name); other != weights.end()) {
      weights.emplace("gzip", other->second);
    }
  }
  return weights["gzip"] > 0 && weights["gzip"] >= weights["identity"];
}

bool IsCompressible(std::string_view content_type) {
  constexpr std::array<std::string_view, 5> kTypes = {
      "application/json", "application/problem+json", "application/javascript",
      "application/x-ndjson", "image/svg+xml"};
  const std::string type = Lower(Trimmed(content_type.substr(0, content_type.find(';'))));
  return type.starts_with("text/") || std::find(kTypes.begin(), kTypes.end(), type) != kTypes.end();
}

void Compressor::Compress(const Request& request, Response& response) {
  if (!IsCompressible(response.content_type)) return;
  // Also for answers that are too short now: caches must not mix them up.
  response.headers.emplace_back("Vary", "Accept-Encoding");
  const std::size_t bytes = response.body.size();
  std::string accepted;
  const auto [begin, end] = request.headers.equal_range("Accept-Encoding");
  for (auto header = begin; header != end; ++header) accepted += header->second + ",";
  const bool partial = response.status == 206;
  if (!PrefersGzip(accepted) || partial || bytes < kFewestBytes || bytes > kMostBytes) return;
  const bool is_long = bytes >= kLongBytes;
  if (is_long && --free_ < 0) {
    ++free_;
    return;
  }
  std::string packed = Gzipped(response.body);
  if (is_long) ++free_;
  if (packed.empty() || packed.size() >= bytes) return;
  response.body = std::move(packed);
  for (auto& [name, value] : response.headers) {
    const bool strong = value.size() >= 2 && value.front() == '"' && value.back() == '"';
    if (name == "ETag" && strong) value.replace(value.size() - 1, 1, kGzipEtagEnd);
  }
  response.headers.emplace_back("Content-Encoding", "gzip");
}

}  // namespace pliant::server
