// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features that another program made: rows of the benchmarks, and images of a database.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "descriptor/features/descriptor.h"

namespace pliant {

// A row of a benchmark.
struct FeatureSource {
  std::string label;
  // The features of an image file, in pixels of that file. Called from several threads.
  std::function<Features(const std::filesystem::path& image)> read;
};

// The form of these features. The model id is also the descriptor's name.
DescriptorInfo ForeignDescriptorInfo(const Features& features);

// Stands for a descriptor that is not part of Pliant. Describe throws kUnprocessable
// "described_elsewhere".
std::shared_ptr<const Descriptor> MakeForeignDescriptor(DescriptorInfo info);

}  // namespace pliant
