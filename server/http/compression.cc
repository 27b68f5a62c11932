// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/compression.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <map>

#include <brotli/encode.h>
#include <zlib.h>

#include "descriptor/base/strings.h"
#include "server/http/accept.h"

namespace pliant::server {

namespace {

// Long answers at a speed of about 100 MB/s, short ones as well as it makes sense.
constexpr int kGzipLevel = 6;
constexpr int kGzipLevelOfLong = 1;
constexpr int kBrotliQuality = 5;
constexpr int kBrotliQualityOfLong = 1;
constexpr int kGzipWindowBits = 15 + 16;  // 16: a gzip header and trailer
constexpr int kGzipMemory = 8;

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
  std::map<std::string, int> listed = WeightsOf(accept_encoding);
  if (const auto old = listed.find("x-gzip"); old != listed.end()) {
    listed.emplace("gzip", old->second);  // its earlier name (RFC 9110, section 8.4.1.3)
  }
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
