// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/descriptor_sample.h"

#include "index/store/draw_descriptors.h"

namespace pliant {

DescriptorSample SampleDescriptors(Connection& db, Key collection, const DescriptorInfo& model,
                                   std::size_t count, std::uint64_t seed) {
  std::vector<StoredCount> pictures;
  Cursor row = db.Prepare("SELECT key, keypoints FROM pictures WHERE collection = ? ORDER BY id");
  row.Bind(collection);
  while (row.Next()) {
    pictures.push_back({row.Int(0), static_cast<std::uint64_t>(row.Int(1))});
  }
  return DrawDescriptors(model, pictures, count, seed, [&](std::span<const Key> keys) {
    std::vector<std::vector<std::uint8_t>> encoded;
    for (const Key key : keys) encoded.push_back(ReadFeaturesBlob(db, key));
    return encoded;
  });
}

}  // namespace pliant
