// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/features_npz.h"

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>
#include <utility>

#include <zlib.h>

#include "descriptor/base/error.h"
#include "descriptor/base/utf8.h"

namespace pliant {
namespace {

constexpr std::uint64_t kMost32 = std::numeric_limits<std::uint32_t>::max();
constexpr int kDate =
    (0 << 9) | (1 << 5) | 1;  // 1980-01-01, the earliest: files do not depend on the time
// Sizes of what has no name in it (PKWARE's APPNOTE.TXT, section 4.3), with ZIP64's extra fields:
// two sizes, and in the directory the offset as well.
constexpr std::uint64_t kHeadExtra = 4 + 16;
constexpr std::uint64_t kEntryExtra = 4 + 24;
constexpr std::uint64_t kHeadBytes = 30 + kHeadExtra;
constexpr std::uint64_t kEntryBytes = 46 + kEntryExtra;
constexpr std::uint64_t kEndBytes = 56 + 20 + 22;  // ZIP64's end, where that is, and the plain end
constexpr int kVersion = 45;                       // of zip: 4.5 has ZIP64

void Put(std::string& out, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 0xFF);
}

std::uint32_t Crc(std::uint32_t before, std::string_view bytes) {
  if (bytes.empty()) return before;  // zlib returns the initial value for a null pointer
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html, version 1.0
std::string NpyHeader(std::string_view dtype, std::span<const std::int64_t> shape) {
  std::string text = "{'descr': '" + std::string(dtype) + "', 'fortran_order': False, 'shape': (";
  for (const std::int64_t side : shape) text += std::to_string(side) + ",";
  text += "), }";
  constexpr std::size_t kBefore = 10;
  while ((kBefore + text.size() + 1) % 64 != 0) text += ' ';
  text += '\n';
  std::string header = "\x93NUMPY";
  Put(header, 1, 2);  // major, minor
  Put(header, text.size(), 2);
  return header + text;
}

std::uint64_t ValueBytes(std::string_view dtype) {
  const std::uint64_t count = std::stoull(std::string(dtype.substr(2)));
  return dtype[1] == 'U' ? 4 * count : count;
}

// The part that a file's head and its entry in the directory share.
void PutDescription(std::string& out, std::uint32_t crc, std::uint64_t name, std::uint64_t extra) {
  Put(out, kVersion, 2);
  Put(out, 0, 2);  // flags
  Put(out, 0, 2);  // method: stored
  Put(out, 0, 2);  // time
  Put(out, kDate, 2);
  Put(out, crc, 4);
  Put(out, kMost32, 4);  // both sizes are in the extra field
  Put(out, kMost32, 4);
  Put(out, name, 2);
  Put(out, extra, 2);
}

void PutExtra(std::string& out, std::uint64_t bytes, std::uint64_t size) {
  Put(out, 1, 2);  // ZIP64
  Put(out, bytes - 4, 2);
  Put(out, size, 8);
  Put(out, size, 8);
}

template <typename Value>
std::string_view ViewOf(const std::vector<Value>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value)};
}

