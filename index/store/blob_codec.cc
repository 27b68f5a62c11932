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
namespace {

static_assert(std::endian::native == std::endian::little,
              "the blob formats are little-endian and written by memcpy");

constexpr char kFeatureMagic[4] = {'P', 'L', 'F', 'T'};
constexpr std::uint8_t kFeatureVersion = 1;
constexpr std::uint8_t kBowVersion = 1;        // words only
constexpr std::uint8_t kSignedBowVersion = 2;  // and a signature each
constexpr std::uint8_t kCodedBowVersion = 3;   // and a code per descriptor
constexpr std::uint8_t kCodebookVersion = 1;
constexpr std::size_t kFeatureHeaderBytes = 24;
constexpr std::size_t kKeypointBytes = 24;
constexpr std::size_t kChecksumBytes = 4;
constexpr std::uint32_t kMaxRows = 1u << 20;
constexpr std::uint32_t kMaxDim = 1u << 14;

[[noreturn]] void ThrowCorrupt(const std::string& what) {
  throw Error(ErrorCode::kCorrupt, "blob_corrupt", "stored " + what);
}

template <typename T>
void Put(std::vector<std::uint8_t>& out, const T& value) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
  out.insert(out.end(), bytes, bytes + sizeof(T));
}

template <typename T>
T Get(Bytes bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

// Drops the checksum at the end after comparing it.
Bytes Checked(Bytes blob, const char* what) {
  if (blob.size() < kChecksumBytes) ThrowCorrupt(std::string(what) + " are cut short");
  const Bytes body = blob.first(blob.size() - kChecksumBytes);
  if (Get<std::uint32_t>(blob, body.size()) != Crc32(body)) {
    ThrowCorrupt(std::string(what) + " do not match their checksum");
  }
  return body;
}

void PutVarint(std::vector<std::uint8_t>& out, std::uint32_t value) {
  for (; value >= 0x80; value >>= 7) out.push_back(static_cast<std::uint8_t>(value | 0x80));
  out.push_back(static_cast<std::uint8_t>(value));
}

std::uint32_t GetVarint(Bytes bytes, std::size_t& offset) {
  std::uint64_t value = 0;
  for (int shift = 0; shift <= 28; shift += 7) {
    if (offset >= bytes.size()) ThrowCorrupt("words are cut short");
    const std::uint8_t byte = bytes[offset++];
    value |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
    if (byte < 0x80) {
      if (value > std::numeric_limits<std::uint32_t>::max()) break;
      return static_cast<std::uint32_t>(value);
    }
  }
  ThrowCorrupt("words hold a number that is too large");
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

float ScaleOf(std::span<const float> row) {
  float largest = 0;
  for (const float value : row) largest = std::max(largest, std::abs(value));
  return largest / 127.0F;
}

std::int8_t StepOf(float value, float scale) {
  const float step = scale > 0 ? std::nearbyint(value / scale) : 0.0F;
  return static_cast<std::int8_t>(std::clamp(step, -127.0F, 127.0F));
}

void PutScaledRow(std::vector<std::uint8_t>& out, std::span<const float> row) {
  const float scale = ScaleOf(row);
  Put(out, scale);
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
    const auto scale = Get<float>(body, offset);
    for (std::size_t d = 0; d < width; ++d) {
      result.floats[i * width + d] =
          scale * static_cast<float>(static_cast<std::int8_t>(body[offset + sizeof(float) + d]));
    }
  }
  return result;
}

void CheckShape(const Features& features) {
  const Descriptors& d = features.descriptors;
  const std::size_t values = d.kind == DescriptorKind::kFloat ? d.floats.size() : d.bytes.size();
  if (d.rows != features.keypoints.size() || d.rows > kMaxRows || d.dim < 0 ||
      static_cast<std::uint32_t>(d.dim) > kMaxDim ||
      values != d.rows * static_cast<std::size_t>(d.dim)) {
    throw Error(ErrorCode::kInvalidArgument, "features_shape",
                "the descriptors do not fit the key points: " + std::to_string(d.rows) +
                    " rows of " + std::to_string(d.dim) + " for " +
                    std::to_string(features.keypoints.size()) + " key points");
  }
}

}  // namespace

