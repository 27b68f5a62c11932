// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/npz_archive.h"

#include <algorithm>
#include <utility>

#include <zlib.h>

#include "descriptor/base/error.h"
#include "descriptor/base/utf8.h"

namespace pliant {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{1} << 31;
constexpr int kNeededVersion = 20;  // of zip: 2.0
constexpr int kDate =
    (0 << 9) | (1 << 5) | 1;  // 1980-01-01, the earliest: files do not depend on the time

void Put(std::string& out, std::uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 0xFF);
}

// The part that a file's local header and its entry in the directory share.
void PutDescription(std::string& out, std::uint32_t crc, std::uint32_t size, std::size_t name) {
  Put(out, kNeededVersion, 2);
  Put(out, 0, 2);  // flags
  Put(out, 0, 2);  // method: stored
  Put(out, 0, 2);  // time
  Put(out, kDate, 2);
  Put(out, crc, 4);
  Put(out, size, 4);
  Put(out, size, 4);
  Put(out, static_cast<std::uint32_t>(name), 2);
  Put(out, 0, 2);  // extra field
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
  Put(header, static_cast<std::uint32_t>(text.size()), 2);
  return header + text;
}

}  // namespace

void NpzArchive::Add(std::string_view name, std::string_view dtype,
                     std::span<const std::int64_t> shape, std::string_view values) {
  const std::string header = NpyHeader(dtype, shape);
  if (files_.size() + header.size() + values.size() > kMaxBytes) {
    throw Error(
        ErrorCode::kTooLarge, "archive_too_large",
        "A .npz holds at most 2 GiB: describe fewer pictures at once, or with fewer key points, "
        "or write .safetensors");
  }
  const auto bytes = [](std::string_view text) {
    return reinterpret_cast<const Bytef*>(text.data());
  };
  uLong crc = crc32_z(0, bytes(header), header.size());
  crc = crc32_z(crc, bytes(values), values.size());
  Entry entry{std::string(name) + ".npy", static_cast<std::uint32_t>(crc),
              static_cast<std::uint32_t>(header.size() + values.size()),
              static_cast<std::uint32_t>(files_.size())};
  files_ += "PK\x03\x04";
  PutDescription(files_, entry.crc, entry.size, entry.name.size());
  files_.append(entry.name).append(header).append(values);
  entries_.push_back(std::move(entry));
}

void NpzArchive::AddText(std::string_view name, std::string_view text) {
  const std::u32string points = DecodeUtf8(text);
  std::string values;
  for (const char32_t point : points) Put(values, point, 4);
  if (values.empty()) Put(values, 0, 4);  // NumPy has no text of length 0
  Add(name, "<U" + std::to_string(values.size() / 4), {}, values);
}

void NpzArchive::AddTexts(std::string_view name, std::span<const std::string> texts) {
  std::vector<std::u32string> decoded;
  std::size_t longest = 1;
  for (const std::string& text : texts) {
    decoded.push_back(DecodeUtf8(text));
    longest = std::max(longest, decoded.back().size());
  }
  std::string values;
  for (std::u32string& points : decoded) {
    points.resize(longest);  // NumPy fills up with zeros
    for (const char32_t point : points) Put(values, point, 4);
  }
  const std::int64_t count = static_cast<std::int64_t>(texts.size());
  Add(name, "<U" + std::to_string(longest), {&count, 1}, values);
}

std::string NpzArchive::Finish() const {
  std::string directory;
  for (const Entry& entry : entries_) {
    directory += "PK\x01\x02";
    Put(directory, kNeededVersion, 2);
    PutDescription(directory, entry.crc, entry.size, entry.name.size());
    Put(directory, 0, 2);  // comment
    Put(directory, 0, 2);  // disk
    Put(directory, 0, 2);  // internal attributes
    Put(directory, 0, 4);  // external attributes
    Put(directory, entry.offset, 4);
    directory += entry.name;
  }
  std::string end = "PK\x05\x06";
  Put(end, 0, 4);  // this disk, and that of the directory
  Put(end, static_cast<std::uint32_t>(entries_.size()), 2);
  Put(end, static_cast<std::uint32_t>(entries_.size()), 2);
  Put(end, static_cast<std::uint32_t>(directory.size()), 4);
  Put(end, static_cast<std::uint32_t>(files_.size()), 4);
  Put(end, 0, 2);  // comment
  return files_ + directory + end;
}

}  // namespace pliant
