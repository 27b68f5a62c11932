// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/blob_codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

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
constexpr std::uint8_t kFeatureVersion = 1;
constexpr std::size_t kFeatureHeaderBytes = 24;
constexpr std::size_t kKeypointBytes = 24;
constexpr std::uint32_t kMaxRows = 1u << 20;
constexpr std::uint8_t kWithColours = 1;
constexpr std::size_t kColourHeaderBytes = 4;
constexpr std::uint16_t kMaxColourSide = 1024;
constexpr float kLargestScale = std::numeric_limits<float>::max() / 128.0F;  // of 8-bit steps

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

DescriptorEncoding ChooseEncoding(const Descriptors& descriptors) {
  if (descriptors.kind == DescriptorKind::kBinary) return DescriptorEncoding::kBits;
  bool whole = true;
  for (const float value : descriptors.floats) {
    if (!std::isfinite(value)) {
      throw Error(ErrorCode::kInvalidArgument, "descriptor_not_finite",
                  "a descriptor holds a value that is not a finite number");
    }
    whole = whole && value >= 0.0F && value <= 255.0F && value == std::floor(value);
  }
  return whole ? DescriptorEncoding::kUint8 : DescriptorEncoding::kScaledInt8;
}

std::size_t RowBytes(DescriptorEncoding encoding, std::size_t dim) {
  return encoding == DescriptorEncoding::kScaledInt8 ? dim + sizeof(float) : dim;
}

// At most kLargestScale, so that every step of the row can be read: values beyond it are cut off
// there.
float ScaleOf(std::span<const float> row) {
  float largest = 0;
  for (const float value : row) largest = std::max(largest, std::abs(value));
  return std::min(largest / 127.0F, kLargestScale);
}

std::int8_t StepOf(float value, float scale) {
  const float step = scale > 0 ? std::nearbyint(value / scale) : 0.0F;
  return static_cast<std::int8_t>(std::clamp(step, -127.0F, 127.0F));
}

void PutScaledRow(std::vector<std::uint8_t>& out, std::span<const float> row) {
  const float scale = ScaleOf(row);
  PutValue(out, scale);
  for (const float value : row) out.push_back(static_cast<std::uint8_t>(StepOf(value, scale)));
}

void PutDescriptors(std::vector<std::uint8_t>& out, const Descriptors& descriptors,
                    DescriptorEncoding encoding) {
  switch (encoding) {
    case DescriptorEncoding::kBits:
      out.insert(out.end(), descriptors.bytes.begin(), descriptors.bytes.end());
      break;
    case DescriptorEncoding::kUint8:
      for (const float value : descriptors.floats) out.push_back(static_cast<std::uint8_t>(value));
      break;
    case DescriptorEncoding::kScaledInt8:
      for (std::size_t i = 0; i < descriptors.rows; ++i)
        PutScaledRow(out, descriptors.float_row(i));
      break;
  }
}

Descriptors GetDescriptors(Bytes body, DescriptorEncoding encoding, std::size_t rows, int dim) {
  const auto width = static_cast<std::size_t>(dim);
  if (encoding == DescriptorEncoding::kBits) {
    Descriptors result = Descriptors::Binary(rows, dim);
    std::copy(body.begin(), body.end(), result.bytes.begin());
    return result;
  }
  Descriptors result = Descriptors::Float(rows, dim);
  if (encoding == DescriptorEncoding::kUint8) {
    std::copy(body.begin(), body.end(), result.floats.begin());
    return result;
  }
  for (std::size_t i = 0; i < rows; ++i) {
    const std::size_t offset = i * RowBytes(encoding, width);
    const auto scale = GetValue<float>(body, offset);
    if (!(std::abs(scale) <= kLargestScale)) {
      ThrowCorruptBlob("features have values that are not finite");
    }
    for (std::size_t d = 0; d < width; ++d) {
      result.floats[i * width + d] =
          scale * static_cast<float>(static_cast<std::int8_t>(body[offset + sizeof(float) + d]));
    }
  }
  return result;
}

void PutColours(std::vector<std::uint8_t>& out, const ColourGrid& colours) {
  if (colours.empty()) return;
  PutValue(out, static_cast<std::uint16_t>(colours.width));
  PutValue(out, static_cast<std::uint16_t>(colours.height));
  out.insert(out.end(), colours.chroma.begin(), colours.chroma.end());
}

