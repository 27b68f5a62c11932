// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdlib>
#include <memory>
#include <system_error>

#include "descriptor/base/error.h"
#include "descriptor/base/strings.h"
#include "descriptor/deal/deal.h"
#include "descriptor/features/baselines.h"
#include "descriptor/features/descriptor.h"

namespace pliant {
namespace {

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
