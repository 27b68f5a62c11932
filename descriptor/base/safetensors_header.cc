// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/safetensors_header.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

constexpr std::size_t kMaxHeaderBytes = std::size_t{16} << 20;
constexpr std::size_t kMaxValues = std::size_t{1} << 40;  // of a tensor; keeps products below 2^63

[[noreturn]] void FailTensor(const std::string& file, const std::string& tensor,
                             const std::string& fault) {
  FailSafetensors(file, "tensor '" + tensor + "' " + fault);
}

// Bytes a value, 0 for a type that the format does not know.
std::size_t TypeBytes(std::string_view dtype) {
  static const std::map<std::string_view, std::size_t> sizes = {
      {"BOOL", 1}, {"U8", 1},  {"I8", 1},  {"F8_E4M3", 1}, {"F8_E5M2", 1},
      {"I16", 2},  {"U16", 2}, {"F16", 2}, {"BF16", 2},    {"I32", 4},
      {"U32", 4},  {"F32", 4}, {"I64", 8}, {"U64", 8},     {"F64", 8}};
  const auto found = sizes.find(dtype);
  return found == sizes.end() ? 0 : found->second;
}

nlohmann::json ParseHeader(const std::string& file, std::string_view text) {
  std::set<std::string> seen;
  std::string duplicate;
  const auto callback = [&](int depth, nlohmann::json::parse_event_t event,
                            const nlohmann::json& value) {
    if (event == nlohmann::json::parse_event_t::key && depth == 1 &&
        !seen.insert(value.get<std::string>()).second && duplicate.empty()) {
      duplicate = value.get<std::string>();
    }
    return true;
  };
  const nlohmann::json header = nlohmann::json::parse(text, callback, /*allow_exceptions=*/false);
  if (!duplicate.empty()) FailTensor(file, duplicate, "is described twice");
  if (!header.is_object())
    FailSafetensors(file, "the header is not a JSON object; not a safetensors file?");
  return header;
}

std::map<std::string, std::string> ParseMetadata(const std::string& file,
                                                 const nlohmann::json& object) {
  if (!object.is_object()) FailSafetensors(file, "__metadata__ is not a JSON object");
  std::map<std::string, std::string> metadata;
  for (const auto& [key, value] : object.items()) {
    if (!value.is_string()) FailSafetensors(file, "__metadata__ '" + key + "' is not a string");
    metadata.emplace(key, value.get<std::string>());
  }
  return metadata;
}

// A JSON number as a size; nothing for anything but a non-negative integer below 2^63.
bool ReadSize(const nlohmann::json& value, std::size_t* size) {
  if (!value.is_number_unsigned()) return false;
  const auto number = value.get<std::uint64_t>();
  if (number > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())) return false;
  *size = static_cast<std::size_t>(number);
  return true;
}

// Fills the shape and returns how many values it has.
std::size_t ParseShape(const std::string& file, const std::string& name,
                       const nlohmann::json& extents, TensorShape* shape) {
  if (!extents.is_array()) FailTensor(file, name, "has a shape that is not an array");
  std::size_t count = 1;
  for (const nlohmann::json& value : extents) {
    std::size_t extent = 0;
    if (!ReadSize(value, &extent)) FailTensor(file, name, "has an extent that is not a size");
    if (extent != 0 && count > kMaxValues / extent) {
      FailTensor(file, name, "has a shape larger than any file that is read");
    }
    count *= extent;
    shape->push_back(static_cast<std::int64_t>(extent));
  }
  return count;
}

TensorInfo ParseTensor(const std::string& file, const std::string& name,
                       const nlohmann::json& entry, std::size_t data_bytes) {
  if (!entry.is_object() || !entry.contains("dtype") || !entry.contains("shape") ||
      !entry.contains("data_offsets")) {
    FailTensor(file, name, "needs dtype, shape and data_offsets");
  }
  TensorInfo info;
  if (!entry["dtype"].is_string()) FailTensor(file, name, "has a dtype that is not a string");
  info.dtype = entry["dtype"].get<std::string>();
  const std::size_t type_bytes = TypeBytes(info.dtype);
  if (type_bytes == 0) FailTensor(file, name, "has the unknown dtype '" + info.dtype + "'");

  const std::size_t expected = type_bytes * ParseShape(file, name, entry["shape"], &info.shape);

  const nlohmann::json& offsets = entry["data_offsets"];
  if (!offsets.is_array() || offsets.size() != 2 || !ReadSize(offsets[0], &info.begin) ||
      !ReadSize(offsets[1], &info.end) || info.begin > info.end) {
    FailTensor(file, name, "has data_offsets that are not [begin, end]");
  }
  if (info.end > data_bytes) {
    FailTensor(file, name,
               "ends at byte " + std::to_string(info.end) + " of " + std::to_string(data_bytes) +
                   " bytes of data; the file is truncated");
  }
  if (info.end - info.begin != expected) {
    FailTensor(file, name,
               "holds " + std::to_string(info.end - info.begin) + " bytes, but its shape " +
                   ShapeText(info.shape) + " needs " + std::to_string(expected));
  }
  return info;
}

void CheckLayout(const std::string& file, const std::map<std::string, TensorInfo>& tensors,
                 std::size_t data_bytes) {
  std::vector<std::pair<const std::string*, const TensorInfo*>> order;
  order.reserve(tensors.size());
  for (const auto& [name, info] : tensors) order.emplace_back(&name, &info);
  std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
    return std::pair(a.second->begin, a.second->end) < std::pair(b.second->begin, b.second->end);
  });
  std::size_t at = 0;
  for (const auto& [name, info] : order) {
    if (info->begin < at) FailTensor(file, *name, "overlaps the tensor before it");
    if (info->begin > at) FailTensor(file, *name, "leaves a gap before it");
    at = info->end;
  }
  if (at != data_bytes) {
    FailSafetensors(
        file, std::to_string(data_bytes - at) + " bytes after the last tensor belong to none");
  }
}

}  // namespace

void FailSafetensors(const std::string& file, const std::string& fault) {
  throw Error(ErrorCode::kCorrupt, "tensor_file_corrupt", file + ": " + fault);
}

std::size_t SafetensorsHeaderBytes(const std::string& file, std::string_view start,
                                   std::uintmax_t file_bytes) {
  if (start.size() < kSafetensorsLengthBytes || file_bytes < kSafetensorsLengthBytes) {
    FailSafetensors(
        file, "has " + std::to_string(file_bytes) + " bytes, too short for a safetensors file");
  }
  std::uint64_t length = 0;
  std::memcpy(&length, start.data(), kSafetensorsLengthBytes);
  if (length > std::min<std::uintmax_t>(kMaxHeaderBytes, file_bytes - kSafetensorsLengthBytes)) {
    FailSafetensors(file, "the header's length, " + std::to_string(length) +
                              ", exceeds the file; truncated or not a safetensors file");
  }
  return static_cast<std::size_t>(length);
}

SafetensorsHeader ParseSafetensorsHeader(const std::string& file, std::string_view text,
                                         std::size_t data_bytes) {
  SafetensorsHeader header;
  header.data_begin = kSafetensorsLengthBytes + text.size();
  const nlohmann::json json = ParseHeader(file, text);
  for (const auto& [key, entry] : json.items()) {
    if (key == "__metadata__") {
      header.metadata = ParseMetadata(file, entry);
    } else {
      header.tensors.emplace(key, ParseTensor(file, key, entry, data_bytes));
    }
  }
  CheckLayout(file, header.tensors, data_bytes);
  return header;
}

}  // namespace pliant
