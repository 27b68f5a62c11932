// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Measures the small set and writes tests/accuracy/baseline.json.
#include <cmath>
#include <fstream>
#include <iostream>

#include <nlohmann/json.hpp>

#include "tests/accuracy/small_set.h"

namespace {

double Rounded(double value) { return std::round(value * 1e4) / 1e4; }

nlohmann::ordered_json MakeBaseline() {
  const pliant::evaluation::MatchingReport report = pliant::testing::MeasureSmallSet();
  nlohmann::ordered_json results;
  for (const pliant::evaluation::DescriptorResult& r : report.results) {
    results[r.label] = {{"ms", Rounded(r.ms)},
                        {"mma", Rounded(r.mma)},
                        {"mutual_precision", Rounded(r.mutual_precision)}};
  }
  return {{"weights", pliant::testing::WeightHashes()},
          {"pairs", report.pairs},
          {"margins", {{"ms", 0.02}, {"mma", 0.04}, {"mutual_precision", 0.04}}},
          {"results", results}};
}

}  // namespace

int main() {
  try {
    const std::string text = MakeBaseline().dump(2) + "\n";
    std::ofstream file(pliant::testing::BaselinePath(), std::ios::trunc);
    file << text;
    file.close();
    if (!file) throw std::runtime_error("cannot write " + pliant::testing::BaselinePath().string());
    std::cout << text;
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
