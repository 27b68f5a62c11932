// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Why an image is refused.
#pragma once

#include <string>

#include "descriptor/base/error.h"
#include "descriptor/image/image.h"
#include "tests/unit/image_files.h"

namespace pliant::testing {

inline std::string ReasonOf(const FileBytes& bytes, const DecodeOptions& options = {}) {
  try {
    DecodeImage(bytes, options);
  } catch (const Error& e) {
    return e.reason();
  }
  return "decoded";
}

}  // namespace pliant::testing
