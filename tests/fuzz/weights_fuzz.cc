// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The reader of DEAL's weights. An input is the header of a weights file; the data behind it are
// zeros, as many as the smallest weights have.
#include <cstring>

#include "descriptor/deal/weights.h"
#include "tests/fuzz/fuzz.h"

namespace {

// make_corpus.py writes a header for so many bytes of data.
constexpr std::size_t kDataBytes = 3'414'234;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Accepts;
  using pliant::fuzz::Require;
  const std::uint64_t length = size;
  std::vector<std::uint8_t> bytes(sizeof(length) + size + kDataBytes);
  std::memcpy(bytes.data(), &length, sizeof(length));
  if (size > 0) std::memcpy(bytes.data() + sizeof(length), data, size);
  Accepts([&] {
    const auto file = pliant::SafetensorsFile::Parse(std::move(bytes), "input");
    const pliant::deal::DealWeights weights = pliant::deal::ParseDealWeights(file);
    Require(
        weights.radius_per_size > 0 && weights.blocks.size() >= 2 && weights.sha256.size() == 64,
        "weights that are accepted are whole");
    int inputs = 25 * weights.feature_channels();
    for (const pliant::deal::LinearLayer& layer : weights.localization) {
      Require(layer.inputs == inputs &&
                  layer.bias.size() == static_cast<std::size_t>(layer.outputs) &&
                  layer.weight.size() == layer.bias.size() * static_cast<std::size_t>(inputs),
              "layers fit together");
      inputs = layer.outputs;
    }
  });
  return 0;
}
