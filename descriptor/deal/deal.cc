// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/deal.h"

#include <utility>

#include "descriptor/base/parallel.h"
#include "descriptor/deal/network.h"

namespace pliant {
namespace {

class DealDescriptor final : public Descriptor {
 public:
  DealDescriptor(deal::DealWeights weights, DealVariant variant)
      : network_(std::move(weights)), warp_(variant == DealVariant::kWarped) {
    info_.name = warp_ ? "deal" : "deal-fixed";
    info_.kind = DescriptorKind::kFloat;
    info_.dim = deal::kDescriptorDim;
    info_.model_id = info_.name + ":" + network_.weights().sha256.substr(0, 16);
  }

  const DescriptorInfo& info() const override { return info_; }

  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int threads) const override {
    return Describe(grey, keypoints, deal::kOneSupport, threads);
  }

  Descriptors DescribeReference(const Image& grey, std::span<const Keypoint> keypoints,
                                int threads) const override {
    return Describe(grey, keypoints, deal::kPooledSupports, threads);
  }

 private:
  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       std::span<const float> supports, int threads) const {
    Descriptors result;
    result.kind = DescriptorKind::kFloat;
    result.dim = info_.dim;
    result.rows = keypoints.size();
    result.floats = network_.Describe(grey, keypoints, warp_, supports, ResolveThreads(threads));
    return result;
  }

  deal::DealNetwork network_;
  bool warp_;
  DescriptorInfo info_;
};

}  // namespace

std::shared_ptr<const Descriptor> MakeDealDescriptor(const std::filesystem::path& weights,
                                                     DealVariant variant) {
  return std::make_shared<DealDescriptor>(deal::LoadDealWeights(weights), variant);
}

}  // namespace pliant
