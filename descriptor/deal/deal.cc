// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/deal.h"

#include <utility>

#include "descriptor/deal/network.h"
#include "descriptor/parallel.h"

namespace pliant {
namespace {

class DealDescriptor final : public Descriptor {
 public:
  DealDescriptor(deal::DealWeights weights, bool warp) : network_(std::move(weights)), warp_(warp) {
    info_.name = warp ? "deal" : "deal-fixed";
    info_.kind = DescriptorKind::kFloat;
    info_.dim = deal::kDescriptorDim;
    info_.model_id = info_.name + ":" + network_.weights().sha256.substr(0, 16);
  }

  const DescriptorInfo& info() const override { return info_; }

  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int threads) const override {
    Descriptors result;
    result.kind = DescriptorKind::kFloat;
    result.dim = info_.dim;
    result.rows = keypoints.size();
    result.floats = network_.Describe(grey, keypoints, warp_, ResolveThreads(threads));
    return result;
  }

 private:
  deal::DealNetwork network_;
  bool warp_;
  DescriptorInfo info_;
};

}  // namespace

std::shared_ptr<const Descriptor> MakeDealDescriptor(const std::filesystem::path& weights,
                                                     bool warp) {
  return std::make_shared<DealDescriptor>(deal::LoadDealWeights(weights), warp);
}

}  // namespace pliant
