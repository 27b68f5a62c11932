// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/baseline.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace pliant::testing {
namespace {

constexpr const char* kHint =
    "; when the change is meant, run the test again with PLIANT_UPDATE_BASELINE=1";

}  // namespace

Baseline::Baseline(const std::string& name, double margin)
    : path_(std::string(PLIANT_SOURCE_DIR) + "/tests/accuracy/" + name + ".json"),
      margin_(margin),
      updates_(std::getenv("PLIANT_UPDATE_BASELINE") != nullptr) {
  if (updates_) return;
  std::ifstream file(path_);
  const auto json = nlohmann::json::parse(file, nullptr, false);
  if (!json.is_object()) {
    ADD_FAILURE() << path_ << " cannot be read as JSON" << kHint;
    return;
  }
  expected_ = json.get<std::map<std::string, double>>();
}

Baseline::~Baseline() {
  std::printf("%-44s %9s %9s %9s\n", "figure", "measured", "baseline", "change");
  for (const auto& [figure, value] : measured_) {
    const auto found = expected_.find(figure);
    if (found == expected_.end()) {
      std::printf("%-44s %9.4f %9s\n", figure.c_str(), value, "-");
    } else {
      std::printf("%-44s %9.4f %9.4f %+9.4f\n", figure.c_str(), value, found->second,
                  value - found->second);
    }
  }
  std::fflush(stdout);
  if (updates_) {
    nlohmann::ordered_json json;
    for (const auto& [figure, value] : measured_) json[figure] = std::round(value * 1e4) / 1e4;
    std::ofstream file(path_);
    file << json.dump(1) << '\n';
    EXPECT_TRUE(file.flush().good()) << path_ << " could not be written";
    return;
  }
  for (const auto& [figure, value] : expected_) {
    EXPECT_TRUE(measured_.contains(figure)) << figure << " of " << path_ << " was not measured";
  }
}

void Baseline::Check(const std::string& figure, double value) {
  measured_[figure] = value;
  if (updates_) return;
  const auto found = expected_.find(figure);
  if (found == expected_.end()) {
    ADD_FAILURE() << path_ << " lacks " << figure << kHint;
    return;
  }
  EXPECT_GE(value, found->second - margin_) << figure << " fell" << kHint;
}

}  // namespace pliant::testing
