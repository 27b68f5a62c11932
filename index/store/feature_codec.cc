// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/feature_codec.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "descriptor/base/error.h"
#include "index/store/blob_bytes.h"

namespace pliant {
namespace {

constexpr char kFeatureMagic[4] = {'P', 'L', 'F', 'T'};
constexpr std::uint8_t kFeatureVersion = 1;
constexpr std::size_t kFeatureHeaderBytes = 24;
constexpr std::size_t kKeypointBytes = 24;
constexpr std::uint32_t kMaxRows = 1u << 20;
constexpr std::uint8_t kWithColours = 1;
constexpr std::size_t kColourHeaderBytes = 4;
constexpr std::uint16_t kMaxColourSide = 1024;
constexpr float kLargestScale = std::numeric_limits<float>::max() / 128.0F;  // of 8-bit steps

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

}  // namespace pliant
