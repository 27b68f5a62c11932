// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/features_file.h"

#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/base/safetensors.h"
#include "index/cli/npz_archive.h"
#include "index/cli/write_file.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

template <typename Value>
std::vector<std::uint8_t> BytesOf(const std::vector<Value>& values) {
  std::vector<std::uint8_t> bytes(values.size() * sizeof(Value));
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

template <typename Value>
std::string_view ViewOf(const std::vector<Value>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value)};
}

std::vector<float> KeypointRows(const Features& features) {
  std::vector<float> rows;
  for (const Keypoint& k : features.keypoints) {
    rows.insert(rows.end(), {k.x, k.y, k.size, k.angle, k.response, static_cast<float>(k.octave)});
  }
  return rows;
}

void WriteNpz(const std::filesystem::path& path, const Features& features) {
  const Descriptors& d = features.descriptors;
  const bool is_float = d.kind == DescriptorKind::kFloat;
  const std::array<std::int64_t, 2> points = {static_cast<std::int64_t>(features.keypoints.size()),
                                              6};
  const std::array<std::int64_t, 2> rows = {static_cast<std::int64_t>(d.rows), d.dim};
  NpzArchive archive;
  archive.Add("keypoints", "<f4", points, ViewOf(KeypointRows(features)));
  archive.Add("descriptors", is_float ? "<f4" : "|u1", rows,
              is_float ? ViewOf(d.floats) : ViewOf(d.bytes));
  archive.Add("width", "<i8", {}, ViewOf(std::vector<std::int64_t>{features.width}));
  archive.Add("height", "<i8", {}, ViewOf(std::vector<std::int64_t>{features.height}));
  archive.AddText("model_id", features.model_id);
  WriteFile(path, archive.Finish());
}

void WriteTensors(const std::filesystem::path& path, const Features& features) {
  const Descriptors& d = features.descriptors;
  const bool is_float = d.kind == DescriptorKind::kFloat;
  const auto points = static_cast<std::int64_t>(features.keypoints.size());
  const auto rows = static_cast<std::int64_t>(d.rows);
  const std::error_code error =
      WriteSafetensors(path,
                       {{"keypoints", "F32", {points, 6}, BytesOf(KeypointRows(features))},
                        {"descriptors",
                         is_float ? "F32" : "U8",
                         {rows, d.dim},
                         is_float ? BytesOf(d.floats) : BytesOf(d.bytes)}},
                       {{"model_id", features.model_id},
                        {"width", std::to_string(features.width)},
                        {"height", std::to_string(features.height)}});
  if (error) {
    throw Error(ErrorCode::kNoSpace, "write_failed",
                path.string() + " could not be written: " + error.message());
  }
}

}  // namespace

void CheckFeaturesName(const std::filesystem::path& path) {
  if (path.extension() == ".npz" || path.extension() == ".safetensors") return;
  throw Error(
      ErrorCode::kInvalidArgument, "bad_features_name",
      ToDisplayText(path.string()) +
          ": features are written as .npz (NumPy) or .safetensors; the name must say which");
}

void WriteFeatures(const std::filesystem::path& path, const Features& features) {
  CheckFeaturesName(path);
  if (path.extension() == ".npz") {
    WriteNpz(path, features);
  } else {
    WriteTensors(path, features);
  }
}

}  // namespace pliant::cli