std::uint32_t Crc32(Bytes bytes, std::uint32_t seed) {
  return static_cast<std::uint32_t>(::crc32_z(seed, bytes.data(), bytes.size()));
}

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
  out.push_back(0);
  Put(out, static_cast<std::uint32_t>(descriptors.rows));
  Put(out, static_cast<std::uint32_t>(descriptors.dim));
  Put(out, static_cast<std::uint32_t>(features.width));
  Put(out, static_cast<std::uint32_t>(features.height));
  for (const Keypoint& k : features.keypoints) {
    for (const float value : {k.x, k.y, k.size, k.angle, k.response}) Put(out, value);
    Put(out, k.octave);
  }
  PutDescriptors(out, descriptors, encoding);
  Put(out, Crc32(out));
  return out;
}

Features DecodeFeatures(Bytes blob) {
  const Bytes body = Checked(blob, "features");
  if (body.size() < kFeatureHeaderBytes ||
      std::memcmp(body.data(), kFeatureMagic, sizeof(kFeatureMagic)) != 0) {
    ThrowCorrupt("features do not begin with PLFT");
  }
  if (body[4] != kFeatureVersion) {
    ThrowCorrupt("features are of format version " + std::to_string(body[4]) +
                 ", which this Pliant does not read");
  }
  const auto encoding = static_cast<DescriptorEncoding>(body[6]);
  const bool binary = body[5] == static_cast<std::uint8_t>(DescriptorKind::kBinary);
  if (body[5] > 1 || body[6] > 2 || binary != (encoding == DescriptorEncoding::kBits)) {
    ThrowCorrupt("features have an unknown kind or encoding");
  }
  const auto rows = Get<std::uint32_t>(body, 8);
  const auto dim = Get<std::uint32_t>(body, 12);
  if (rows > kMaxRows || dim > kMaxDim) ThrowCorrupt("features claim an impossible size");
  const std::size_t keypoint_bytes = std::size_t{rows} * kKeypointBytes;
  if (body.size() != kFeatureHeaderBytes + keypoint_bytes + rows * RowBytes(encoding, dim)) {
    ThrowCorrupt("features have a length that differs from what their header says");
  }
  Features features;
  features.width = static_cast<int>(Get<std::uint32_t>(body, 16));
  features.height = static_cast<int>(Get<std::uint32_t>(body, 20));
  features.keypoints.reserve(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    const std::size_t at = kFeatureHeaderBytes + i * kKeypointBytes;
    features.keypoints.push_back({Get<float>(body, at), Get<float>(body, at + 4),
                                  Get<float>(body, at + 8), Get<float>(body, at + 12),
                                  Get<float>(body, at + 16), Get<std::int32_t>(body, at + 20)});
  }
  features.descriptors = GetDescriptors(body.subspan(kFeatureHeaderBytes + keypoint_bytes),
                                        encoding, rows, static_cast<int>(dim));
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
  std::vector<std::uint8_t> out;
  const bool is_signed = !bow.signatures.empty();
  if (is_signed && bow.signatures.size() != bow.words.size()) {
    throw Error(ErrorCode::kInternal, "bow_signatures",
                "a bag of words has more or fewer signatures than words");
  }
  out.reserve(8 + 3 * bow.words.size() + 8 * bow.signatures.size());
  const bool is_coded = !bow.codes.empty();
  if (is_coded && (!is_signed || bow.total == 0 || bow.codes.size() % bow.total != 0)) {
    throw Error(ErrorCode::kInternal, "bow_codes",
                "a bag of words has more or fewer codes than descriptors");
  }
  out.push_back(is_coded ? kCodedBowVersion : is_signed ? kSignedBowVersion : kBowVersion);
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
  for (const std::uint64_t signature : bow.signatures) Put(out, signature);
  if (is_coded) {
    PutVarint(out, static_cast<std::uint32_t>(bow.codes.size() / bow.total));
    out.insert(out.end(), bow.codes.begin(), bow.codes.end());
  }
  Put(out, Crc32(out));
  return out;
}

