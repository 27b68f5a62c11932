// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Perceptual distance of two pictures, by a network supplied by the user (LPIPS; Zhang et al.
// 2018).
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "descriptor/image/image.h"

namespace pliant {

// LPIPS needs weights that Pliant may not ship. Python's package `lpips` can export a file:
//   import lpips, torch; x = torch.zeros(1, 3, 256, 256)
//   torch.onnx.export(lpips.LPIPS(net="alex").eval(), (x, x), "lpips.onnx",
//                     input_names=["in0", "in1"])
// Any ONNX file with inputs in0 and in1 (float, 1 x 3 x 256 x 256, red, green, blue, -1..1) and a
// single number as its output works. TorchScript is not supported: it would need PyTorch's library
// at run time. Not thread-safe.
class PerceptualDistance {
 public:
  // Throws kNotFound "cannot_read", kCorrupt "network_unreadable".
  explicit PerceptualDistance(const std::filesystem::path& onnx);
  ~PerceptualDistance();
  PerceptualDistance(const PerceptualDistance&) = delete;
  PerceptualDistance& operator=(const PerceptualDistance&) = delete;

  // Both are scaled to 256 x 256; grey or colour. Throws kInvalidArgument for empty pictures,
  // kCorrupt "network_unfit" when the file has other inputs or outputs.
  double Distance(const Image& a, const Image& b);

 private:
  struct Network;

  std::string name_;
  std::unique_ptr<Network> network_;
};

}  // namespace pliant
