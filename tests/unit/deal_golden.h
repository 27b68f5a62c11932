// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Golden tensors: what descriptor/training computed in double precision for each stage.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "descriptor/base/safetensors.h"
#include "descriptor/deal/network.h"

namespace pliant::deal {

inline const std::array<std::string, 2> kModels = {"deal", "deal-small"};

inline std::filesystem::path ModelPath(const std::string& name = "deal") {
  return std::filesystem::path(PLIANT_SOURCE_DIR) / "descriptor/model" / (name + ".safetensors");
}

// One network of each model and type for all tests of a program.
inline const DealNetwork& SharedNetwork(const std::string& name = "deal",
                                        dnnl::memory::data_type type = FastestType()) {
  static std::map<std::pair<std::string, dnnl::memory::data_type>, DealNetwork> networks;
  const auto key = std::pair(name, type);
  const auto found = networks.find(key);
  if (found != networks.end()) return found->second;
  return networks.try_emplace(key, LoadDealWeights(ModelPath(name)), type).first->second;
}

struct Golden {
  SafetensorsFile tensors;
  Image image;
  std::vector<Keypoint> keypoints;
};

inline const std::array<std::string, 2> kGoldenSizes = {"75x53", "163x117"};

inline Image ReadGrey(const std::filesystem::path& path) {
  const cv::Mat mat = cv::imread(path.string(), cv::IMREAD_GRAYSCALE);
  Image image;
  image.width = mat.cols;
  image.height = mat.rows;
  image.pixels.assign(mat.begin<std::uint8_t>(), mat.end<std::uint8_t>());
  return image;
}

inline Golden LoadGolden(const std::string& model, const std::string& size) {
  const std::string start = PLIANT_SOURCE_DIR "/tests/data/golden_";
  Golden golden = {SafetensorsFile::Open(start + model + "_" + size + ".safetensors"),
                   ReadGrey(start + size + ".png"),
                   {}};
  const std::vector<float> rows = golden.tensors.Floats("keypoints_x_y_size");
  for (std::size_t i = 0; i + 2 < rows.size(); i += 3) {
    Keypoint point;
    point.x = rows[i];
    point.y = rows[i + 1];
    point.size = rows[i + 2];
    golden.keypoints.push_back(point);
  }
  return golden;
}

// |actual - expected| <= tolerance for the leading expected.size() values.
inline void ExpectNear(std::span<const float> actual, std::span<const float> expected,
                       double tolerance, const std::string& what) {
  ASSERT_GE(actual.size(), expected.size()) << what;
  double worst = 0;
  std::size_t at = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const double error = std::abs(static_cast<double>(actual[i]) - expected[i]);
    if (!(error <= worst)) {  // also catches NaN
      worst = error;
      at = i;
    }
  }
  EXPECT_LE(worst, tolerance) << what << ": value " << at << " is " << actual[at] << ", expected "
                              << expected[at];
  ::testing::Test::RecordProperty(what, std::to_string(worst));
}

}  // namespace pliant::deal
