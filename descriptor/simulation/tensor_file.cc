// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/tensor_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <system_error>

#include "descriptor/base/error.h"

namespace pliant::simulation {
namespace {

namespace fs = std::filesystem;

std::size_t TypeSize(std::string_view type) {
  if (type == "U8" || type == "I8" || type == "BOOL") return 1;
  if (type == "U16" || type == "I16" || type == "F16" || type == "BF16") return 2;
  if (type == "U32" || type == "I32" || type == "F32") return 4;
  if (type == "U64" || type == "I64" || type == "F64") return 8;
  return 0;
}

// Just enough JSON for a safetensors header: objects, strings, arrays of whole numbers.
class HeaderParser {
 public:
  explicit HeaderParser(std::string_view text) : text_(text) {}

  [[noreturn]] static void Fail(const std::string& what) {
    throw Error(ErrorCode::kCorrupt, "tensor_file_corrupt", "broken safetensors header: " + what);
  }
  bool Accept(char wanted) {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n' || text_[at_] == '\t'))
      ++at_;
    if (at_ >= text_.size() || text_[at_] != wanted) return false;
    ++at_;
    return true;
  }
  void Expect(char wanted) {
    if (!Accept(wanted)) Fail(std::string("expected '") + wanted + "'");
  }
  std::string String() {
    Expect('"');
    std::string out;
    while (at_ < text_.size() && text_[at_] != '"') {
      if (text_[at_] == '\\') ++at_;
      if (at_ < text_.size()) out.push_back(text_[at_++]);
    }
    Expect('"');
    return out;
  }
  std::vector<std::size_t> Numbers() {
    std::vector<std::size_t> out;
    Expect('[');
    while (!Accept(']')) {
      if (!out.empty()) Expect(',');
      Accept(' ');
      std::size_t value = 0;
      const auto parsed = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
      if (parsed.ec != std::errc()) Fail("expected a number");
      at_ = static_cast<std::size_t>(parsed.ptr - text_.data());
      out.push_back(value);
    }
    return out;
  }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
};

struct Described {
  Tensor tensor;
  std::vector<std::size_t> offsets;
};

std::vector<Described> ParseHeader(std::string_view text) {
  HeaderParser parser(text);
  std::vector<Described> out;
  parser.Expect('{');
  while (!parser.Accept('}')) {
    Described described;
    described.tensor.name = parser.String();
    parser.Expect(':');
    parser.Expect('{');
    while (!parser.Accept('}')) {
      const std::string key = parser.String();
      parser.Expect(':');
      if (described.tensor.name == "__metadata__") {
        parser.String();
      } else if (key == "dtype") {
        described.tensor.type = parser.String();
      } else if (key == "shape") {
        described.tensor.shape = parser.Numbers();
      } else if (key == "data_offsets") {
        described.offsets = parser.Numbers();
      } else {
        HeaderParser::Fail("unknown key " + key);
      }
      parser.Accept(',');
    }
    parser.Accept(',');
    if (described.tensor.name != "__metadata__") out.push_back(std::move(described));
  }
  return out;
}

std::size_t CheckedSize(const Described& described, std::size_t data_size) {
  std::size_t size = TypeSize(described.tensor.type);
  for (const std::size_t extent : described.tensor.shape) {
    if (extent != 0 && size > data_size / extent)
      HeaderParser::Fail(described.tensor.name + " is larger than the file");
    size *= extent;
  }
  const auto& range = described.offsets;
  if (size == 0 || range.size() != 2 || range[1] > data_size || range[0] > range[1] ||
      range[1] - range[0] != size) {
    HeaderParser::Fail("type, shape and offsets of " + described.tensor.name + " do not fit");
  }
  return size;
}

}  // namespace

std::string JsonQuote(std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  std::string out(1, '"');
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (byte < 0x20) {
      out += "\\u00";
      out += kHex[byte >> 4U];
      out += kHex[byte & 15U];
    } else {
      out += c;
    }
  }
  out += '"';
  return out;
}

void WriteTensorFile(const fs::path& path, const std::vector<Tensor>& tensors,
                     const std::map<std::string, std::string>& metadata) {
  std::string header = "{\"__metadata__\":{";
  for (const auto& [key, value] : metadata) {
    if (header.back() != '{') header += ',';
    header += JsonQuote(key) + ':' + JsonQuote(value);
  }
  header += '}';
  std::size_t offset = 0;
  for (const Tensor& tensor : tensors) {
    header +=
        ',' + JsonQuote(tensor.name) + ":{\"dtype\":" + JsonQuote(tensor.type) + ",\"shape\":[";
    for (std::size_t i = 0; i < tensor.shape.size(); ++i)
      header += std::to_string(tensor.shape[i]) + (i + 1 < tensor.shape.size() ? "," : "");
    header += "],\"data_offsets\":[" + std::to_string(offset) + ',' +
              std::to_string(offset + tensor.bytes.size()) + "]}";
    offset += tensor.bytes.size();
  }
  header += '}';
  header.resize((header.size() + 7) / 8 * 8, ' ');
  const fs::path temporary = path.string() + ".part";
  std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
  const std::uint64_t length = header.size();
  for (unsigned byte = 0; byte < 8; ++byte)
    file.put(static_cast<char>((length >> (8U * byte)) & 0xFFU));
  file.write(header.data(), static_cast<std::streamsize>(header.size()));
  for (const Tensor& tensor : tensors) {
    file.write(reinterpret_cast<const char*>(tensor.bytes.data()),
               static_cast<std::streamsize>(tensor.bytes.size()));
  }
  file.close();
  std::error_code failed;
  if (file) fs::rename(temporary, path, failed);
  if (!file || failed) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw Error(
        ErrorCode::kNoSpace, "file_unwritable",
        "cannot write " + path.string() + "; is the folder writable and the disk not full?");
  }
}

std::vector<Tensor> ReadTensorFile(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(ErrorCode::kNotFound, "file_unreadable", "cannot read " + path.string());
  const std::uint64_t file_size = fs::file_size(path);
  std::array<unsigned char, 8> raw{};
  file.read(reinterpret_cast<char*>(raw.data()), raw.size());
  std::uint64_t length = 0;
  for (unsigned byte = 0; byte < 8; ++byte)
    length |= static_cast<std::uint64_t>(raw[byte]) << (8U * byte);
  if (!file || length > file_size - 8) HeaderParser::Fail(path.string() + " is too short");
  std::string header(length, ' ');
  file.read(header.data(), static_cast<std::streamsize>(length));
  std::vector<Described> described = ParseHeader(header);
  std::ranges::sort(described, {}, [](const Described& d) { return d.tensor.name; });
  const std::size_t data_size = file_size - 8 - length;
  std::vector<Tensor> tensors;
  for (Described& one : described) {
    one.tensor.bytes.resize(CheckedSize(one, data_size));
    file.seekg(static_cast<std::streamoff>(8 + length + one.offsets[0]));
    file.read(reinterpret_cast<char*>(one.tensor.bytes.data()),
              static_cast<std::streamsize>(one.tensor.bytes.size()));
    if (!file) HeaderParser::Fail(path.string() + " ends early");
    tensors.push_back(std::move(one.tensor));
  }
  return tensors;
}

}  // namespace pliant::simulation
