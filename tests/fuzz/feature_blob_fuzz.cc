// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features as they are stored.
#include "index/store/blob_codec.h"
#include "tests/fuzz/blob.h"

namespace {

using pliant::Features;
using pliant::fuzz::Accepts;
using pliant::fuzz::Require;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::vector<std::uint8_t> blob = pliant::fuzz::WithChecksum({data, size});
  Features features;
  if (!Accepts([&] { features = pliant::DecodeFeatures(blob); })) return 0;
  Require(features.keypoints.size() == features.descriptors.rows, "a keypoint has a descriptor");
  std::vector<std::uint8_t> again;
  Require(Accepts([&] { again = pliant::EncodeFeatures(features); }),
          "features that are read can be written");
  const Features back = pliant::DecodeFeatures(again);
  Require(back.colours == features.colours, "colours come back");
  // What another program compressed can have another size.
  Require(!back.colours.empty() || again.size() == blob.size(), "features have one size");
  return 0;
}
