// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/safetensors.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/replace_file.h"
#include "descriptor/base/safetensors_header.h"

namespace pliant {
namespace {

// The i-th of little-endian halves (IEEE 754 binary16).
float HalfAt(std::span<const std::uint8_t> data, std::size_t i) {
  std::uint16_t bits = 0;
  std::memcpy(&bits, data.data() + i * sizeof(bits), sizeof(bits));
  return static_cast<float>(Eigen::numext::bit_cast<Eigen::half>(bits));
}

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "tensor data are little-endian");

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{1} << 30;  // of a file in memory

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
      FailSafetensors(name_, "ends early; truncated while it was read?");
    }
  }
  void SeekTo(std::size_t at) { stream_.seekg(static_cast<std::streamoff>(at)); }

  SafetensorsHeader ReadHeader() {
    std::string start(std::min<std::uintmax_t>(bytes_, kSafetensorsLengthBytes), ' ');
    Read(start.data(), start.size());
    std::string text(SafetensorsHeaderBytes(name_, start, bytes_), ' ');
    Read(text.data(), text.size());
    return ParseSafetensorsHeader(
        name_, text, static_cast<std::size_t>(bytes_) - kSafetensorsLengthBytes - text.size());
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
  if (file.bytes() > kMaxFileBytes) FailSafetensors(file.name(), "is larger than 1 GiB");
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(file.bytes()));
  file.Read(bytes.data(), bytes.size());
  return Parse(std::move(bytes), file.name());
}

SafetensorsFile SafetensorsFile::Parse(std::vector<std::uint8_t> bytes, std::string name) {
  SafetensorsFile file;
  file.name_ = std::move(name);
  file.bytes_ = std::move(bytes);
  const std::string_view all = TextOf(file.bytes_.data(), file.bytes_.size());
  const std::size_t header_bytes =
      SafetensorsHeaderBytes(file.name_, all.substr(0, kSafetensorsLengthBytes), all.size());
  file.header_ =
      ParseSafetensorsHeader(file.name_, all.substr(kSafetensorsLengthBytes, header_bytes),
                             all.size() - kSafetensorsLengthBytes - header_bytes);
  return file;
}

std::span<const std::uint8_t> SafetensorsFile::Data(const TensorInfo& tensor) const {
  return std::span(bytes_).subspan(header_.data_begin + tensor.begin, tensor.end - tensor.begin);
}

std::vector<float> SafetensorsFile::Floats(const std::string& tensor) const {
  const auto fail = [&](const std::string& fault) {
    FailSafetensors(name_, "tensor '" + tensor + "' " + fault);
  };
  const auto found = tensors().find(tensor);
  if (found == tensors().end()) fail("is missing");
  const TensorInfo& info = found->second;
  const bool is_half = info.dtype == "F16";
  if (!is_half && info.dtype != "F32") fail("is of type " + info.dtype + ", not F32 or F16");
  std::vector<float> values(info.count());
  const std::span<const std::uint8_t> data = Data(info);
  if (is_half) {
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = HalfAt(data, i);
  } else if (!values.empty()) {
    std::memcpy(values.data(), data.data(), data.size());
  }
  const bool finite =
      std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
  if (!finite) fail("holds NaN or infinity");
  return values;
}

}  // namespace pliant
