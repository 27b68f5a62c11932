// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>
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
// thin-plate spline. "deal-small": a narrower network that learned from it, for processors without
// AMX. "deal-fixed": the plain polar grid, for comparison. Floats of unit length per keypoint.
// DescribeReference averages over three support radii, so that errors of a keypoint's size matter
// less, in twice the time. The keypoint's angle is not used. Keypoints may lie outside the image,
// whose border pixels are replicated.
//
// Describe additionally throws kInvalidArgument for a keypoint that is not finite or has no
// positive size, and kTooLarge for more than 2^24 pixels. Concurrent calls with the same number of
// threads give bit-identical results. The other keypoints of a call, and the number of threads,
// change a descriptor by rounding only (below 1e-5 and 1e-4).
class DealDescriptor final : public Descriptor {
 public:
  DealDescriptor(std::string name, deal::DealWeights weights, bool warp)
      : network_(std::move(weights)), warp_(warp) {
    info_.name = std::move(name);
    info_.kind = DescriptorKind::kFloat;
    info_.dim = static_cast<int>(network_.dim());
    info_.model_id = info_.name + ":" + network_.weights().sha256.substr(0, 16);
  }

  const DescriptorInfo& info() const override { return info_; }

  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int threads) const override {
    return DescribeFine(grey, keypoints, {}, threads);
  }

  Descriptors DescribeReference(const Image& grey, std::span<const Keypoint> keypoints,
                                int threads) const override {
    return Rows(
        network_.Describe(grey, keypoints, warp_, deal::kPooledSupports, ResolveThreads(threads)));
  }

  Descriptors DescribeFine(const Image& grey, std::span<const Keypoint> keypoints,
                           std::span<const EnlargedKeypoints> finer, int threads) const override {
    return Rows(network_.Describe(grey, keypoints, warp_, deal::kOneSupport,
                                  ResolveThreads(threads), finer));
  }

 private:
  Descriptors Rows(std::vector<float> floats) const {
    const std::size_t rows = floats.size() / network_.dim();
    return {DescriptorKind::kFloat, info_.dim, rows, std::move(floats), {}};
  }

  deal::DealNetwork network_;
  bool warp_;
  DescriptorInfo info_;
};

struct NamedDescriptor {
  const char* name;
  std::shared_ptr<const Descriptor> (*make)(const std::string& name, const DescriptorOptions&);
};

std::shared_ptr<const Descriptor> MakeDeal(const std::string& name,
                                           const DescriptorOptions& options) {
  constexpr std::string_view kFixed = "-fixed";
  const bool warp = !name.ends_with(kFixed);
  const std::string model = warp ? name : name.substr(0, name.size() - kFixed.size());
  return std::make_shared<DealDescriptor>(
      name, deal::LoadDealWeights(ModelPath(model, options.model_path)), warp);
}

template <auto make>
std::shared_ptr<const Descriptor> Make(const std::string& /*name*/,
                                       const DescriptorOptions& /*options*/) {
  return make();
}

constexpr std::array kDescriptors = {
    NamedDescriptor{"deal", MakeDeal},  // best first
    NamedDescriptor{"deal-small", MakeDeal},
    NamedDescriptor{"deal-fixed", MakeDeal},
    NamedDescriptor{"rootsift", Make<MakeRootSift>},
    NamedDescriptor{"sift", Make<MakeSift>},
    NamedDescriptor{"daisy", Make<MakeDaisy>},
    NamedDescriptor{"brisk", Make<MakeBrisk>},
    NamedDescriptor{"orb", Make<MakeOrb>},
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
    if (d.name == name) return d.make(name, options);
  }
  throw Error(ErrorCode::kInvalidArgument, "unknown_descriptor",
              "There is no descriptor named '" + name +
                  "'. Known are: " + Join(DescriptorNames(), ", ") + ".");
}

std::filesystem::path ModelPath(const std::string& name, const std::filesystem::path& given) {
  namespace fs = std::filesystem;
  const std::string file = name + ".safetensors";
  std::error_code error;
  if (!given.empty()) return fs::is_directory(given, error) ? given / file : given;
  if (const char* set = std::getenv("PLIANT_MODEL"); set != nullptr && *set != '\0') {
    return ModelPath(name, set);
  }
  const fs::path below = fs::path("share/pliant") / file;
  // Without /proc the installed place is left.
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  const std::array<fs::path, 2> places = {program.parent_path().parent_path() / below,
                                          fs::path(PLIANT_INSTALL_PREFIX) / below};
  std::string looked;
  for (const fs::path& place : places) {
    if (fs::exists(place, error)) return place;
    looked += (looked.empty() ? "" : ", ") + place.string();
  }
  throw Error(ErrorCode::kNotFound, "model_not_found",
              "The weights of " + name + " were not found. Looked at: " + looked +
                  ". Set PLIANT_MODEL to the weight file or its folder.");
}

}  // namespace pliant
