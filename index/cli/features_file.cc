// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/features_file.h"

#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/base/safetensors.h"
#include "index/cli/hdf5_file.h"
#include "index/cli/write_file.h"
#include "index/files/features_npz.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

template <typename Value>
std::vector<std::uint8_t> BytesOf(const std::vector<Value>& values) {
  std::vector<std::uint8_t> bytes(values.size() * sizeof(Value));
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

std::vector<Tensor> TensorsOf(const Features& features) {
  const Descriptors& d = features.descriptors;
  const bool is_float = d.kind == DescriptorKind::kFloat;
  const auto points = static_cast<std::int64_t>(features.keypoints.size());
  const auto rows = static_cast<std::int64_t>(d.rows);
  return {{"keypoints", "F32", {points, 6}, BytesOf(KeypointRows(features))},
          {"descriptors",
           is_float ? "F32" : "U8",
           {rows, d.dim},
           is_float ? BytesOf(d.floats) : BytesOf(d.bytes)}};
}

void WriteTensors(const std::filesystem::path& path, const std::vector<Tensor>& tensors,
                  const std::map<std::string, std::string>& metadata) {
  if (const std::error_code error = WriteSafetensors(path, tensors, metadata)) {
    throw Error(ErrorCode::kNoSpace, "write_failed",
                path.string() + " could not be written: " + error.message());
  }
}

bool IsNpz(const std::filesystem::path& path) {
  return path.extension() == ".npz" || path == kStandardOutput;
}

bool IsHdf5(const std::filesystem::path& path) {
  return path.extension() == ".h5" || path.extension() == ".hdf5";
}

// The rows of all pictures, and which are whose.
struct Joined {
  Features all;
  std::vector<std::string> names;
  std::vector<std::int64_t> starts = {0}, widths, heights;
};

Joined Join(const std::vector<FolderPicture>& pictures) {
  Joined joined;
  for (const FolderPicture& picture : pictures) {
    const Features& f = picture.features;
    Features& all = joined.all;
    if (joined.names.empty()) {
      all.model_id = f.model_id;
      all.descriptors.kind = f.descriptors.kind;
      all.descriptors.dim = f.descriptors.dim;
    }
    all.keypoints.insert(all.keypoints.end(), f.keypoints.begin(), f.keypoints.end());
    all.descriptors.Append(f.descriptors);
    joined.names.push_back(ToDisplayText(picture.name));
    joined.starts.push_back(static_cast<std::int64_t>(all.keypoints.size()));
    joined.widths.push_back(f.width);
    joined.heights.push_back(f.height);
  }
  return joined;
}

void WriteTensorsOf(const std::filesystem::path& path, const std::vector<FolderPicture>& pictures) {
  const Joined joined = Join(pictures);
  std::vector<Tensor> tensors = TensorsOf(joined.all);
  for (const auto& [name, values] : {std::pair{"starts", &joined.starts},
                                     {"width", &joined.widths},
                                     {"height", &joined.heights}}) {
    tensors.push_back({name, "I64", {static_cast<std::int64_t>(values->size())}, BytesOf(*values)});
  }
  WriteTensors(path, tensors,
               {{"model_id", joined.all.model_id}, {"names", Json(joined.names).dump()}});
}

void WriteArchiveOf(const std::filesystem::path& path, const std::vector<FolderPicture>& pictures) {
  FeatureTotals totals;
  for (const FolderPicture& picture : pictures) {
    const Features& features = picture.features;
    totals.Count(ToDisplayText(picture.name), features.keypoints.size());
    totals.kind = features.descriptors.kind;
    totals.dim = features.descriptors.dim;
    totals.model_id = features.model_id;
  }
  const auto write = [&](const auto& put) {
    FeaturesArchive archive(totals, put);
    for (const FolderPicture& picture : pictures) {
      archive.Add(ToDisplayText(picture.name), "", picture.features);
    }
    archive.Finish();
  };
  if (path == kStandardOutput) {  // where nothing can be written twice
    std::string whole;
    write([&whole](std::uint64_t offset, std::string_view bytes) {
      if (whole.size() < offset + bytes.size()) whole.resize(offset + bytes.size());
      bytes.copy(whole.data() + offset, bytes.size());
    });
    return WriteFile(path, whole);
  }
  NewFile file(path);
  write([&file](std::uint64_t offset, std::string_view bytes) { file.Write(offset, bytes); });
  file.Publish();
}

class JoinedFile final : public FolderFeaturesFile {
 public:
  explicit JoinedFile(std::filesystem::path path) : path_(std::move(path)) {}
  bool Add(FolderPicture picture) override {
    pictures_.push_back(std::move(picture));
    return true;
  }
  void Publish() override {
    IsNpz(path_) ? WriteArchiveOf(path_, pictures_) : WriteTensorsOf(path_, pictures_);
  }

 private:
  const std::filesystem::path path_;
  std::vector<FolderPicture> pictures_;
};

class GroupsFile final : public FolderFeaturesFile {
 public:
  explicit GroupsFile(const std::filesystem::path& path) : file_(path) {}
  bool Add(FolderPicture picture) override {
    return file_.Add(ToDisplayText(picture.name), picture.features);
  }
  void Publish() override { file_.Publish(); }

 private:
  Hdf5File file_;
};

}  // namespace

void CheckFeaturesName(const std::filesystem::path& path) {
  if (!IsNpz(path) && !IsHdf5(path) && path.extension() != ".safetensors") {
    throw Error(ErrorCode::kInvalidArgument, "bad_features_name",
                ToDisplayText(path.string()) +
                    ": features are written as .npz (NumPy), .h5 (HDF5) or .safetensors; the name "
                    "must say which (- is standard output, as .npz)");
  }
  CheckWritable(path);
}

void WriteFeatures(const std::filesystem::path& path, const std::string& name,
                   const Features& features) {
  CheckFeaturesName(path);
  if (IsHdf5(path)) {
    Hdf5File file(path);
    file.Add(ToDisplayText(name), features);
    file.Publish();
  } else if (IsNpz(path)) {
    WriteFile(path, FeaturesNpz(features));
  } else {
    WriteTensors(path, TensorsOf(features),
                 {{"model_id", features.model_id},
                  {"width", std::to_string(features.width)},
                  {"height", std::to_string(features.height)}});
  }
}

std::unique_ptr<FolderFeaturesFile> OpenFolderFeatures(const std::filesystem::path& path) {
  CheckFeaturesName(path);
  if (IsHdf5(path)) return std::make_unique<GroupsFile>(path);
  return std::make_unique<JoinedFile>(path);
}

}  // namespace pliant::cli