// All of `rest`.
ColourGrid GetColours(Bytes rest) {
  if (rest.size() < kColourHeaderBytes) ThrowCorruptBlob("features end within their colours");
  const auto width = GetValue<std::uint16_t>(rest, 0);
  const auto height = GetValue<std::uint16_t>(rest, 2);
  const Bytes chroma = rest.subspan(kColourHeaderBytes);
  if (width < 1 || height < 1 || width > kMaxColourSide || height > kMaxColourSide ||
      chroma.size() != std::size_t{2} * width * height) {
    ThrowCorruptBlob("features have colours of another size than they say");
  }
  return {width, height, {chroma.begin(), chroma.end()}};
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
  for (const Keypoint& k : features.keypoints) {
    for (const float value : {k.x, k.y, k.size, k.angle, k.response}) {
      if (std::isfinite(value)) continue;
      throw Error(ErrorCode::kInvalidArgument, "keypoint_not_finite",
                  "the features have keypoints that are not finite");
    }
  }
}

constexpr std::uint8_t kBowVersion = 1;
constexpr std::uint8_t kCodebookVersion = 1;

}  // namespace

std::vector<std::uint8_t> EncodeFeatures(const Features& features) {
  CheckShape(features);
  const Descriptors& descriptors = features.descriptors;
  const DescriptorEncoding encoding = ChooseEncoding(descriptors);
  std::vector<std::uint8_t> out;
  out.reserve(kFeatureHeaderBytes + kChecksumBytes +
              descriptors.rows * (kKeypointBytes + RowBytes(encoding, descriptors.dim)));
  for (const char c : kFeatureMagic) out.push_back(static_cast<std::uint8_t>(c));
  out.push_back(kFeatureVersion);
  out.push_back(static_cast<std::uint8_t>(descriptors.kind));
  out.push_back(static_cast<std::uint8_t>(encoding));
  out.push_back(features.colours.empty() ? 0 : kWithColours);
  PutValue(out, static_cast<std::uint32_t>(descriptors.rows));
  PutValue(out, static_cast<std::uint32_t>(descriptors.dim));
  PutValue(out, static_cast<std::uint32_t>(features.width));
  PutValue(out, static_cast<std::uint32_t>(features.height));
  for (const Keypoint& k : features.keypoints) {
    for (const float value : {k.x, k.y, k.size, k.angle, k.response}) PutValue(out, value);
    PutValue(out, k.octave);
  }
  PutDescriptors(out, descriptors, encoding);
  PutColours(out, features.colours);
  PutValue(out, Crc32(out));
  return out;
}

Features DecodeFeatures(Bytes blob) {
  const Bytes body = CheckedBody(blob, "features");
  if (body.size() < kFeatureHeaderBytes ||
      std::memcmp(body.data(), kFeatureMagic, sizeof(kFeatureMagic)) != 0) {
    ThrowCorruptBlob("features do not begin with PLFT");
  }
  if (body[4] != kFeatureVersion) {
    ThrowCorruptBlob("features are of format version " + std::to_string(body[4]) +
                     ", which this Pliant does not read");
  }
  const auto encoding = static_cast<DescriptorEncoding>(body[6]);
  const bool binary = body[5] == static_cast<std::uint8_t>(DescriptorKind::kBinary);
  if (body[5] > 1 || body[6] > 2 || body[7] > kWithColours ||
      binary != (encoding == DescriptorEncoding::kBits)) {
    ThrowCorruptBlob("features have an unknown kind or encoding");
  }
  const auto rows = GetValue<std::uint32_t>(body, 8);
  const auto dim = GetValue<std::uint32_t>(body, 12);
  if (rows > kMaxRows || dim > kMaxDim) ThrowCorruptBlob("features claim an impossible size");
  const std::size_t keypoint_bytes = std::size_t{rows} * kKeypointBytes;
  const std::size_t end = kFeatureHeaderBytes + keypoint_bytes + rows * RowBytes(encoding, dim);
  const bool with_colours = body[7] == kWithColours;
  if (with_colours ? body.size() < end : body.size() != end) {
    ThrowCorruptBlob("features have a length that differs from what their header says");
  }
  Features features;
  features.width = static_cast<int>(GetValue<std::uint32_t>(body, 16));
  features.height = static_cast<int>(GetValue<std::uint32_t>(body, 20));
  features.keypoints.reserve(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    const std::size_t at = kFeatureHeaderBytes + i * kKeypointBytes;
    for (std::size_t value = 0; value < 5; ++value) {
      if (!std::isfinite(GetValue<float>(body, at + 4 * value))) {
        ThrowCorruptBlob("features have keypoints that are not finite");
      }
    }
    features.keypoints.push_back({GetValue<float>(body, at), GetValue<float>(body, at + 4),
                                  GetValue<float>(body, at + 8), GetValue<float>(body, at + 12),
                                  GetValue<float>(body, at + 16),
                                  GetValue<std::int32_t>(body, at + 20)});
  }
  const Bytes after_keypoints = body.first(end).subspan(kFeatureHeaderBytes + keypoint_bytes);
  features.descriptors = GetDescriptors(after_keypoints, encoding, rows, static_cast<int>(dim));
  if (with_colours) features.colours = GetColours(body.subspan(end));
  return features;
}

