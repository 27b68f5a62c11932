// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/features_subset.h"

namespace pliant {

Features Subset(const Features& features, const std::function<bool(const Keypoint&)>& keep) {
  Features kept{features.width, features.height, {}, {}, features.model_id, features.colours};
  const Descriptors& all = features.descriptors;
  kept.descriptors.kind = all.kind;
  kept.descriptors.dim = all.dim;
  for (std::size_t i = 0; i < features.keypoints.size(); ++i) {
    if (!keep(features.keypoints[i])) continue;
    kept.keypoints.push_back(features.keypoints[i]);
    if (all.kind == DescriptorKind::kFloat) {
      const auto row = all.float_row(i);
      kept.descriptors.floats.insert(kept.descriptors.floats.end(), row.begin(), row.end());
    } else {
      const auto row = all.binary_row(i);
      kept.descriptors.bytes.insert(kept.descriptors.bytes.end(), row.begin(), row.end());
    }
  }
  kept.descriptors.rows = kept.keypoints.size();
  return kept;
}

}  // namespace pliant
