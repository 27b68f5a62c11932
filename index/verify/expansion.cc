// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/expansion.h"

#include <algorithm>
#include <cstdint>

#include "descriptor/base/parallel.h"
#include "index/records/records.h"
#include "index/verify/verification.h"
#include "index/verify/warp_geometry.h"

namespace pliant {
namespace {

constexpr double kTrusted = 10;   // evidence of an image that is used as a further query
constexpr double kDecay = 0.4;    // of evidence, from link to link
constexpr double kGrowth = 1.3;   // of the matched part: more of the object lies around it
constexpr double kSupported = 1;  // less evidence than this moves nothing

}  // namespace

std::vector<const VerifiedImage*> ExpansionSources(const std::vector<VerifiedImage>& images,
                                                   int most) {
  std::vector<const VerifiedImage*> sources;
  for (const VerifiedImage& image : images) {
    if (image.evidence >= kTrusted) sources.push_back(&image);
  }
  std::sort(sources.begin(), sources.end(), [](const auto* a, const auto* b) {
    if (a->inliers() != b->inliers()) return a->inliers() > b->inliers();
    return a->image.ref.id < b->image.ref.id;
  });
  sources.resize(std::min(sources.size(), static_cast<std::size_t>(most)));
  return sources;
}

std::unordered_map<std::int64_t, Support> Expand(
    const std::vector<VerifiedImage>& images, const ExpansionOptions& options,
    const std::function<std::optional<Features>(std::int64_t version)>& load,
    const std::function<std::vector<RankedImage>(const Features&, std::size_t depth)>& nearest) {
  std::unordered_map<std::int64_t, double> known;  // evidence so far
  for (const auto& p : images) known[p.image.ref.version] = p.evidence;
  std::unordered_map<std::int64_t, Support> supports;
  for (const VerifiedImage* source : ExpansionSources(images, options.sources)) {
    const auto whole = load(source->image.ref.version);
    if (!whole) continue;
    const std::vector<Vec2> outline = Enlarged(source->seen, kGrowth);
    const auto is_seen = [&](const Keypoint& k) { return IsInside({k.x, k.y}, outline); };
    const Features part = Subset(*whole, is_seen);
    if (part.keypoints.size() < kMinKeypoints) continue;
    const double most = kDecay * source->evidence;
    std::vector<RankedImage> found = nearest(part, options.depth);
    std::erase_if(found, [&](const RankedImage& image) {
      const auto at = known.find(image.ref.version);
      return image.ref.version == source->image.ref.version ||
             (at != known.end() && at->second >= most);
    });
    const Verifier verifier(part, {});
    std::vector<double> evidence(found.size(), 0);
    ParallelFor(found.size(), options.threads, [&](std::size_t i) {
      const auto features = load(found[i].ref.version);
      if (!features) return;
      const VerificationResult result = verifier.Verify(*features);
      evidence[i] =
          Evidence(result.effective_inliers,
                   InliersByChance(part.keypoints.size(), result.distinctness, result.agreeing));
    });
    for (std::size_t i = 0; i < found.size(); ++i) {
      const double chained = kDecay * std::min(source->evidence, evidence[i]);
      double& so_far = known[found[i].ref.version];
      if (chained < kSupported || chained <= so_far) continue;
      so_far = chained;
      supports[found[i].ref.version] = {chained, source->image.ref.id};
    }
  }
  return supports;
}

}  // namespace pliant