Bow DecodeBow(Bytes blob, std::size_t vocabulary_size) {
  const Bytes body = Checked(blob, "words");
  if (body.empty() || body[0] < kBowVersion || body[0] > kCodedBowVersion) {
    ThrowCorrupt("words are of an unknown format version");
  }
  std::size_t offset = 1;
  const std::uint32_t distinct = GetVarint(body, offset);
  if (distinct > body.size() || distinct > vocabulary_size) ThrowCorrupt("words are too many");
  Bow bow;
  bow.words.reserve(distinct);
  std::uint64_t next = 0;
  for (std::uint32_t i = 0; i < distinct; ++i) {
    const std::uint64_t word = next + GetVarint(body, offset);
    const std::uint32_t count = GetVarint(body, offset);
    if (word >= vocabulary_size || count == 0) ThrowCorrupt("words are outside the vocabulary");
    bow.words.push_back({static_cast<std::uint32_t>(word), count});
    bow.total += count;
    next = word + 1;
  }
  if (body[0] >= kSignedBowVersion) {
    if (body.size() - offset < std::size_t{distinct} * sizeof(std::uint64_t)) {
      ThrowCorrupt("words have fewer signatures than they need");
    }
    for (std::uint32_t i = 0; i < distinct; ++i, offset += sizeof(std::uint64_t)) {
      bow.signatures.push_back(Get<std::uint64_t>(body, offset));
    }
  }
  if (body[0] == kCodedBowVersion) {
    const std::size_t bytes = GetVarint(body, offset);
    if (bytes == 0 || body.size() - offset != bytes * bow.total) {
      ThrowCorrupt("words have more or fewer codes than they need");
    }
    const auto codes = body.subspan(offset);
    bow.codes.assign(codes.begin(), codes.end());
    offset = body.size();
  }
  if (offset != body.size()) ThrowCorrupt("words are followed by something else");
  return bow;
}

std::vector<std::uint8_t> EncodeCodebook(const Codebook& codebook) {
  std::vector<std::uint8_t> out;
  out.push_back(kCodebookVersion);
  PutVarint(out, static_cast<std::uint32_t>(codebook.code_bytes));
  PutVarint(out, static_cast<std::uint32_t>(codebook.part_dim));
  for (const float value : codebook.rotation) Put(out, value);
  for (const float value : codebook.centroids) Put(out, value);
  Put(out, Crc32(out));
  return out;
}

Codebook DecodeCodebook(Bytes blob, const Descriptors& words) {
  const Bytes body = Checked(blob, "codebooks");
  if (body.empty() || body[0] != kCodebookVersion) {
    ThrowCorrupt("codebooks are of an unknown format version");
  }
  std::size_t offset = 1;
  const std::uint32_t code_bytes = GetVarint(body, offset);
  const std::uint32_t part_dim = GetVarint(body, offset);
  if (code_bytes > kMaxDim || part_dim > kMaxDim) ThrowCorrupt("codebooks claim impossible sizes");
  Codebook codebook;
  codebook.code_bytes = static_cast<int>(code_bytes);
  codebook.part_dim = static_cast<int>(part_dim);
  const std::size_t rotation = codebook.padded_dim() * static_cast<std::size_t>(words.dim);
  const std::size_t centroids = codebook.padded_dim() * 16;
  const bool binary = words.kind == DescriptorKind::kBinary;
  if (body.size() - offset != (binary ? 0 : rotation + centroids) * sizeof(float)) {
    ThrowCorrupt("codebooks have another length than they say");
  }
  for (std::size_t i = 0; !binary && i < rotation + centroids; ++i, offset += sizeof(float)) {
    (i < rotation ? codebook.rotation : codebook.centroids).push_back(Get<float>(body, offset));
  }
  try {
    CheckCodebook(codebook, words);
  } catch (const Error& error) {
    ThrowCorrupt(error.what());
  }
  return codebook;
}

}  // namespace pliant
