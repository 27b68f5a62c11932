// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A random sample of the stored descriptors.
#include <algorithm>
#include <limits>
#include <random>
#include <unordered_set>

#include "descriptor/base/error.h"
#include "index/store/blob_codec.h"
#include "index/store/catalogue.h"
#include "index/store/sql/access.h"
#include "index/store/sql/rows.h"

namespace pliant {
namespace {

constexpr std::size_t kLoadedTogether = 64;  // images

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

struct StoredCount {
  Key key = 0;
  std::uint64_t descriptors = 0;
};

// The images that one of the numbers falls into, and the rows of each.
struct Drawn {
  std::vector<Key> keys;
  std::vector<std::uint64_t> descriptors;        // of that image
  std::vector<std::vector<std::uint64_t>> rows;  // that were drawn
};

Drawn Divide(std::span<const StoredCount> images, const std::vector<std::uint64_t>& chosen) {
  Drawn drawn;
  std::uint64_t first = 0;  // number of the image's first descriptor
  auto next = chosen.begin();
  for (const StoredCount& image : images) {
    const std::uint64_t end = first + image.descriptors;
    if (next != chosen.end() && *next < end) {
      drawn.keys.push_back(image.key);
      drawn.descriptors.push_back(image.descriptors);
      drawn.rows.emplace_back();
      for (; next != chosen.end() && *next < end; ++next)
        drawn.rows.back().push_back(*next - first);
    }
    first = end;
  }
  return drawn;
}

}  // namespace

DescriptorSample Catalogue::SampleDescriptors(Key collection, std::size_t count,
                                              std::uint64_t seed) {
  const DescriptorInfo& model = model_.model.info;
  return access_.Read([&](Connection& db) {
    DescriptorSample sample;
    sample.descriptors.kind = model.kind;
    sample.descriptors.dim = model.dim;
    std::vector<StoredCount> images;
    Cursor row = db.Prepare("SELECT key, keypoints FROM images WHERE collection = ? ORDER BY id");
    row.Bind(collection);
    while (row.Next()) {
      images.push_back({row.Int(0), row.Count(1)});
      sample.available += row.Count(1);
    }
    const Drawn drawn = Divide(
        images, Choose(std::min<std::uint64_t>(count, sample.available), sample.available, seed));
    for (std::size_t from = 0; from < drawn.keys.size(); from += kLoadedTogether) {
      const std::size_t size = std::min(kLoadedTogether, drawn.keys.size() - from);
      const auto encoded = ReadFeaturesBlobs(db, std::span(drawn.keys).subspan(from, size));
      for (std::size_t i = 0; i < size; ++i) {
        const Features features = DecodeFeatures(encoded.at(i));
        if (features.descriptors.rows != drawn.descriptors[from + i] ||
            features.descriptors.kind != model.kind || features.descriptors.dim != model.dim) {
          throw Error(ErrorCode::kCorrupt, "features_mismatch",
                      "a stored image's features differ from its record; run `pliant db check`");
        }
        for (const std::uint64_t drawn_row : drawn.rows[from + i]) {
          AppendRow(sample.descriptors, features.descriptors, drawn_row);
        }
      }
    }
    return sample;
  });
}

}  // namespace pliant
