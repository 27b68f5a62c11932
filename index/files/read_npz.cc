// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/read_npz.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <system_error>
#include <utility>
#include <vector>

#include <zlib.h>

#include "descriptor/base/error.h"
#include "index/files/image_files.h"
#include "index/files/text.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMaxBytes = 256LL << 20;  // of a file, and of an unpacked array
constexpr std::int64_t kMaxColumns = 1 << 14;    // of descriptors
constexpr float kMostValue = 1e9F;               // of a keypoint
constexpr std::int64_t kMostSide = 1'000'000;    // pixels
constexpr std::uint32_t kIn64 = 0xFFFFFFFF;      // the number is where ZIP64 says
constexpr std::uint16_t kStored = 0;             // methods of zip
constexpr std::uint16_t kDeflated = 8;

struct Array {
  std::string dtype;  // NumPy's, such as "<f4"
  std::vector<std::int64_t> shape;
  std::vector<std::uint8_t> values;  // with the header before `begin`
  std::size_t begin = 0;

  template <typename Value>
  std::vector<Value> Values() const {
    std::vector<Value> result((values.size() - begin) / sizeof(Value));
    if (!result.empty()) {
      std::memcpy(result.data(), values.data() + begin, result.size() * sizeof(Value));
    }
    return result;
  }
};

// A zip archive without comment (PKWARE's APPNOTE.TXT, section 4.3), of .npy files
// (https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html).
class NpzFile {
 public:
  explicit NpzFile(const fs::path& path)
      : name_(ToDisplayText(path.string())), bytes_(ReadFile(path, kMaxBytes)) {}

  // Throws if it is missing or is not of one of these types, or does not have these many
  // dimensions.
  Array Read(const std::string& array, const std::string& types, std::size_t dimensions) const;

  [[noreturn]] void Fail(const std::string& what) const {
    throw Error(ErrorCode::kCorrupt, "features_unreadable", name_ + ": " + what);
  }

 private:
  Bytes Part(Bytes all, std::uint64_t offset, std::uint64_t size) const {
    if (offset > all.size() || size > all.size() - offset) Fail("it is no complete .npz file");
    return all.subspan(static_cast<std::size_t>(offset), static_cast<std::size_t>(size));
  }
  template <typename Value>
  Value Number(Bytes all, std::uint64_t offset) const {
    Value value = 0;
    std::memcpy(&value, Part(all, offset, sizeof value).data(), sizeof value);
    return value;
  }
  // Where the directory begins, and its number of entries.
  std::pair<std::uint64_t, std::uint64_t> Directory() const;
  // Of an entry: packed and unpacked size, and the offset of the head.
  std::array<std::uint64_t, 3> Sizes(Bytes entry) const;
  std::vector<std::uint8_t> Unpack(Bytes entry) const;
  Array ParseNpy(const std::string& array, std::vector<std::uint8_t> file) const;

  std::string name_;
  std::vector<std::uint8_t> bytes_;
};

std::pair<std::uint64_t, std::uint64_t> NpzFile::Directory() const {
  constexpr std::uint64_t kEnd = 22;
  constexpr std::uint64_t kLocator = 20;  // of ZIP64, before the end
  const std::uint64_t at = std::max<std::uint64_t>(bytes_.size(), kEnd) - kEnd;
  const auto offset = Number<std::uint32_t>(bytes_, at + 16);
  if (offset != kIn64) return {offset, Number<std::uint16_t>(bytes_, at + 10)};
  const auto end = Number<std::uint64_t>(bytes_, at - kLocator + 8);
  return {Number<std::uint64_t>(Part(bytes_, end, 56), 48),
          Number<std::uint64_t>(Part(bytes_, end, 56), 32)};
}