// N x 6, row-major.
std::vector<float> KeypointRows(const Features& features) {
  std::vector<float> rows;
  for (const Keypoint& k : features.keypoints) {
    rows.insert(rows.end(), {k.x, k.y, k.size, k.angle, k.response, static_cast<float>(k.octave)});
  }
  return rows;
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

std::size_t NpzArchive::Declare(std::string_view name, std::string_view dtype,
                                std::span<const std::int64_t> shape) {
  Entry entry;
  entry.name = std::string(name) + ".npy";
  entry.header = NpyHeader(dtype, shape);
  std::uint64_t count = 1;
  for (const std::int64_t side : shape) count *= static_cast<std::uint64_t>(side);
  entry.size = entry.header.size() + count * ValueBytes(dtype);
  entries_.push_back(std::move(entry));
  return entries_.size() - 1;
}

// Gives everything its place.
void NpzArchive::Place() {
  if (placed_) return;
  placed_ = true;
  std::uint64_t entries = 0;
  for (Entry& entry : entries_) {
    entry.offset = directory_;
    entry.begin = entry.offset + kHeadBytes + entry.name.size();
    directory_ = entry.begin + entry.size;
    entries += kEntryBytes + entry.name.size();
  }
  bytes_ = directory_ + entries + kEndBytes;
  for (std::size_t i = 0; i < entries_.size(); ++i) Append(i, entries_[i].header);
}

std::uint64_t NpzArchive::bytes() {
  Place();
  return bytes_;
}

void NpzArchive::Append(std::size_t array, std::string_view values) {
  Place();
  Entry& entry = entries_[array];
  if (entry.written + values.size() > entry.size) {
    throw Error(ErrorCode::kInternal, "archive_incomplete", "more values than were declared");
  }
  entry.crc = Crc(entry.crc, values);
  write_(entry.begin + entry.written, values);
  entry.written += values.size();
}

std::size_t NpzArchive::TextLength(std::string_view text) {
  return std::max<std::size_t>(1, DecodeUtf8(text).size());
}

void NpzArchive::AppendText(std::size_t array, std::string_view text, std::size_t length) {
  std::u32string points = DecodeUtf8(text);
  points.resize(length);  // NumPy fills up with zeros
  std::string values;
  for (const char32_t point : points) Put(values, point, 4);
  Append(array, values);
}

std::string NpzArchive::Head(const Entry& entry) const {
  std::string head = "PK\x03\x04";
  PutDescription(head, entry.crc, entry.name.size(), kHeadExtra);
  head += entry.name;
  PutExtra(head, kHeadExtra, entry.size);
  return head;
}

std::string NpzArchive::Directory() const {
  std::string directory;
  for (const Entry& entry : entries_) {
    directory += "PK\x01\x02";
    Put(directory, kVersion, 2);
    PutDescription(directory, entry.crc, entry.name.size(), kEntryExtra);
    Put(directory, 0, 2);        // comment
    Put(directory, 0, 2);        // disk
    Put(directory, 0, 2);        // internal attributes
    Put(directory, 0, 4);        // external attributes
    Put(directory, kMost32, 4);  // the offset is in the extra field
    directory += entry.name;
    PutExtra(directory, kEntryExtra, entry.size);
    Put(directory, entry.offset, 8);
  }
  const std::uint64_t size = directory.size();
  directory += "PK\x06\x06";
  Put(directory, 56 - 12, 8);  // what follows of it
  Put(directory, kVersion, 2);
  Put(directory, kVersion, 2);
  Put(directory, 0, 8);  // this disk, and that of the directory
  Put(directory, entries_.size(), 8);
  Put(directory, entries_.size(), 8);
  Put(directory, size, 8);
  Put(directory, directory_, 8);
  directory += "PK\x06\x07";
  Put(directory, 0, 4);  // disk
  Put(directory, directory_ + size, 8);
  Put(directory, 1, 4);  // disks
  directory += "PK\x05\x06";
  Put(directory, 0, 4);
  Put(directory, entries_.size(), 2);
  Put(directory, entries_.size(), 2);
  Put(directory, kMost32, 4);  // the directory's size and place, which ZIP64 has
  Put(directory, kMost32, 4);
  Put(directory, 0, 2);  // comment
  return directory;
}

void NpzArchive::Finish() {
  Place();
  for (const Entry& entry : entries_) {
    if (entry.written != entry.size) {
      throw Error(ErrorCode::kInternal, "archive_incomplete", "fewer values than were declared");
    }
    write_(entry.offset, Head(entry));
  }
  write_(directory_, Directory());
}

NpzArchive::Write NpzArchive::ToMemory(std::string* file) {
  return [file](std::uint64_t offset, std::string_view bytes) {
    file->resize(std::max(file->size(), static_cast<std::size_t>(offset) + bytes.size()));
    file->replace(static_cast<std::size_t>(offset), bytes.size(), bytes);
  };
}

std::string FeaturesNpz(const Features& features) {
  std::string file;
  NpzArchive archive(NpzArchive::ToMemory(&file));
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
