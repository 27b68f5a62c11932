// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/compressed.h"

#include <cstring>
#include <new>

#include <zlib.h>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

constexpr std::size_t kMostRatio = 1032;  // of a stream (RFC 1951: 258 bytes for 2 bits)

}  // namespace

void PutCompressed(Bytes plain, Compression compression, std::vector<std::uint8_t>* out) {
  z_stream stream = {};
  const int strategy =
      compression == Compression::kValuesOnly ? Z_HUFFMAN_ONLY : Z_DEFAULT_STRATEGY;
  constexpr int kDefaultMemory = 8;
  if (::deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, MAX_WBITS, kDefaultMemory,
                     strategy) != Z_OK) {
    throw std::bad_alloc();  // its only other failure is wrong arguments
  }
  const std::size_t begin = out->size() + sizeof(std::uint32_t);
  out->resize(begin + ::deflateBound(&stream, plain.size()));
  stream.next_in = const_cast<Bytef*>(plain.data());
  stream.avail_in = static_cast<uInt>(plain.size());
  stream.next_out = out->data() + begin;
  stream.avail_out = static_cast<uInt>(out->size() - begin);
  ::deflate(&stream, Z_FINISH);  // at once: there is room for all
  const auto length = static_cast<std::uint32_t>(stream.total_out);
  ::deflateEnd(&stream);
  std::memcpy(out->data() + begin - sizeof(length), &length, sizeof(length));
  out->resize(begin + length);
}

std::vector<std::uint8_t> GetCompressed(Bytes bytes, std::size_t* offset, std::size_t size) {
  const auto fail = [] {
    throw Error(ErrorCode::kCorrupt, "blob_corrupt",
                "stored features have a compressed part of another size than they say");
  };
  std::uint32_t length = 0;
  if (bytes.size() < *offset + sizeof(length)) fail();
  std::memcpy(&length, bytes.data() + *offset, sizeof(length));
  *offset += sizeof(length);
  if (length > bytes.size() - *offset || size > length * kMostRatio) fail();
  std::vector<std::uint8_t> plain(size);
  uLongf found = size;
  uLong used = length;
  if (::uncompress2(plain.data(), &found, bytes.data() + *offset, &used) != Z_OK || found != size ||
      used != length) {
    fail();
  }
  *offset += length;
  return plain;
}

}  // namespace pliant
