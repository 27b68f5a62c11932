// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/segment_file.h"

#include <cstring>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

#define XXH_STATIC_LINKING_ONLY  // a state of known size
#if defined(__x86_64__)
// Takes the widest registers of the processor: much of a large index's start is its checksum.
#include <xxh_x86dispatch.h>
#else
#include <xxhash.h>
#endif

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/safetensors.h"
#include "descriptor/base/strings.h"
#include "index/files/durable_file.h"
#include "index/files/mapped_file.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "pliant-segment-2";  // another number for other contents

std::string HexOf(XXH64_hash_t hash) {
  XXH64_canonical_t bytes;
  XXH64_canonicalFromHash(&bytes, hash);
  return ToHex(bytes.digest);
}

}  // namespace

template <typename Segment, typename Visit>
void SegmentFile::ForEachArray(Segment& segment, const Visit& visit) {
  visit("images", "U8", segment.images_);
  visit("offsets", "U32", segment.codes_.offsets_);
  visit("image_of_code", "U16", segment.codes_.images_);
  visit("biases", "I16", segment.codes_.biases_);
  visit("codes", "U8", segment.codes_.codes_);
  visit("ids", "U8", segment.ids_);
}

void SegmentFile::Write(const fs::path& path, const IndexSegment& segment) {
  std::vector<Tensor> tensors;
  XXH3_state_t hash;
  XXH3_64bits_reset(&hash);
  ForEachArray(segment, [&](const char* name, const char* type, const auto& array) {
    const auto bytes = std::as_bytes(array.span());
    const auto* const begin = reinterpret_cast<const std::uint8_t*>(bytes.data());
    const std::size_t values = std::strcmp(type, "U8") == 0 ? bytes.size() : array.size();
    tensors.push_back(
        {name, type, {static_cast<std::int64_t>(values)}, {begin, begin + bytes.size()}});
    XXH3_64bits_update(&hash, begin, bytes.size());
  });
  const std::error_code error =
      WriteSafetensors(path, tensors,
                       {{"format", kFormat},
                        {"code_bytes", std::to_string(segment.codes_.bytes_)},
                        {"binary", segment.codes_.binary_ ? "1" : "0"},
                        {"xxh3", HexOf(XXH3_64bits_digest(&hash))}});
  if (error) ThrowErrno("cannot write", path, error.value());
}

std::shared_ptr<const IndexSegment> SegmentFile::Map(const fs::path& path) {
  const auto require = [&](bool holds) {
    if (holds) return;
    throw Error(ErrorCode::kCorrupt, "segment_damaged",
                "the index file " + path.string() + " is damaged");
  };
  const SafetensorsHeader header = ReadSafetensorsHeader(path);
  const auto metadata = [&](const char* name) {
    const auto found = header.metadata.find(name);
    return found == header.metadata.end() ? std::string() : found->second;
  };
  require(metadata("format") == kFormat);
  const std::shared_ptr<const std::string_view> file = MapFile(path);
  require(file->size() > header.data_begin &&
          header.data_begin % alignof(IndexSegment::Image) == 0);
  const std::string_view data = file->substr(header.data_begin);
  require(metadata("xxh3") == HexOf(XXH3_64bits(data.data(), data.size())));
  auto segment = std::make_shared<IndexSegment>();
  ForEachArray(*segment, [&](const char* name, const char* /*type*/, auto& array) {
    using Value = std::remove_cvref_t<decltype(array[0])>;
    const auto tensor = header.tensors.find(name);
    require(tensor != header.tensors.end());
    const auto& [begin, end] = std::pair(tensor->second.begin, tensor->second.end);
    array = {std::span(reinterpret_cast<const Value*>(data.data() + begin),
                       (end - begin) / sizeof(Value)),
             file};
  });
  segment->file_ = path;
  CodeLists& codes = segment->codes_;
  codes.bytes_ = NumberOf<std::size_t>(metadata("code_bytes")).value_or(0);
  codes.binary_ = metadata("binary") == "1";
  // The checksum covers the values of the arrays, but not where one begins.
  const std::size_t count = codes.images_.size();
  require(segment->size() > 0 &&
          segment->images_[segment->size() - 1].id_end == segment->ids_.size());
  require(codes.offsets_.size() > 0 && codes.offsets_[codes.offsets_.size() - 1] == count);
  require(codes.biases_.size() == (codes.binary_ ? 0 : count));
  require(codes.codes_.size() == count * codes.bytes_ + kCodePadding);
  return segment;
}

}  // namespace pliant
