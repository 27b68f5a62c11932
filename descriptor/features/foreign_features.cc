// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/foreign_features.h"

#include <utility>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

class ForeignDescriptor final : public Descriptor {
 public:
  explicit ForeignDescriptor(DescriptorInfo info) : info_(std::move(info)) {}

  const DescriptorInfo& info() const override { return info_; }
  Descriptors Describe(const Image& /*grey*/, std::span<const Keypoint> /*keypoints*/,
                       int /*threads*/) const override {
    throw Error(ErrorCode::kUnprocessable, "described_elsewhere",
                "The database has features of " + info_.model_id +
                    ", which Pliant cannot compute. Give features instead of an image.");
  }

 private:
  DescriptorInfo info_;
};

}  // namespace

DescriptorInfo ForeignDescriptorInfo(const Features& features) {
  if (features.model_id.empty() || features.descriptors.dim < 1) {
    throw Error(ErrorCode::kInvalidArgument, "features_invalid",
                "The features need a model_id and descriptors of at least one component.");
  }
  return {features.model_id, features.descriptors.kind, features.descriptors.dim,
          features.model_id};
}

std::shared_ptr<const Descriptor> MakeForeignDescriptor(DescriptorInfo info) {
  return std::make_shared<ForeignDescriptor>(std::move(info));
}

}  // namespace pliant
