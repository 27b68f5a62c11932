// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/blob_codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <string>
#include <utility>

#include <zlib.h>

#include "descriptor/base/error.h"
#include "vocab/residual_codes.h"

namespace pliant {

std::uint32_t Crc32(Bytes bytes, std::uint32_t seed) {
  return static_cast<std::uint32_t>(::crc32_z(seed, bytes.data(), bytes.size()));
}

namespace {

static_assert(std::endian::native == std::endian::little,
              "the blob formats are little-endian and written by memcpy");

constexpr std::size_t kChecksumBytes = 4;

constexpr char kFeatureMagic[4] = {'P', 'L', 'F', 'T'};
constexpr std::uint8_t kFeatureVersion = 4;
constexpr std::size_t kFeatureHeaderBytes = 23;
constexpr std::size_t kKeypointBytes = 8;
constexpr std::uint32_t kMaxRows = 1u << 20;
constexpr std::uint8_t kWithColours = 1;  // bits
constexpr std::uint8_t kWithPreview = 2;
constexpr std::size_t kColourHeaderBytes = 4;  // and of a preview
constexpr std::uint16_t kMaxColourSide = 1024;

// `what`: the blob, in the plural.
[[noreturn]] void ThrowCorruptBlob(const std::string& what) {
  throw Error(ErrorCode::kCorrupt, "blob_corrupt", "stored " + what);
}

// The caller has checked that the bytes are there.
template <typename T>
T GetValue(Bytes bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

void PutVarint(std::vector<std::uint8_t>& out, std::uint32_t value) {
  for (; value >= 0x80; value >>= 7) out.push_back(static_cast<std::uint8_t>(value | 0x80));
  out.push_back(static_cast<std::uint8_t>(value));
}

// Moves `offset` behind the integer.
std::uint32_t GetVarint(Bytes bytes, std::size_t& offset, const char* what) {
  std::uint64_t value = 0;
  for (int shift = 0; shift <= 28; shift += 7) {
    if (offset >= bytes.size()) ThrowCorruptBlob(std::string(what) + " are cut short");
    const std::uint8_t byte = bytes[offset++];
    value |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
    if (byte < 0x80) {
      if (value > std::numeric_limits<std::uint32_t>::max()) break;
      return static_cast<std::uint32_t>(value);
    }
  }
  ThrowCorruptBlob(std::string(what) + " hold a number that is too large");
}

// The blob without the checksum at its end.
Bytes CheckedBody(Bytes blob, const char* what) {
  if (blob.size() < kChecksumBytes) ThrowCorruptBlob(std::string(what) + " are cut short");
  const Bytes body = blob.first(blob.size() - kChecksumBytes);
  if (GetValue<std::uint32_t>(blob, body.size()) != Crc32(body)) {
    ThrowCorruptBlob(std::string(what) + " do not match their checksum");
  }
  return body;
}

// `value` of `range` in 65 535 steps.
std::uint16_t ToShare(float value, int range) {
  const double share = std::clamp((value + 0.5) / range, 0.0, 1.0);
  return static_cast<std::uint16_t>(std::lround(share * 65535));
}
float FromShare(std::uint16_t share, int range) {
  return static_cast<float>(share / 65535.0 * range - 0.5);
}

// Positive values on a logarithmic scale: `value` is 2^((code - 1) / steps + lowest), or 0 for code
// 0, up to the largest code.
struct LogScale {
  double steps;  // an octave
  double lowest;
  double largest;

  std::uint16_t Code(float value) const {
    if (!(value > 0)) return 0;
    return static_cast<std::uint16_t>(
        std::clamp(std::round((std::log2(value) - lowest) * steps) + 1, 1.0, largest));
  }
  float Value(std::uint16_t code) const {
    return code == 0 ? 0 : static_cast<float>(std::exp2((code - 1) / steps + lowest));
  }
};
constexpr LogScale kSizes = {4096, -2, 65535};  // 0.25 to 16 384 pixels
constexpr LogScale kResponses = {8, -20, 255};  // 1e-6 to 3444

void PutKeypoints(const Features& features, std::vector<std::uint8_t>& out) {
  for (const Keypoint& k : features.keypoints) {
    PutValue(out, ToShare(k.x, features.width));
    PutValue(out, ToShare(k.y, features.height));
    PutValue(out, kSizes.Code(k.size));
    const double turns = k.angle / 360.0;
    PutValue(out, static_cast<std::uint8_t>(std::lround((turns - std::floor(turns)) * 256)));
    PutValue(out, static_cast<std::uint8_t>(kResponses.Code(k.response)));
  }
}

std::vector<Keypoint> GetKeypoints(Bytes bytes, int width, int height) {
  std::vector<Keypoint> keypoints;
  keypoints.reserve(bytes.size() / kKeypointBytes);
  for (std::size_t at = 0; at < bytes.size(); at += kKeypointBytes) {
    keypoints.push_back({FromShare(GetValue<std::uint16_t>(bytes, at), width),
                         FromShare(GetValue<std::uint16_t>(bytes, at + 2), height),
                         kSizes.Value(GetValue<std::uint16_t>(bytes, at + 4)),
                         static_cast<float>(bytes[at + 6]) * (360.0F / 256),
                         kResponses.Value(bytes[at + 7])});
  }
  return keypoints;
}

void PutColours(std::vector<std::uint8_t>& out, const ColourGrid& colours) {
  if (colours.empty()) return;
  PutValue(out, static_cast<std::uint16_t>(colours.width));
  PutValue(out, static_cast<std::uint16_t>(colours.height));
  // All a*, then all b*: a third to a half of the bytes when compressed.
  const std::size_t cells = colours.chroma.size() / 2;
  std::vector<std::uint8_t> planes(2 * cells);
  for (std::size_t i = 0; i < cells; ++i) {
    planes[i] = colours.chroma[2 * i];
    planes[cells + i] = colours.chroma[2 * i + 1];
  }
  uLongf bytes = ::compressBound(planes.size());
  const std::size_t begin = out.size();
  out.resize(begin + bytes);
  if (::compress(out.data() + begin, &bytes, planes.data(), planes.size()) != Z_OK) {
    throw std::bad_alloc();  // its only other failure is too small a buffer
  }
  out.resize(begin + bytes);
}

// All of `rest`.
ColourGrid GetColours(Bytes rest) {
  if (rest.size() < kColourHeaderBytes) ThrowCorruptBlob("features end within their colours");
  const auto width = GetValue<std::uint16_t>(rest, 0);
  const auto height = GetValue<std::uint16_t>(rest, 2);
  const Bytes compressed = rest.subspan(kColourHeaderBytes);
  const std::size_t cells = std::size_t{width} * height;
  const bool fits = cells > 0 && width <= kMaxColourSide && height <= kMaxColourSide;
  std::vector<std::uint8_t> planes(fits ? 2 * cells : 0);
  uLongf bytes = planes.size();
  uLong used = compressed.size();
  if (!fits || ::uncompress2(planes.data(), &bytes, compressed.data(), &used) != Z_OK ||
      bytes != planes.size() || used != compressed.size()) {
    ThrowCorruptBlob("features have colours of another size than they say");
  }
  ColourGrid grid = {width, height, std::vector<std::uint8_t>(planes.size())};
  for (std::size_t i = 0; i < cells; ++i) {
    grid.chroma[2 * i] = planes[i];
    grid.chroma[2 * i + 1] = planes[cells + i];
  }
  return grid;
}

void PutPreview(std::vector<std::uint8_t>& out, Bytes preview) {
  if (preview.empty()) return;
  PutValue(out, static_cast<std::uint32_t>(preview.size()));
  out.insert(out.end(), preview.begin(), preview.end());
}

// From the beginning of `rest`, which then begins behind it.
std::vector<std::uint8_t> GetPreview(Bytes* rest) {
  constexpr std::size_t kSizeBytes = 4;
  if (rest->size() < kSizeBytes) ThrowCorruptBlob("features end within their preview");
  const auto size = GetValue<std::uint32_t>(*rest, 0);
  if (size == 0 || size > rest->size() - kSizeBytes) {
    ThrowCorruptBlob("features have a preview of another size than they say");
  }
  const Bytes preview = rest->subspan(kSizeBytes, size);
  *rest = rest->subspan(kSizeBytes + size);
  return {preview.begin(), preview.end()};
}

void CheckShape(const Features& features) {
  const Descriptors& d = features.descriptors;
  const std::size_t values = d.kind == DescriptorKind::kFloat ? d.floats.size() : d.bytes.size();
  if (d.rows != features.keypoints.size() || d.rows > kMaxRows || d.dim < 0 ||
      static_cast<std::uint32_t>(d.dim) > kMaxDim ||
      values != d.rows * static_cast<std::size_t>(d.dim)) {
    throw Error(ErrorCode::kInvalidArgument, "features_shape",
                "the descriptors do not fit the keypoints: " + std::to_string(d.rows) +
                    " rows of " + std::to_string(d.dim) + " for " +
                    std::to_string(features.keypoints.size()) + " keypoints");
  }
  const ColourGrid& colours = features.colours;
  if (colours.width < 0 || colours.height < 0 || colours.width > kMaxColourSide ||
      colours.height > kMaxColourSide ||
      colours.chroma.size() !=
          2 * static_cast<std::size_t>(colours.width) * static_cast<std::size_t>(colours.height)) {
    throw Error(ErrorCode::kInvalidArgument, "features_shape",
                "the colours do not fit their grid of " + std::to_string(colours.width) + " x " +
                    std::to_string(colours.height) + " cells");
  }
  if (d.rows > 0 && (features.width < 1 || features.height < 1)) {
    throw Error(ErrorCode::kInvalidArgument, "features_shape",
                "the features have keypoints, but no image size");
  }
  for (const Keypoint& k : features.keypoints) {
    for (const float value : {k.x, k.y, k.size, k.angle, k.response}) {
      if (std::isfinite(value)) continue;
      throw Error(ErrorCode::kInvalidArgument, "keypoint_not_finite",
                  "the features have keypoints that are not finite");
    }
  }
}

// The parts of a blob, checked, but not decoded.
struct StoredFeatures {
  std::uint8_t contents;  // kWithColours, kWithPreview
  std::int32_t width;
  std::int32_t height;
  Bytes keypoints;
  CodedDescriptors descriptors;
  Bytes more;

  explicit StoredFeatures(Bytes blob) {
    const Bytes body = CheckedBody(blob, "features");
    if (body.size() < kFeatureHeaderBytes ||
        std::memcmp(body.data(), kFeatureMagic, sizeof(kFeatureMagic)) != 0) {
      ThrowCorruptBlob("features do not begin with PLFT");
    }
    if (body[4] != kFeatureVersion) {
      ThrowCorruptBlob("features are of format version " + std::to_string(body[4]) +
                       ", which this Pliant does not read");
    }
    if (body[5] > 1 || body[6] > (kWithColours | kWithPreview))
      ThrowCorruptBlob("features are of an unknown kind");
    const auto kind = static_cast<DescriptorKind>(body[5]);
    contents = body[6];
    const auto rows = GetValue<std::uint32_t>(body, 7);
    const auto components = GetValue<std::uint32_t>(body, 11);
    if (rows > kMaxRows || components > kMaxDim) {
      ThrowCorruptBlob("features claim an impossible size");
    }
    const int dim = static_cast<int>(components);
    const std::size_t keypoint_bytes = rows * kKeypointBytes;
    const std::size_t descriptor_bytes = rows * CodedRowBytes(kind, dim);
    const Bytes rest = body.subspan(kFeatureHeaderBytes);
    const std::size_t least = keypoint_bytes + descriptor_bytes;
    if (contents != 0 ? rest.size() < least : rest.size() != least) {
      ThrowCorruptBlob("features have a length that differs from what their header says");
    }
    width = GetValue<std::int32_t>(body, 15);
    height = GetValue<std::int32_t>(body, 19);
    if (rows > 0 && (width < 1 || height < 1)) {
      ThrowCorruptBlob("features have keypoints in an image without a size");
    }
    keypoints = rest.first(keypoint_bytes);
    descriptors = {kind, rows, dim, rest.subspan(keypoint_bytes, descriptor_bytes)};
    more = rest.subspan(least);
  }
};

constexpr std::uint8_t kWordsVersion = 2;
constexpr std::uint8_t kCodebookVersion = 1;

}  // namespace

std::vector<std::uint8_t> EncodeFeatures(const Features& features) {
  CheckShape(features);
  const Descriptors& descriptors = features.descriptors;
  std::vector<std::uint8_t> out;
  out.reserve(kFeatureHeaderBytes + kChecksumBytes +
              descriptors.rows *
                  (kKeypointBytes + CodedRowBytes(descriptors.kind, descriptors.dim)));
  for (const char c : kFeatureMagic) out.push_back(static_cast<std::uint8_t>(c));
  out.push_back(kFeatureVersion);
  out.push_back(static_cast<std::uint8_t>(descriptors.kind));
  out.push_back(static_cast<std::uint8_t>((features.colours.empty() ? 0 : kWithColours) |
                                          (features.preview.empty() ? 0 : kWithPreview)));
  PutValue(out, static_cast<std::uint32_t>(descriptors.rows));
  PutValue(out, static_cast<std::uint32_t>(descriptors.dim));
  PutValue(out, static_cast<std::int32_t>(features.width));
  PutValue(out, static_cast<std::int32_t>(features.height));
  PutKeypoints(features, out);
  PutDescriptors(descriptors, &out);
  PutPreview(out, features.preview);
  PutColours(out, features.colours);
  PutValue(out, Crc32(out));
  return out;
}

Features DecodeFeatures(Bytes blob) {
  const StoredFeatures stored(blob);
  Features features;
  features.width = stored.width;
  features.height = stored.height;
  features.keypoints = GetKeypoints(stored.keypoints, stored.width, stored.height);
  features.descriptors = GetDescriptors(stored.descriptors);
  Bytes more = stored.more;
  if ((stored.contents & kWithPreview) != 0) features.preview = GetPreview(&more);
  if ((stored.contents & kWithColours) != 0) {
    features.colours = GetColours(more);
  } else if (!more.empty()) {
    ThrowCorruptBlob("features have a length that differs from what their header says");
  }
  return features;
}

CodedDescriptors DescriptorsIn(Bytes features) { return StoredFeatures(features).descriptors; }

Features InStoredPrecision(Features features) {
  Features stored = DecodeFeatures(EncodeFeatures(features));
  stored.model_id = std::move(features.model_id);
  return stored;
}

std::vector<std::uint8_t> EncodeWords(std::span<const std::uint32_t> words) {
  const std::uint32_t largest = words.empty() ? 0 : *std::ranges::max_element(words);
  const int bits = std::bit_width(largest);
  std::vector<std::uint8_t> out = {kWordsVersion};
  PutVarint(out, static_cast<std::uint32_t>(words.size()));
  out.push_back(static_cast<std::uint8_t>(bits));
  std::uint64_t waiting = 0;
  int filled = 0;
  for (const std::uint32_t word : words) {
    waiting |= std::uint64_t{word} << filled;
    for (filled += bits; filled >= 8; filled -= 8, waiting >>= 8U) {
      out.push_back(static_cast<std::uint8_t>(waiting));
    }
  }
  if (filled > 0) out.push_back(static_cast<std::uint8_t>(waiting));
  PutValue(out, Crc32(out));
  return out;
}

std::vector<std::uint32_t> DecodeWords(Bytes blob, std::size_t vocabulary_size) {
  const Bytes body = CheckedBody(blob, "words");
  if (body.empty() || body[0] != kWordsVersion) {
    ThrowCorruptBlob("words are of an unknown format version");
  }
  std::size_t offset = 1;
  const std::uint64_t count = GetVarint(body, offset, "words");
  const int bits = offset < body.size() ? body[offset++] : 33;
  if (count > kMaxRows || bits > 32 ||
      (count * static_cast<unsigned>(bits) + 7) / 8 != body.size() - offset) {
    ThrowCorruptBlob("words are more or fewer than they say");
  }
  std::vector<std::uint32_t> words(count);
  std::uint64_t waiting = 0;
  int filled = 0;
  for (std::uint32_t& word : words) {
    for (; filled < bits; filled += 8) waiting |= std::uint64_t{body[offset++]} << filled;
    word = static_cast<std::uint32_t>(waiting & ((std::uint64_t{1} << bits) - 1));
    waiting >>= static_cast<unsigned>(bits);
    filled -= bits;
    if (word >= vocabulary_size) ThrowCorruptBlob("words are outside the vocabulary");
  }
  if (waiting != 0) ThrowCorruptBlob("words are more or fewer than they say");
  return words;
}

std::vector<std::uint8_t> EncodeCodebook(const Codebook& codebook) {
  std::vector<std::uint8_t> out;
  out.push_back(kCodebookVersion);
  PutVarint(out, static_cast<std::uint32_t>(codebook.code_bytes));
  PutVarint(out, static_cast<std::uint32_t>(codebook.part_dim));
  for (const float value : codebook.rotation) PutValue(out, value);
  for (const float value : codebook.centroids) PutValue(out, value);
  PutValue(out, Crc32(out));
  return out;
}

Codebook DecodeCodebook(Bytes blob, const Descriptors& words) {
  const Bytes body = CheckedBody(blob, "codebooks");
  if (body.empty() || body[0] != kCodebookVersion) {
    ThrowCorruptBlob("codebooks are of an unknown format version");
  }
  std::size_t offset = 1;
  const std::uint32_t code_bytes = GetVarint(body, offset, "codebooks");
  const std::uint32_t part_dim = GetVarint(body, offset, "codebooks");
  if (code_bytes > kMaxDim || part_dim > kMaxDim)
    ThrowCorruptBlob("codebooks claim impossible sizes");
  Codebook codebook;
  codebook.code_bytes = static_cast<int>(code_bytes);
  codebook.part_dim = static_cast<int>(part_dim);
  const std::size_t rotation = codebook.padded_dim() * static_cast<std::size_t>(words.dim);
  const std::size_t centroids = codebook.padded_dim() * 16;
  const bool binary = words.kind == DescriptorKind::kBinary;
  if (body.size() - offset != (binary ? 0 : rotation + centroids) * sizeof(float)) {
    ThrowCorruptBlob("codebooks have another length than they say");
  }
  for (std::size_t i = 0; !binary && i < rotation + centroids; ++i, offset += sizeof(float)) {
    (i < rotation ? codebook.rotation : codebook.centroids)
        .push_back(GetValue<float>(body, offset));
  }
  if (codebook.empty()) ThrowCorruptBlob("codebooks are empty");
  try {
    CheckCodebook(codebook, words);
  } catch (const Error& error) {
    ThrowCorruptBlob(error.what());
  }
  return codebook;
}

Bytes WordBytes(const Descriptors& words, std::size_t i) {
  if (words.kind == DescriptorKind::kBinary) return words.binary_row(i);
  const std::span<const float> row = words.float_row(i);
  return {reinterpret_cast<const std::uint8_t*>(row.data()), row.size_bytes()};
}

std::uint32_t VocabularyChecksum(const Vocabulary& vocabulary) {
  std::uint32_t crc = 0;
  for (std::size_t i = 0; i < vocabulary.size(); ++i) {
    crc = Crc32(WordBytes(vocabulary.words, i), crc);
  }
  return crc;
}

}  // namespace pliant
