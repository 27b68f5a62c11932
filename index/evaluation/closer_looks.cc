// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/evaluation/closer_looks.h"

#include <fstream>
#include <limits>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "index/files/picture_files.h"
#include "index/files/text.h"
#include "index/store/feature_codec.h"

namespace pliant {
namespace fs = std::filesystem;

namespace {

void Write(const std::vector<std::uint8_t>& bytes, const fs::path& path) {
  std::error_code failed;
  fs::create_directories(path.parent_path(), failed);
  const fs::path unfinished = path.string() + ".new";
  std::ofstream file(unfinished, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (file) fs::rename(unfinished, path, failed);
  if (!file || failed) {
    throw Error(ErrorCode::kNoSpace, "folder_unwritable",
                "cannot write " + ToDisplayText(path.string()) +
                    "; give a folder on a disk with room, which you may write to");
  }
}

}  // namespace

CloserLooks::CloserLooks(Engine* engine, fs::path folder)
    : engine_(*engine), folder_(std::move(folder)) {}

std::optional<Features> CloserLooks::Of(const std::string& id, const fs::path& file,
                                        std::int64_t max_bytes, const Features& known) {
  const fs::path kept = folder_ / id;
  if (fs::exists(kept)) {
    Features features = DecodeFeatures(ReadFile(kept, std::numeric_limits<std::int64_t>::max()));
    features.model_id = known.model_id;
    return features;
  }
  std::optional<Features> features =
      engine_.DescribeFiner(ReadFile(file, max_bytes), known, /*threads=*/0);
  if (features) Write(EncodeFeatures(*features), kept);
  return features;
}

}  // namespace pliant