std::array<std::uint64_t, 3> NpzFile::Sizes(Bytes entry) const {
  const auto name = Number<std::uint16_t>(entry, 28);
  const Bytes extra = Part(entry, 46 + std::uint64_t{name}, Number<std::uint16_t>(entry, 30));
  const bool is_64 = extra.size() > 4 && Number<std::uint16_t>(extra, 0) == 1;
  std::uint64_t at = 4;
  const auto read = [&](std::uint64_t offset) -> std::uint64_t {
    const auto number = Number<std::uint32_t>(entry, offset);
    if (number != kIn64 || !is_64) return number;
    at += 8;
    return Number<std::uint64_t>(extra, at - 8);
  };
  const std::uint64_t size = read(24);  // in this order
  const std::uint64_t packed = read(20);
  return {packed, size, read(42)};
}

// The content of a file, from its entry in the directory.
std::vector<std::uint8_t> NpzFile::Unpack(Bytes entry) const {
  const auto method = Number<std::uint16_t>(entry, 10);
  const auto [packed_size, size, offset] = Sizes(entry);
  const Bytes head = Part(bytes_, offset, 30);
  const std::uint64_t begin =
      offset + 30 + Number<std::uint16_t>(head, 26) + Number<std::uint16_t>(head, 28);
  const Bytes packed = Part(bytes_, begin, packed_size);
  if (size > kMaxBytes || (method != kStored && method != kDeflated)) {
    Fail("it has an array of over 256 MiB, or is packed in an unknown way");
  }
  std::vector<std::uint8_t> content(packed.begin(), packed.end());
  if (method == kDeflated) {
    content.assign(size, 0);
    z_stream stream{};
    stream.next_in = const_cast<Bytef*>(packed.data());  // zlib only reads
    stream.avail_in = static_cast<uInt>(packed_size);
    stream.next_out = content.data();
    stream.avail_out = static_cast<uInt>(size);
    const bool begun = inflateInit2(&stream, -MAX_WBITS) == Z_OK;
    const int ended = begun ? inflate(&stream, Z_FINISH) : Z_MEM_ERROR;
    if (begun) inflateEnd(&stream);
    if (ended != Z_STREAM_END) Fail("an array cannot be unpacked");
  }
  if (content.size() != size ||
      crc32_z(0, content.data(), content.size()) != Number<std::uint32_t>(entry, 16)) {
    Fail("an array is damaged");
  }
  return content;
}

Array NpzFile::ParseNpy(const std::string& array, std::vector<std::uint8_t> file) const {
  Array parsed;
  const bool is_long = Number<std::uint8_t>(file, 6) > 1;  // version
  const std::uint64_t size =
      is_long ? Number<std::uint32_t>(file, 8) : Number<std::uint16_t>(file, 8);
  const Bytes head = Part(file, is_long ? 12 : 10, size);
  const std::string text(head.begin(), head.end());
  parsed.begin = (is_long ? 12 : 10) + static_cast<std::size_t>(size);
  const std::size_t type = text.find("'descr': '");
  const std::size_t shape = text.find("'shape': (");
  if (type == std::string::npos || shape == std::string::npos ||
      text.find("'fortran_order': False") == std::string::npos) {
    Fail(array + " is no array in row-major order");
  }
  parsed.dtype = text.substr(type + 10, text.find('\'', type + 10) - type - 10);
  std::uint64_t count = 1;
  for (const char* at = text.data() + shape + 10; at < text.data() + text.size() && *at != ')';) {
    std::uint32_t side = 0;
    const auto [end, error] = std::from_chars(at, text.data() + text.size(), side);
    if (error == std::errc()) {
      parsed.shape.push_back(side);
      if (side > 0 && count > kMaxBytes / side) Fail(array + " is too large");
      count *= side;
    }
    at = error == std::errc() ? end : at + 1;
  }
  if (parsed.dtype.size() < 3) Fail(array + " has an unknown type");
  std::uint64_t each = 0;
  std::from_chars(parsed.dtype.data() + 2, parsed.dtype.data() + parsed.dtype.size(), each);
  if (parsed.dtype[1] == 'U') each *= 4;
  if (each > kMaxBytes || file.size() - parsed.begin != count * each) {
    Fail(array + " does not have the size that it says");
  }
  parsed.values = std::move(file);
  return parsed;
}

