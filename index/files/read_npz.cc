// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/read_npz.h"

#include <charconv>
#include <cmath>
#include <cstring>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include <zip.h>

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

// A zip archive of .npy files
// (https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html).
class NpzFile {
 public:
  explicit NpzFile(const fs::path& path)
      : name_(ToDisplayText(path.string())), bytes_(ReadFile(path, kMaxBytes)) {
    zip_source_t* source = zip_source_buffer_create(bytes_.data(), bytes_.size(), 0, nullptr);
    zip_.reset(source == nullptr ? nullptr : zip_open_from_source(source, ZIP_RDONLY, nullptr));
    if (zip_) return;
    zip_source_free(source);
    Fail("it is no complete .npz file");
  }

  // Throws if it is missing or is not of one of these types, or does not have these many
  // dimensions.
  Array Read(const std::string& array, const std::string& types, std::size_t dimensions) const;

  [[noreturn]] void Fail(const std::string& what) const {
    throw Error(ErrorCode::kCorrupt, "features_unreadable", name_ + ": " + what);
  }

 private:
  std::vector<std::uint8_t> Unpack(const std::string& array) const;
  Array ParseNpy(const std::string& array, std::vector<std::uint8_t> file) const;

  std::string name_;
  std::vector<std::uint8_t> bytes_;  // of zip_
  std::unique_ptr<zip_t, void (*)(zip_t*)> zip_{nullptr, zip_discard};
};

std::vector<std::uint8_t> NpzFile::Unpack(const std::string& array) const {
  zip_stat_t entry{};
  if (zip_stat(zip_.get(), (array + ".npy").c_str(), 0, &entry) != 0) {
    Fail("it has no array " + array);
  }
  if (entry.size > kMaxBytes) Fail("it has an array of over 256 MiB");
  const std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> file(
      zip_fopen_index(zip_.get(), entry.index, 0), zip_fclose);
  if (!file) Fail("an array cannot be unpacked");
  std::vector<std::uint8_t> content(entry.size);
  char more = 0;  // its end, at which libzip compares the checksum
  if (zip_fread(file.get(), content.data(), entry.size) != static_cast<zip_int64_t>(entry.size) ||
      zip_fread(file.get(), &more, 1) != 0) {
    Fail("an array is damaged");
  }
  return content;
}

Array NpzFile::ParseNpy(const std::string& array, std::vector<std::uint8_t> file) const {
  Array parsed;
  const bool is_long = file.size() > 12 && file[6] > 1;  // version
  const std::size_t head = is_long ? 12 : 10;
  std::uint32_t size = 0;  // little-endian, of two or four bytes
  if (file.size() > head) std::memcpy(&size, file.data() + 8, head - 8);
  parsed.begin = head + size;
  if (parsed.begin > file.size()) Fail(array + " is not complete");
  const std::string text(file.data() + head, file.data() + parsed.begin);
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
  Array found = ParseNpy(array, Unpack(array));
  const std::string kind = found.dtype.starts_with("<U") ? "<U" : found.dtype;
  if ((' ' + types + ' ').find(' ' + kind + ' ') == std::string::npos ||
      found.shape.size() != dimensions) {
    Fail(array + " has " + std::to_string(found.shape.size()) + " dimensions of " + found.dtype +
         "; it must have " + std::to_string(dimensions) + " of " + types);
  }
  return found;
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
