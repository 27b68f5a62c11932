// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A stand-in for LPIPS: tests/data/mean_square_difference.onnx, 307 bytes, made by
//   class M(torch.nn.Module):
//       def forward(self, a, b): return ((a - b) * (a - b)).mean(dim=(1, 2, 3), keepdim=True)
//   x = torch.zeros(1, 3, 256, 256)
//   torch.onnx.export(M(), (x, x + 1), "mean_square_difference.onnx", input_names=["in0", "in1"])
#include "descriptor/evaluation/perceptual.h"

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "descriptor/plot/drawing.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_pictures.h"

namespace pliant {
namespace {

const char* const kNetwork = PLIANT_SOURCE_DIR "/tests/data/mean_square_difference.onnx";

TEST(PerceptualDistance, AsksTheNetworkOfTheUser) {
  PerceptualDistance distance(kNetwork);
  const Image black = BlankPicture(80, 60);
  const Image white = BlankPicture(33, 500, colours::kWhite);
  EXPECT_NEAR(distance.Distance(black, white), 4, 1e-5) << "-1 and 1";
  EXPECT_NEAR(distance.Distance(white, white), 0, 1e-7);
  const Image red = BlankPicture(20, 20, {255, 0, 0});
  EXPECT_NEAR(distance.Distance(red, black), 4.0 / 3, 1e-5);
  EXPECT_NEAR(distance.Distance(black, {2, 1, 1, {0, 0}}), 0, 1e-7) << "grey will do";
  EXPECT_THROW(distance.Distance(black, Image{}), Error);
}

TEST(PerceptualDistance, SaysWhatIsWrongWithTheFile) {
  const testing::TemporaryFolder folder;
  testing::ExpectError(ErrorCode::kNotFound, "cannot_read",
                       [&] { PerceptualDistance(folder / "none.onnx"); });
  testing::WriteText(folder / "text.onnx", "no network");
  testing::ExpectError(ErrorCode::kCorrupt, "network_unreadable",
                       [&] { PerceptualDistance(folder / "text.onnx"); });
}

}  // namespace
}  // namespace pliant
