// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/safetensors.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <fstream>
#include <limits>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/replace_file.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "tensor data are little-endian");

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{1} << 30;  // of a file in memory
constexpr std::size_t kLengthBytes = 8;                            // of the header's length
constexpr std::size_t kMaxHeaderBytes = std::size_t{16} << 20;
constexpr std::size_t kMaxValues = std::size_t{1} << 40;  // of a tensor; keeps products below 2^63

[[noreturn]] void Fail(const std::string& file, const std::string& fault) {
  throw Error(ErrorCode::kCorrupt, "tensor_file_corrupt", file + ": " + fault);
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

nlohmann::json ParseJson(const std::string& file, std::string_view text) {
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
    Fail(file, std::to_string(data_bytes - at) + " bytes after the last tensor belong to none");
  }
}

// The header's length from the file's first bytes (`start`, at most 8); never more than the file
// has, nor more than any header needs.
std::size_t HeaderBytes(const std::string& file, std::string_view start,
                        std::uintmax_t file_bytes) {
  if (start.size() < kLengthBytes || file_bytes < kLengthBytes) {
    Fail(file, "has " + std::to_string(file_bytes) + " bytes, too short for a safetensors file");
  }
  std::uint64_t length = 0;
  std::memcpy(&length, start.data(), kLengthBytes);
  if (length > std::min<std::uintmax_t>(kMaxHeaderBytes, file_bytes - kLengthBytes)) {
    Fail(file, "the header's length, " + std::to_string(length) +
                   ", exceeds the file; truncated or not a safetensors file");
  }
  return static_cast<std::size_t>(length);
}

// `text` is the JSON. `data_bytes` of data follow it.
SafetensorsHeader ParseHeader(const std::string& file, std::string_view text,
                              std::size_t data_bytes) {
  SafetensorsHeader header;
  header.data_begin = kLengthBytes + text.size();
  const nlohmann::json json = ParseJson(file, text);
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

constexpr std::uint32_t kExponent = 0x7f800000;  // of a float; all ones: not finite

// IEEE 754 binary16, without branches: a start converts millions.
float FromHalf(std::uint16_t half) {
  constexpr float kBias = 0x1p112F;  // between the exponents of both types
  const std::uint32_t magnitude = (half & 0x7fffU) << 13U;
  const auto finite = std::bit_cast<std::uint32_t>(std::bit_cast<float>(magnitude) * kBias);
  const std::uint32_t value = magnitude < 0x7c00U << 13U ? finite : magnitude | kExponent;
  return std::bit_cast<float>(value | (half & 0x8000U) << 16U);
}

bool AllFinite(const std::vector<float>& values) {
  std::uint32_t largest = 0;
  for (const float value : values) {
    largest = std::max(largest, std::bit_cast<std::uint32_t>(value) & kExponent);
  }
  return largest < kExponent;
}

// A file whose header has been read and checked; the stream stands at the data.
class OpenFile {
 public:
  explicit OpenFile(const fs::path& path) : name_(path.string()) {
    std::error_code error;
    if (!fs::is_regular_file(path, error)) {
      throw Error(ErrorCode::kNotFound, "file_unreadable", name_ + ": there is no such file");
    }
    bytes_ = fs::file_size(path, error);
    stream_.open(path, std::ios::binary);
    if (error || !stream_) {
      throw Error(ErrorCode::kNotFound, "file_unreadable", name_ + " cannot be read");
    }
  }

  const std::string& name() const { return name_; }
  std::uintmax_t bytes() const { return bytes_; }

  // The next bytes.
  void Read(void* to, std::size_t bytes) {
    if (!stream_.read(static_cast<char*>(to), static_cast<std::streamsize>(bytes))) {
      Fail(name_, "ends early; truncated while it was read?");
    }
  }
  void SeekTo(std::size_t at) { stream_.seekg(static_cast<std::streamoff>(at)); }

  SafetensorsHeader ReadHeader() {
    std::string start(std::min<std::uintmax_t>(bytes_, kLengthBytes), ' ');
    Read(start.data(), start.size());
    std::string text(HeaderBytes(name_, start, bytes_), ' ');
    Read(text.data(), text.size());
    return ParseHeader(name_, text, static_cast<std::size_t>(bytes_) - kLengthBytes - text.size());
  }

 private:
  std::string name_;
  std::uintmax_t bytes_ = 0;
  std::ifstream stream_;
};

std::string HeaderText(const std::vector<Tensor>& tensors,
                       const std::map<std::string, std::string>& metadata) {
  using Json = nlohmann::ordered_json;
  Json header = Json::object();
  if (!metadata.empty()) header["__metadata__"] = metadata;
  std::size_t begin = 0;
  for (const Tensor& tensor : tensors) {
    const std::size_t end = begin + tensor.bytes.size();
    header[tensor.name] = {
        {"dtype", tensor.dtype}, {"shape", tensor.shape}, {"data_offsets", {begin, end}}};
    begin = end;
  }
  std::string text = header.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize((text.size() + 7) / 8 * 8, ' ');  // so that the data begin aligned
  return text;
}

std::string_view TextOf(const void* data, std::size_t bytes) {
  return {static_cast<const char*>(data), bytes};
}

}  // namespace

