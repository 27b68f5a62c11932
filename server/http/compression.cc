// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/compression.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdint>
#include <limits>
#include <map>

#include <brotli/encode.h>
#include <zlib.h>

namespace pliant::server {

namespace {

// Long answers at a speed of about 100 MB/s, short ones as well as it makes sense.
constexpr int kGzipLevel = 6;
constexpr int kGzipLevelOfLong = 1;
constexpr int kBrotliQuality = 5;
constexpr int kBrotliQualityOfLong = 1;
constexpr int kGzipWindowBits = 15 + 16;  // 16: a gzip header and trailer
constexpr int kGzipMemory = 8;

std::string_view Trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t") + 1 - begin);
}

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

// "0", "0.5", "1.000" in thousandths; -1 = no q-value (RFC 9110, section 12.4.2).
int ThousandthsOf(std::string_view text) {
  if (text.empty() || text.size() > 5 || (text[0] != '0' && text[0] != '1')) return -1;
  if (text.size() > 1 && text[1] != '.') return -1;
  int value = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    if (i == 1) continue;
    const char digit = i < text.size() ? text[i] : '0';
    if (digit < '0' || digit > '9') return -1;
    value = value * 10 + (digit - '0');
  }
  return value > 1000 ? -1 : value;
}

// q of what a list names, in thousandths.
std::map<std::string, int> ListedCodings(std::string_view list) {
  std::map<std::string, int> listed;
  while (!list.empty()) {
    const std::size_t comma = std::min(list.find(','), list.size());
    const std::string_view entry = list.substr(0, comma);
    list.remove_prefix(std::min(comma + 1, list.size()));
    const std::size_t semicolon = std::min(entry.find(';'), entry.size());
    std::string name = Lower(Trimmed(entry.substr(0, semicolon)));
    if (name == "x-gzip") name = "gzip";
    int q = 1000;
    if (semicolon < entry.size()) {
      const std::string weight = Lower(Trimmed(entry.substr(semicolon + 1)));
      q = weight.starts_with("q=") ? ThousandthsOf(std::string_view(weight).substr(2)) : -1;
    }
    if (q >= 0 && !name.empty()) listed.emplace(name, q);
  }
  return listed;
}

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

std::string Brotlied(const std::string& body) {
  const int quality = body.size() >= Compressor::kLongBytes ? kBrotliQualityOfLong : kBrotliQuality;
  std::string packed(BrotliEncoderMaxCompressedSize(body.size()), '\0');
  std::size_t size = packed.size();
  const bool whole =
      BrotliEncoderCompress(quality, BROTLI_DEFAULT_WINDOW, BROTLI_MODE_TEXT, body.size(),
                            reinterpret_cast<const std::uint8_t*>(body.data()), &size,
                            reinterpret_cast<std::uint8_t*>(packed.data())) == BROTLI_TRUE;
  packed.resize(whole ? size : 0);
  return packed;
}

void NameCoding(Coding coding, Response& response) {
  response.headers.emplace_back("Content-Encoding", CodingName(coding));
  for (auto& [name, value] : response.headers) {
    const bool strong = value.size() >= 2 && value.front() == '"' && value.back() == '"';
    if (name == "ETag" && strong) {
      value.insert(value.size() - 1, std::string("-") + CodingName(coding));
    }
  }
}

}  // namespace

const char* CodingName(Coding coding) {
  switch (coding) {
    case Coding::kIdentity:
      return "identity";
    case Coding::kGzip:
      return "gzip";
    case Coding::kBrotli:
      return "br";
  }
  return "identity";
}

Coding ChooseCoding(std::string_view accept_encoding) {
  const std::map<std::string, int> listed = ListedCodings(accept_encoding);
  const auto others = listed.find("*");
  const auto weight = [&](Coding coding) {
    const auto it = listed.find(CodingName(coding));
    if (it != listed.end()) return it->second;
    return others == listed.end() || coding == Coding::kIdentity ? 0 : others->second;
  };
  Coding best = Coding::kIdentity;
  for (const Coding coding : {Coding::kGzip, Coding::kBrotli}) {
    const int q = weight(coding);
    if (q > 0 && q >= weight(best)) best = coding;
  }
  return best;
}

bool IsCompressible(std::string_view content_type) {
  constexpr std::array<std::string_view, 5> kTypes = {
      "application/json", "application/problem+json", "application/javascript",
      "application/x-ndjson", "image/svg+xml"};
  const std::string type = Lower(Trimmed(content_type.substr(0, content_type.find(';'))));
  return type.starts_with("text/") || std::find(kTypes.begin(), kTypes.end(), type) != kTypes.end();
}

std::string Compressed(const std::string& body, Coding coding) {
  if (body.size() > std::numeric_limits<uInt>::max() / 2) return {};
  if (coding == Coding::kGzip) return Gzipped(body);
  return coding == Coding::kBrotli ? Brotlied(body) : std::string();
}

void Compressor::Compress(const Request& request, Response& response) {
  if (!IsCompressible(response.content_type)) return;
  // Also for those that are too short now: caches must not mix them up.
  response.headers.emplace_back("Vary", "Accept-Encoding");
  const std::size_t bytes = response.body.size();
  std::string accepted;
  const auto [begin, end] = request.headers.equal_range("Accept-Encoding");
  for (auto header = begin; header != end; ++header) accepted += header->second + ",";
  const Coding coding = ChooseCoding(accepted);
  const bool partial = response.status == 206;
  if (coding == Coding::kIdentity || partial || bytes < kFewestBytes || bytes > kMostBytes) return;
  const bool is_long = bytes >= kLongBytes;
  if (is_long && --free_ < 0) {
    ++free_;
    return;
  }
  std::string packed = Compressed(response.body, coding);
  if (is_long) ++free_;
  if (packed.empty() || packed.size() >= bytes) return;
  response.body = std::move(packed);
  NameCoding(coding, response);
}

}  // namespace pliant::server
