// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/features_npz.h"

#include <algorithm>
#include <array>
#include <tuple>
#include <utility>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

template <typename Value>
std::string_view ViewOf(const std::vector<Value>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value)};
}

std::string_view RowsOf(const Descriptors& d) {
  return d.kind == DescriptorKind::kFloat ? ViewOf(d.floats) : ViewOf(d.bytes);
}

std::string_view NumberBytes(const std::int64_t& value) {
  return {reinterpret_cast<const char*>(&value), sizeof(value)};
}

std::string TextType(std::size_t length) { return "<U" + std::to_string(length); }

// Of keypoints and of their descriptors.
std::pair<std::size_t, std::size_t> DeclareRows(NpzArchive& archive, std::int64_t rows,
                                                DescriptorKind kind, int dim) {
  const std::array<std::int64_t, 2> points = {rows, 6};
  const std::array<std::int64_t, 2> descriptors = {rows, dim};
  const std::size_t keypoints = archive.Declare("keypoints", "<f4", points);
  return {keypoints, archive.Declare("descriptors", kind == DescriptorKind::kFloat ? "<f4" : "|u1",
                                     descriptors)};
}

}  // namespace

std::vector<float> KeypointRows(const Features& features) {
  std::vector<float> rows;
  for (const Keypoint& k : features.keypoints) {
    rows.insert(rows.end(), {k.x, k.y, k.size, k.angle, k.response, static_cast<float>(k.octave)});
  }
  return rows;
}

std::string FeaturesNpz(const Features& features) {
  std::string file;
  NpzArchive archive([&file](std::uint64_t offset, std::string_view bytes) {
    file.resize(std::max(file.size(), static_cast<std::size_t>(offset) + bytes.size()));
    file.replace(static_cast<std::size_t>(offset), bytes.size(), bytes);
  });
  const auto [keypoints, descriptors] =
      DeclareRows(archive, static_cast<std::int64_t>(features.keypoints.size()),
                  features.descriptors.kind, features.descriptors.dim);
  const std::size_t length = NpzArchive::TextLength(features.model_id);
  const std::size_t model_id = archive.Declare("model_id", TextType(length), {});
  const std::size_t width = archive.Declare("width", "<i8", {});
  const std::size_t height = archive.Declare("height", "<i8", {});
  file.reserve(static_cast<std::size_t>(archive.bytes()));
  archive.Append(keypoints, ViewOf(KeypointRows(features)));
  archive.Append(descriptors, RowsOf(features.descriptors));
  archive.AppendText(model_id, features.model_id, length);
  archive.Append(width, NumberBytes(features.width));
  archive.Append(height, NumberBytes(features.height));
  archive.Finish();
  return file;
}

void FeatureTotals::Count(std::string_view name, std::size_t keypoints) {
  ++images;
  rows += static_cast<std::int64_t>(keypoints);
  name_length = std::max(name_length, NpzArchive::TextLength(name));
}

FeaturesArchive::FeaturesArchive(const FeatureTotals& totals, NpzArchive::Write write)
    : totals_(totals), archive_(std::move(write)) {
  const std::int64_t images = totals.images;
  const std::int64_t starts = images + 1;
  std::tie(keypoints_, descriptors_) = DeclareRows(archive_, totals.rows, totals.kind, totals.dim);
  const std::size_t model_length = NpzArchive::TextLength(totals.model_id);
  const std::size_t model_id = archive_.Declare("model_id", TextType(model_length), {});
  names_ = archive_.Declare("names", TextType(totals.name_length), {&images, 1});
  if (totals.object_length > 0) {
    objects_ = archive_.Declare("objects", TextType(totals.object_length), {&images, 1});
  }
  starts_ = archive_.Declare("starts", "<i8", {&starts, 1});
  width_ = archive_.Declare("width", "<i8", {&images, 1});
  height_ = archive_.Declare("height", "<i8", {&images, 1});
  archive_.AppendText(model_id, totals.model_id, model_length);
  AddNumber(starts_, 0);
}

void FeaturesArchive::AddNumber(std::size_t array, std::int64_t value) {
  archive_.Append(array, NumberBytes(value));
}

void FeaturesArchive::Add(std::string_view name, std::string_view object,
                          const Features& features) {
  const Descriptors& d = features.descriptors;
  if (d.kind != totals_.kind || d.dim != totals_.dim || d.rows != features.keypoints.size()) {
    throw Error(ErrorCode::kInternal, "archive_incomplete", "an image's rows are of another kind");
  }
  archive_.Append(keypoints_, ViewOf(KeypointRows(features)));
  archive_.Append(descriptors_, RowsOf(d));
  archive_.AppendText(names_, name, totals_.name_length);
  if (totals_.object_length > 0) archive_.AppendText(objects_, object, totals_.object_length);
  rows_ += static_cast<std::int64_t>(d.rows);
  AddNumber(starts_, rows_);
  AddNumber(width_, features.width);
  AddNumber(height_, features.height);
}

void FeaturesArchive::Finish() { archive_.Finish(); }

}  // namespace pliant
