// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/deal.h"

#include <array>
#include <cstdlib>
#include <memory>
#include <system_error>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/strings.h"
#include "descriptor/deal/network.h"
#include "descriptor/features/baselines.h"
#include "descriptor/features/descriptor.h"

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

constexpr const char* kModelFile = "share/pliant/deal.safetensors";

struct NamedDescriptor {
  const char* name;
  std::shared_ptr<const Descriptor> (*make)(const DescriptorOptions&);
};

template <DealVariant variant>
std::shared_ptr<const Descriptor> MakeDeal(const DescriptorOptions& options) {
  return MakeDealDescriptor(options.model_path.empty() ? DefaultModelPath() : options.model_path,
                            variant);
}

constexpr std::array kDescriptors = {
    NamedDescriptor{"deal", MakeDeal<DealVariant::kWarped>},
    NamedDescriptor{"deal-fixed", MakeDeal<DealVariant::kFixed>},
    NamedDescriptor{"rootsift", [](const DescriptorOptions&) { return MakeRootSift(); }},
    NamedDescriptor{"sift", [](const DescriptorOptions&) { return MakeSift(); }},
    NamedDescriptor{"daisy", [](const DescriptorOptions&) { return MakeDaisy(); }},
    NamedDescriptor{"brisk", [](const DescriptorOptions&) { return MakeBrisk(); }},
    NamedDescriptor{"orb", [](const DescriptorOptions&) { return MakeOrb(); }},
};

}  // namespace

std::shared_ptr<const Descriptor> MakeDealDescriptor(const std::filesystem::path& weights,
                                                     DealVariant variant) {
  return std::make_shared<DealDescriptor>(deal::LoadDealWeights(weights), variant);
}

std::vector<std::string> DescriptorNames() {
  std::vector<std::string> names;
  for (const NamedDescriptor& d : kDescriptors) names.emplace_back(d.name);
  return names;
}

std::shared_ptr<const Descriptor> MakeDescriptor(const std::string& name,
                                                 const DescriptorOptions& options) {
  for (const NamedDescriptor& d : kDescriptors) {
    if (d.name == name) return d.make(options);
  }
  throw Error(ErrorCode::kInvalidArgument, "unknown_descriptor",
              "There is no descriptor named '" + name +
                  "'. Known are: " + Join(DescriptorNames(), ", ") + ".");
}

std::filesystem::path DefaultModelPath() {
  namespace fs = std::filesystem;
  if (const char* given = std::getenv("PLIANT_MODEL"); given != nullptr && *given != '\0') {
    return given;
  }
  std::error_code ignored;  // no /proc: the installed place is left
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  const std::array<fs::path, 2> places = {program.parent_path().parent_path() / kModelFile,
                                          fs::path(PLIANT_INSTALL_PREFIX) / kModelFile};
  std::string looked;
  for (const fs::path& place : places) {
    std::error_code error;
    if (fs::exists(place, error)) return place;
    looked += (looked.empty() ? "" : ", ") + place.string();
  }
  throw Error(ErrorCode::kNotFound, "model_not_found",
              "DEAL's weights were not found. Looked at: " + looked +
                  ". Set PLIANT_MODEL to the weight file.");
}

}  // namespace pliant
