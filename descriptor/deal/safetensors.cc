// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/safetensors.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"

namespace pliant::deal {
namespace {

static_assert(std::endian::native == std::endian::little, "tensor data is read as little-endian");

constexpr std::size_t kMaxFileBytes = std::size_t{1} << 30;
constexpr std::size_t kMaxHeaderBytes = std::size_t{16} << 20;
constexpr std::size_t kLengthBytes = 8;

[[noreturn]] void Fail(const std::string& file, const std::string& fault) {
  throw Error(ErrorCode::kCorrupt, "model_corrupt", file + ": " + fault);
}

[[noreturn]] void FailTensor(const std::string& file, const std::string& tensor,
                             const std::string& fault) {
  Fail(file, "tensor '" + tensor + "' " + fault);
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
  if (!header.is_object()) Fail(file, "the header is not a JSON object; not a safetensors file?");
  return header;
}

std::map<std::string, std::string> ParseMetadata(const std::string& file,
                                                 const nlohmann::json& object) {
  if (!object.is_object()) Fail(file, "__metadata__ is not a JSON object");
  std::map<std::string, std::string> metadata;
  for (const auto& [key, value] : object.items()) {
    if (!value.is_string()) Fail(file, "__metadata__ '" + key + "' is not a string");
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

  if (!entry["shape"].is_array()) FailTensor(file, name, "has a shape that is not an array");
  std::size_t expected = type_bytes;
  for (const nlohmann::json& value : entry["shape"]) {
    std::size_t extent = 0;
    if (!ReadSize(value, &extent)) FailTensor(file, name, "has an extent that is not a size");
    if (extent != 0 && expected > kMaxFileBytes / extent) {
      FailTensor(file, name, "has a shape larger than any file that is read");
    }
    expected *= extent;
    info.shape.push_back(static_cast<std::int64_t>(extent));
  }

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
    Fail(file, std::to_string(data_bytes - at) + " bytes after the last tensor belong to none");
  }
}

}  // namespace

std::size_t TensorInfo::count() const {
  std::size_t product = 1;
  for (const std::int64_t extent : shape) product *= static_cast<std::size_t>(extent);
  return product;
}

std::string ShapeText(const std::vector<std::int64_t>& shape) {
  std::string text = "[";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    text += (i == 0 ? "" : ", ") + std::to_string(shape[i]);
  }
  return text + "]";
}

SafetensorsFile SafetensorsFile::Open(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    throw Error(ErrorCode::kNotFound, "model_not_found",
                path.string() + ": no such weight file; give the path of a .safetensors file");
  }
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) Fail(path.string(), "cannot be read (" + error.message() + ")");
  if (size > kMaxFileBytes) Fail(path.string(), "is larger than 1 GiB; not a DEAL weight file");
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
  std::ifstream stream(path, std::ios::binary);
  if (!stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size))) {
    Fail(path.string(), "cannot be read");
  }
  return Parse(std::move(bytes), path.string());
}

SafetensorsFile SafetensorsFile::Parse(std::vector<std::uint8_t> bytes, std::string name) {
  SafetensorsFile file;
  file.name_ = std::move(name);
  file.bytes_ = std::move(bytes);
  if (file.bytes_.size() < kLengthBytes) {
    Fail(file.name_,
         "has " + std::to_string(file.bytes_.size()) + " bytes, too short for a safetensors file");
  }
  std::uint64_t header_bytes = 0;
  std::memcpy(&header_bytes, file.bytes_.data(), kLengthBytes);
  if (header_bytes > std::min(kMaxHeaderBytes, file.bytes_.size() - kLengthBytes)) {
    Fail(file.name_, "the header's length, " + std::to_string(header_bytes) +
                         ", exceeds the file; truncated or not a safetensors file");
  }
  file.data_start_ = kLengthBytes + static_cast<std::size_t>(header_bytes);
  const std::size_t data_bytes = file.bytes_.size() - file.data_start_;
  const std::string_view text(reinterpret_cast<const char*>(file.bytes_.data()) + kLengthBytes,
                              static_cast<std::size_t>(header_bytes));
  const nlohmann::json header = ParseHeader(file.name_, text);
  for (const auto& [key, entry] : header.items()) {
    if (key == "__metadata__") {
      file.metadata_ = ParseMetadata(file.name_, entry);
    } else {
      file.tensors_.emplace(key, ParseTensor(file.name_, key, entry, data_bytes));
    }
  }
  CheckLayout(file.name_, file.tensors_, data_bytes);
  return file;
}

std::vector<float> SafetensorsFile::Floats(const std::string& tensor) const {
  const auto found = tensors_.find(tensor);
  if (found == tensors_.end()) FailTensor(name_, tensor, "is missing");
  const TensorInfo& info = found->second;
  if (info.dtype != "F32") FailTensor(name_, tensor, "is of type " + info.dtype + ", not F32");
  std::vector<float> values(info.count());
  if (!values.empty()) {
    std::memcpy(values.data(), bytes_.data() + data_start_ + info.begin, info.end - info.begin);
  }
  const bool finite =
      std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
  if (!finite) FailTensor(name_, tensor, "holds NaN or infinity");
  return values;
}

}  // namespace pliant::deal