// The same sums as in PutDescriptors and GetDescriptors, so that the result is the same to the bit.
Features InStoredPrecision(Features features) {
  CheckShape(features);
  Descriptors& descriptors = features.descriptors;
  switch (ChooseEncoding(descriptors)) {
    case DescriptorEncoding::kBits:
      break;
    case DescriptorEncoding::kUint8:  // makes -0 a 0
      for (float& value : descriptors.floats) value = static_cast<std::uint8_t>(value);
      break;
    case DescriptorEncoding::kScaledInt8: {
      const auto dim = static_cast<std::size_t>(descriptors.dim);
      for (std::size_t i = 0; i < descriptors.rows; ++i) {
        const std::span<float> row = std::span(descriptors.floats).subspan(i * dim, dim);
        const float scale = ScaleOf(row);
        for (float& value : row) value = scale * static_cast<float>(StepOf(value, scale));
      }
      break;
    }
  }
  return features;
}

std::vector<std::uint8_t> EncodeBow(const Bow& bow) {
  const std::size_t code_bytes = bow.total == 0 ? 0 : bow.codes.size() / bow.total;
  if (bow.codes.size() != code_bytes * bow.total || (code_bytes == 0) != (bow.total == 0)) {
    throw Error(ErrorCode::kInternal, "bow_codes",
                "a bag of words has more or fewer codes than descriptors");
  }
  std::vector<std::uint8_t> out = {kBowVersion};
  PutVarint(out, static_cast<std::uint32_t>(bow.words.size()));
  std::uint32_t next = 0;  // smallest word that may follow
  for (const WordCount& entry : bow.words) {
    if (entry.word < next || entry.count == 0) {
      throw Error(ErrorCode::kInternal, "bow_order", "a bag of words is not in ascending order");
    }
    PutVarint(out, entry.word - next);
    PutVarint(out, entry.count);
    next = entry.word + 1;
  }
  PutVarint(out, static_cast<std::uint32_t>(code_bytes));
  out.insert(out.end(), bow.codes.begin(), bow.codes.end());
  PutValue(out, Crc32(out));
  return out;
}

Bow DecodeBow(Bytes blob, std::size_t vocabulary_size) {
  const Bytes body = CheckedBody(blob, "words");
  if (body.empty() || body[0] != kBowVersion) {
    ThrowCorruptBlob("words are of an unknown format version");
  }
  std::size_t offset = 1;
  const std::uint32_t distinct = GetVarint(body, offset, "words");
  if (distinct > body.size() || distinct > vocabulary_size) ThrowCorruptBlob("words are too many");
  Bow bow;
  bow.words.reserve(distinct);
  std::uint64_t next = 0;
  std::uint64_t total = 0;
  for (std::uint32_t i = 0; i < distinct; ++i) {
    const std::uint64_t word = next + GetVarint(body, offset, "words");
    const std::uint32_t count = GetVarint(body, offset, "words");
    if (word >= vocabulary_size || count == 0) ThrowCorruptBlob("words are outside the vocabulary");
    bow.words.push_back({static_cast<std::uint32_t>(word), count});
    total += count;
    next = word + 1;
  }
  if (total > std::numeric_limits<std::uint32_t>::max()) ThrowCorruptBlob("words are too many");
  bow.total = static_cast<std::uint32_t>(total);
  const std::size_t code_bytes = GetVarint(body, offset, "words");
  if ((code_bytes == 0) != (bow.total == 0) || body.size() - offset != code_bytes * bow.total) {
    ThrowCorruptBlob("words have more or fewer codes than they need");
  }
  const auto codes = body.subspan(offset);
  bow.codes.assign(codes.begin(), codes.end());
  return bow;
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
