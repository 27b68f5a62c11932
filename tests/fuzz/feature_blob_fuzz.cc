// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features as they are stored.
#include "index/store/blob_codec.h"
#include "tests/fuzz/blob.h"

namespace {

using pliant::Features;
using pliant::fuzz::Accepts;
using pliant::fuzz::Require;
using pliant::fuzz::SameBytes;

void RequireSame(const Features& a, const Features& b, const char* promise) {
  Require(a.width == b.width && a.height == b.height && SameBytes(a.keypoints, b.keypoints) &&
              a.descriptors.kind == b.descriptors.kind && a.descriptors.dim == b.descriptors.dim &&
              a.descriptors.rows == b.descriptors.rows &&
              SameBytes(a.descriptors.floats, b.descriptors.floats) &&
              SameBytes(a.descriptors.bytes, b.descriptors.bytes) && a.colours == b.colours,
          promise);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::vector<std::uint8_t> blob = pliant::fuzz::WithChecksum({data, size});
  Features features;
  if (!Accepts([&] { features = pliant::DecodeFeatures(blob); })) return 0;
  Require(features.keypoints.size() == features.descriptors.rows, "a keypoint has a descriptor");
  std::vector<std::uint8_t> again;
  Require(Accepts([&] { again = pliant::EncodeFeatures(features); }),
          "features that are read can be written");
  RequireSame(pliant::DecodeFeatures(again), pliant::InStoredPrecision(features),
              "the stored precision is that of what is stored");
  // Scaled rows have several forms: the largest step need not be 127.
  const bool lossless =
      blob[6] != static_cast<std::uint8_t>(pliant::DescriptorEncoding::kScaledInt8);
  Require(!lossless || again == blob, "lossless features have one form");
  return 0;
}
