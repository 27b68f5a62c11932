// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/collection_npz.h"

#include <algorithm>
#include <optional>

#include "index/files/features_npz.h"

namespace pliant {
namespace {

constexpr int kImagesAtOnce = 50;  // with their features, in memory

}  // namespace

std::int64_t WriteFeaturesNpz(Engine& engine, ImageListing list,
                              const std::function<void(std::uint64_t bytes)>& begin,
                              const NpzArchive::Write& write) {
  list.limit = kImagesAtOnce;
  const DescriptorInfo model = engine.Model();
  FeatureTotals totals;
  totals.kind = model.kind;
  totals.dim = model.dim;
  totals.model_id = model.model_id;
  totals.object_length = 1;
  std::optional<FeaturesArchive> archive;
  const auto open = [&] {
    if (archive) return;
    archive.emplace(totals, write);
    begin(archive->bytes());
  };
  engine.ForEachFeatures(
      list,
      [&](const ImagePage& page) {
        for (const ImageRecord& record : page.records) {
          totals.Count(record.id, record.keypoints);
          totals.object_length =
              std::max(totals.object_length, NpzArchive::TextLength(record.object));
        }
      },
      [&](const ImageRecord& record, const Features& features) {
        open();
        archive->Add(record.id, record.object, features);
      });
  open();
  archive->Finish();
  return totals.images;
}

}  // namespace pliant
