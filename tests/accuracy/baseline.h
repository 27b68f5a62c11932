// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Accuracy against a committed file: each figure may fall below it by a margin, and the differences
// are printed. With PLIANT_UPDATE_BASELINE=1 in the environment the file is written anew instead.
#pragma once

#include <map>
#include <string>

namespace pliant::testing {

class Baseline {
 public:
  // tests/accuracy/NAME.json of the source tree. `margin`: how far a figure may fall. A file that
  // cannot be read fails the test.
  Baseline(const std::string& name, double margin);
  // Prints what was measured; fails when a figure of the file was not measured; writes the file
  // when asked to.
  ~Baseline();
  Baseline(const Baseline&) = delete;
  Baseline& operator=(const Baseline&) = delete;

  // Fails the test when `value` is more than the margin below the file's, or the file lacks it.
  void Check(const std::string& figure, double value);

 private:
  std::string path_;
  double margin_;
  bool updates_;
  std::map<std::string, double> expected_;
  std::map<std::string, double> measured_;
};

}  // namespace pliant::testing
