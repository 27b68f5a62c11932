// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/features_file.h"

#include <cstdint>
#include <string>
#include <string_view>

#include "descriptor/base/error.h"
#include "index/cli/write_file.h"
#include "index/files/features_npz.h"
#include "index/files/text.h"

namespace pliant::cli {

void CheckFeaturesName(const std::filesystem::path& path) {
  if (path.extension() != ".npz" && path != kStandardOutput) {
    throw Error(ErrorCode::kInvalidArgument, "bad_features_name",
                ToDisplayText(path.string()) +
                    ": features are written as .npz (NumPy); end the name in .npz, or give - for "
                    "standard output");
  }
  CheckWritable(path);
}

void WriteFeatures(const std::filesystem::path& path, const Features& features) {
  WriteFile(path, FeaturesNpz(features));
}

void WriteFolderFeatures(const std::filesystem::path& path,
                         const std::vector<FolderPicture>& pictures) {
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
  if (path == kStandardOutput) {  // which takes no offsets
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

}  // namespace pliant::cli
