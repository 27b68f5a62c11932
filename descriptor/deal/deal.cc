// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
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

// "deal" (Potje et al., NeurIPS 2021): the polar grid around each keypoint is bent by the learned
// thin-plate spline. "deal-fixed": the plain polar grid, for comparison. 128 floats of unit length
// per keypoint. DescribeReference averages over three support radii, so that errors of a keypoint's
// size matter less, in twice the time. The keypoint's angle is not used. Keypoints may lie outside
// the image, whose border pixels are replicated.
//
// Describe additionally throws kInvalidArgument for a keypoint that is not finite or has no
// positive size, and kTooLarge for more than 2^24 pixels. Concurrent calls with the same number of
// threads give bit-identical results. The other keypoints of a call, and the number of threads,
// change a descriptor by rounding only (below 1e-5 and 1e-4).
class DealDescriptor final : public Descriptor {
 public:
  DealDescriptor(deal::DealWeights weights, bool warp) : network_(std::move(weights)), warp_(warp) {
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
    Descriptors result{DescriptorKind::kFloat, info_.dim, keypoints.size(), {}, {}};
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

template <bool warp>
std::shared_ptr<const Descriptor> MakeDeal(const DescriptorOptions& options) {
  return std::make_shared<DealDescriptor>(
      deal::LoadDealWeights(options.model_path.empty() ? DefaultModelPath() : options.model_path),
      warp);
}

constexpr std::array kDescriptors = {
    NamedDescriptor{"deal", MakeDeal<true>},
    NamedDescriptor{"deal-fixed", MakeDeal<false>},
    NamedDescriptor{"rootsift", [](const DescriptorOptions&) { return MakeRootSift(); }},
    NamedDescriptor{"sift", [](const DescriptorOptions&) { return MakeSift(); }},
    NamedDescriptor{"daisy", [](const DescriptorOptions&) { return MakeDaisy(); }},
    NamedDescriptor{"brisk", [](const DescriptorOptions&) { return MakeBrisk(); }},
    NamedDescriptor{"orb", [](const DescriptorOptions&) { return MakeOrb(); }},
};

}  // namespace

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
