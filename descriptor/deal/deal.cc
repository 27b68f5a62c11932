// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/deal.h"

#include <array>
#include <utility>

#include "descriptor/base/parallel.h"
#include "descriptor/deal/network.h"

namespace pliant {
namespace {

struct Variant {
  const char* name;
  bool warp;
  std::span<const float> supports;  // of Describe
};

// In the order of DealVariant.
constexpr std::array kVariants = {Variant{"deal", true, deal::kOneSupport},
                                  Variant{"deal-fixed", false, deal::kOneSupport},
                                  Variant{"deal-pooled", true, deal::kPooledSupports}};

class DealDescriptor final : public Descriptor {
 public:
  DealDescriptor(deal::DealWeights weights, DealVariant variant)
      : network_(std::move(weights)), variant_(kVariants.at(static_cast<std::size_t>(variant))) {
    info_.name = variant_.name;
    info_.kind = DescriptorKind::kFloat;
    info_.dim = deal::kDescriptorDim;
    info_.model_id = info_.name + ":" + network_.weights().sha256.substr(0, 16);
  }

  const DescriptorInfo& info() const override { return info_; }

  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int threads) const override {
    return Describe(grey, keypoints, variant_.supports, threads);
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
    result.floats =
        network_.Describe(grey, keypoints, variant_.warp, supports, ResolveThreads(threads));
    return result;
  }

  deal::DealNetwork network_;
  Variant variant_;
  DescriptorInfo info_;
};

}  // namespace

std::shared_ptr<const Descriptor> MakeDealDescriptor(const std::filesystem::path& weights,
                                                     DealVariant variant) {
  return std::make_shared<DealDescriptor>(deal::LoadDealWeights(weights), variant);
}

}  // namespace pliant