Array NpzFile::Read(const std::string& array, const std::string& types,
                    std::size_t dimensions) const {
  auto [at, entries] = Directory();
  for (; entries > 0; --entries) {
    const Bytes fixed = Part(bytes_, at, 46);
    const auto length = Number<std::uint16_t>(fixed, 28);
    const Bytes name = Part(bytes_, at + 46, length);
    const Bytes entry = Part(bytes_, at, 46ULL + length + Number<std::uint16_t>(fixed, 30));
    at += entry.size() + Number<std::uint16_t>(fixed, 32);
    if (std::string(name.begin(), name.end()) != array + ".npy") continue;
    Array found = ParseNpy(array, Unpack(entry));
    const std::string kind = found.dtype.starts_with("<U") ? "<U" : found.dtype;
    if ((' ' + types + ' ').find(' ' + kind + ' ') == std::string::npos ||
        found.shape.size() != dimensions) {
      Fail(array + " has " + std::to_string(found.shape.size()) + " dimensions of " + found.dtype +
           "; it must have " + std::to_string(dimensions) + " of " + types);
    }
    return found;
  }
  Fail("it has no array " + array);
}

}  // namespace

Features ReadFeaturesNpz(const fs::path& file) {
  const NpzFile npz(file);
  Features features;
  const Array keypoints = npz.Read("keypoints", "<f4", 2);
  const Array descriptors = npz.Read("descriptors", "<f4 |u1", 2);
  if (keypoints.shape[1] != 6 || keypoints.shape[0] != descriptors.shape[0] ||
      descriptors.shape[1] < 1 || descriptors.shape[1] > kMaxColumns) {
    npz.Fail("keypoints must be N x 6, and descriptors N x D");
  }
  const std::vector<float> rows = keypoints.Values<float>();
  for (std::size_t i = 0; i < rows.size(); i += 6) {
    for (std::size_t k = i; k < i + 6; ++k) {
      if (!(std::abs(rows[k]) < kMostValue)) npz.Fail("keypoints must be finite, and below 1e9");
    }
    features.keypoints.push_back({rows[i], rows[i + 1], rows[i + 2], rows[i + 3], rows[i + 4],
                                  static_cast<std::int32_t>(rows[i + 5])});
  }
  Descriptors& d = features.descriptors;
  d.kind = descriptors.dtype == "<f4" ? DescriptorKind::kFloat : DescriptorKind::kBinary;
  d.dim = static_cast<int>(descriptors.shape[1]);
  d.rows = features.keypoints.size();
  if (d.kind == DescriptorKind::kFloat) {
    d.floats = descriptors.Values<float>();
  } else {
    d.bytes = descriptors.Values<std::uint8_t>();
  }
  for (const auto& [array, side] :
       {std::pair("width", &features.width), std::pair("height", &features.height)}) {
    const std::int64_t pixels = npz.Read(array, "<i8", 0).Values<std::int64_t>().front();
    if (pixels < 1 || pixels > kMostSide) npz.Fail(std::string(array) + " must be 1 to 1000000");
    *side = static_cast<int>(pixels);
  }
  for (const std::uint32_t point : npz.Read("model_id", "<U", 0).Values<std::uint32_t>()) {
    if (point >= 0x80) npz.Fail("model_id must be ASCII");
    if (point != 0) features.model_id += static_cast<char>(point);
  }
  return features;
}

FeatureSource ParseFeatureSource(const std::string& text, const fs::path& root) {
  const std::size_t equals = text.find('=');
  const fs::path folder = equals == std::string::npos ? "" : text.substr(equals + 1);
  std::error_code error;
  if (equals == 0 || !fs::is_directory(folder, error)) {
    throw Error(ErrorCode::kInvalidArgument, "features_invalid",
                "'" + ToDisplayText(text) + "': give NAME=FOLDER, with a folder of .npz files");
  }
  return {text.substr(0, equals), [folder, root](const fs::path& image) {
            const fs::path relative = image.lexically_relative(root);
            const bool is_inside = !relative.empty() && *relative.begin() != "..";
            fs::path file = folder / (is_inside ? relative : image.filename());
            file += ".npz";
            return ReadFeaturesNpz(file);
          }};
}

}  // namespace pliant