std::size_t TensorInfo::count() const {
  std::size_t product = 1;
  for (const std::int64_t extent : shape) product *= static_cast<std::size_t>(extent);
  return product;
}

std::string ShapeText(const TensorShape& shape) {
  std::string text = "[";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    text += (i == 0 ? "" : ", ") + std::to_string(shape[i]);
  }
  return text + "]";
}

SafetensorsHeader ReadSafetensorsHeader(const fs::path& path) {
  return OpenFile(path).ReadHeader();
}

std::vector<Tensor> ReadSafetensors(const fs::path& path) {
  OpenFile file(path);
  const SafetensorsHeader header = file.ReadHeader();
  std::vector<Tensor> tensors;
  tensors.reserve(header.tensors.size());
  for (const auto& [name, info] : header.tensors) {
    tensors.push_back({name, info.dtype, info.shape, {}});
    tensors.back().bytes.resize(info.end - info.begin);
    file.SeekTo(header.data_begin + info.begin);
    file.Read(tensors.back().bytes.data(), tensors.back().bytes.size());
  }
  return tensors;
}

std::error_code WriteSafetensors(const fs::path& path, const std::vector<Tensor>& tensors,
                                 const std::map<std::string, std::string>& metadata) {
  const std::string header = HeaderText(tensors, metadata);
  const std::uint64_t length = header.size();
  std::vector<std::string_view> parts = {TextOf(&length, sizeof length), header};
  for (const Tensor& tensor : tensors) {
    parts.push_back(TextOf(tensor.bytes.data(), tensor.bytes.size()));
  }
  return ReplaceFile(path, parts);
}

SafetensorsFile SafetensorsFile::Open(const fs::path& path) {
  OpenFile file(path);
  if (file.bytes() > kMaxFileBytes) Fail(file.name(), "is larger than 1 GiB");
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(file.bytes()));
  file.Read(bytes.data(), bytes.size());
  return Parse(std::move(bytes), file.name());
}

SafetensorsFile SafetensorsFile::Parse(std::vector<std::uint8_t> bytes, std::string name) {
  SafetensorsFile file;
  file.name_ = std::move(name);
  file.bytes_ = std::move(bytes);
  const std::string_view all = TextOf(file.bytes_.data(), file.bytes_.size());
  const std::size_t header_bytes = HeaderBytes(file.name_, all.substr(0, kLengthBytes), all.size());
  file.header_ = ParseHeader(file.name_, all.substr(kLengthBytes, header_bytes),
                             all.size() - kLengthBytes - header_bytes);
  return file;
}

std::span<const std::uint8_t> SafetensorsFile::Data(const TensorInfo& tensor) const {
  return std::span(bytes_).subspan(header_.data_begin + tensor.begin, tensor.end - tensor.begin);
}

std::vector<float> SafetensorsFile::Floats(const std::string& tensor) const {
  const auto fail = [&](const std::string& fault) { FailTensor(name_, tensor, fault); };
  const auto found = tensors().find(tensor);
  if (found == tensors().end()) fail("is missing");
  const TensorInfo& info = found->second;
  const bool is_half = info.dtype == "F16";
  if (!is_half && info.dtype != "F32") fail("is of type " + info.dtype + ", not F32 or F16");
  std::vector<float> values(info.count());
  if (values.empty()) return values;
  const std::span<const std::uint8_t> data = Data(info);
  if (is_half) {
    std::vector<std::uint16_t> halves(values.size());
    std::memcpy(halves.data(), data.data(), data.size());
    std::ranges::transform(halves, values.begin(), FromHalf);
  } else {
    std::memcpy(values.data(), data.data(), data.size());
  }
  if (!AllFinite(values)) fail("holds NaN or infinity");
  return values;
}

}  // namespace pliant
