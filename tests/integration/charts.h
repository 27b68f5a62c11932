// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Charts of the reports of `pliant eval ... --json`, drawn by index/evaluation/plot.py.
#pragma once

#include <string>

#include <gtest/gtest.h>

#include "descriptor/image/image.h"
#include "tests/integration/program.h"

namespace pliant::testing {

// `least_height_px`: what the charts of this report need.
inline void ExpectCharts(const std::string& report, int least_height_px) {
  const TemporaryFolder folder;
  WriteBytes(folder / "report.json", {report.begin(), report.end()});
  const ProgramResult drawn =
      Program({PLIANT_SOURCE_DIR "/index/evaluation/plot.py", (folder / "report.json").string(),
               (folder / "report.png").string()},
              {}, "/usr/bin/python3")
          .Wait();
  ASSERT_EQ(drawn.status, 0) << drawn.err;
  const ImageHeader header = ReadImageHeader(ReadBytes(folder / "report.png"));
  EXPECT_EQ(header.format, ImageFormat::kPng);
  EXPECT_GT(header.height, least_height_px);
}

}  // namespace pliant::testing
