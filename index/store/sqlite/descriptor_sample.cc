// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/descriptor_sample.h"

#include <algorithm>
#include <limits>
#include <random>
#include <unordered_set>

#include "descriptor/base/error.h"
#include "index/store/feature_codec.h"

namespace pliant {
namespace {

struct StoredCount {
  Key key = 0;
  std::uint64_t descriptors = 0;
};

// Uniform in [0, bound). The standard's distributions differ between libraries, this does not.
std::uint64_t Below(std::mt19937_64& random, std::uint64_t bound) {
  const std::uint64_t limit =
      std::numeric_limits<std::uint64_t>::max() - std::numeric_limits<std::uint64_t>::max() % bound;
  std::uint64_t value = random();
  while (value >= limit) value = random();
  return value % bound;
}

// `count` different numbers below `available`, ascending. (R. Floyd, "A sample of brilliance",
// Communications of the ACM 30(9), 1987.)
std::vector<std::uint64_t> Choose(std::uint64_t count, std::uint64_t available,
                                  std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::unordered_set<std::uint64_t> chosen;
  for (std::uint64_t top = available - count; top < available; ++top) {
    if (!chosen.insert(Below(random, top + 1)).second) chosen.insert(top);
  }
  std::vector<std::uint64_t> sorted(chosen.begin(), chosen.end());
  std::sort(sorted.begin(), sorted.end());
  return sorted;
}

void AppendRow(Descriptors& to, const Descriptors& from, std::size_t row) {
  if (from.kind == DescriptorKind::kFloat) {
    const auto values = from.float_row(row);
    to.floats.insert(to.floats.end(), values.begin(), values.end());
  } else {
    const auto values = from.binary_row(row);
    to.bytes.insert(to.bytes.end(), values.begin(), values.end());
  }
  ++to.rows;
}

}  // namespace

DescriptorSample SampleDescriptors(Connection& db, Key collection, const DescriptorInfo& model,
                                   std::size_t count, std::uint64_t seed) {
  DescriptorSample sample;
  std::vector<StoredCount> pictures;
  Cursor row = db.Prepare("SELECT key, keypoints FROM pictures WHERE collection = ? ORDER BY id");
  row.Bind(collection);
  while (row.Next()) {
    pictures.push_back({row.Int(0), static_cast<std::uint64_t>(row.Int(1))});
    sample.available += pictures.back().descriptors;
  }
  const std::vector<std::uint64_t> chosen =
      Choose(std::min<std::uint64_t>(count, sample.available), sample.available, seed);
  sample.descriptors.kind = model.kind;
  sample.descriptors.dim = model.dim;
  std::uint64_t first = 0;  // number of the picture's first descriptor
  auto next = chosen.begin();
  for (const StoredCount& picture : pictures) {
    const std::uint64_t end = first + picture.descriptors;
    if (next != chosen.end() && *next < end) {
      const Features features = DecodeFeatures(ReadFeaturesBlob(db, picture.key));
      if (features.descriptors.rows != picture.descriptors ||
          features.descriptors.kind != model.kind || features.descriptors.dim != model.dim) {
        throw Error(ErrorCode::kCorrupt, "features_mismatch",
                    "a stored picture's features differ from its record; run `pliant db check`");
      }
      for (; next != chosen.end() && *next < end; ++next) {
        AppendRow(sample.descriptors, features.descriptors, *next - first);
      }
    }
    first = end;
  }
  return sample;
}

}  // namespace pliant
